//! Parameters of a vehicle: the raw form of its data file.

mod drive;
mod suspension;

pub use drive::{AckermannParameters, DriveParameters, SkidSteerParameters};
pub use suspension::{IndependentParameters, RockerBogieParameters, SuspensionParameters};

use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A wheeled vehicle. Frame base_link: x forward, y left, z up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VehicleParameters {
    /// Body without wheels.
    pub chassis: ChassisParameters,
    /// Wheels: one at each end of every axle.
    pub wheels: WheelParameters,
    /// Suspension of the wheels.
    pub suspension: SuspensionParameters,
    /// Contact between wheel and ground.
    pub tyre: TyreParameters,
    /// Contact between chassis and ground.
    pub belly: BellyParameters,
    /// Motors and steering.
    pub drive: DriveParameters,
}

/// Body without wheels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChassisParameters {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Moments of inertia about x, y, z through the chassis' centre of mass, kg m2.
    pub inertia_kg_m2: [f64; 3],
    /// Centre of mass in base_link, m.
    pub centre_of_mass_m: [f64; 3],
    /// Length, width and height of the chassis, m.
    pub size_m: [f64; 3],
    /// Height of the bottom plate in base_link, m.
    pub bottom_z_m: f64,
}

/// Wheels: one at each end of every axle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WheelParameters {
    /// Positions of the axles along x in base_link, front to rear, m.
    pub axles_m: Vec<f64>,
    /// Distance between the centre planes of a left and a right wheel, m.
    pub track_m: f64,
    /// Height of the axles in base_link, m.
    pub axle_z_m: f64,
    /// Mass of a wheel, kg.
    pub mass_kg: f64,
    /// Radius, m.
    pub radius_m: f64,
    /// Width, m.
    pub width_m: f64,
    /// Moment of inertia about the axle, kg m2.
    pub spin_inertia_kg_m2: f64,
    /// Moment of inertia about a diameter, kg m2.
    pub transverse_inertia_kg_m2: f64,
}

/// Contact between wheel and ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TyreParameters {
    /// Static load divided by static sag on level ground, N/m; the stiffness of each rim ray follows from it.
    pub stiffness_n_m: f64,
    /// Damping along the contact normal, N s/m per wheel.
    pub damping_n_s_m: f64,
    /// Stiffness of the tread in the contact plane, N/m per wheel.
    pub tangential_stiffness_n_m: f64,
    /// Damping of the tread in the contact plane, N s/m per wheel.
    pub tangential_damping_n_s_m: f64,
    /// Rolling distance over which a tread deflection decays, m.
    pub relaxation_length_m: f64,
    /// Discs across the width of a wheel, 1 to 9.
    pub discs: u32,
    /// Rays on the rim of each disc, 3 to 181.
    pub rays: u32,
    /// Angle that the rays span on each side of the body's down direction, deg, 10 to 120.
    pub fan_deg: f64,
}

/// Contact between chassis and ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BellyParameters {
    /// Contact points along and across the bottom plate, 2 to 101 each.
    pub points: [u32; 2],
    /// Height in base_link of the contact points on the bumpers (three at the front, three at the rear), m.
    pub bumper_z_m: f64,
    /// Stiffness of a contact point, normal and tangential, N/m.
    pub stiffness_n_m: f64,
    /// Normal damping as a fraction of the elastic force per unit approach speed (Hunt and Crossley, 1975), s/m.
    pub dissipation_s_m: f64,
    /// Damping of a contact point in the contact plane, N s/m.
    pub tangential_damping_n_s_m: f64,
}

impl VehicleParameters {
    /// Checks every number and their consistency.
    pub(crate) fn check(&self) -> Result<(), ParameterError> {
        self.chassis.check().map_err(|e| e.within("chassis"))?;
        self.wheels.check().map_err(|e| e.within("wheels"))?;
        self.tyre.check().map_err(|e| e.within("tyre"))?;
        self.belly.check().map_err(|e| e.within("belly"))?;
        let axles = self.wheels.axles_m.len();
        self.suspension.check(&self.wheels.axles_m).map_err(|e| e.within("suspension"))?;
        self.drive.check(axles).map_err(|e| e.within("drive"))?;
        self.check_balance()
    }

    /// The centre of mass must lie between the wheels.
    fn check_balance(&self) -> Result<(), ParameterError> {
        let [x, y, _] = self.chassis.centre_of_mass_m;
        let axles = &self.wheels.axles_m;
        let (front, rear) = (axles[0], axles[axles.len() - 1]);
        let key = "chassis.centre_of_mass_m";
        if !(x < front && x > rear) {
            return Err(ParameterError::new(
                key,
                format!("x is {x}; it must lie between the axles, {rear} to {front} m"),
            ));
        }
        let half_track = 0.5 * self.wheels.track_m;
        if y.abs() >= half_track {
            return Err(ParameterError::new(
                key,
                format!("y is {y}; it must lie within {half_track} m of the centre line"),
            ));
        }
        Ok(())
    }
}

