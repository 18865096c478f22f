//! Steepest slopes that a vehicle can climb and descend on an even plane, straight up or down.
//!
//! At constant speed on a slope of angle a, with weight `W`, friction `mu` and rolling resistance `c`, all wheels driven:
//!
//! ```text
//! grip      tan a <= mu - c  uphill,  tan a <= mu + c  downhill     (traction at most mu W cos a)
//! torque    W (sin a + c cos a) r <= T                              (T the torque of all motors, r the wheel radius)
//! stability tan a <= lever / h                                      (h the height of the centre of mass above the ground, lever its
//!                                                                    distance in plan from the lower outer axle)
//! ```
//!
//! These are the textbook limits of a rigid vehicle (Wong, 2008, Theory of Ground Vehicles, section 3.1 on grades). Downhill the motors
//! may brake with their full torque as well. Load transfer does not matter for grip while every wheel has its own motor or shares it with its side.

use super::model::{GRAVITY_M_S2, Vehicle};
use super::params::DriveParameters;
use super::surface::SurfaceParameters;

/// Steepest slopes that may be travelled, and what travel uphill costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopeAbility {
    /// Steepest climb, degrees, 0 to below 90.
    pub up_deg: f64,
    /// Steepest descent, degrees, 0 to below 90.
    pub down_deg: f64,
    /// Rolling resistance over normal force: the work of a metre on the level, over the weight.
    pub rolling_resistance: f64,
}

impl SlopeAbility {
    /// That of a vehicle on a surface (where no class and no raster says otherwise).
    pub fn of(vehicle: &Vehicle, surface: &SurfaceParameters) -> Self {
        let friction = surface.friction();
        let torque = torque_ratio(vehicle);
        let [rear, front] = stability_ratios(vehicle);
        let climb = (friction.wheel - friction.rolling).min(torque_slope(torque, friction.rolling)).min(rear);
        let descend = (friction.wheel + friction.rolling).min(torque_slope(torque, -friction.rolling)).min(front);
        let degrees = |slope: f64| libm::atan(slope.max(0.0)).to_degrees();
        Self { up_deg: degrees(climb), down_deg: degrees(descend), rolling_resistance: friction.rolling }
    }
}

/// Force of all motors at the rims over the weight.
fn torque_ratio(vehicle: &Vehicle) -> f64 {
    let torque_n_m = match &vehicle.parameters().drive {
        DriveParameters::SkidSteer(drive) => drive.torque_limit_n_m * vehicle.channels() as f64,
        DriveParameters::Ackermann(drive) => drive.torque_limit_n_m * vehicle.channels() as f64,
    };
    torque_n_m / (vehicle.parameters().wheels.radius_m * vehicle.mass_kg * GRAVITY_M_S2)
}

/// Slope `s` with `sin a + c cos a = k`, for `s = tan a`; infinite where the force is enough for any slope.
fn torque_slope(k: f64, c: f64) -> f64 {
    // (s + c)^2 = k^2 (1 + s^2).
    let (a, b, d) = (1.0 - k * k, c, c * c - k * k);
    if a <= 0.0 {
        return f64::INFINITY;
    }
    (-b + (b * b - a * d).max(0.0).sqrt()) / a
}

/// Slopes at which the vehicle tips over its rear axle (nose up) and over its front axle (nose down).
fn stability_ratios(vehicle: &Vehicle) -> [f64; 2] {
    let wheels = &vehicle.parameters().wheels;
    let (front_m, rear_m) = (wheels.axles_m[0], wheels.axles_m[wheels.axles_m.len() - 1]);
    let [x_m, _, z_m] = vehicle.centre_of_mass_m;
    let height_m = z_m - (wheels.axle_z_m - wheels.radius_m);
    [(x_m - rear_m) / height_m, (front_m - x_m) / height_m]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::vehicle;

    fn ability(name: &str, surface: SurfaceParameters) -> SlopeAbility {
        SlopeAbility::of(&vehicle(name, &serde_json::Map::new()).unwrap(), &surface)
    }

    fn slippery(wheel: f64) -> SurfaceParameters {
        SurfaceParameters { wheel_friction: Some(wheel), ..SurfaceParameters::default() }
    }

    /// The Husky on the ground of the study: grip 0.97 uphill, stability 0.256 / 0.194 = 1.32 either way, 80 N m over 0.1651 m against
    /// 556 N: 0.873 of the weight, so `sin a + 0.03 cos a = 0.873`: a = 59.1 deg. Grip is the least: 44.1 deg.
    #[test]
    fn val_grip_limits_the_husky() {
        let found = ability("husky_a200", SurfaceParameters::default());
        assert!((found.up_deg - libm::atan(0.97).to_degrees()).abs() < 1e-12, "{found:?}");
        assert!((found.down_deg - libm::atan(1.03).to_degrees()).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn val_ice_leaves_little() {
        let found = ability("husky_a200", slippery(0.02));
        assert_eq!(found.up_deg, 0.0);
        assert!((found.down_deg - libm::atan(0.05).to_degrees()).abs() < 1e-12);
    }

    /// On ground of unlimited grip torque or stability decides; the slope of the torque solves its equation.
    #[test]
    fn val_torque_and_stability_limit_on_rough_grip() {
        for (k, c) in [(0.3, 0.03), (0.9, 0.2), (0.5, -0.1), (0.99, 0.0)] {
            let a = libm::atan(torque_slope(k, c));
            assert!((libm::sin(a) + c * libm::cos(a) - k).abs() < 1e-12, "{k} {c}");
        }
        assert_eq!(torque_slope(1.2, 0.03), f64::INFINITY);
        let husky = vehicle("husky_a200", &serde_json::Map::new()).unwrap();
        let [rear, front] = stability_ratios(&husky);
        assert!((rear - front).abs() < 0.01 * rear && (1.0..2.0).contains(&rear), "{rear} {front}");
        let found = ability("husky_a200", slippery(50.0));
        let expected = torque_slope(torque_ratio(&husky), 0.03).min(rear);
        assert!((found.up_deg - libm::atan(expected).to_degrees()).abs() < 1e-12);
    }

    #[test]
    fn val_every_vehicle_climbs_something() {
        for name in ["husky_a200", "ugv_4x4", "rocker_bogie_rover"] {
            let found = ability(name, SurfaceParameters::default());
            assert!(found.up_deg > 5.0 && found.up_deg < 60.0 && found.down_deg >= found.up_deg, "{name}: {found:?}");
        }
    }
}
