//! Where rovers start, and where they are to go.

use super::pose::Pose;
use sastrugi_numeric::Streams;
use std::f64::consts::TAU;

/// A start and its goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Start, m.
    pub start_m: [f64; 2],
    /// Goal, m.
    pub goal_m: [f64; 2],
}

impl Start {
    /// At the start, facing the goal.
    pub fn pose(&self) -> Pose {
        let ([x, y], [goal_x, goal_y]) = (self.start_m, self.goal_m);
        Pose { position_m: self.start_m, heading_rad: libm::atan2(goal_y - y, goal_x - x) }
    }
}

/// Rovers at equal angles on a circle, the first in the east, on to the north; the goal is its centre.
pub fn on_circle(count: u32, centre_m: [f64; 2], radius_m: f64) -> Vec<Start> {
    let start = |k: u32| {
        let (sin, cos) = libm::sincos(TAU * f64::from(k) / f64::from(count));
        Start { start_m: [centre_m[0] + radius_m * cos, centre_m[1] + radius_m * sin], goal_m: centre_m }
    };
    (0..count).map(start).collect()
}

/// Starts and goals a distance apart, at drawn places in a disk about the centre, in drawn directions. Each pair has a stream of its own.
pub fn drawn(count: u32, centre_m: [f64; 2], radius_m: f64, distance_m: f64, streams: &Streams) -> Vec<Start> {
    let start = |k: u32| {
        let mut stream = streams.stream(&format!("start-{:04}", k + 1));
        let (sin, cos) = libm::sincos(stream.uniform_in(0.0, TAU));
        let away_m = radius_m * stream.uniform_in(0.0, 1.0).sqrt();
        let start_m = [centre_m[0] + away_m * cos, centre_m[1] + away_m * sin];
        let (sin, cos) = libm::sincos(stream.uniform_in(0.0, TAU));
        Start { start_m, goal_m: [start_m[0] + distance_m * cos, start_m[1] + distance_m * sin] }
    };
    (0..count).map(start).collect()
}
