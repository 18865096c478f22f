//! `roughness`: a DEM described and classified.

use super::{Read, Reading, parameters, read};
use crate::error::Error;
use crate::jobs::roughness::settings;
use crate::study::check_roughness;
pub use sastrugi_roughness::ArealFigures;
use sastrugi_roughness::{Summary, classify, describe, moore_gradient};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::RoughnessSection;
use sastrugi_store::dem as store;
use serde_json::Value;
use std::path::Path;

/// What to describe.
pub struct Request<'a> {
    /// DEM.
    pub dem: &'a Path,
    /// Settings of `[roughness]`.
    pub parameters: Value,
    /// Class map to write.
    pub classes: Option<&'a Path>,
    /// How the DEM is read.
    pub reading: Reading,
}

/// Describes a DEM; returns the figures and sentences on how it was read.
///
/// # Errors
/// Unknown settings, a DEM that cannot be read, a class map that cannot be written.
pub fn roughness(request: &Request<'_>) -> Result<(Summary, Vec<String>), Error> {
    parameters::check_schema(&request.parameters, &schema_of::<RoughnessSection>(), "roughness")?;
    let section: RoughnessSection = read_parameters(&request.parameters)?;
    check_roughness(&section)?;
    let settings = settings(&section)?;
    let Read { dem, notes, .. } = read(request.dem, &request.reading)?;
    if let Some(path) = request.classes {
        let classes = classify(&moore_gradient(&dem.grid), &settings.thresholds);
        store::write_classes(path, &classes, &dem.info.crs).map_err(Error::failed)?;
    }
    Ok((describe(&dem.grid, &settings), notes))
}
