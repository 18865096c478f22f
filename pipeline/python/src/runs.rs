//! Studies, and verbs that run one.

use crate::errors::usage;
use crate::surfaces::{text, value};
use crate::waiting::{waited, watched};
use pyo3::prelude::*;
use sastrugi_schemas::Record;
use sastrugi_schemas::kind::read_parameters;
use sastrugi_stages::Error;
use sastrugi_stages::loaded::load;
use sastrugi_stages::remote::check_file;
use sastrugi_stages::runner::execute::Limits;
use sastrugi_stages::studies::{self, RunRequest, RunSummary};
use sastrugi_stages::verbs::navigate::{self as navigation, is_route_file};
use sastrugi_stages::verbs::traverse::Place;
use sastrugi_stages::verbs::{LogSettings, analyze as logs, parameters as known, traverse as driving};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Default limit on the working memory of items that run at the same time: 4 GiB, as that of the program.
const MEMORY_BYTES: u64 = 4 << 30;

/// Limits as the program has them without options.
fn limits() -> Limits {
    Limits { workers: rayon::current_num_threads(), memory_bytes: MEMORY_BYTES, beyond: true }
}

/// Where a release goes.
struct Destination {
    output: PathBuf,
    work: Option<PathBuf>,
    replace: bool,
}

impl Destination {
    fn place(&self) -> Place<'_> {
        Place { output: &self.output, work: self.work.as_deref(), replace: self.replace, limits: limits() }
    }
}

/// Summary of a run as JSON, with warnings about its study.
fn summary(run: &RunSummary, warnings: &[String]) -> PyResult<String> {
    text(&json!({
        "output": run.output,
        "items": run.items,
        "computed": run.computed,
        "failures": run.failures,
        "notes": run.notes,
        "warnings": warnings,
    }))
}

/// Runs a study file to a release.
#[pyfunction]
pub fn run(
    py: Python<'_>,
    study: PathBuf,
    output: PathBuf,
    work: Option<PathBuf>,
    replace: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let (done, warnings) = watched(py, progress, move |watched| {
        let loaded = load(&study)?;
        let request =
            RunRequest { output: &output, work: work.as_deref(), part: None, purpose: None, replace, limits: limits() };
        Ok((studies::run(&loaded, &request, watched)?, loaded.doubts))
    })?;
    summary(&done, &warnings)
}

/// A table of a request, empty if absent.
fn table(request: &Value, key: &str) -> Value {
    if request[key].is_null() { json!({}) } else { request[key].clone() }
}

/// Drives missions over a DEM; the request is a JSON object with `seed`, `vehicle`, `missions`, `parameters`, `roughness` and `date`.
#[pyfunction]
pub fn traverse(
    py: Python<'_>,
    dem: PathBuf,
    request: &str,
    output: PathBuf,
    work: Option<PathBuf>,
    replace: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let request = value(request)?;
    let destination = Destination { output, work, replace };
    let (done, warnings) = watched(py, progress, move |watched| {
        let mut parameters = json!({});
        known::assign_vehicle(&mut parameters, request["vehicle"].as_str().unwrap_or_default())?;
        let parameters = joined(parameters, &table(&request, "parameters"));
        let warnings = known::vehicle_doubts(&parameters);
        let drive = driving::Request {
            dem: &dem,
            seed: request["seed"].as_u64().unwrap_or_default(),
            roughness: table(&request, "roughness"),
            missions: table(&request, "missions"),
            parameters,
            date: request["date"].as_str().unwrap_or_default(),
        };
        Ok((driving::traverse(&drive, &destination.place(), watched)?, warnings))
    })?;
    summary(&done, &warnings)
}

/// One table with the keys of both; those of the second win.
fn joined(mut one: Value, other: &Value) -> Value {
    if let (Some(all), Some(more)) = (one.as_object_mut(), other.as_object()) {
        all.extend(more.iter().map(|(key, value)| (key.clone(), value.clone())));
    }
    one
}

