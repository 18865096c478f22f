//! Execution of commands: exact, unless noise is enabled.

use super::draws::{CycleDraws, Purpose};
use super::policies::Command;
use super::pose::Pose;
use sastrugi_schemas::{ParameterError, limits, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Largest standard deviation of motion noise: beyond it, the motion is independent of the command.
const DEVIATION_MAX: f64 = 10.0;

/// Noise of sensing and motion; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseParameters {
    /// Standard deviation of sensed heights, m.
    #[schemars(transform = limits::not_negative)]
    pub height_m: f64,
    /// Share of a commanded distance that is lost to slip, below 1.
    #[schemars(transform = limits::half_open(0.0, 1.0))]
    pub slip: f64,
    /// Standard deviation of that share from cycle to cycle.
    #[schemars(transform = limits::within(0.0, DEVIATION_MAX))]
    pub slip_deviation: f64,
    /// Relative standard deviation of a turn.
    #[schemars(transform = limits::within(0.0, DEVIATION_MAX))]
    pub turn: f64,
    /// Standard deviation of the heading drift over 1 m of driving, rad; it grows with the square root of the distance.
    #[schemars(transform = limits::within(0.0, DEVIATION_MAX))]
    pub drift_rad: f64,
    /// Whether the rover estimates its position from its own commands alone, so turn errors, drift and slip go unnoticed.
    pub dead_reckoning: bool,
}

impl NoiseParameters {
    /// # Errors
    /// A value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::not_negative("height_m", self.height_m)?;
        if !(0.0..1.0).contains(&self.slip) {
            return Err(ParameterError::new("slip", format!("is {}; it must be at least 0 and below 1", self.slip)));
        }
        let rest = [("slip_deviation", self.slip_deviation), ("turn", self.turn), ("drift_rad", self.drift_rad)];
        rest.into_iter().try_for_each(|(key, value)| {
            ParameterError::not_negative(key, value)?;
            let message = format!("is {}; it must be at most {DEVIATION_MAX}", shown(value));
            if value > DEVIATION_MAX { Err(ParameterError::new(key, message)) } else { Ok(()) }
        })
    }
}

/// The true pose of a rover and the pose it believes it has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Poses {
    /// True pose.
    pub real: Pose,
    /// Pose by its own estimate.
    pub believed: Pose,
}

/// The actual motion of a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// Turn to the left, rad.
    pub turn_rad: f64,
    /// Drive ahead, m.
    pub drive_m: f64,
}

impl Poses {
    /// Executes a command.
    pub fn carry_out(&mut self, command: &Command, noise: &NoiseParameters, draws: &CycleDraws) -> Moved {
        let error = if noise.turn > 0.0 { noise.turn * draws.normal(Purpose::Heading) } else { 0.0 };
        let turn_rad = command.turn_rad * (1.0 + error);
        let slip_error =
            if noise.slip_deviation > 0.0 { noise.slip_deviation * draws.normal(Purpose::Slip) } else { 0.0 };
        let drive_m = command.drive_m * (1.0 - (noise.slip + slip_error).clamp(0.0, 1.0));
        let drift_rad = if noise.drift_rad > 0.0 {
            noise.drift_rad * drive_m.abs().sqrt() * draws.normal(Purpose::Drift)
        } else {
            0.0
        };
        self.real = self.real.turned(turn_rad).driven(drive_m).turned(drift_rad);
        self.believed = if noise.dead_reckoning {
            self.believed.turned(command.turn_rad).driven(command.drive_m)
        } else {
            self.real
        };
        Moved { turn_rad, drive_m }
    }
}
