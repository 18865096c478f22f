//! `roughness`: a DEM described and classified.

use super::{fit::read_metric, parameters};
use crate::error::Error;
use crate::jobs::roughness::settings;
use crate::study::check_roughness;
use sastrugi_roughness::{Summary, classify, describe, moore_gradient};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::RoughnessSection;
use sastrugi_store::dem;
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
    /// Cell size for files that carry none, m.
    pub cell_m: Option<[f64; 2]>,
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
    let (read, notes) = read_metric(request.dem, None, request.cell_m)?;
    if let Some(path) = request.classes {
        let classes = classify(&moore_gradient(&read.grid), &settings.thresholds);
        dem::write_classes(path, &classes, &read.info.crs).map_err(Error::failed)?;
    }
    Ok((describe(&read.grid, &settings), notes))
}
