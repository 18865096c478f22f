//! Parameters of a traverse: vehicle, surface, steering, mission rules and rates.

use super::model::{GRAVITY_M_S2, Vehicle};
use super::params::SuspensionParameters;
use super::surface::SurfaceParameters;
use super::vector::{Vec3, add};
use crate::metrics::Differentiator;
use crate::registry;
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// A vehicle and how it drives missions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TraverseParameters {
    /// Kind of vehicle (see `sastrugi kinds vehicle`), or `custom`, in which case `vehicle_changes` holds all parameters.
    pub vehicle: String,
    /// Vehicle parameters that differ from its data file, such as `{ drive = { torque_limit_n_m = 30 } }`; `sastrugi kinds husky_a200` lists all.
    pub vehicle_changes: Map<String, Value>,
    /// Friction and rolling resistance of the ground.
    pub surface: SurfaceParameters,
    /// Path following.
    pub controller: ControllerParameters,
    /// Commanded speed, m/s (Majhor and Bos, section 2.3: 1).
    #[schemars(transform = limits::positive)]
    pub speed_m_s: f64,
    /// The goal counts as reached within this horizontal distance, m (chosen here).
    #[schemars(transform = limits::positive)]
    pub goal_tolerance_m: f64,
    /// Pitch or roll beyond this angle is a tip-over, deg, below 90 (Majhor and Bos, section 2.4: 75).
    #[schemars(transform = limits::between(0.0, 90.0))]
    pub tip_deg: f64,
    /// A vehicle that moves less than this horizontally within `stuck_time_s` is stuck, m (section 2.4: 0.2).
    #[schemars(transform = limits::positive)]
    pub stuck_distance_m: f64,
    /// Time without motion after which a vehicle is stuck, s (section 2.4: 30).
    #[schemars(transform = limits::positive)]
    pub stuck_time_s: f64,
    /// Time limit of a mission, s (chosen here: about seven times the undisturbed drive).
    #[schemars(transform = limits::between(0.0, TIME_MAX_S))]
    pub timeout_s: f64,
    /// Settling time on the ground before the clock starts, s; up to ten times as long while the suspension still moves.
    #[schemars(transform = limits::half_open(0.0, TIME_MAX_S))]
    pub settle_s: f64,
    /// Time steps per second, Hz (500; 1000 to check convergence).
    #[schemars(range(min = 1, max = STEP_RATE_MAX_HZ))]
    pub step_rate_hz: u32,
    /// Rate of recorded poses, wheels and commands, Hz; divides `step_rate_hz` (section 2.4: 20).
    #[schemars(range(min = 1))]
    pub sample_rate_hz: u32,
    /// Rate of recorded inertial measurements, Hz; divides `step_rate_hz`.
    #[schemars(range(min = 1))]
    pub imu_rate_hz: u32,
    /// Rate of the steering, Hz; divides `step_rate_hz`.
    #[schemars(range(min = 1))]
    pub control_rate_hz: u32,
    /// How the recorded poses are differentiated for the metrics.
    pub differentiator: Differentiator,
}

/// Pure-pursuit steering along the straight line or polyline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerParameters {
    /// Look-ahead distance, measured along the line from the vehicle's foot point, m; three wheelbases when absent (assumed).
    #[schemars(transform = limits::positive)]
    pub lookahead_m: Option<f64>,
    /// Look-ahead time, s: the look-ahead distance is the larger of `lookahead_m` and the commanded speed times this; it does
    /// not grow with speed when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub lookahead_time_s: Option<f64>,
    /// Factor on the yaw rate of the pursuit arc (assumed: 1, the plain arc).
    #[schemars(transform = limits::positive)]
    pub steering_gain: f64,
    /// Bearing of the look-ahead point beyond which the vehicle turns on the spot, deg (assumed: the point is behind).
    #[schemars(transform = limits::between(0.0, 180.0))]
    pub turn_start_deg: f64,
    /// Bearing below which it resumes driving, deg; below `turn_start_deg` (assumed).
    #[schemars(transform = limits::between(0.0, 180.0))]
    pub turn_stop_deg: f64,
    /// Yaw rate of a turn on the spot, rad/s (assumed: half of the vehicle's limit).
    #[schemars(transform = limits::positive)]
    pub turn_rate_rad_s: f64,
}

