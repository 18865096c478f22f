//! `fit`: covariance of a measured DEM to a fit file.

use super::parameters;
use crate::error::Error;
use crate::jobs::dem::{input_error, to_metres, window_of};
use crate::jobs::fit::{STAGE, to_json};
use sastrugi_numeric::Streams;
use sastrugi_schemas::fit::{FitFile, Source};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_store::dem::{self, Dem, ReadOptions};
use sastrugi_store::{atomic, digest};
use sastrugi_texture::{FitError, FitParameters, FitSettings};
use serde_json::Value;
use std::path::Path;

/// What to fit.
pub struct Request<'a> {
    /// Measured DEM.
    pub dem: &'a Path,
    /// Fit file to write.
    pub output: &'a Path,
    /// Parameters of the fit.
    pub parameters: Value,
    /// Seed of the replicates' random streams.
    pub seed: u64,
    /// Part of the DEM in its own coordinates.
    pub window: Option<[f64; 4]>,
    /// Cell size for files that carry none, m.
    pub cell_m: Option<[f64; 2]>,
}

/// Fits a DEM and writes the fit file. Returns it with sentences on how the DEM was read.
///
/// # Errors
/// Unknown parameters, a DEM that cannot be read or fitted, a file that cannot be written.
pub fn fit(request: &Request<'_>) -> Result<(FitFile, Vec<String>), Error> {
    parameters::check_schema(&request.parameters, &schema_of::<FitParameters>(), "fit")?;
    let raw: FitParameters = read_parameters(&request.parameters)?;
    let settings = FitSettings::try_from(raw)?;
    let (read, notes) = read_metric(request.dem, request.window, request.cell_m)?;
    let outcome =
        sastrugi_texture::fit(&read.grid, &settings, &Streams::for_seed(request.seed, STAGE)).map_err(refused)?;
    let (_, sha256) =
        digest::of_file(request.dem).map_err(|e| Error::Input(format!("{}: {e}", request.dem.display())))?;
    let file = request.dem.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let fit = FitFile { source: Some(Source { file, sha256, window: request.window }), ..outcome.fit };
    atomic::write(request.output, to_json(&fit)?.as_bytes())
        .map_err(|e| Error::failed(format!("{}: {e}", request.output.display())))?;
    Ok((fit, notes))
}

/// A DEM as the fit wants it: window cut, metres.
///
/// # Errors
/// A DEM that cannot be read, or a window without data.
pub fn read_metric(
    path: &Path,
    window: Option<[f64; 4]>,
    cell_m: Option<[f64; 2]>,
) -> Result<(Dem, Vec<String>), Error> {
    let read = dem::read_with(path, &ReadOptions { cell_m }).map_err(|e| Error::from(input_error(&e)))?;
    let grid = match window {
        Some(window) => window_of(&read.grid, window)?,
        None => read.grid.clone(),
    };
    Ok(to_metres(Dem { grid, info: read.info }))
}

/// A parameter out of range is the caller's; anything else lies in the DEM.
fn refused(error: FitError) -> Error {
    match error {
        FitError::Parameter(parameter) => parameter.into(),
        other => Error::Input(other.to_string()),
    }
}