/// Plans a route: to a file of a route, whose metrics and notes are returned, or to a release, whose summary is returned. The request is a JSON
/// object with `start`, `goal`, `vehicle`, `obstacles`, `route`, `team` and `date`.
#[pyfunction]
pub fn navigate(
    py: Python<'_>,
    dem: PathBuf,
    request: &str,
    output: PathBuf,
    work: Option<PathBuf>,
    replace: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let request = value(request)?;
    let [start, goal] = [point(&request, "start")?, point(&request, "goal")?];
    let is_route = is_route_file(&output);
    let destination = Destination { output, work, replace };
    let done = watched(py, progress, move |watched| {
        let obstacles: Vec<PathBuf> = request["obstacles"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
            .map(PathBuf::from)
            .collect();
        let plan = navigation::Request {
            dem: &dem,
            start,
            goal,
            vehicle: request["vehicle"].as_str(),
            obstacles: &obstacles,
            route: table(&request, "route"),
            team: Some(request["team"].clone()).filter(|team| !team.is_null()),
        };
        if is_route {
            return navigation::route(&plan, &destination.output).map(Planned::Route);
        }
        let date = request["date"].as_str().unwrap_or_default();
        navigation::release(&plan, date, &destination.place(), watched).map(Planned::Release)
    })?;
    match done {
        Planned::Route(metrics) => text(&metrics),
        Planned::Release(done) => summary(&done, &[]),
    }
}

/// What a planned route became.
enum Planned {
    Route(Value),
    Release(RunSummary),
}

fn point(request: &Value, key: &str) -> PyResult<[f64; 2]> {
    let read = || -> Option<[f64; 2]> {
        let pair = request[key].as_array()?;
        let numbers: Vec<f64> = pair.iter().map(Value::as_f64).collect::<Option<_>>()?;
        numbers.try_into().ok()
    };
    read().ok_or_else(|| usage(format!("`{key}` must be two finite numbers (x, y), got {}", request[key])))
}

/// Analyses logs; the settings are a JSON object with the options of the verb. Returns a JSON list with `log` and `notes` of each.
#[pyfunction]
pub fn analyze(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    dem: Option<PathBuf>,
    settings: &str,
    output: Option<PathBuf>,
) -> PyResult<String> {
    let settings = value(settings)?;
    waited(py, move || analyzed(&paths, dem.as_deref(), &settings, output.as_deref())).and_then(|found| text(&found))
}

fn analyzed(paths: &[PathBuf], dem: Option<&Path>, settings: &Value, output: Option<&Path>) -> Result<Value, Error> {
    fn read<T: DeserializeOwned>(settings: &Value, key: &str, otherwise: T) -> Result<T, Error> {
        if settings[key].is_null() {
            return Ok(otherwise);
        }
        read_parameters(&settings[key]).map_err(|e| Error::from(e.within(key)))
    }
    let default = LogSettings::default();
    let log_settings = LogSettings {
        topic: read(settings, "topic", None)?,
        body_frame: read(settings, "body_frame", default.body_frame)?,
        fixed_frame: read(settings, "fixed_frame", None)?,
        rate_hz: read(settings, "rate_hz", default.rate_hz)?,
        band_hz: read(settings, "band_hz", default.band_hz)?,
        differentiator: read(settings, "differentiator", default.differentiator)?,
    };
    let request = logs::Request {
        settings: log_settings,
        dem,
        offset_m: read(settings, "offset_m", [0.0; 3])?,
        group: read(settings, "group", None)?,
    };
    output.map_or(Ok(()), check_file)?;
    let ground = request.prepare()?;
    let judged = paths.iter().map(|path| request.judge(path, ground.as_ref())).collect::<Result<Vec<_>, _>>()?;
    if let Some(output) = output {
        let rows: Vec<_> = judged.iter().map(|one| one.row.clone()).collect();
        logs::write(output, &rows)?;
    }
    Ok(judged.iter().map(|one| json!({ "log": one.row.to_json(), "notes": one.notes })).collect())
}
