//! `compare`: are two DEMs, or two fits, statistically the same?

use super::parameters;
use super::texture::read_fit;
use crate::error::Error;
use crate::verbs::fit::read_metric;
use sastrugi_numeric::{Grid, Streams};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_texture::compare::{CompareError, CompareParameters, CompareSettings, fits, surfaces};
pub use sastrugi_texture::compare::{Comparison, Quantity};
use sastrugi_texture::{FitParameters, FitSettings};
use serde_json::{Value, json};
use std::path::Path;

/// Name of the random streams.
const STAGE: &str = "compare";

/// One side.
pub struct Side<'a> {
    /// DEM or fit file.
    pub path: &'a Path,
    /// Part of a DEM in its own coordinates.
    pub window: Option<[f64; 4]>,
}

/// What to compare.
pub struct Request<'a> {
    /// A and B.
    pub sides: [Side<'a>; 2],
    /// Parameters of the comparison.
    pub parameters: Value,
    /// Seed of the random streams.
    pub seed: u64,
    /// Cell size for files that carry none, m.
    pub cell_m: Option<[f64; 2]>,
}

enum Content {
    Dem(Grid),
    Fit(Box<FitFile>),
}

/// Compares two DEMs, two fits, or a DEM (fitted as the fit was) and a fit. Returns the comparison and its full record.
///
/// # Errors
/// Unknown parameters, a release, files that cannot be read or fitted.
pub fn compare(request: &Request<'_>) -> Result<(Comparison, Value), Error> {
    parameters::check_schema(&request.parameters, &schema_of::<CompareParameters>(), STAGE)?;
    let raw: CompareParameters = read_parameters(&request.parameters)?;
    let settings = CompareSettings::try_from(raw)?;
    let streams = Streams::for_seed(request.seed, STAGE);
    let [(a, mut notes), (b, more)] = [read(&request.sides[0], request)?, read(&request.sides[1], request)?];
    notes.extend(more);
    let mut comparison = match (&a, &b) {
        (Content::Dem(a), Content::Dem(b)) => surfaces(a, b, &settings, &streams).map_err(refused)?,
        (Content::Fit(a), Content::Fit(b)) => fits(a, b, &settings, &streams)?,
        (Content::Dem(dem), Content::Fit(fit)) => {
            fits(&like(dem, fit, &settings, &streams)?, fit, &settings, &streams)?
        }
        (Content::Fit(fit), Content::Dem(dem)) => {
            fits(fit, &like(dem, fit, &settings, &streams)?, &settings, &streams)?
        }
    };
    comparison.notes.splice(0..0, notes);
    let described = |side: &Side, content: &Content| {
        let what = if matches!(content, Content::Dem(_)) { "dem" } else { "fit" };
        json!({ "file": side.path.display().to_string(), "what": what, "window": side.window })
    };
    let mut record = serde_json::to_value(&comparison).map_err(Error::failed)?;
    record["a"] = described(&request.sides[0], &a);
    record["b"] = described(&request.sides[1], &b);
    record["parameters"] = serde_json::to_value(settings.parameters()).map_err(Error::failed)?;
    record["seed"] = json!(request.seed);
    Ok((comparison, record))
}

fn read(side: &Side<'_>, request: &Request<'_>) -> Result<(Content, Vec<String>), Error> {
    let name = side.path.display();
    if side.path.is_dir() {
        let message = format!(
            "{name} is a folder: two DEMs, two fit files, or one of each can be compared, not releases; compare the DEMs \
             and fits inside of them"
        );
        return Err(Error::Usage(message));
    }
    let is_fit = side.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    if !is_fit {
        let (dem, notes) = read_metric(side.path, side.window, request.cell_m)?;
        let notes = notes.into_iter().map(|n| format!("{name}: {n}")).collect();
        return Ok((Content::Dem(dem.grid), notes));
    }
    if side.window.is_some() {
        return Err(Error::Usage(format!("{name} is a fit file, which has no window to cut")));
    }
    Ok((Content::Fit(Box::new(read_fit(side.path)?)), Vec::new()))
}

/// A DEM fitted as a fit was: its model, window and trimming.
fn like(dem: &Grid, fit: &FitFile, settings: &CompareSettings, streams: &Streams) -> Result<FitFile, Error> {
    let own = settings.parameters();
    let parameters = FitParameters {
        model: fit.model.clone(),
        outer_scale_m: fit.window_m.map_or(own.outer_scale_m, |w| 0.5 * (w[0] + w[1])),
        trim: fit.trim.map(|t| t.level).filter(|level| *level > 0.0).unwrap_or(own.trim),
        bootstrap: own.simulations,
        ..FitParameters::default()
    };
    let settings = FitSettings::try_from(parameters)?;
    let outcome = sastrugi_texture::fit(dem, &settings, &streams.child("fit"));
    outcome.map(|o| o.fit).map_err(|e| Error::Input(e.to_string()))
}

fn refused(error: CompareError) -> Error {
    match error {
        CompareError::Parameter(parameter) => parameter.into(),
        other => Error::Input(other.to_string()),
    }
}
