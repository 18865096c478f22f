//! `fit` of several DEMs, or with a table as output.

use super::reading;
use super::shown::check_ending;
use crate::Verdict;
use crate::args::{Common, Fit};
use crate::failure::{Code, Failure};
use crate::output::{columns, print, significant, warn};
use sastrugi_schemas::Record;
use sastrugi_schemas::fit::{FitFile, Intervals, Quoted, SILL_OVER_RANGE};
use sastrugi_schemas::tables::DemFitRow;
use sastrugi_stages::verbs::fits::{self, Request};
use sastrugi_stages::verbs::{Reading, numbers, parameters};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// `fit A B C ... --table OUT`.
pub fn fits(args: &Fit, common: &Common) -> Verdict {
    let why = "a table of fits must be .parquet or .csv";
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
    let mut fitted = BTreeMap::new();
    let rows = fits::fits(&request, &mut |dem, done| match done.as_ref().map(|done| &done.fit) {
        Ok(Ok(fit)) => {
            if !common.quiet {
                warn(&format!("{}: fitted", dem.display()));
            }
            fitted.insert(dem.display().to_string(), fit.clone());
        }
        Ok(Err(error)) | Err(error) => warn(&failure(dem, &error.to_string())),
    })?;
    print(common.json, &rows.iter().map(Record::to_json).collect(), &text(&rows, &fitted))?;
    Ok(match rows.iter().filter(|row| row.error.is_some()).count() {
        0 => Code::Done,
        failed if failed == rows.len() => Code::Failed,
        _ => Code::Partial,
    })
}

/// Why a DEM was not fitted; most messages already name the file.
fn failure(dem: &Path, error: &str) -> String {
    let name = dem.display().to_string();
    if error.starts_with(&name) { format!("sastrugi: {error}") } else { format!("sastrugi: {name}: {error}") }
}

/// Refuses outputs that exist for a single DEM only.
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
            let message = format!("`{option}` works with one DEM only; fit it alone, with `-o` and without `--table`");
            Err(Failure::usage(message))
        }
        None => Ok(()),
    }
}

/// Sigma, b and sigma^2 / b of every DEM, as quoted by `fit`.
fn text(rows: &[DemFitRow], fitted: &BTreeMap<String, FitFile>) -> String {
    let head =
        ["file", "model", "sigma m", "b m", "sigma^2/b m", "band RMS m", "intervals"].map(str::to_owned).to_vec();
    let line = |row: &DemFitRow| match fitted.get(&row.file) {
        None => vec![row.file.clone(), "not fitted".to_owned()],
        Some(fit) => {
            let of = |name: &str| fit.quoted(name).map_or_else(|| "-".to_owned(), parameter);
            // A sum of terms does not have a single sigma and b.
            let of_one = |name: &str| if row.fit.sigma_m.is_finite() { of(name) } else { "-".to_owned() };
            let kind = |(intervals, kind): (&Intervals, &str)| format!("{:.0} %, {kind}", 100.0 * intervals.level);
            vec![
                row.file.clone(),
                fit.model.clone(),
                of_one("sigma_m"),
                of_one("range_m"),
                of_one(SILL_OVER_RANGE),
                number(row.fit.band_rms_m),
                fit.quoted_intervals().map_or_else(|| "-".to_owned(), kind),
            ]
        }
    };
    columns(&[head].into_iter().chain(rows.iter().map(line)).collect::<Vec<_>>())
}

fn number(value: f64) -> String {
    if value.is_finite() { significant(value) } else { "-".to_owned() }
}

fn parameter(quoted: Quoted) -> String {
    let end = |end: Option<f64>| end.map_or_else(|| "open".to_owned(), number);
    match quoted {
        Quoted::Estimate { value, interval: None } => number(value),
        Quoted::Estimate { value, interval: Some([low, high]) } => {
            format!("{} [{}, {}]", number(value), end(low), end(high))
        }
        Quoted::AtLeast(low) => format!("at least {}", number(low)),
        Quoted::NotIdentified { .. } => "not identified".to_owned(),
    }
}

/// Parameters of a fit from the options.
pub fn fit_parameters(args: &Fit) -> Result<Value, Failure> {
    let mut params = json!({});
    parameters::assign(&mut params, &args.set)?;
    let mut put = |key: &str, value: Option<Value>| {
        if let Some(value) = value {
            params[key] = value;
        }
    };
    put("outer_scale_m", args.outer_scale.map(|v| json!(v)));
    put("mode", args.mode.as_ref().map(|v| json!(v)));
    put("trim", args.trim.map(|v| json!(v)));
    put("model", args.model.as_ref().map(|v| json!(v)));
    put("bootstrap", args.bootstrap.map(|v| json!(v)));
    put("statistics", args.statistics.then(|| json!(true)));
    put("noise_sigma_m", args.noise_sigma.map(|v| json!(v)));
    put("correlated_noise_sigma_m", args.correlated_noise_sigma.map(|v| json!(v)));
    put("correlated_noise_range_m", args.correlated_noise_range.map(|v| json!(v)));
    put("inner_scale_m", args.inner_scale.map(|v| json!(v)));
    Ok(params)
}

/// Which part of a DEM is fitted, and how it is read.
pub fn fit_reading(args: &Fit) -> Result<Reading, Failure> {
    let window = args.window.as_deref().map(|w| numbers::<4>("--window", w)).transpose()?;
    let noise_reference = args.noise_reference.clone();
    Ok(Reading { window, masks: args.masks.all(), noise_reference, ..reading(&args.reading)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_limits_and_estimates_are_distinguished() {
        assert_eq!(parameter(Quoted::AtLeast(4.395_78)), "at least 4.396");
        assert_eq!(parameter(Quoted::AtLeast(0.012_345)), "at least 0.01235");
        assert_eq!(parameter(Quoted::NotIdentified { ended: 420.0 }), "not identified");
        let open = Quoted::Estimate { value: 0.3, interval: Some([Some(0.2), None]) };
        assert_eq!(parameter(open), "0.3000 [0.2000, open]");
        assert_eq!(parameter(Quoted::Estimate { value: 0.000_199_5, interval: None }), "0.0001995");
        assert_eq!(parameter(Quoted::Estimate { value: f64::NAN, interval: None }), "-");
    }
}