impl Default for TraverseParameters {
    fn default() -> Self {
        Self {
            vehicle: "husky_a200".to_owned(),
            vehicle_changes: Map::new(),
            surface: SurfaceParameters::default(),
            controller: ControllerParameters::default(),
            speed_m_s: 1.0,
            goal_tolerance_m: 0.5,
            tip_deg: 75.0,
            stuck_distance_m: 0.2,
            stuck_time_s: 30.0,
            timeout_s: 240.0,
            settle_s: 1.0,
            step_rate_hz: 500,
            sample_rate_hz: 20,
            imu_rate_hz: 100,
            control_rate_hz: 50,
            differentiator: Differentiator::SecondDifference,
        }
    }
}

impl Default for ControllerParameters {
    fn default() -> Self {
        Self {
            lookahead_m: None,
            lookahead_time_s: None,
            steering_gain: 1.0,
            turn_start_deg: 90.0,
            turn_stop_deg: 30.0,
            turn_rate_rad_s: 1.0,
        }
    }
}

impl TraverseParameters {
    /// Checks everything, the vehicle included.
    ///
    /// # Errors
    /// A [`ParameterError`] for an unknown vehicle, a number out of range, rates that do not divide the step rate, or a
    /// time step that is unstable for the vehicle's stiffness.
    ///
    /// ```
    /// use sastrugi_mobility::vehicle::TraverseParameters;
    ///
    /// let (vehicle, settings) = TraverseParameters::default().prepare().unwrap();
    /// assert_eq!(vehicle.name(), "husky_a200");
    /// // What the study leaves open is filled in.
    /// assert_eq!(settings.parameters().surface.wheel_friction, Some(1.0));
    ///
    /// let coarse = TraverseParameters { step_rate_hz: 100, ..TraverseParameters::default() };
    /// assert_eq!(coarse.prepare().unwrap_err().key, "step_rate_hz");
    /// ```
    pub fn prepare(&self) -> Result<(Vehicle, TraverseSettings), ParameterError> {
        let vehicle = registry::vehicle(&self.vehicle, &self.vehicle_changes)?;
        self.check_rules()?;
        self.surface.check().map_err(|e| e.within("surface"))?;
        self.controller.check().map_err(|e| e.within("controller"))?;
        self.check_rates()?;
        self.check_step(&vehicle)?;
        let tip_sin_cos = libm::sincos(self.tip_deg.to_radians());
        let mut parameters = self.clone();
        let lookahead_m = self.controller.lookahead_m.unwrap_or(LOOKAHEAD_WHEELBASES * vehicle.wheelbase_m());
        parameters.controller.lookahead_m = Some(lookahead_m);
        parameters.surface.fill();
        Ok((vehicle, TraverseSettings { parameters, tip_sin_cos, lookahead_m }))
    }

    fn check_rules(&self) -> Result<(), ParameterError> {
        let positive = [
            ("speed_m_s", self.speed_m_s),
            ("goal_tolerance_m", self.goal_tolerance_m),
            ("stuck_distance_m", self.stuck_distance_m),
            ("stuck_time_s", self.stuck_time_s),
        ];
        positive.into_iter().try_for_each(|(key, value)| ParameterError::positive(key, value).map(drop))?;
        ParameterError::between("tip_deg", self.tip_deg, 0.0, 90.0)?;
        ParameterError::between("timeout_s", self.timeout_s, 0.0, TIME_MAX_S)?;
        if !(0.0..TIME_MAX_S).contains(&self.settle_s) {
            let message = format!("is {}; it must be at least 0 and less than {TIME_MAX_S}", self.settle_s);
            return Err(ParameterError::new("settle_s", message));
        }
        Ok(())
    }

    fn check_rates(&self) -> Result<(), ParameterError> {
        if !(1..=STEP_RATE_MAX_HZ).contains(&self.step_rate_hz) {
            let message = format!("is {}; it must be 1 to {STEP_RATE_MAX_HZ}", self.step_rate_hz);
            return Err(ParameterError::new("step_rate_hz", message));
        }
        let rates = [
            ("sample_rate_hz", self.sample_rate_hz),
            ("imu_rate_hz", self.imu_rate_hz),
            ("control_rate_hz", self.control_rate_hz),
        ];
        match rates.into_iter().find(|&(_, rate)| rate == 0 || !self.step_rate_hz.is_multiple_of(rate)) {
            None => Ok(()),
            Some((key, rate)) => {
                let message = format!("is {rate}; it must divide the step rate of {} Hz", self.step_rate_hz);
                Err(ParameterError::new(key, message))
            }
        }
    }

    fn check_step(&self, vehicle: &Vehicle) -> Result<(), ParameterError> {
        let (step_s, limit_s) = (1.0 / f64::from(self.step_rate_hz), step_limit_s(vehicle));
        if step_s < limit_s {
            return Ok(());
        }
        let message = format!(
            "is {}: steps of {step_s} s are unstable for the stiffness of `{}`; the limit is {limit_s:.2e} s, so use \
             {} Hz or more",
            self.step_rate_hz,
            vehicle.name(),
            (1.0 / limit_s).floor() + 1.0
        );
        Err(ParameterError::new("step_rate_hz", message))
    }
}

