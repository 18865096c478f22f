//! Vehicles: their parameters as data, and the dynamics that drive them over a terrain.
//!
//! # Model
//! A rigid body with six degrees of freedom and one more per side, the spin of the wheels that a motor channel turns
//! together. State: position of the centre of mass, velocity, unit quaternion, body angular velocity `w`, spin `W` of
//! either side, and one deflection per contact (`contact.rs`, `belly.rs`). With mass `m`, inertia `I` (wheels included,
//! save their spin), contact forces `F` at `p`, rolling-resistance couples and wheel spin momentum `J W` about the axle
//! direction `y`,
//!
//! ```text
//! m a        = sum F - m g z
//! I dw/dt    = sum (p - com) x F + sum rolling y - J dW/dt y - w x (I w)
//! J dW/dt    = torque - r sum F_x + sum rolling                        (per side, implicit: drive.rs)
//! ```
//!
//! The motor torque itself is internal: what the chassis feels of it is the contact force at its true point and the
//! change of the wheels' momentum. Fixed steps, semi-implicit (velocities first, then positions with the new
//! velocities); 500 Hz unless told otherwise.
//!
//! Source: the vehicle of Majhor and Bos, section 2; the model is described in `docs/traversal.md`. Only `+ - * /`, `sqrt` and
//! `libm` are used. Cost: about a microsecond per step and vehicle. What the model leaves out (side walls, spikes between
//! rays, soil) is listed in `docs/traversal.md`.

mod actuation;
mod articulated;
mod belly;
mod body;
mod clearance;
mod contact;
mod controller;
mod doubts;
mod drive;
mod ground;
mod linkage;
mod mechanism;
mod model;
mod params;
mod settings;
mod simulation;
mod slopes;
mod surface;
#[cfg(test)]
mod tests;
mod traverse;
mod vector;

pub(crate) use doubts::doubts;
pub use ground::{Ground, GroundError, check_scale};
pub use model::Vehicle;
pub use params::{
    AckermannParameters, BellyParameters, ChassisParameters, DriveParameters, IndependentParameters,
    RockerBogieParameters, SkidSteerParameters, SuspensionParameters, TyreParameters, VehicleParameters,
    WheelParameters,
};
pub(crate) use settings::LOOKAHEAD_WHEELBASES;
pub use settings::{ControllerParameters, TraverseParameters, TraverseSettings};
pub use slopes::SlopeAbility;
pub use surface::{ClassSurfaceParameters, SurfaceError, SurfaceLayers, SurfaceMap, SurfaceParameters, SurfacePreset};
pub(crate) use surface::{MATERIALS, Material};
pub use traverse::{TraverseError, drive};

/// Data file of the Clearpath Husky A200.
pub(crate) const HUSKY_A200: &str = include_str!("models/husky_a200.toml");
/// Data file of a generic car-sized vehicle.
pub(crate) const UGV_4X4: &str = include_str!("models/ugv_4x4.toml");
/// Data file of a generic six-wheel rover.
pub(crate) const ROCKER_BOGIE_ROVER: &str = include_str!("models/rocker_bogie_rover.toml");
