//! `fit`: covariance of a measured DEM to a fit file.

use super::{Read, Reading, parameters, read, transects};
use crate::error::Error;
use crate::jobs::fit::{STAGE, to_json};
use sastrugi_numeric::Streams;
use sastrugi_schemas::fit::{FitFile, MaskSource, Source};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_store::dem::Dem;
use sastrugi_store::{atomic, digest};
use sastrugi_texture::{FitError, FitParameters, FitSettings};
use serde_json::Value;
use std::path::{Path, PathBuf};

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
    /// What of the DEM to take, and how.
    pub reading: Reading,
}

/// Fits a DEM and writes the fit file. Returns it with sentences on how the DEM was read.
///
/// # Errors
/// Unknown parameters, a DEM that cannot be read or fitted, a file that cannot be written.
pub fn fit(request: &Request<'_>) -> Result<(FitFile, Vec<String>), Error> {
    parameters::check_schema(&request.parameters, &schema_of::<FitParameters>(), "fit")?;
    let raw: FitParameters = read_parameters(&request.parameters)?;
    let settings = FitSettings::try_from(raw)?;
    if let Some(found) = transects(request.dem, &request.reading)? {
        let (path, count) = (request.dem.display(), found.profiles.len());
        return Err(Error::Input(format!("{path}: holds {count} transects; a fit takes a DEM")));
    }
    let Read { dem, notes, masked_share } = read(request.dem, &request.reading)?;
    let outcome =
        sastrugi_texture::fit(&dem.grid, &settings, &Streams::for_seed(request.seed, STAGE)).map_err(refused)?;
    let source = Source { masked_share, ..source_of(request)? };
    let fit = FitFile { source: Some(source), ..outcome.fit };
    atomic::write(request.output, to_json(&fit)?.as_bytes())
        .map_err(|e| Error::failed(format!("{}: {e}", request.output.display())))?;
    Ok((fit, notes))
}

/// What the fit file says of the files it was made from.
fn source_of(request: &Request<'_>) -> Result<Source, Error> {
    let hashed = |path: &Path| {
        let (_, sha256) = digest::of_file(path).map_err(|e| Error::Input(format!("{}: {e}", path.display())))?;
        Ok::<_, Error>((path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()), sha256))
    };
    let mask = |(path, excludes): &(PathBuf, bool)| {
        hashed(path).map(|(file, sha256)| MaskSource { file, sha256, excludes: *excludes })
    };
    let (file, sha256) = hashed(request.dem)?;
    let masks = request.reading.masks.iter().map(mask).collect::<Result<_, _>>()?;
    Ok(Source { file, sha256, window: request.reading.window, masks, masked_share: None })
}

/// As [`read`], without masks.
///
/// # Errors
/// As [`read`].
pub fn read_metric(
    path: &Path,
    window: Option<[f64; 4]>,
    cell_m: Option<[f64; 2]>,
) -> Result<(Dem, Vec<String>), Error> {
    let read = read(path, &Reading { window, cell_m, ..Reading::default() })?;
    Ok((read.dem, read.notes))
}

/// A parameter out of range is the caller's; anything else lies in the DEM.
fn refused(error: FitError) -> Error {
    match error {
        FitError::Parameter(parameter) => parameter.into(),
        other => Error::Input(other.to_string()),
    }
}
