//! Export of a vehicle for other simulators, as bodies connected by joints.

use super::parameters::assign_vehicle;
use crate::error::Error;
use sastrugi_mobility::registry::{doubts, kinds, vehicle};
use sastrugi_mobility::vehicle::SurfaceParameters;
use sastrugi_schemas::kind::read_parameters;
use sastrugi_schemas::mechanism::Mechanism;
use serde_json::json;

/// True for the name of a known vehicle.
pub fn is_known(name: &str) -> bool {
    kinds().iter().any(|kind| kind.family == "vehicle" && kind.kind == name)
}

/// The vehicle of that name or file, with the friction of a surface preset, and warnings about it, one sentence each.
///
/// # Errors
/// A file that cannot be read, an unknown vehicle or surface, or a value out of range.
pub fn mechanism(name: &str, surface: Option<&str>) -> Result<(Mechanism, Vec<String>), Error> {
    let mut params = json!({});
    assign_vehicle(&mut params, name)?;
    let kind = params["vehicle"].as_str().unwrap_or_default();
    let changes = params["vehicle_changes"].as_object().cloned().unwrap_or_default();
    let surface: SurfaceParameters = match surface {
        Some(preset) => read_parameters(&json!({ "preset": preset }))?,
        None => SurfaceParameters::default(),
    };
    let found = vehicle(kind, &changes)?;
    Ok((found.mechanism(&surface), doubts(kind, &changes)))
}
