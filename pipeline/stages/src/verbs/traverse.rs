//! `traverse`: missions over one DEM, run as a small study.

use super::parameters;
use crate::error::Error;
use crate::jobs::traverse::STAGE;
use crate::runner::execute::Limits;
use crate::runner::progress::Progress;
use crate::studies::{RunRequest, RunSummary, run_text};
use serde_json::{Map, Value, json};
use std::path::Path;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table};

/// What to drive.
pub struct Request<'a> {
    /// DEM.
    pub dem: &'a Path,
    /// Seed of the random streams.
    pub seed: u64,
    /// Settings of `[roughness]`, which decide where missions may start and end.
    pub roughness: Value,
    /// Rules of the missions.
    pub missions: Value,
    /// Parameters of the traverse, including the vehicle.
    pub parameters: Value,
    /// Date of the release.
    pub date: &'a str,
}

/// Where the release goes.
pub struct Place<'a> {
    /// Release folder.
    pub output: &'a Path,
    /// Work area; default: `<output>.work`.
    pub work: Option<&'a Path>,
    /// Whether to replace a release of another study, over another DEM, or with fewer failed items.
    pub replace: bool,
    /// Limits.
    pub limits: Limits,
}

/// Drives missions over a DEM and writes a release with recordings, tables and report.
///
/// # Errors
/// As [`crate::studies::run`]; also a DEM on which no mission can be driven.
pub fn traverse(request: &Request<'_>, place: &Place<'_>, progress: &dyn Progress) -> Result<RunSummary, Error> {
    let path = given_file(request.dem)?;
    let study = json!({ "name": "traverse", "seed": request.seed, "date": request.date });
    let dem = json!({ "id": "dem", "file": path });
    let missions = with(json!({ "id": "missions", "terrains": ["dem"], "seed": request.seed }), &request.missions)?;
    let drive = with(json!({ "id": "mission", "missions": "missions" }), &request.parameters)?;
    let text = document(&study, &request.roughness, [("dem", dem), ("missions", missions), ("traverse", drive)])?;
    let Place { output, work, replace, limits } = *place;
    let run = RunRequest { output, work, part: None, purpose: Some(STAGE), replace, limits };
    run_text(&text, Path::new(""), &run, progress)
}

/// The absolute path of a file that the study is to name, which must be readable here.
///
/// # Errors
/// A path at which there is no regular file, or one that cannot be read.
pub(super) fn given_file(path: &Path) -> Result<String, Error> {
    let absolute = std::path::absolute(path).map_err(|e| Error::unreadable(path, &e))?;
    // A folder can be opened, but not read.
    sastrugi_store::file::head(&absolute, 1).map_err(|e| Error::unreadable(path, &e))?;
    Ok(absolute.to_string_lossy().into_owned())
}

/// The text of a study: its head, its `[roughness]`, and one item of each section given.
///
/// # Errors
/// Values that cannot be written as TOML.
pub(super) fn document<'a>(
    head: &Value,
    roughness: &Value,
    sections: impl IntoIterator<Item = (&'a str, Value)>,
) -> Result<String, Error> {
    let mut document = DocumentMut::new();
    document["study"] = Item::Table(table(head)?);
    document["roughness"] = Item::Table(table(roughness)?);
    for (section, item) in sections {
        let mut tables = ArrayOfTables::new();
        tables.push(table(&item)?);
        document[section] = Item::ArrayOfTables(tables);
    }
    Ok(document.to_string())
}

/// Adds parameters to an envelope; the keys of the envelope cannot be overridden.
pub(super) fn with(mut envelope: Value, more: &Value) -> Result<Value, Error> {
    let (Some(map), Some(more)) = (envelope.as_object_mut(), more.as_object()) else { return Ok(envelope) };
    for (key, value) in more {
        if map.insert(key.clone(), value.clone()).is_some() {
            return Err(Error::Usage(format!("`{key}` cannot be set here")));
        }
    }
    Ok(envelope)
}

fn table(value: &Value) -> Result<Table, Error> {
    let empty = Map::new();
    let mut table = Table::new();
    for (key, value) in value.as_object().unwrap_or(&empty) {
        table.insert(key, Item::Value(parameters::to_toml(value)?));
    }
    Ok(table)
}
