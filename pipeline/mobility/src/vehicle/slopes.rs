//! Steepest slopes that a vehicle can climb and descend on a plane, driving straight up or down.
//!
//! At constant speed on a slope of angle `a`, with weight `W`, friction `mu` and rolling resistance `c`, all wheels driven:
//!
//! ```text
//! grip      tan a <= mu - c  uphill,  tan a <= mu + c  downhill     (traction at most mu W cos a)
//! torque    W (sin a + c cos a) r <= T                              (T the torque of all motors, r the wheel radius)
//! stability tan a <= lever / h                                      (h the height of the centre of mass above the ground, lever its
//!                                                                    distance in plan from the lower outer axle)
//! ```
//!
//! These are the textbook limits of a rigid vehicle (Wong, 2008, Theory of Ground Vehicles, section 3.1 on grades). Downhill,
//! the motors may also brake with their full torque. Load transfer does not affect grip, because every wheel has its own motor
//! or shares one with the wheels of its side.

use super::model::{GRAVITY_M_S2, Vehicle};
use super::params::DriveParameters;
use super::surface::SurfaceParameters;

/// Steepest slopes that a vehicle can drive, and its rolling resistance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopeAbility {
    /// Steepest climb, degrees, 0 to below 90.
    pub up_deg: f64,
    /// Steepest descent, degrees, 0 to below 90.
    pub down_deg: f64,
    /// Rolling resistance divided by normal force, which is the work per metre on level ground divided by the weight.
    pub rolling_resistance: f64,
}

impl SlopeAbility {
    /// Slope limits of a vehicle on a surface (outside of areas where a class or raster overrides it).
    ///
    /// ```
    /// use sastrugi_mobility::registry::vehicle;
    /// use sastrugi_mobility::vehicle::{SlopeAbility, SurfaceParameters};
    ///
    /// let husky = vehicle("husky_a200", &serde_json::Map::new()).unwrap();
    /// // Friction 0.53 less a rolling resistance of 0.03: the climb ends at a slope of one in two.
    /// let ground = SurfaceParameters { wheel_friction: Some(0.53), ..SurfaceParameters::default() };
    /// let ability = SlopeAbility::of(&husky, &ground);
    /// assert!((ability.up_deg - 26.565).abs() < 1e-3);
    /// assert!(ability.down_deg > ability.up_deg);
    /// ```
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

/// Total motor force at the rims divided by the weight.
fn torque_ratio(vehicle: &Vehicle) -> f64 {
    let torque_n_m = match &vehicle.parameters().drive {
        DriveParameters::SkidSteer(drive) => drive.torque_limit_n_m * vehicle.channels() as f64,
        DriveParameters::Ackermann(drive) => drive.torque_limit_n_m * vehicle.channels() as f64,
    };
    torque_n_m / (vehicle.parameters().wheels.radius_m * vehicle.mass_kg * GRAVITY_M_S2)
}

/// Slope `s = tan a` that solves `sin a + c cos a = k`; infinite if the force suffices for any slope.
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

    /// The Husky on the ground of the study: grip 0.97 uphill; stability 0.256 / 0.189 = 1.36 either way; torque 80 N m over
    /// 0.1651 m against 555 N, 0.873 of the weight, so `sin a + 0.03 cos a = 0.873`, a = 59.1 deg. Grip is the lowest limit:
    /// 44.1 deg.
    #[test]
    fn val_grip_limits_the_husky() {
        let found = ability("husky_a200", SurfaceParameters::default());
        assert!((found.up_deg - libm::atan(0.97).to_degrees()).abs() < 1e-12, "{found:?}");
        assert!((found.down_deg - libm::atan(1.03).to_degrees()).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn val_ice_allows_no_climb() {
        let found = ability("husky_a200", slippery(0.02));
        assert_eq!(found.up_deg, 0.0);
        assert!((found.down_deg - libm::atan(0.05).to_degrees()).abs() < 1e-12);
    }

    /// With unlimited grip, torque or stability is the limit; the torque-limited slope solves its equation.
    #[test]
    fn val_torque_and_stability_limit_with_unlimited_grip() {
        for (k, c) in [(0.3, 0.03), (0.9, 0.2), (0.5, -0.1), (0.99, 0.0)] {
            let a = libm::atan(torque_slope(k, c));
            assert!((libm::sin(a) + c * libm::cos(a) - k).abs() < 1e-12, "{k} {c}");
        }
        assert_eq!(torque_slope(1.2, 0.03), f64::INFINITY);
        let husky = vehicle("husky_a200", &serde_json::Map::new()).unwrap();
        assert!((torque_ratio(&husky) - 80.0 / (0.1651 * 56.582 * 9.80665)).abs() < 1e-9, "{}", torque_ratio(&husky));
        // The centre of mass lies halfway between the axles, 0.05656 m above base_link, whose wheels reach 0.13228 m below it.
        let [rear, front] = stability_ratios(&husky);
        assert!((rear - front).abs() < 1e-12 && (rear - 0.256 / 0.18884).abs() < 1e-4, "{rear} {front}");
        let found = ability("husky_a200", slippery(50.0));
        let expected = torque_slope(torque_ratio(&husky), 0.03).min(rear);
        assert!((found.up_deg - libm::atan(expected).to_degrees()).abs() < 1e-12);
    }

    /// On the ground of the study, grip is the lowest limit of every shipped vehicle: the other 4x4 has 0.82 of its weight at
    /// the rims and its centre of mass at half the wheelbase over 2.15; the rover 1.04 and 1.75.
    #[test]
    fn val_grip_limits_every_vehicle() {
        for name in ["husky_a200", "ugv_4x4", "rocker_bogie_rover"] {
            let found = ability(name, SurfaceParameters::default());
            assert!((found.up_deg - libm::atan(0.97).to_degrees()).abs() < 1e-9, "{name}: {found:?}");
            assert!((found.down_deg - libm::atan(1.03).to_degrees()).abs() < 1e-9, "{name}: {found:?}");
            assert_eq!(found.rolling_resistance, 0.03);
        }
        // All six motors of the rover count, and so do all four of the 4x4.
        let ratio = |name: &str| torque_ratio(&vehicle(name, &serde_json::Map::new()).unwrap());
        assert!((ratio("ugv_4x4") - 4.0 * 1200.0 / (0.4 * 1500.0 * 9.80665)).abs() < 1e-9);
        assert!((ratio("rocker_bogie_rover") - 6.0 * 25.0 / (0.125 * 118.0 * 9.80665)).abs() < 1e-9);
    }

    /// A centre of mass moved ahead of the middle makes a vehicle steadier uphill and less steady downhill.
    #[test]
    fn val_stability_is_measured_from_the_lower_axle() {
        let serde_json::Value::Object(ahead) = serde_json::json!({"chassis": {"centre_of_mass_m": [0.1, 0.0, 0.062]}})
        else {
            panic!()
        };
        let [rear, front] = stability_ratios(&vehicle("husky_a200", &ahead).unwrap());
        // Chassis 46.034 of 56.582 kg: the common centre lies 0.08136 m ahead.
        assert!((rear - (0.256 + 0.08136) / 0.18884).abs() < 1e-3, "{rear}");
        assert!((front - (0.256 - 0.08136) / 0.18884).abs() < 1e-3, "{front}");
    }
}
