//! Vehicles: their parameters as data, and their dynamics on a terrain.
//!
//! # Model
//! A rigid body with six degrees of freedom, plus one per side: the spin of the wheels that one motor channel turns
//! together. State: position of the centre of mass, velocity, unit quaternion, body angular velocity `w`, spin `W` of
//! each side, and one deflection per contact (`contact.rs`, `belly.rs`). With mass `m`, inertia `I` (including the wheels
//! but not their spin), contact forces `F` at `p`, rolling-resistance couples, and wheel spin momentum `J W` about the axle
//! direction `y`:
//!
//! ```text
//! m a        = sum F - m g z
//! I dw/dt    = sum (p - com) x F + sum rolling y - J dW/dt y - w x (I w)
//! J dW/dt    = torque - r sum F_x + sum rolling                        (per side, implicit: drive.rs)
//! ```
//!
//! The motor torque is internal: it acts on the chassis through the contact force at its true point of action and through
//! the change of the wheels' momentum. Integration: fixed steps, semi-implicit Euler (velocities first, then positions with
//! the new velocities), 500 Hz by default.
//!
//! Source: the vehicle of Majhor and Bos, section 2. `docs/traversal.md` describes the model and lists what it leaves out
//! (side walls, spikes between rays, soil). Only `+ - * /`, `sqrt` and `libm` are used. Cost: about a microsecond per step
//! and vehicle.

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
mod lanes;
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
