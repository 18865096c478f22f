//! Motors and steering.

use super::all_positive;
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Motors and steering.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum DriveParameters {
    /// The wheels of a side turn together; the vehicle turns by driving its sides at different speeds.
    SkidSteer(SkidSteerParameters),
    /// Every wheel has a motor; the wheels of some axles steer so that all wheels roll about one centre of turning.
    Ackermann(AckermannParameters),
}

/// Skid steering with one motor channel per side.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SkidSteerParameters {
    /// Largest torque of a side, N m.
    pub torque_limit_n_m: f64,
    /// Torque of a side per unit difference between commanded and actual wheel speed, N m s/rad.
    pub servo_gain_n_m_s: f64,
    /// Largest commanded speed, m/s.
    pub speed_limit_m_s: f64,
    /// Largest change of the commanded speed, m/s2.
    pub acceleration_limit_m_s2: f64,
    /// Largest commanded yaw rate, rad/s.
    pub yaw_rate_limit_rad_s: f64,
    /// Largest change of the commanded yaw rate, rad/s2.
    pub yaw_acceleration_limit_rad_s2: f64,
    /// Wheel speeds are computed for a track wider by this factor, to compensate for skidding.
    pub track_multiplier: f64,
}

/// Steered wheels, each with its own motor. The centre of turning lies abeam of the unsteered axles (of the origin of
/// base_link if all axles steer). Steering angles follow their commands at a limited rate, whatever the load.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AckermannParameters {
    /// Indices of the axles whose wheels steer, counted from the front, which is 0.
    pub steered_axles: Vec<u32>,
    /// Largest steering angle of a wheel to either side, deg, below 90.
    pub steering_limit_deg: f64,
    /// Largest change of a steering angle, deg/s.
    pub steering_rate_deg_s: f64,
    /// Whether the wheels can be set for a turn on the spot; otherwise the vehicle turns on its smallest circle.
    pub spot_turn: bool,
    /// Largest torque of a wheel, N m.
    pub torque_limit_n_m: f64,
    /// Torque of a wheel per unit difference between commanded and actual speed, N m s/rad.
    pub servo_gain_n_m_s: f64,
    /// Largest commanded speed, m/s.
    pub speed_limit_m_s: f64,
    /// Largest change of the commanded speed, m/s2.
    pub acceleration_limit_m_s2: f64,
    /// Largest commanded yaw rate, rad/s.
    pub yaw_rate_limit_rad_s: f64,
    /// Largest change of the commanded yaw rate, rad/s2.
    pub yaw_acceleration_limit_rad_s2: f64,
}

impl DriveParameters {
    /// Checks every number, for a vehicle with `axles` axles.
    pub(super) fn check(&self, axles: usize) -> Result<(), ParameterError> {
        match self {
            Self::SkidSteer(drive) => drive.check(),
            Self::Ackermann(drive) => drive.check(axles),
        }
    }
}

impl SkidSteerParameters {
    fn check(&self) -> Result<(), ParameterError> {
        all_positive([
            ("torque_limit_n_m", self.torque_limit_n_m),
            ("servo_gain_n_m_s", self.servo_gain_n_m_s),
            ("speed_limit_m_s", self.speed_limit_m_s),
            ("acceleration_limit_m_s2", self.acceleration_limit_m_s2),
            ("yaw_rate_limit_rad_s", self.yaw_rate_limit_rad_s),
            ("yaw_acceleration_limit_rad_s2", self.yaw_acceleration_limit_rad_s2),
            ("track_multiplier", self.track_multiplier),
        ])
    }
}

impl AckermannParameters {
    fn check(&self, axles: usize) -> Result<(), ParameterError> {
        all_positive([
            ("steering_rate_deg_s", self.steering_rate_deg_s),
            ("torque_limit_n_m", self.torque_limit_n_m),
            ("servo_gain_n_m_s", self.servo_gain_n_m_s),
            ("speed_limit_m_s", self.speed_limit_m_s),
            ("acceleration_limit_m_s2", self.acceleration_limit_m_s2),
            ("yaw_rate_limit_rad_s", self.yaw_rate_limit_rad_s),
            ("yaw_acceleration_limit_rad_s2", self.yaw_acceleration_limit_rad_s2),
        ])?;
        ParameterError::between("steering_limit_deg", self.steering_limit_deg, 0.0, 90.0)?;
        let key = "steered_axles";
        if self.steered_axles.is_empty() {
            return Err(ParameterError::new(key, "is empty; this drive needs at least one steered axle"));
        }
        match self.steered_axles.iter().find(|&&axle| axle as usize >= axles) {
            Some(axle) => Err(ParameterError::new(key, format!("names axle {axle}; the axles are 0 to {}", axles - 1))),
            None => Ok(()),
        }
    }
}
