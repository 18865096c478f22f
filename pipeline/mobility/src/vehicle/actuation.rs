//! Wheel speeds and steering angles from the commanded speed and yaw rate.
//!
//! *Skid steering*: the sides are driven at `(v -+ w b / 2) / r`, with the track `b` widened by the multiplier.
//!
//! *Ackermann*: a hub at `(x, y)`, relative to the point of the chassis about which the turn is commanded, must move with
//! `(v - w y, w x)`. Its steering angle is the direction of that velocity (or its reverse, if that needs the smaller angle),
//! within the limit; its speed is the component of that velocity along the current direction of the wheel.

use super::drive::Servo;
use super::model::{Vehicle, Wheel};
use super::params::{AckermannParameters, DriveParameters};

/// Commands and the errors from which they are computed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Command {
    pub speed_m_s: f64,
    pub yaw_rate_rad_s: f64,
    pub cross_track_m: f64,
    pub heading_error_rad: f64,
    pub distance_to_goal_m: f64,
}

/// Limits of the commands.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    pub speed_m_s: f64,
    pub acceleration_m_s2: f64,
    pub yaw_rate_rad_s: f64,
    pub yaw_acceleration_rad_s2: f64,
    /// Smallest turning radius, m; 0 for a vehicle that turns on the spot.
    pub turn_radius_m: f64,
}

impl Limits {
    pub(crate) fn of(vehicle: &Vehicle) -> Self {
        match &vehicle.parameters().drive {
            DriveParameters::SkidSteer(drive) => Self {
                speed_m_s: drive.speed_limit_m_s,
                acceleration_m_s2: drive.acceleration_limit_m_s2,
                yaw_rate_rad_s: drive.yaw_rate_limit_rad_s,
                yaw_acceleration_rad_s2: drive.yaw_acceleration_limit_rad_s2,
                turn_radius_m: 0.0,
            },
            DriveParameters::Ackermann(drive) => Self {
                speed_m_s: drive.speed_limit_m_s,
                acceleration_m_s2: drive.acceleration_limit_m_s2,
                yaw_rate_rad_s: drive.yaw_rate_limit_rad_s,
                yaw_acceleration_rad_s2: drive.yaw_acceleration_limit_rad_s2,
                turn_radius_m: if drive.spot_turn { 0.0 } else { turn_radius_m(vehicle, drive) },
            },
        }
    }
}

impl Vehicle {
    /// Highest speed at which it is driven, m/s, whatever a run commands.
    pub fn speed_limit_m_s(&self) -> f64 {
        Limits::of(self).speed_m_s
    }
}

/// Smallest turning radius, m, at which the inner one of the farthest steered wheels reaches its limit.
fn turn_radius_m(vehicle: &Vehicle, drive: &AckermannParameters) -> f64 {
    let steered = vehicle.wheels.iter().filter(|wheel| wheel.steered);
    let tan = libm::tan(drive.steering_limit_deg.to_radians());
    steered.map(|wheel| wheel.turning_arm_m[0].abs() / tan + wheel.turning_arm_m[1].abs()).fold(0.0, f64::max)
}

/// Steering angles required by a command, rad; a vehicle commanded to stand still keeps its angles.
pub(crate) fn steering_angles(vehicle: &Vehicle, command: &Command, angles: &mut [f64]) {
    let DriveParameters::Ackermann(drive) = &vehicle.parameters().drive else { return };
    let limit = drive.steering_limit_deg.to_radians();
    for (wheel, angle) in vehicle.wheels.iter().zip(angles).filter(|(wheel, _)| wheel.steered) {
        let [vx, vy] = hub_velocity(wheel, command);
        if vx != 0.0 || vy != 0.0 {
            let forwards = if vx < 0.0 { libm::atan2(-vy, -vx) } else { libm::atan2(vy, vx) };
            *angle = forwards.clamp(-limit, limit);
        }
    }
}

/// Servos of all channels for a command, with the wheels at the given steering angles.
pub(crate) fn servos(vehicle: &Vehicle, command: &Command, steering: &[f64], servos: &mut Vec<Servo>) {
    servos.clear();
    let wheels = &vehicle.parameters().wheels;
    match &vehicle.parameters().drive {
        DriveParameters::SkidSteer(drive) => {
            let half_track = 0.5 * wheels.track_m * drive.track_multiplier;
            servos.extend([-1.0, 1.0].map(|side| Servo {
                target: (command.speed_m_s + side * command.yaw_rate_rad_s * half_track) / wheels.radius_m,
                gain: drive.servo_gain_n_m_s,
                limit: drive.torque_limit_n_m,
            }));
        }
        DriveParameters::Ackermann(drive) => {
            servos.extend(vehicle.wheels.iter().zip(steering).map(|(wheel, &angle)| {
                let [vx, vy] = hub_velocity(wheel, command);
                let (sin, cos) = libm::sincos(angle);
                Servo {
                    target: (vx * cos + vy * sin) / wheels.radius_m,
                    gain: drive.servo_gain_n_m_s,
                    limit: drive.torque_limit_n_m,
                }
            }));
        }
    }
}

/// Horizontal velocity of a hub required by a command, m/s.
fn hub_velocity(wheel: &Wheel, command: &Command) -> [f64; 2] {
    let [x, y] = wheel.turning_arm_m;
    [command.speed_m_s - command.yaw_rate_rad_s * y, command.yaw_rate_rad_s * x]
}
