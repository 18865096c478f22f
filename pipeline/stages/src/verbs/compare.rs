//! `compare`: are two DEMs, or two fits, statistically the same?

use super::parameters;
use super::texture::read_fit;
use crate::error::Error;
use crate::verbs::Reading;
use sastrugi_numeric::{Grid, Streams};
pub use sastrugi_roughness::{COPY_SIDE, Copies};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_store::digest;
pub use sastrugi_texture::compare::{BlockEvidence, Comparison, Quantity};
use sastrugi_texture::compare::{CompareError, CompareParameters, CompareSettings, blocks, fits, halves, surfaces};
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
    /// A.
    pub a: Side<'a>,
    /// B; if absent, textures fitted to one half of A are compared with its other half.
    pub b: Option<Side<'a>>,
    /// Compare B, a DEM of any origin, with A by statistics of their blocks.
    pub by_statistics: bool,
    /// Parameters of the comparison.
    pub parameters: Value,
    /// Seed of the random streams.
    pub seed: u64,
    /// Cell size for files that state none, m.
    pub cell_m: Option<[f64; 2]>,
}

enum Content {
    Dem(Grid),
    Fit(Box<FitFile>),
}

/// Compares two DEMs (by their fits, or by statistics of their blocks), two fits, a DEM (fitted with the settings of the fit) and a fit, or
/// textures of one half of a DEM with its other half. Returns the comparison and its full record.
///
/// # Errors
/// Unknown parameters, a release, files that cannot be read or fitted, a fit and the DEM that it was made from.
pub fn compare(request: &Request<'_>) -> Result<(Comparison, Value), Error> {
    parameters::check_schema(&request.parameters, &schema_of::<CompareParameters>(), STAGE)?;
    let raw: CompareParameters = read_parameters(&request.parameters)?;
    let settings = CompareSettings::try_from(raw)?;
    let streams = Streams::for_seed(request.seed, STAGE);
    let a = read(&request.a, request)?;
    let b = request.b.as_ref().map(|side| read(side, request)).transpose()?;
    let mut comparison = match (&a.content, b.as_ref().map(|b| &b.content)) {
        (Content::Dem(site), None) => halves(site, &settings, &streams).map_err(refused)?,
        (Content::Dem(site), Some(Content::Dem(texture))) if request.by_statistics => {
            blocks(site, texture, &settings, &streams).map_err(refused)?
        }
        (Content::Fit(_), _) | (_, Some(Content::Fit(_))) if request.by_statistics => {
            let message = "`--statistics` compares two DEMs; a fit file contains no heights";
            return Err(Error::Usage(message.to_owned()));
        }
        (Content::Dem(one), Some(Content::Dem(other))) => surfaces(one, other, &settings, &streams).map_err(refused)?,
        (Content::Fit(one), Some(Content::Fit(other))) => fits(one, other, &settings, &streams)?,
        (Content::Dem(dem), Some(Content::Fit(fit))) => {
            not_circular(&request.a, fit)?;
            fits(&like(dem, fit, &settings, &streams)?, fit, &settings, &streams)?
        }
        (Content::Fit(fit), Some(Content::Dem(dem))) => {
            request.b.as_ref().map_or(Ok(()), |side| not_circular(side, fit))?;
            fits(fit, &like(dem, fit, &settings, &streams)?, &settings, &streams)?
        }
        (Content::Fit(_), None) => {
            let message = "a fit file cannot be split; `--split-half` requires a DEM";
            return Err(Error::Usage(format!("{}: {message}", request.a.path.display())));
        }
    };
    let notes = [Some(&a), b.as_ref()].into_iter().flatten().flat_map(|side| side.notes.clone());
    comparison.notes = notes.chain(comparison.notes).collect();
    let mut record = serde_json::to_value(&comparison).map_err(Error::failed)?;
    record["a"] = a.described(&request.a);
    record["b"] = json!(b.as_ref().zip(request.b.as_ref()).map(|(read, side)| read.described(side)));
    record["parameters"] = serde_json::to_value(settings.parameters()).map_err(Error::failed)?;
    record["seed"] = json!(request.seed);
    Ok((comparison, record))
}

/// A side after reading.
struct Read {
    content: Content,
    notes: Vec<String>,
}

impl Read {
    fn described(&self, side: &Side<'_>) -> Value {
        let what = if matches!(self.content, Content::Dem(_)) { "dem" } else { "fit" };
        json!({ "file": side.path.display().to_string(), "what": what, "window": side.window })
    }
}

/// Refuses to compare a fit with the DEM it was made from: their agreement is not evidence.
fn not_circular(side: &Side<'_>, fit: &FitFile) -> Result<(), Error> {
    let name = side.path.display();
    let (_, sha256) = digest::of_file(side.path).map_err(|e| Error::unreadable(side.path, &e))?;
    match fit.source.as_ref().is_some_and(|source| source.sha256 == sha256) {
        true => Err(Error::Usage(format!(
            "{name} is the DEM that the fit was made from, so agreement proves nothing; `compare {name} --split-half` tests \
             a texture by statistics that were not fitted"
        ))),
        false => Ok(()),
    }
}

fn read(side: &Side<'_>, request: &Request<'_>) -> Result<Read, Error> {
    let name = side.path.display();
    if side.path.is_dir() {
        let message =
            format!("{name} is a folder; a release can only be compared with another release, not with a DEM or a fit");
        return Err(Error::Usage(message));
    }
    let is_fit = side.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    if !is_fit {
        let reading = Reading { window: side.window, cell_m: request.cell_m, ..Reading::default() };
        let super::Read { dem, notes, .. } = super::read(side.path, &reading)?;
        let notes = notes.into_iter().map(|n| format!("{name}: {n}")).collect();
        return Ok(Read { content: Content::Dem(dem.grid), notes });
    }
    if side.window.is_some() {
        return Err(Error::Usage(format!("{name} is a fit file; a window applies to DEMs only")));
    }
    Ok(Read { content: Content::Fit(Box::new(read_fit(side.path)?)), notes: Vec::new() })
}

/// Fits a DEM with the settings of another fit; for older fit files, with its model, window and trimming.
fn like(dem: &Grid, fit: &FitFile, settings: &CompareSettings, streams: &Streams) -> Result<FitFile, Error> {
    settings.check_simulations()?;
    let own = settings.parameters();
    let given: FitParameters = serde_json::from_value(fit.settings.clone()).unwrap_or_default();
    let parameters = FitParameters {
        mode: sastrugi_texture::fit::Mode::Corrected,
        model: fit.model.clone(),
        outer_scale_m: fit.window_m.map_or(own.outer_scale_m, |w| 0.5 * (w[0] + w[1])),
        trim: fit.trim.map(|t| t.level).filter(|level| *level > 0.0).unwrap_or(own.trim),
        bootstrap: own.simulations,
        ..given
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
