//! `texture`: synthesises a heightfield with the covariance of a fit file.

use super::parameters;
use crate::error::Error;
use crate::jobs::texture::{STAGE, kinds};
use crate::memory;
use crate::operations::fits::of_json;
use crate::operations::textures::{fill_note, has_its_texture, lay_onto, scaled};
use crate::verbs::{Read, Reading, read};
use sastrugi_numeric::Streams;
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::FitFile;
use sastrugi_store::dem::points::GridSettings;
use sastrugi_store::dem::{self, Crs, WriteOptions};
use sastrugi_store::digest;
use sastrugi_texture::covariance::Covariance;
use sastrugi_texture::synth::{conditional, fft_ma};
use serde_json::{Value, json};
use std::path::Path;

/// What to synthesise.
pub struct Request<'a> {
    /// Fit file.
    pub fit: &'a Path,
    /// Synthesis method.
    pub method: &'a str,
    /// Parameters of the method.
    pub parameters: Value,
    /// Seed of the random streams.
    pub seed: u64,
    /// DEM to add the texture to.
    pub onto: Option<&'a Path>,
    /// Factor on the heights of the texture.
    pub amplitude: Option<Amplitude<'a>>,
    /// DEM whose holes are filled, instead of synthesising a texture.
    pub fill: Option<&'a Path>,
    /// DEM to write.
    pub output: &'a Path,
    /// How to write.
    pub options: WriteOptions,
}

/// Factor on a texture.
#[derive(Clone, Copy)]
pub enum Amplitude<'a> {
    /// One number.
    Factor(f64),
    /// A raster of factors, for a texture on a base.
    Raster(&'a Path),
}

/// Note for a base without `covariance`: a file does not state whether it was measured.
const RESIDUAL_CHOSEN: &str = "covariance = residual: the base is assumed to be a measured background; use --covariance surface for a generated one";

/// Whether a file is the DEM that a fit was made from, by its SHA-256.
fn is_fitted_dem(path: &Path, fit: &FitFile) -> bool {
    let fitted = fit.source.as_ref().map_or("", |source| source.sha256.as_str());
    !fitted.is_empty() && digest::of_file(path).is_ok_and(|(_, sha256)| sha256 == fitted)
}