/// Look-ahead distance over wheelbase.
pub(crate) const LOOKAHEAD_WHEELBASES: f64 = 3.0;
/// Longest time limit and settling time accepted, s.
const TIME_MAX_S: f64 = 86_400.0;
/// Highest step rate accepted, Hz.
const STEP_RATE_MAX_HZ: u32 = 100_000;

impl ControllerParameters {
    fn check(&self) -> Result<(), ParameterError> {
        self.lookahead_m.map_or(Ok(0.0), |v| ParameterError::positive("lookahead_m", v))?;
        self.lookahead_time_s.map_or(Ok(0.0), |v| ParameterError::positive("lookahead_time_s", v))?;
        ParameterError::positive("steering_gain", self.steering_gain)?;
        ParameterError::positive("turn_rate_rad_s", self.turn_rate_rad_s)?;
        ParameterError::between("turn_start_deg", self.turn_start_deg, 0.0, 180.0)?;
        ParameterError::between("turn_stop_deg", self.turn_stop_deg, 0.0, self.turn_start_deg)?;
        Ok(())
    }
}

/// Checked [`TraverseParameters`].
#[derive(Clone, Debug, PartialEq)]
pub struct TraverseSettings {
    parameters: TraverseParameters,
    tip_sin_cos: (f64, f64),
    lookahead_m: f64,
}

impl TraverseSettings {
    /// The parameters, with defaults filled in.
    pub fn parameters(&self) -> &TraverseParameters {
        &self.parameters
    }

    pub(crate) fn controller(&self) -> &ControllerParameters {
        &self.parameters.controller
    }

    /// Look-ahead distance at a commanded speed, m.
    pub(crate) fn lookahead_m(&self, speed_m_s: f64) -> f64 {
        self.lookahead_m.max(self.parameters.controller.lookahead_time_s.unwrap_or(0.0) * speed_m_s)
    }

    pub(crate) fn speed_m_s(&self) -> f64 {
        self.parameters.speed_m_s
    }

    pub(crate) fn step_s(&self) -> f64 {
        1.0 / f64::from(self.parameters.step_rate_hz)
    }

    /// Sine and cosine of the angle of a tip-over.
    pub(crate) fn tip_sin_cos(&self) -> (f64, f64) {
        self.tip_sin_cos
    }

    pub(crate) fn turn_start_rad(&self) -> f64 {
        self.parameters.controller.turn_start_deg.to_radians()
    }

    pub(crate) fn turn_stop_rad(&self) -> f64 {
        self.parameters.controller.turn_stop_deg.to_radians()
    }
}

/// Largest stable time step of a vehicle with every contact point in the ground, s.
///
/// A semi-implicit Euler step `h` of a mass `M` on a spring `K` with an explicit damper `C` is stable while
/// `K h^2 + 2 C h < 4 M`. The condition is applied to each of the six degrees of freedom of the body separately, and to every
/// joint of the suspension.
pub(crate) fn step_limit_s(vehicle: &Vehicle) -> f64 {
    let contacts = contacts(vehicle);
    let limit = |mass: f64, arm_squared: &dyn Fn(Vec3) -> f64| {
        let stiffness: f64 = contacts.iter().map(|c| c.stiffness * arm_squared(c.arm)).sum();
        let damping: f64 = contacts.iter().map(|c| c.damping * arm_squared(c.arm)).sum();
        step_limit_of(mass, stiffness, damping)
    };
    let shift = limit(vehicle.mass_kg, &|_| 1.0);
    let turn = |axis: usize| {
        let arm_squared = |arm: Vec3| {
            let (a, b) = (arm[(axis + 1) % 3], arm[(axis + 2) % 3]);
            a * a + b * b
        };
        limit(vehicle.inertia_kg_m2[axis], &arm_squared)
    };
    (0..3).map(turn).fold(shift, f64::min).min(joint_step_limit_s(vehicle))
}

fn step_limit_of(mass: f64, stiffness: f64, damping: f64) -> f64 {
    // The root of the condition, in a form without cancellation and without overflow to an infinite limit.
    4.0 * mass / (damping + (damping * damping + 4.0 * stiffness * mass).sqrt())
}

