//! What a rover senses: areas ahead of it, from left to right, each a hazard or not.

mod rays;
mod rectangles;

pub use rays::RaySensor;
pub use rectangles::RectangleSensor;

use super::draws::CycleDraws;
use super::pose::{Body, Pose};
use sastrugi_numeric::{Ground, NoGround};

/// Part of the ground ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    /// Its corners in the rover's own axes (ahead, left), m: near right, near left, far left, far right.
    pub corners_m: [[f64; 2]; 4],
    /// Whether the rover must not go there.
    pub hazard: bool,
}

impl Area {
    fn between(ahead: [f64; 2], left: [f64; 2], hazard: bool) -> Self {
        let ([near, far], [right, left]) = (ahead, left);
        Self { corners_m: [[near, right], [near, left], [far, left], [far, right]], hazard }
    }

    /// Offset of its centre to the left, m.
    pub fn left_m(&self) -> f64 {
        0.25 * self.corners_m.iter().map(|c| c[1]).sum::<f64>()
    }
}

/// One range measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Origin, in the coordinates of the terrain, m.
    pub from_m: [f64; 3],
    /// Where it met the ground, or where it was given up, m.
    pub to_m: [f64; 3],
    /// Height of the hit above the plane of the body, m; `None` where nothing was hit.
    pub height_m: Option<f64>,
    /// The ground that it tells of, in the rover's own axes (ahead, left), m: where it met it, or, where it met none, where it was aimed.
    pub place_m: [f64; 2],
    /// Whether it shows a hazard there.
    pub hazard: bool,
}

/// What a rover sees in one cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// From left to right.
    pub areas: Vec<Area>,
    /// Column by column from the left, near ones first; none for sensors without.
    pub rays: Vec<Ray>,
    /// Whether the rover itself leans too much.
    pub tilted: bool,
}

impl View {
    /// Whether something is in the way.
    pub fn has_hazard(&self) -> bool {
        self.tilted || self.areas.iter().any(|area| area.hazard)
    }
}

/// A sensor.
#[derive(Clone, Debug, PartialEq)]
pub enum Sensor {
    /// Ranges along rays.
    Rays(RaySensor),
    /// Safe and unsafe rectangles.
    Rectangles(RectangleSensor),
}

impl Sensor {
    /// What a rover sees; `noise_m` is the standard deviation of sensed heights.
    ///
    /// # Errors
    /// Ground that is not known, which is no hazard and no height of 0.
    pub fn look(
        &self,
        ground: &impl Ground,
        pose: &Pose,
        body: &Body,
        noise_m: f64,
        draws: &CycleDraws,
    ) -> Result<View, NoGround> {
        match self {
            Self::Rays(sensor) => sensor.look(ground, pose, body, noise_m, draws),
            Self::Rectangles(sensor) => sensor.look(ground, pose, body, noise_m, draws),
        }
    }
}