/// Synthesises a texture and writes it. Returns a description of the result.
///
/// An item of a study with the same fit, parameters, explicit `seed` and explicit `covariance` has the same bytes. The default
/// of `covariance` differs: in a study, where the origin of the base is known, it is `residual` only on a measured DEM and on the
/// background of a fit.
///
/// # Errors
/// Unknown methods and parameters, an unusable fit file or base, too little memory, a file that cannot be written.
pub fn texture(request: &Request<'_>) -> Result<Value, Error> {
    if let Some(known) = kinds().iter().find(|k| k.kind == request.method) {
        parameters::check(&request.parameters, known)?;
    }
    let fit = read_fit(request.fit)?;
    if let Some(dem) = request.fill {
        return fill(request, dem, &fit);
    }
    let (factor, raster) = match request.amplitude {
        None => (1.0, None),
        Some(Amplitude::Factor(factor)) => (ParameterError::positive("--amplitude", factor)?, None),
        Some(Amplitude::Raster(path)) => (1.0, Some(path)),
    };
    if raster.is_some() && request.onto.is_none() {
        let message = "`--amplitude` with a raster requires `--onto`";
        return Err(Error::Usage(message.to_owned()));
    }
    let mut parameters = request.parameters.clone();
    let on_background = request.onto.is_some() && fit.window_m.is_some() && request.method == fft_ma::kind().kind;
    let chosen = on_background && parameters["covariance"].is_null();
    if chosen {
        parameters["covariance"] = json!(fft_ma::CovarianceOf::Residual);
    }
    let synthesis = sastrugi_texture::prepare(request.method, &parameters, &fit)?;
    super::check_output(request.output)?;
    memory::check("the texture", synthesis.cost().memory_bytes)?;
    let streams = Streams::for_seed(request.seed, STAGE);
    let mut notes = sastrugi_texture::fit_notes(&fit);
    notes.extend(synthesis.notes());
    notes.extend((factor != 1.0).then(|| format!("heights scaled by {factor}")));
    notes.extend(chosen.then(|| RESIDUAL_CHOSEN.to_owned()));
    if let Some(path) = request.onto.filter(|path| is_fitted_dem(path, &fit)) {
        notes.push(format!("{}: {}", path.display(), has_its_texture("`fit --background DEM` writes it")));
    }
    let outcome = synthesis.generate(&streams).map_err(|e| Error::Usage(e.to_string()))?;
    let texture = scaled(outcome.grid, factor);
    let (heights, crs) = match request.onto {
        None => (texture, Crs::default()),
        Some(path) => {
            // A point cloud is gridded to the texture's cells.
            let gridding = GridSettings { cell_m: Some(texture.geometry.cell[0]), ..GridSettings::default() };
            let reading = Reading { gridding, ..Reading::default() };
            let Read { dem: base, notes: read_notes, .. } = read(path, &reading)?;
            notes.extend(read_notes);
            let factors = match raster {
                None => None,
                Some(path) => {
                    let raster = read(path, &reading)?.dem.grid;
                    let factors = sastrugi_texture::amplitude(&base.grid, &raster);
                    Some(factors.map_err(|e| Error::Input(format!("{}: {e}", path.display())))?)
                }
            };
            let sum = lay_onto(&base.grid, &texture, synthesis.is_periodic(), factors.as_ref());
            (sum.map_err(|e| Error::Usage(e.message))?, base.info.crs)
        }
    };
    notes.extend(dem::write(request.output, &heights, &crs, &request.options).map_err(super::write_error)?);
    let (warnings, notes): (Vec<String>, Vec<String>) =
        notes.into_iter().partition(|note| note == fft_ma::MOSTLY_EXTRAPOLATED);
    Ok(json!({
        "file": request.output.display().to_string(),
        "method": request.method,
        "seed": request.seed,
        "stream": streams.label(),
        "parameters": synthesis.parameters(),
        "amplitude": factor,
        "covariance_error_max_m2": outcome.covariance_error_max_m2,
        "clip_share": outcome.clip_share,
        "grid": super::describe_grid(&heights),
        "warnings": warnings,
        "notes": notes,
    }))
}

/// Fills the holes of a DEM and writes it.
fn fill(request: &Request<'_>, path: &Path, fit: &FitFile) -> Result<Value, Error> {
    super::check_output(request.output)?;
    // For a DEM without a cell size.
    let cell_m = request.parameters["cell_m"].as_f64().map(|side| [side; 2]);
    let Read { dem, mut notes, .. } = read(path, &Reading { cell_m, ..Reading::default() })?;
    let streams = Streams::for_seed(request.seed, STAGE);
    let covariance = Covariance::of_fit(fit).map_err(|e| Error::Input(format!("{}: {e}", request.fit.display())))?;
    let filled = conditional::fill(&dem.grid, &covariance, &streams)
        .map_err(|e| Error::Input(format!("{}: {e}", path.display())))?;
    notes.push(filled.to_string());
    notes.extend(fill_note(fit));
    let lost = dem::write(request.output, &filled.grid, &dem.info.crs, &request.options);
    notes.extend(lost.map_err(super::write_error)?);
    Ok(json!({
        "file": request.output.display().to_string(),
        "seed": request.seed,
        "stream": streams.label(),
        "filled_cells": filled.cells,
        "grid": super::describe_grid(&filled.grid),
        "notes": notes,
    }))
}

/// Reads a fit file; only `model` and `parameters` are required.
///
/// # Errors
/// A missing file, or one that is not a fit.
pub fn read_fit(path: &Path) -> Result<FitFile, Error> {
    let name = path.display();
    let bytes = sastrugi_store::file::read(path).map_err(|e| Error::unreadable(path, &e))?;
    of_json(&bytes).map_err(|why| match dem::Format::of_name(path) {
        Some(_) => Error::Input(format!("{name} is a DEM, not a fit file; run `sastrugi fit` first")),
        None => Error::Input(format!("{name}: not a fit file: {why}")),
    })
}
