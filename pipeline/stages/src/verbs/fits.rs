//! `fit` of several DEMs with the same settings: a table with one row per DEM and, on request, one fit file per DEM.
//! The row of a DEM that could not be fitted states the error.

use super::fit::{self, Done};
use super::{Reading, check_distinct};
use crate::error::Error;
use crate::operations::fits::fit_row;
use crate::remote::check_file;
use sastrugi_schemas::fit::{FitFile, Source};
use sastrugi_schemas::tables::{BesideFit, DemFitRow, FitRow};
use sastrugi_store::parquet::{TableMetadata, write_table};
use sastrugi_store::{PROGRAM, csv};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What to fit.
pub struct Request<'a> {
    /// Measured DEMs.
    pub dems: &'a [PathBuf],
    /// Fit file of a single DEM; for several, a folder for fit files `<name of the DEM>.json`. Without it, none are written.
    pub output: Option<&'a Path>,
    /// Table to write, .csv or .parquet.
    pub table: Option<&'a Path>,
    /// Parameters of every fit.
    pub parameters: Value,
    /// Seed for the random streams of the replicates, the same for every DEM.
    pub seed: u64,
    /// Which part of each DEM is read, and how.
    pub reading: Reading,
    /// DEM to co-register to each and subtract.
    pub minus: Option<&'a Path>,
}

/// Fits every DEM; `on_result` is called with each result. The rows are sorted by file.
///
/// # Errors
/// Unknown parameters; outputs that would replace another file; a table that cannot be written. The error of a single DEM
/// is recorded in its row.
pub fn fits(
    request: &Request<'_>,
    on_result: &mut dyn FnMut(&Path, &Result<Done, Error>),
) -> Result<Vec<DemFitRow>, Error> {
    fit::settings(&request.parameters)?;
    let outputs = fit_files(request)?;
    let mut rows = Vec::new();
    for (dem, output) in request.dems.iter().zip(&outputs) {
        let one = fit::Request {
            dem,
            output: output.as_deref(),
            parameters: request.parameters.clone(),
            seed: request.seed,
            reading: request.reading.clone(),
            minus: request.minus,
            difference: None,
            map: None,
            background: None,
            local: None,
            beside: request.table.into_iter().collect(),
        };
        let done = fit::fit(&one);
        on_result(dem, &done);
        rows.push(row(dem, done));
    }
    rows.sort_by(|a, b| a.file.cmp(&b.file));
    request.table.map(|path| write(path, &rows)).transpose()?;
    Ok(rows)
}

/// The fit file of each DEM; refuses names that would replace another, an input, or something other than a file.
fn fit_files(request: &Request<'_>) -> Result<Vec<Option<PathBuf>>, Error> {
    let mut owners: BTreeMap<PathBuf, &Path> = BTreeMap::new();
    let single = request.dems.len() == 1;
    if let Some(path) = request.output.filter(|path| !single && path.exists() && !path.is_dir()) {
        let message = format!("{} is a file; for several DEMs, `-o` must be a folder", path.display());
        return Err(Error::Usage(message));
    }
    let of = |dem: &PathBuf| {
        request.output.map(|path| if single { path.to_owned() } else { path.join(format!("{}.json", stem(dem))) })
    };
    let files: Vec<Option<PathBuf>> = request.dems.iter().map(of).collect();
    for (dem, file) in request.dems.iter().zip(&files) {
        let Some(file) = file else { continue };
        if let Some(other) = owners.insert(file.clone(), dem) {
            let message = format!(
                "{} and {} would both be written to {}; rename one, or omit `-o`",
                other.display(),
                dem.display(),
                file.display()
            );
            return Err(Error::Usage(message));
        }
    }
    let outputs: Vec<&Path> = files.iter().flatten().map(PathBuf::as_path).chain(request.table).collect();
    outputs.iter().try_for_each(|path| check_file(path))?;
    let dems: Vec<&Path> = request.dems.iter().map(PathBuf::as_path).collect();
    let masks = request.reading.masks.iter().map(|(path, _)| path.as_path());
    let others = masks.chain(request.minus).chain(request.reading.noise_reference.as_deref());
    let inputs: Vec<&Path> = dems.iter().copied().chain(others).collect();
    check_distinct(&outputs, &inputs)?;
    check_distinct(&dems, &[]).map_err(|_| {
        let message = "a DEM is given twice; the table has one row per DEM";
        Error::Usage(message.to_owned())
    })?;
    Ok(files)
}

fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn row(dem: &Path, done: Result<Done, Error>) -> DemFitRow {
    let (id, file) = (stem(dem), dem.display().to_string());
    let (fit, source) = match done {
        Ok(done) => (done.fit, done.source),
        Err(error) => (Err(error), Source::default()),
    };
    let beside = beside(fit.as_ref().ok(), &source);
    match fit {
        Ok(fit) => DemFitRow { file, fit: fit_row(&id, &id, &fit), beside, error: None },
        Err(error) => {
            let nothing = fit_row(&id, &id, &FitFile::default());
            // Keys missing from a fit file have defaults; here they are unknown.
            let unknown = FitRow { nugget_m2: f64::NAN, ratio: f64::NAN, trim_level: f64::NAN, ..nothing };
            DemFitRow { file, fit: unknown, beside, error: Some(error.to_string()) }
        }
    }
}

/// The co-registration, kept even if the fit failed, and the verdict on the fit.
fn beside(fit: Option<&FitFile>, source: &Source) -> BesideFit {
    let c = source.minus.as_ref().map(|minus| &minus.coregistration);
    let [shift_east_m, shift_north_m] = c.and_then(|c| c.shift_m).unwrap_or([f64::NAN; 2]);
    BesideFit {
        shift_east_m,
        shift_north_m,
        raise_m: c.map_or(f64::NAN, |c| c.raise_m),
        nmad_before_m: c.map_or(f64::NAN, |c| c.nmad_before_m),
        nmad_after_m: c.map_or(f64::NAN, |c| c.nmad_after_m),
        gained: c.and_then(|c| c.gained),
        verdict: fit.map(|fit| fit.verdict.clone()).filter(|verdict| !verdict.is_empty()),
        carried_rms_share: fit.and_then(|fit| fit.carried.as_ref()).map_or(f64::NAN, |carried| carried.rms_share),
    }
}

/// Writes the table `dem_fits`: as CSV if the name ends in .csv, else as Parquet.
fn write(path: &Path, rows: &[DemFitRow]) -> Result<(), Error> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
        return csv::write_records(path, rows).map_err(|e| Error::at(path, e));
    }
    let metadata =
        TableMetadata { study_sha256: String::new(), seed: 0, version: PROGRAM.to_owned(), license: String::new() };
    write_table(path, rows.iter().cloned(), Some(&metadata)).map(drop).map_err(Error::io)
}
