//! Starts and goals of rovers.

use super::pose::Pose;
use sastrugi_numeric::{Stream, Streams};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Maximum number of draws of a start; the last one is kept even if it is off the ground.
pub const DRAWS_MAX: u32 = 1000;

/// A start and its goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Start, m.
    pub start_m: [f64; 2],
    /// Heading at the start, from east to north, rad.
    pub heading_rad: f64,
    /// Goal, m.
    pub goal_m: [f64; 2],
}

/// Which way rovers face at the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Facing {
    /// In a random direction.
    #[default]
    Drawn,
    /// Towards the goal.
    Goal,
}

impl Start {
    /// A start that faces its goal.
    pub fn facing(start_m: [f64; 2], goal_m: [f64; 2]) -> Self {
        let heading_rad = libm::atan2(goal_m[1] - start_m[1], goal_m[0] - start_m[0]);
        Self { start_m, heading_rad, goal_m }
    }

    /// The pose at the start.
    pub fn pose(&self) -> Pose {
        Pose { position_m: self.start_m, heading_rad: self.heading_rad }
    }

    /// The same start with the heading given by `facing`.
    fn turned(self, facing: Facing, stream: &mut Stream) -> Self {
        match facing {
            Facing::Drawn => Self { heading_rad: stream.uniform_in(-PI, PI), ..self },
            Facing::Goal => self,
        }
    }
}

/// The random stream of a start: each start has its own, so a larger number of rovers leaves the earlier ones unchanged.
fn stream(streams: &Streams, k: u32) -> Stream {
    streams.stream(&format!("start-{:04}", k + 1))
}

/// Starts at equal angles on a circle, counterclockwise from the east; the goal is its centre.
///
/// ```
/// use sastrugi_mobility::rover::starts::{Facing, on_circle};
/// use sastrugi_numeric::Streams;
///
/// let starts = on_circle(4, [0.0, 0.0], 25.0, Facing::Goal, &Streams::for_seed(1, "rover"));
/// let [x, y] = starts[1].start_m;
/// assert!(x.abs() < 1e-12 && (y - 25.0).abs() < 1e-12);
/// assert!(starts[1].pose().bearing_error_rad([0.0, 0.0]).abs() < 1e-12);
/// ```
pub fn on_circle(count: u32, centre_m: [f64; 2], radius_m: f64, facing: Facing, streams: &Streams) -> Vec<Start> {
    let start = |k: u32| {
        let (sin, cos) = libm::sincos(TAU * f64::from(k) / f64::from(count));
        let start_m = [centre_m[0] + radius_m * cos, centre_m[1] + radius_m * sin];
        Start::facing(start_m, centre_m).turned(facing, &mut stream(streams, k))
    };
    (0..count).map(start).collect()
}

/// The disk in which starts are drawn, and the distance to their goals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    /// Centre, m.
    pub centre_m: [f64; 2],
    /// Radius, m.
    pub radius_m: f64,
    /// Distance from start to goal, m.
    pub distance_m: f64,
}

impl Disk {
    fn draw(&self, stream: &mut Stream) -> Start {
        let (sin, cos) = libm::sincos(stream.uniform_in(0.0, TAU));
        let away_m = self.radius_m * stream.uniform_in(0.0, 1.0).sqrt();
        let start_m = [self.centre_m[0] + away_m * cos, self.centre_m[1] + away_m * sin];
        let (sin, cos) = libm::sincos(stream.uniform_in(0.0, TAU));
        Start::facing(start_m, [start_m[0] + self.distance_m * cos, start_m[1] + self.distance_m * sin])
    }
}

/// Starts at random points in a disk, with goals in random directions. Each pair is drawn again, up to [`DRAWS_MAX`] times, until
/// both points are `on_ground`.
pub fn drawn(
    count: u32,
    disk: &Disk,
    facing: Facing,
    streams: &Streams,
    on_ground: impl Fn([f64; 2]) -> bool,
) -> Vec<Start> {
    let start = |k: u32| {
        let mut stream = stream(streams, k);
        let mut start = disk.draw(&mut stream);
        for _ in 1..DRAWS_MAX {
            if on_ground(start.start_m) && on_ground(start.goal_m) {
                break;
            }
            start = disk.draw(&mut stream);
        }
        start.turned(facing, &mut stream)
    };
    (0..count).map(start).collect()
}
