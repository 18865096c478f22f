//! Functions on single surfaces.

use crate::errors::{refused, usage};
use crate::rasters::{Parts, array, parts, raster};
use crate::waiting::waited;
use numpy::PyArray2;
use pyo3::prelude::*;
use sastrugi_schemas::fit::{FitFile, Quoted, SILL_OVER_RANGE};
use sastrugi_stages::Error;
use sastrugi_stages::arrays::{self, Generated, Raster, Registered, Textured};
use sastrugi_stages::operations::fits::{of_json, to_json};
use sastrugi_stages::remote::check_file;
use sastrugi_stages::verbs::fit::{Done, Request, fit as fit_dem};
use sastrugi_stages::verbs::roughness::{Bumps, Detrender, RideRequest};
use sastrugi_stages::verbs::{Reading, texture as verb};
use sastrugi_store::atomic;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;

/// The value of a JSON text.
pub fn value(text: &str) -> PyResult<Value> {
    serde_json::from_str(text).map_err(usage)
}

/// A result as JSON text.
pub fn text(result: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(result).map_err(|e| refused(Error::failed(e)))
}

/// Maps by name.
type Maps<'py> = HashMap<&'static str, Bound<'py, PyArray2<f64>>>;

/// Generates a terrain: its parts, its maps, and a JSON object with `parameters` and `notes`.
#[pyfunction]
pub fn terrain<'py>(
    py: Python<'py>,
    kind: String,
    parameters: &str,
    seed: u64,
    inputs: HashMap<String, Bound<'py, PyAny>>,
) -> PyResult<(Parts<'py>, Maps<'py>, String)> {
    let parameters = value(parameters)?;
    let inputs = inputs.into_iter().map(|(name, heights)| Ok((name, raster(&heights)?)));
    let inputs = inputs.collect::<PyResult<BTreeMap<String, Raster>>>()?;
    let made = waited(py, move || arrays::terrain(&kind, &parameters, seed, &inputs))?;
    let Generated { heights, maps, parameters, notes } = made;
    let maps = maps.into_iter().map(|(name, map)| Ok((name, array(py, map)?))).collect::<PyResult<_>>()?;
    Ok((parts(py, heights)?, maps, text(&json!({ "parameters": parameters, "notes": notes }))?))
}

/// Fits the covariance of heights; returns the fit file.
#[pyfunction]
pub fn fit_array(py: Python<'_>, heights: &Bound<'_, PyAny>, parameters: &str, seed: u64) -> PyResult<String> {
    let (heights, parameters) = (raster(heights)?, value(parameters)?);
    waited(py, move || Ok(to_json(&arrays::fit(&heights, &parameters, seed)?)?))
}

/// Fits the covariance of a file, as the verb `fit` does; returns the fit file and notes on how the file was read.
#[pyfunction]
pub fn fit_file(
    py: Python<'_>,
    path: PathBuf,
    parameters: &str,
    seed: u64,
    cell: Option<[f64; 2]>,
    window: Option<[f64; 4]>,
    minus: Option<PathBuf>,
) -> PyResult<(String, Vec<String>)> {
    let parameters = value(parameters)?;
    waited(py, move || {
        let request = Request {
            dem: &path,
            output: None,
            parameters,
            seed,
            reading: Reading { cell_m: cell, window, ..Reading::default() },
            minus: minus.as_deref(),
            difference: None,
            map: None,
            background: None,
            local: None,
            beside: Vec::new(),
        };
        let Done { fit, notes, .. } = fit_dem(&request)?;
        Ok((to_json(&fit?)?, notes))
    })
}

/// Reads a fit file and checks it.
#[pyfunction]
pub fn load_fit(path: PathBuf) -> PyResult<String> {
    let fit = verb::read_fit(&path).map_err(refused)?;
    to_json(&fit).map_err(|e| refused(e.into()))
}

