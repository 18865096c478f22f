//! `texture`: synthesises a heightfield with the covariance of a fit file.

use super::parameters;
use crate::error::Error;
use crate::jobs::texture::{STAGE, kinds};
use crate::memory;
use crate::operations::fits::of_json;
use crate::operations::textures::{
    check_memory, completes_background, fill_note, has_its_texture, lay_onto, notes_on_filling, on_site_cells, scaled,
};
use crate::verbs::{Read, Reading, read};
use sastrugi_numeric::{Grid, Streams};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::{FitFile, Source};
use sastrugi_store::dem::points::GridSettings;
use sastrugi_store::dem::{self, Crs, WriteOptions};
use sastrugi_store::digest;
use sastrugi_texture::covariance::Covariance;
use sastrugi_texture::synth::{conditional, fft_ma};
use sastrugi_texture::{Measured, Needs, Synthesis, needs};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

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
    /// The DEM of the fit, for methods that copy from its residual.
    pub exemplar: Option<Exemplar<'a>>,
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

/// The DEM of a fit.
pub struct Exemplar<'a> {
    /// Its file.
    pub dem: &'a Path,
    /// Masks of the fit; `true` for those that exclude cells.
    pub masks: Vec<(PathBuf, bool)>,
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
/// Unknown methods and parameters, an unusable fit file, exemplar or base, too little memory, a file that cannot be written.
pub fn texture(request: &Request<'_>) -> Result<Value, Error> {
    sastrugi_texture::check_keys(request.method, &request.parameters)?;
    if let Some(known) = kinds().iter().find(|k| k.kind == request.method) {
        parameters::check(&request.parameters, known)?;
    }
    let fit = read_fit(request.fit)?;
    check_exemplar(request)?;
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
    let on_background = request.onto.is_some() && fit.window_m.is_some() && completes_background(request.method);
    let chosen = on_background && parameters["covariance"].is_null();
    if chosen {
        parameters["covariance"] = json!(fft_ma::CovarianceOf::Residual);
    }
    on_site_cells(request.method, &mut parameters, fit.cell_m);
    super::check_output(request.output)?;
    let (synthesis, read_notes) = prepared(request, &parameters, &fit)?;
    let streams = Streams::for_seed(request.seed, STAGE);
    let mut notes = sastrugi_texture::fit_notes(&fit);
    notes.extend(read_notes);
    notes.extend(synthesis.notes());
    notes.extend((factor != 1.0).then(|| format!("heights scaled by {factor}")));
    notes.extend(chosen.then(|| RESIDUAL_CHOSEN.to_owned()));
    if let Some(path) = request.onto.filter(|path| is_fitted_dem(path, &fit)) {
        notes.push(format!("{}: {}", path.display(), has_its_texture("`fit --background DEM` writes it")));
    }
    let outcome = synthesis.generate(&streams).map_err(|e| Error::Usage(e.to_string()))?;
    notes.extend(outcome.notes);
    let (is_periodic, parameters) = (synthesis.is_periodic(), synthesis.parameters());
    // It may hold a spectrum or a site.
    drop(synthesis);
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
            let sum = lay_onto(&base.grid, &texture, is_periodic, factors.as_ref());
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
        "parameters": parameters,
        "amplitude": factor,
        "covariance_error_max_m2": outcome.covariance_error_max_m2,
        "clip_share": outcome.clip_share,
        "grid": super::describe_grid(&heights),
        "warnings": warnings,
        "notes": notes,
    }))
}

/// Refuses an exemplar for a method that does not copy.
fn check_exemplar(request: &Request<'_>) -> Result<(), Error> {
    let copies = needs(request.method) == Some(Needs::Residual);
    match request.exemplar.as_ref().filter(|_| !copies) {
        None => Ok(()),
        Some(exemplar) => Err(Error::Usage(format!(
            "{}: `{}` does not copy from a DEM; omit `--exemplar`, or choose `quilting` or `exemplar`",
            exemplar.dem.display(),
            request.method
        ))),
    }
}

/// The method bound to the fit and to the exemplar, and notes on the reading of that.
fn prepared(
    request: &Request<'_>,
    parameters: &Value,
    fit: &FitFile,
) -> Result<(Box<dyn Synthesis>, Vec<String>), Error> {
    check_memory(request.method, parameters, fit)?;
    let (measured, notes) = match &request.exemplar {
        None => (None, Vec::new()),
        Some(exemplar) => measured(exemplar, fit)?,
    };
    let synthesis = sastrugi_texture::prepare_from(request.method, parameters, fit, measured.as_ref())?;
    memory::check("the texture", synthesis.cost().memory_bytes)?;
    Ok((synthesis, notes))
}