/// Maximum number of axles.
pub(crate) const AXLES_MAX: usize = 9;

/// `Ok` when every named value is finite and above 0.
fn all_positive<const N: usize>(values: [(&str, f64); N]) -> Result<(), ParameterError> {
    values.into_iter().try_for_each(|(key, value)| ParameterError::positive(key, value).map(drop))
}

/// `Ok` when the value is finite.
fn finite(key: &str, value: f64) -> Result<(), ParameterError> {
    if value.is_finite() { Ok(()) } else { Err(ParameterError::new(key, format!("is {value}; it must be finite"))) }
}

/// `Ok` when the count lies in the closed range.
fn counted(key: &str, value: u32, low: u32, high: u32) -> Result<(), ParameterError> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(ParameterError::new(key, format!("is {value}; it must be {low} to {high}")))
    }
}

impl ChassisParameters {
    fn check(&self) -> Result<(), ParameterError> {
        all_positive([("mass_kg", self.mass_kg)])?;
        all_positive(self.inertia_kg_m2.map(|v| ("inertia_kg_m2", v)))?;
        all_positive(self.size_m.map(|v| ("size_m", v)))?;
        self.centre_of_mass_m.into_iter().try_for_each(|v| finite("centre_of_mass_m", v))?;
        finite("bottom_z_m", self.bottom_z_m)
    }
}

impl WheelParameters {
    fn check(&self) -> Result<(), ParameterError> {
        all_positive([
            ("track_m", self.track_m),
            ("mass_kg", self.mass_kg),
            ("radius_m", self.radius_m),
            ("width_m", self.width_m),
            ("spin_inertia_kg_m2", self.spin_inertia_kg_m2),
            ("transverse_inertia_kg_m2", self.transverse_inertia_kg_m2),
        ])?;
        finite("axle_z_m", self.axle_z_m)?;
        self.axles_m.iter().try_for_each(|&v| finite("axles_m", v))?;
        self.check_room()
    }

    /// Wheels must not overlap.
    fn check_room(&self) -> Result<(), ParameterError> {
        if !(2..=AXLES_MAX).contains(&self.axles_m.len()) {
            let axles = sastrugi_schemas::counted(self.axles_m.len(), "axle");
            let message = format!("lists {axles}; it must list 2 to {AXLES_MAX}, front to rear");
            return Err(ParameterError::new("axles_m", message));
        }
        let diameter = 2.0 * self.radius_m;
        if let Some(pair) = self.axles_m.windows(2).find(|pair| pair[0] - pair[1] < diameter) {
            let message = format!(
                "{} and {} are less than the wheel diameter of {diameter} m apart, or not in order from front to rear",
                pair[0], pair[1]
            );
            return Err(ParameterError::new("axles_m", message));
        }
        if self.track_m < self.width_m {
            let message = format!("is {}; it must be at least the wheel width of {} m", self.track_m, self.width_m);
            return Err(ParameterError::new("track_m", message));
        }
        Ok(())
    }
}

impl TyreParameters {
    fn check(&self) -> Result<(), ParameterError> {
        all_positive([
            ("stiffness_n_m", self.stiffness_n_m),
            ("tangential_stiffness_n_m", self.tangential_stiffness_n_m),
            ("relaxation_length_m", self.relaxation_length_m),
        ])?;
        ParameterError::not_negative("damping_n_s_m", self.damping_n_s_m)?;
        ParameterError::not_negative("tangential_damping_n_s_m", self.tangential_damping_n_s_m)?;
        counted("discs", self.discs, 1, 9)?;
        counted("rays", self.rays, 3, 181)?;
        if !(10.0..=120.0).contains(&self.fan_deg) {
            return Err(ParameterError::new("fan_deg", format!("is {}; it must be 10 to 120", self.fan_deg)));
        }
        Ok(())
    }
}

impl BellyParameters {
    fn check(&self) -> Result<(), ParameterError> {
        self.points.into_iter().try_for_each(|n| counted("points", n, 2, 101))?;
        all_positive([("stiffness_n_m", self.stiffness_n_m)])?;
        ParameterError::not_negative("dissipation_s_m", self.dissipation_s_m)?;
        ParameterError::not_negative("tangential_damping_n_s_m", self.tangential_damping_n_s_m)?;
        finite("bumper_z_m", self.bumper_z_m)
    }
}
