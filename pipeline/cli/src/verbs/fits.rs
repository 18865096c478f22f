//! `fit` of several DEMs, or to a table.

use super::generate::{fit_parameters, fit_reading};
use super::shown::check_ending;
use crate::Verdict;
use crate::args::{Common, Fit};
use crate::failure::{Code, Failure};
use crate::output::{columns, print, warn};
use sastrugi_schemas::tables::DemFitRow;
use sastrugi_stages::verbs::fits::{self, Request};
use serde_json::json;
use std::path::Path;

/// `fit A B C ... --table OUT`.
pub fn fits(args: &Fit, common: &Common) -> Verdict {
    let why = "a table of fits is written as .parquet or .csv";
    args.table.iter().try_for_each(|path| check_ending(path, &["parquet", "csv"], why))?;
    check_single(args)?;
    let request = Request {
        dems: &args.dems,
        output: args.output.as_deref(),
        table: args.table.as_deref(),
        parameters: fit_parameters(args)?,
        seed: args.seed,
        reading: fit_reading(args)?,
        minus: args.minus.as_deref(),
    };
    let rows = fits::fits(&request, &mut |dem, done| match done.as_ref().map(|done| &done.fit) {
        Ok(Ok(_)) if common.quiet => {}
        Ok(Ok(_)) => warn(&format!("{}: fitted", dem.display())),
        Ok(Err(error)) | Err(error) => warn(&failure(dem, &error.to_string())),
    })?;
    print(common.json, &json!(rows), &text(&rows))?;
    Ok(match rows.iter().filter(|row| row.error.is_some()).count() {
        0 => Code::Done,
        failed if failed == rows.len() => Code::Failed,
        _ => Code::Partial,
    })
}

/// Why a DEM was not fitted; most sentences name the file themselves.
fn failure(dem: &Path, error: &str) -> String {
    let name = dem.display().to_string();
    if error.starts_with(&name) { format!("sastrugi: {error}") } else { format!("sastrugi: {name}: {error}") }
}

/// Refuses what is written once, or shown of one DEM.
fn check_single(args: &Fit) -> Result<(), Failure> {
    let single: [(&str, Option<&Path>); 6] = [
        ("--difference", args.difference.as_deref()),
        ("--map", args.map.as_deref()),
        ("--background", args.background.as_deref()),
        ("--plot", args.shown.plot.as_deref()),
        ("--csv", args.shown.csv.as_deref()),
        ("--local", args.shown.local.as_deref()),
    ];
    match single.iter().find(|(_, path)| path.is_some()) {
        Some((option, _)) => {
            let message = format!("`{option}` shows one DEM; fit it alone, with `-o` and without `--table`");
            Err(Failure::usage(message))
        }
        None => Ok(()),
    }
}

/// Sigma, b and sigma^2 / b of every DEM with their intervals.
fn text(rows: &[DemFitRow]) -> String {
    let head = ["file", "model", "sigma m", "b m", "sigma^2/b m", "band RMS m"].map(str::to_owned).to_vec();
    let number = |value: f64| if value.is_finite() { format!("{value:.5}") } else { "-".to_owned() };
    let with_ends = |value: f64, low: f64, high: f64| match low.is_nan() && high.is_nan() {
        true => number(value),
        false => format!("{} [{}, {}]", number(value), end(low), end(high)),
    };
    let line = |row: &DemFitRow| {
        let f = &row.fit;
        if row.error.is_some() {
            return vec![row.file.clone(), "not fitted".to_owned()];
        }
        let sill = [f.sigma2_over_range_m, f.sigma2_over_range_low_m, f.sigma2_over_range_high_m];
        vec![
            row.file.clone(),
            f.model.clone(),
            with_ends(f.sigma_m, f.sigma_low_m, f.sigma_high_m),
            with_ends(f.range_m, f.range_low_m, f.range_high_m),
            with_ends(sill[0], sill[1], sill[2]),
            number(f.band_rms_m),
        ]
    };
    columns(&[head].into_iter().chain(rows.iter().map(line)).collect::<Vec<_>>())
}

/// An end of an interval; 0 and infinity stand for an open one.
fn end(value: f64) -> String {
    if value > 0.0 && value.is_finite() { format!("{value:.5}") } else { "open".to_owned() }
}
