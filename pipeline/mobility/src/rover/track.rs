//! Track of a rover's drive: samples at a fixed spacing, and poses at a fixed rate for the vehicle metrics.

use super::motion::Moved;
use super::pose::{Body, Pose};
use super::trial::{Cycle, Task};
use crate::metrics::{Differentiator, Metrics};
use sastrugi_numeric::Ground;
use sastrugi_schemas::tables::RoverSampleRow;
use sastrugi_schemas::topics::{RoverRecording, StateSample};

/// Rate of the poses for metrics, Hz.
pub const METRICS_RATE_HZ: f64 = RoverRecording::RATE_HZ;

/// Track of a finished drive.
pub struct Tracked {
    /// Samples, without the ids of terrain and rover.
    pub samples: Vec<RoverSampleRow>,
    /// The vehicle metrics.
    pub metrics: Metrics,
    /// Poses at [`METRICS_RATE_HZ`].
    pub states: Vec<StateSample>,
}

/// The track of a drive in progress.
pub struct Track<'a, G> {
    ground: &'a G,
    task: &'a Task,
    sample_m: f64,
    next_m: f64,
    samples: Vec<RoverSampleRow>,
    states: Vec<StateSample>,
}

impl<'a, G: Ground> Track<'a, G> {
    /// A track with one sample every `sample_m` metres of driving; if 0, one per cycle.
    pub fn new(ground: &'a G, task: &'a Task, sample_m: f64) -> Self {
        Self { ground, task, sample_m, next_m: 0.0, samples: Vec::new(), states: Vec::new() }
    }

    /// Adds a cycle.
    pub fn add(&mut self, cycle: &Cycle<'_>) {
        if cycle.distance_m >= self.next_m {
            self.next_m = if self.sample_m > 0.0 { cycle.distance_m + self.sample_m } else { 0.0 };
            let number = self.samples.len() as i64;
            self.samples.push(sample_row(number, cycle));
        }
        self.add_states(cycle);
    }

    /// Adds poses at the fixed rate while the command of the cycle is executed: first the turn, then the drive.
    fn add_states(&mut self, cycle: &Cycle<'_>) {
        let Moved { turn_rad, drive_m } = cycle.moved;
        let turn_s = turn_rad.abs() / self.task.turn_rate_rad_s;
        let drive_s = drive_m.abs() / self.task.speed_m_s;
        loop {
            let time_s = self.states.len() as f64 / METRICS_RATE_HZ;
            let since_s = time_s - cycle.time_s;
            // The last instant belongs to the next cycle; a rover that does not move keeps its pose.
            if since_s >= turn_s + drive_s && since_s > 0.0 {
                return;
            }
            let turned = if turn_s > 0.0 { (since_s / turn_s).min(1.0) } else { 1.0 };
            let driven = if drive_s > 0.0 { ((since_s - turn_s) / drive_s).clamp(0.0, 1.0) } else { 0.0 };
            let pose = cycle.poses.real.turned(turned * turn_rad).driven(driven * drive_m);
            let Ok(body) = Body::standing(self.ground, &pose, &self.task.chassis) else { return };
            let motion = match () {
                () if since_s < turn_s => [0.0, turn_rad / turn_s],
                () if since_s < turn_s + drive_s => [drive_m / drive_s, 0.0],
                () => [0.0; 2],
            };
            self.states.push(state(time_s, &pose, &body, motion));
        }
    }

    /// The track of the finished drive.
    pub fn finish(self) -> Tracked {
        let metrics = Metrics::of(&self.states, METRICS_RATE_HZ, Differentiator::SecondDifference);
        Tracked { samples: self.samples, metrics, states: self.states }
    }
}

/// The state of a rover that moves ahead on the plane of the body (m/s) or turns to the left (rad/s).
fn state(time_s: f64, pose: &Pose, body: &Body, [speed_m_s, turn_rate_rad_s]: [f64; 2]) -> StateSample {
    let (sin, cos) = libm::sincos(pose.heading_rad);
    StateSample {
        time_s,
        position_m: [pose.position_m[0], pose.position_m[1], body.height_m],
        orientation: body.orientation(pose.heading_rad),
        velocity_m_s: [speed_m_s * cos, speed_m_s * sin, speed_m_s * body.slopes[0]],
        angular_velocity_rad_s: [0.0, 0.0, turn_rate_rad_s],
    }
}

fn sample_row(sample: i64, cycle: &Cycle<'_>) -> RoverSampleRow {
    let [roll, pitch] = cycle.body.roll_pitch_rad();
    let (real, believed) = (&cycle.poses.real, &cycle.poses.believed);
    RoverSampleRow {
        terrain_id: String::new(),
        rover_id: String::new(),
        sample,
        cycle: i64::from(cycle.number),
        time_s: cycle.time_s,
        distance_m: cycle.distance_m,
        x_m: real.position_m[0],
        y_m: real.position_m[1],
        z_m: cycle.body.height_m,
        heading_deg: real.heading_rad.to_degrees(),
        roll_deg: roll.to_degrees(),
        pitch_deg: pitch.to_degrees(),
        state: cycle.state.to_owned(),
        hazards: cycle.view.areas.iter().map(|area| if area.hazard { '1' } else { '0' }).collect(),
        believed_x_m: believed.position_m[0],
        believed_y_m: believed.position_m[1],
        split: None,
    }
}
