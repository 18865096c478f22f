//! Sensing: areas ahead of the rover, from left to right, each a hazard or not.

mod rays;
mod rectangles;

pub use rays::RaySensor;
pub use rectangles::RectangleSensor;

use super::draws::CycleDraws;
use super::pose::{Body, Pose};
use sastrugi_numeric::{Ground, NoGround};

/// An area of the ground ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    /// Its corners in the rover's own axes (ahead, left), m: near right, near left, far left, far right.
    pub corners_m: [[f64; 2]; 4],
    /// Whether the rover must not drive there.
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
    /// Where it hit the ground, or where it ended without a hit, m.
    pub to_m: [f64; 3],
    /// Height of the hit above the plane of the body, m; `None` without a hit.
    pub height_m: Option<f64>,
    /// The place that it measures, in the rover's own axes (ahead, left), m: the hit or, without a hit, the point at which it was
    /// aimed.
    pub place_m: [f64; 2],
    /// Whether that place is a hazard.
    pub hazard: bool,
}

/// The sensor view of one cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Areas from left to right.
    pub areas: Vec<Area>,
    /// Rays column by column from the left, near ones first; empty for sensors without rays.
    pub rays: Vec<Ray>,
    /// Whether the rover itself tilts beyond its limit.
    pub tilted: bool,
}

impl View {
    /// Whether there is a hazard in view, or the rover tilts too much.
    pub fn has_hazard(&self) -> bool {
        self.tilted || self.areas.iter().any(|area| area.hazard)
    }
}

/// A sensor.
#[derive(Clone, Debug, PartialEq)]
pub enum Sensor {
    /// Range measurements along rays.
    Rays(RaySensor),
    /// Safe and unsafe rectangles.
    Rectangles(RectangleSensor),
}

impl Sensor {
    /// The view of a rover; `noise_m` is the standard deviation of sensed heights.
    ///
    /// # Errors
    /// Unknown ground, which counts neither as a hazard nor as a height of 0.
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
