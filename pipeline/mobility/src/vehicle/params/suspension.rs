//! Suspension of the wheels.

use super::{all_positive, finite};
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Suspension of the wheels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum SuspensionParameters {
    /// Axles fixed to the chassis.
    Rigid,
    /// Every wheel moves up and down independently, on a spring and a damper.
    Independent(IndependentParameters),
    /// Three axles without springs: on each side, a rocker carries the front wheel and a bogie with the middle and rear
    /// wheels; a differential turns the two rockers by opposite angles.
    RockerBogie(RockerBogieParameters),
}

/// Spring and damper of each wheel. At zero travel every spring carries an equal share of the chassis weight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IndependentParameters {
    /// Spring stiffness at the wheel, N/m.
    pub stiffness_n_m: f64,
    /// Damping at the wheel, N s/m.
    pub damping_n_s_m: f64,
    /// Upward travel of the wheel from zero to the stop, m.
    pub bump_m: f64,
    /// Downward travel of the wheel from zero to the stop, m.
    pub droop_m: f64,
    /// Stiffness of each stop, N/m.
    pub stop_stiffness_n_m: f64,
}

/// Rockers and bogies. Pivots turn about the transverse axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RockerBogieParameters {
    /// Pivot of the rockers on the chassis in base_link, `[x, z]`, m.
    pub rocker_pivot_m: [f64; 2],
    /// Pivot of the bogies on the rockers in base_link with all joints at zero, `[x, z]`, m.
    pub bogie_pivot_m: [f64; 2],
    /// Largest angle of a rocker in either direction, deg, below 90.
    pub rocker_limit_deg: f64,
    /// Largest angle of a bogie relative to its rocker in either direction, deg, below 90.
    pub bogie_limit_deg: f64,
    /// Joint friction, modelled as damping, N m s/rad.
    pub damping_n_m_s: f64,
    /// Stiffness of the stops, N m/rad.
    pub stop_stiffness_n_m: f64,
}

impl SuspensionParameters {
    /// Checks every number, for a vehicle with axles at `axles_m`, front to rear.
    pub(super) fn check(&self, axles_m: &[f64]) -> Result<(), ParameterError> {
        match self {
            Self::Rigid => Ok(()),
            Self::Independent(springs) => springs.check(),
            Self::RockerBogie(linkage) => match axles_m {
                &[front, middle, rear] => linkage.check([front, middle, rear]),
                _ => {
                    let message = format!("is `rocker_bogie`, which needs 3 axles; the vehicle has {}", axles_m.len());
                    Err(ParameterError::new("kind", message))
                }
            },
        }
    }
}

impl IndependentParameters {
    fn check(&self) -> Result<(), ParameterError> {
        ParameterError::not_negative("damping_n_s_m", self.damping_n_s_m)?;
        all_positive([("stiffness_n_m", self.stiffness_n_m), ("bump_m", self.bump_m), ("droop_m", self.droop_m)])?;
        if self.stop_stiffness_n_m.is_finite() && self.stop_stiffness_n_m >= self.stiffness_n_m {
            return Ok(());
        }
        let message = format!(
            "is {}; it must be at least the spring's stiffness of {} N/m",
            self.stop_stiffness_n_m, self.stiffness_n_m
        );
        Err(ParameterError::new("stop_stiffness_n_m", message))
    }
}

impl RockerBogieParameters {
    fn check(&self, [front, middle, rear]: [f64; 3]) -> Result<(), ParameterError> {
        self.rocker_pivot_m.into_iter().try_for_each(|v| finite("rocker_pivot_m", v))?;
        self.bogie_pivot_m.into_iter().try_for_each(|v| finite("bogie_pivot_m", v))?;
        ParameterError::between("rocker_limit_deg", self.rocker_limit_deg, 0.0, 90.0)?;
        ParameterError::between("bogie_limit_deg", self.bogie_limit_deg, 0.0, 90.0)?;
        ParameterError::not_negative("damping_n_m_s", self.damping_n_m_s)?;
        ParameterError::positive("stop_stiffness_n_m", self.stop_stiffness_n_m)?;
        // Otherwise the linkage folds onto its stops under the vehicle's weight.
        let (rocker, bogie) = (self.rocker_pivot_m[0], self.bogie_pivot_m[0]);
        let between = |key: &str, x: f64, low: f64, high: f64, what: &str| {
            let message = format!("x is {x}; it must lie between {what}, {low} to {high} m");
            if x > low && x < high { Ok(()) } else { Err(ParameterError::new(key, message)) }
        };
        between("bogie_pivot_m", bogie, rear, middle, "the rear and middle axles")?;
        between("rocker_pivot_m", rocker, bogie, front, "the bogie pivot and the front axle")
    }
}