/// Writes a fit file: complete, or not at all.
#[pyfunction]
pub fn save_fit(path: PathBuf, fit: &str) -> PyResult<()> {
    check_file(&path).map_err(refused)?;
    atomic::write(&path, fit.as_bytes()).map_err(|e| refused(Error::at(&path, e)))
}

fn fit_of(text: &str) -> PyResult<FitFile> {
    of_json(text.as_bytes()).map_err(|why| usage(format!("not a fit: {why}")))
}

/// What may be quoted from a fit: a JSON object with `level` and `kind` of the intervals, and for each name `value` and `interval`, or
/// `at_least`, or neither if the data do not tell.
#[pyfunction]
pub fn quoted(fit: &str) -> PyResult<String> {
    let fit = fit_of(fit)?;
    let names = fit.parameters.keys().map(String::as_str).chain([SILL_OVER_RANGE]);
    let one = |quoted: Quoted| match quoted {
        Quoted::Estimate { value, interval } => json!({ "value": value, "interval": interval }),
        Quoted::AtLeast(low) => json!({ "at_least": low }),
        Quoted::NotIdentified { .. } => json!({}),
    };
    let parameters: Map<String, Value> =
        names.filter_map(|name| Some((name.to_owned(), one(fit.quoted(name)?)))).collect();
    let (level, kind) = fit.quoted_intervals().map_or((None, None), |(i, kind)| (Some(i.level), Some(kind)));
    text(&json!({ "level": level, "kind": kind, "parameters": parameters }))
}

/// Synthesises a texture, from the fitted heights where a method copies from them: its parts, and a JSON object with `parameters` and `notes`.
#[pyfunction]
pub fn texture<'py>(
    py: Python<'py>,
    fit: &str,
    method: String,
    parameters: &str,
    seed: u64,
    exemplar: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Parts<'py>, String)> {
    let (fit, parameters) = (fit_of(fit)?, value(parameters)?);
    let exemplar = exemplar.map(raster).transpose()?;
    let made = waited(py, move || arrays::texture(&fit, exemplar.as_ref(), &method, &parameters, seed))?;
    let Textured { heights, parameters, notes } = made;
    Ok((parts(py, heights)?, text(&json!({ "parameters": parameters, "notes": notes }))?))
}

/// Roughness of heights, as the verb prints it with `--json`; with a vehicle or a band also what such a vehicle feels.
#[pyfunction]
pub fn roughness(
    py: Python<'_>,
    heights: &Bound<'_, PyAny>,
    parameters: &str,
    vehicle: Option<String>,
    band: Option<[f64; 2]>,
    allow_coarse: bool,
) -> PyResult<String> {
    let (heights, parameters) = (raster(heights)?, value(parameters)?);
    let band = band.map(|[min, max]| format!("{min}:{max}"));
    let described = waited(py, move || {
        let bumps = match (&vehicle, &band) {
            (Some(_), Some(_)) => return Err(Error::Usage("give a vehicle or a band, not both".to_owned())),
            (Some(vehicle), None) => Some(Bumps::Vehicle(vehicle)),
            (None, Some(band)) => Some(Bumps::Band(band)),
            (None, None) => None,
        };
        let ride = bumps.map(|bumps| RideRequest {
            bumps,
            detrender: Detrender::Band,
            allow_coarse,
            map: None,
            predicted: None,
        });
        arrays::roughness(&heights, &parameters, ride.as_ref())
    })?;
    text(&described)
}

/// Co-registers B to A: a JSON object with `coregistration` and `verdict`, and the parts of A minus the moved B.
#[pyfunction]
pub fn coregister<'py>(
    py: Python<'py>,
    a: &Bound<'py, PyAny>,
    b: &Bound<'py, PyAny>,
) -> PyResult<(String, Parts<'py>)> {
    let (a, b) = (raster(a)?, raster(b)?);
    let Registered { difference, coregistration, verdict } = waited(py, move || arrays::coregister(&a, &b))?;
    Ok((text(&json!({ "coregistration": coregistration, "verdict": verdict }))?, parts(py, difference)?))
}