/// The residual of the DEM of a fit, read as the fit read it, and notes on the reading.
fn measured(exemplar: &Exemplar<'_>, fit: &FitFile) -> Result<(Option<Arc<Measured>>, Vec<String>), Error> {
    let name = exemplar.dem.display();
    let source = fit.source.clone().unwrap_or_default();
    if let Some(minus) = &source.minus {
        let message = format!(
            "{name}: the fit is of a difference from {}; write the difference with `fit --minus --difference` and fit that",
            minus.file
        );
        return Err(Error::Input(message));
    }
    if !source.sha256.is_empty() && !is_fitted_dem(exemplar.dem, fit) {
        return Err(Error::Input(format!(
            "{name} is not the DEM of the fit, {} with SHA-256 {}; give that file, or fit this one",
            source.file, source.sha256
        )));
    }
    check_masks(exemplar, &source)?;
    let reading =
        Reading { window: source.window, cell_m: fit.cell_m, masks: exemplar.masks.clone(), ..Reading::default() };
    let Read { dem, notes, .. } = read(exemplar.dem, &reading)?;
    Ok((Some(Arc::new(Measured::of_fit(&dem.grid, fit)?)), notes))
}

/// Refuses masks that are not those of the fit, in its order.
fn check_masks(exemplar: &Exemplar<'_>, source: &Source) -> Result<(), Error> {
    let given = exemplar.masks.iter().map(|(path, excludes)| {
        let (_, sha256) = digest::of_file(path).map_err(|e| Error::unreadable(path, &e))?;
        Ok((sha256, *excludes))
    });
    let given = given.collect::<Result<Vec<_>, Error>>()?;
    let fitted: Vec<(String, bool)> = source.masks.iter().map(|m| (m.sha256.clone(), m.excludes)).collect();
    if given == fitted {
        return Ok(());
    }
    let option = |excludes: bool| if excludes { "--exclude" } else { "--mask" };
    let wanted: Vec<String> = source.masks.iter().map(|m| format!("`{} {}`", option(m.excludes), m.file)).collect();
    let wanted = if wanted.is_empty() { "none".to_owned() } else { wanted.join(", ") };
    let message = format!("{}: the masks are not those of the fit: {wanted}", exemplar.dem.display());
    Err(Error::Usage(message))
}

/// A texture that repeats the site, as large as a DEM whose holes it fills, and notes on it.
fn texture_for(
    request: &Request<'_>,
    dem: &Grid,
    fit: &FitFile,
    streams: &Streams,
) -> Result<(Grid, Vec<String>), Error> {
    let parameters = json!({ "size_px": [dem.cols(), dem.rows()], "cell_m": dem.geometry.cell, "periodic": false });
    let (synthesis, mut notes) = prepared(request, &parameters, fit)?;
    let outcome = synthesis.generate(streams).map_err(|e| Error::Usage(e.to_string()))?;
    notes.extend(notes_on_filling(synthesis.notes()).chain(outcome.notes));
    Ok((outcome.grid, notes))
}

/// Fills the holes of a DEM and writes it.
fn fill(request: &Request<'_>, path: &Path, fit: &FitFile) -> Result<Value, Error> {
    super::check_output(request.output)?;
    // For a DEM without a cell size.
    let cell_m = request.parameters["cell_m"].as_f64().map(|side| [side; 2]);
    let Read { dem, mut notes, .. } = read(path, &Reading { cell_m, ..Reading::default() })?;
    let streams = Streams::for_seed(request.seed, STAGE);
    let covariance = Covariance::of_fit(fit).map_err(|e| Error::Input(format!("{}: {e}", request.fit.display())))?;
    let filled = match needs(request.method) {
        Some(Needs::Covariance) if request.method != fft_ma::kind().kind => {
            let message = "`--fill` takes `fft_ma`, or a method that repeats the site";
            return Err(Error::Usage(format!("{message}; `{}` does not", request.method)));
        }
        Some(Needs::Covariance) => conditional::fill(&dem.grid, &covariance, &streams),
        _ => {
            let (texture, of_texture) = texture_for(request, &dem.grid, fit, &streams)?;
            notes.extend(of_texture);
            conditional::fill_with(&dem.grid, &covariance, &texture)
        }
    };
    let filled = filled.map_err(|e| Error::Input(format!("{}: {e}", path.display())))?;
    notes.push(filled.to_string());
    notes.extend(fill_note(fit, request.method));
    let lost = dem::write(request.output, &filled.grid, &dem.info.crs, &request.options);
    notes.extend(lost.map_err(super::write_error)?);
    Ok(json!({
        "file": request.output.display().to_string(),
        "method": request.method,
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