/// Largest stable time step of a wheel between its tyre and its suspension, s; infinite without joints.
fn joint_step_limit_s(vehicle: &Vehicle) -> f64 {
    let (tyre, wheel_kg) = (&vehicle.parameters().tyre, vehicle.parameters().wheels.mass_kg);
    let stiffness = vehicle.tyre.stiffness_max_n_m().max(tyre.tangential_stiffness_n_m);
    let damping = tyre.damping_n_s_m.max(tyre.tangential_damping_n_s_m);
    match &vehicle.parameters().suspension {
        SuspensionParameters::Rigid => f64::INFINITY,
        SuspensionParameters::Independent(springs) => {
            let stiffness = stiffness + springs.stiffness_n_m + springs.stop_stiffness_n_m;
            step_limit_of(wheel_kg, stiffness, damping + springs.damping_n_s_m)
        }
        SuspensionParameters::RockerBogie(joints) => {
            // The rotating part with the least inertia is a bogie with its two wheels.
            let [x, z] = joints.bogie_pivot_m;
            let wheels = &vehicle.parameters().wheels;
            let arms_squared = |below: f64| -> f64 {
                let dz = wheels.axle_z_m - below - z;
                wheels.axles_m[1..].iter().map(|axle| (axle - x) * (axle - x) + dz * dz).sum()
            };
            let (hubs, contacts) = (arms_squared(0.0), arms_squared(wheels.radius_m).max(arms_squared(0.0)));
            let (stop, friction) = (joints.stop_stiffness_n_m, joints.damping_n_m_s);
            step_limit_of(wheel_kg * hubs, stiffness * contacts + stop, damping * contacts + friction)
        }
    }
}

/// A contact as a spring and damper in every direction.
struct Contact {
    arm: Vec3,
    stiffness: f64,
    damping: f64,
}

fn contacts(vehicle: &Vehicle) -> Vec<Contact> {
    let (tyre, belly) = (&vehicle.parameters().tyre, &vehicle.parameters().belly);
    let wheel = Contact {
        arm: [0.0, 0.0, -vehicle.tyre.radius_m],
        stiffness: vehicle.tyre.stiffness_max_n_m().max(tyre.tangential_stiffness_n_m),
        damping: tyre.damping_n_s_m.max(tyre.tangential_damping_n_s_m),
    };
    let points = vehicle.belly.points();
    // The total dissipation of all points is proportional to their load, here the weight.
    let dissipation = belly.dissipation_s_m * vehicle.mass_kg * GRAVITY_M_S2 / points.len() as f64;
    let damping = belly.tangential_damping_n_s_m.max(dissipation);
    let wheels = vehicle.wheels.iter().map(|w| Contact { arm: add(w.hub, wheel.arm), ..wheel });
    let points = points.iter().map(|&arm| Contact { arm, stiffness: belly.stiffness_n_m, damping });
    wheels.chain(points).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The limit solves `K h^2 + 2 C h = 4 M`; without a damper it is `2 sqrt(M / K)`, without a spring `2 M / C`.
    #[test]
    fn val_the_step_limit_solves_its_condition() {
        for (mass, stiffness, damping) in [(2.0, 8e4, 0.0), (2.0, 8e4, 300.0), (0.1, 10.0, 50.0), (1e3, 1e6, 1e4)] {
            let step_s = step_limit_of(mass, stiffness, damping);
            let left = stiffness * step_s * step_s + 2.0 * damping * step_s;
            assert!((left / (4.0 * mass) - 1.0).abs() < 1e-12, "{mass} {stiffness} {damping}: {step_s}");
        }
        assert!((step_limit_of(2.0, 8e4, 0.0) - 0.01).abs() < 1e-15);
        assert!((step_limit_of(3.0, 0.0, 60.0) - 0.1).abs() < 1e-15);
    }

    /// Just below its limit, a semi-implicit oscillator with an explicit damper stays bounded; just above, it grows beyond bounds.
    #[test]
    fn val_the_step_limit_separates_stable_from_unstable() {
        for (mass, stiffness, damping) in [(2.0, 8e4, 0.0), (2.0, 8e4, 300.0), (0.1, 10.0, 50.0)] {
            let farthest = |share: f64| {
                let step_s = share * step_limit_of(mass, stiffness, damping);
                let (mut position, mut velocity, mut farthest) = (1e-3f64, 0.0f64, 0.0f64);
                for _ in 0..5000 {
                    velocity -= step_s * (stiffness * position + damping * velocity) / mass;
                    position += step_s * velocity;
                    farthest = farthest.max(position.abs());
                }
                farthest
            };
            let [stable, unstable] = [0.99, 1.01].map(farthest);
            assert!(stable < 0.1 && unstable > 1e6, "{mass} {stiffness} {damping}: {stable} {unstable}");
        }
    }
}
