//! The recording of a mission: the only form in which a simulated run passes from the vehicle model to tables and MCAP
//! files. Times count from the mission's start. Frames: map (x east, y north, z up), base_link (x forward, y left,
//! z up).

use serde::{Deserialize, Serialize};

/// A recorded mission.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recording {
    /// Outline of the vehicle.
    pub vehicle: VehicleOutline,
    /// Rate of `states`, `wheels` and `commands`, Hz.
    pub sample_rate_hz: f64,
    /// Rate of `imu`, Hz.
    pub imu_rate_hz: f64,
    /// Pose and motion of base_link, at `sample_rate_hz` from time 0.
    pub states: Vec<StateSample>,
    /// Inertial measurements, at `imu_rate_hz` from time 0.
    pub imu: Vec<ImuSample>,
    /// Wheels, at `sample_rate_hz`.
    pub wheels: Vec<WheelSample>,
    /// Commands and controller state, at `sample_rate_hz`.
    pub commands: Vec<CommandSample>,
    /// Events in order of time; the last one is the outcome.
    pub events: Vec<Event>,
}

/// Outline of a vehicle for viewers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VehicleOutline {
    /// Name, such as `husky_a200`.
    pub name: String,
    /// Size of the chassis box along x, y, z, m.
    pub chassis_size_m: [f64; 3],
    /// Centre of the chassis box in base_link, m.
    pub chassis_centre_m: [f64; 3],
    /// Wheels in the order of every [`WheelSample`].
    pub wheels: Vec<WheelOutline>,
}

/// Outline of one wheel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WheelOutline {
    /// Frame name, such as `front_left_wheel`.
    pub name: String,
    /// Hub in base_link with all joints of the suspension at zero, m.
    pub hub_m: [f64; 3],
    /// Radius, m.
    pub radius_m: f64,
    /// Width, m.
    pub width_m: f64,
}

/// Pose and motion of base_link, quantised to 2^-20 m (and quaternion units) and 2^-16 m/s or rad/s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StateSample {
    /// Time, s.
    pub time_s: f64,
    /// Position in the map frame, m.
    pub position_m: [f64; 3],
    /// Orientation quaternion (map from base_link) `[x, y, z, w]`, of unit length within these steps.
    pub orientation: [f64; 4],
    /// Velocity in the map frame, m/s.
    pub velocity_m_s: [f64; 3],
    /// Angular velocity in base_link, rad/s.
    pub angular_velocity_rad_s: [f64; 3],
}

/// An ideal inertial measurement unit at the base_link origin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImuSample {
    /// Time, s.
    pub time_s: f64,
    /// Orientation quaternion `[x, y, z, w]`.
    pub orientation: [f64; 4],
    /// Angular velocity in base_link, rad/s.
    pub angular_velocity_rad_s: [f64; 3],
    /// Specific force in base_link (+g upwards at rest), mean over the interval since the previous sample, m/s2.
    pub specific_force_m_s2: [f64; 3],
}

/// All wheels at one instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WheelSample {
    /// Time, s.
    pub time_s: f64,
    /// Wheels in the order of [`VehicleOutline::wheels`].
    pub wheels: Vec<WheelState>,
    /// Magnitude of the ground force on the chassis, N.
    pub chassis_force_n: f64,
}

/// One wheel at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WheelState {
    /// Angle turned since the start, rad (forward positive).
    pub angle_rad: f64,
    /// Spin, rad/s.
    pub spin_rad_s: f64,
    /// Drive torque on the wheel, N m.
    pub torque_n_m: f64,
    /// Ground force along the contact normal, N (0 without contact).
    pub normal_force_n: f64,
    /// Ground force along the rolling direction, N.
    pub longitudinal_force_n: f64,
    /// Ground force across the rolling direction (left positive), N.
    pub lateral_force_n: f64,
    /// Longitudinal slip ratio (rim speed minus ground speed, over the larger of the two), in [-1, 1] for forward driving.
    pub slip_ratio: f64,
    /// Contact point in the map frame, m; meaningless without contact.
    pub contact_m: [f64; 3],
    /// Steering angle about the body's z axis, rad (left positive).
    pub steering_rad: f64,
    /// Hub in base_link as displaced by the suspension, m.
    pub hub_m: [f64; 3],
}

/// Command and controller state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CommandSample {
    /// Time, s.
    pub time_s: f64,
    /// Commanded forward speed, m/s.
    pub speed_m_s: f64,
    /// Commanded yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Distance from the mission line, m (left positive).
    pub cross_track_m: f64,
    /// Bearing of the look-ahead point relative to the vehicle, rad.
    pub heading_error_rad: f64,
    /// Distance to the goal, m.
    pub distance_to_goal_m: f64,
}

/// An event.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Time, s.
    pub time_s: f64,
    /// Kind.
    pub kind: EventKind,
    /// One sentence with the numbers.
    pub text: String,
}

/// Kinds of events; every kind except `Start` ends a mission.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// The clock starts, with the vehicle at rest.
    Start,
    /// The goal was reached.
    Success,
    /// Pitch or roll beyond the limit.
    Tipped,
    /// Too little motion for too long.
    Stuck,
    /// The vehicle left the terrain or is on cells without data.
    OutOfBounds,
    /// The time limit was reached.
    Timeout,
}

impl EventKind {
    /// The outcome of that name; `None` for other words.
    pub fn outcome(name: &str) -> Option<Self> {
        let ends = [Self::Success, Self::Tipped, Self::Stuck, Self::OutOfBounds, Self::Timeout];
        ends.into_iter().find(|end| end.name() == name)
    }

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Success => "success",
            Self::Tipped => "tipped",
            Self::Stuck => "stuck",
            Self::OutOfBounds => "out_of_bounds",
            Self::Timeout => "timeout",
        }
    }
}
