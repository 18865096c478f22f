//! `fit`: fits the covariance of a measured DEM and writes a fit file.

use super::coregister::pair;
use super::local::Local;
use super::{Read, Reading, parameters, read, transects};
use crate::error::Error;
use crate::jobs::fit::STAGE;
use crate::operations::coregistration::{self, coregistered};
use crate::operations::dem::{input_error, metres_note};
use crate::operations::fits::{check_noise_reference, covariance_rows, noise_reference, to_json, with_source};
use crate::remote::check_file;
use sastrugi_numeric::resample::in_metres;
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::coregistration::Minus;
use sastrugi_schemas::fit::{FitFile, MaskSource, Source};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::{Cell, counted};
use sastrugi_store::dem::{self, BlockReader, Crs, Format, ReadOptions};
use sastrugi_store::{atomic, csv, digest};
use sastrugi_texture::coregister::Coregistered;
use sastrugi_texture::noise::ReferenceNoise;
use sastrugi_texture::{FitOutcome, FitParameters, FitSettings, Heights, Profiles};
use serde_json::Value;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// What to fit.
pub struct Request<'a> {
    /// Measured DEM.
    pub dem: &'a Path,
    /// Fit file to write, if any.
    pub output: Option<&'a Path>,
    /// Parameters of the fit.
    pub parameters: Value,
    /// Seed for the random streams of the replicates.
    pub seed: u64,
    /// Which part of the DEM is read, and how.
    pub reading: Reading,
    /// DEM to co-register to the first and subtract.
    pub minus: Option<&'a Path>,
    /// DEM to write with the difference.
    pub difference: Option<&'a Path>,
    /// GeoTIFF to write with the covariance at every lag.
    pub map: Option<&'a Path>,
    /// DEM to write with the background that the fit removes.
    pub background: Option<&'a Path>,
    /// Maps of local roughness to write.
    pub local: Option<Local<'a>>,
    /// Other files that the caller writes about the fit, checked for name clashes here.
    pub beside: Vec<&'a Path>,
}

/// Result for one DEM. A co-registration in the source is kept even if the fit failed.
pub struct Done {
    /// The fit as written, or why it failed.
    pub fit: Result<FitFile, Error>,
    /// Origin of the DEM.
    pub source: Source,
    /// Notes on how the DEM was read.
    pub notes: Vec<String>,
}

/// Fits a DEM and writes the fit file.
///
/// # Errors
/// Unknown parameters, a DEM that cannot be read or co-registered, a file that cannot be written.
pub fn fit(request: &Request<'_>) -> Result<Done, Error> {
    let settings = settings(&request.parameters)?;
    check_noise_reference(request.reading.noise_reference.is_some(), request.minus.is_some())?;
    check_outputs(request)?;
    request.local.as_ref().map_or(Ok(()), |local| local.check_mode(&settings))?;
    let Fitted { outcome, notes, masked_share, noise, minus } = fitted(request, &settings)?;
    let source = Source { masked_share, minus, ..source_of(request, noise.as_ref())? };
    let fit = match outcome {
        Ok(outcome) => Ok(written(request, outcome, source.clone())?),
        Err(error) => Err(error),
    };
    Ok(Done { fit, source, notes })
}

/// Checked parameters of a fit.
///
/// # Errors
/// Parameters that are unknown or out of range.
pub fn settings(parameters: &Value) -> Result<FitSettings, Error> {
    parameters::check_schema(parameters, &schema_of::<FitParameters>(), "fit")?;
    let raw: FitParameters = read_parameters(parameters)?;
    Ok(FitSettings::try_from(raw)?)
}

/// Writes the outputs of a fit.
fn written(request: &Request<'_>, outcome: FitOutcome, source: Source) -> Result<FitFile, Error> {
    if let Some(path) = request.map {
        dem::write(path, &outcome.covariance_map(), &Crs::default(), &Default::default())
            .map_err(super::write_error)?;
    }
    let fit = with_source(outcome.fit, source);
    if let Some(path) = request.output {
        atomic::write(path, to_json(&fit)?.as_bytes()).map_err(|e| Error::at(path, e))?;
    }
    Ok(fit)
}

/// Writes the covariance bins of a fit as CSV: rings, then directions.
///
/// # Errors
/// File-system errors.
pub fn write_bins(path: &Path, fit: &FitFile) -> Result<(), Error> {
    csv::write_rows(path, &BIN_COLUMNS, bins(fit)).map_err(|e| Error::at(path, e))
}

/// Columns of the bins.
const BIN_COLUMNS: [&str; 7] =
    ["kind", "lag_m", "azimuth_deg", "covariance_m2", "pairs", "model_m2", "surface_model_m2"];

fn bins(fit: &FitFile) -> impl Iterator<Item = Vec<Cell>> {
    covariance_rows("", fit, &[]).into_iter().map(|row| {
        vec![
            Cell::Text(if row.azimuth_deg.is_none() { "ring" } else { "direction" }.to_owned()),
            Cell::F64(row.lag_m),
            row.azimuth_deg.map_or(Cell::Null, Cell::F64),
            Cell::F64(row.covariance_m2),
            Cell::I64(row.pairs),
            Cell::F64(row.model_m2),
            Cell::F64(row.surface_model_m2),
        ]
    })
}

/// Refuses rasters of unknown format, and outputs that would replace another file of this fit, or something other than a file.
fn check_outputs(request: &Request<'_>) -> Result<(), Error> {
    let rasters = [request.map, request.difference, request.background];
    rasters.into_iter().flatten().try_for_each(super::check_output)?;
    let local = request.local.as_ref().map(Local::files).unwrap_or_default();
    let beside = request.beside.iter().copied().chain(local.iter().map(PathBuf::as_path));
    let outputs: Vec<&Path> = request.output.into_iter().chain(rasters.into_iter().flatten()).chain(beside).collect();
    outputs.iter().try_for_each(|path| check_file(path))?;
    let inputs: Vec<&Path> = inputs(request).collect();
    super::check_distinct(&outputs, &inputs)
}

/// All input files of a fit.
fn inputs<'a>(request: &'a Request<'_>) -> impl Iterator<Item = &'a Path> {
    let masks = request.reading.masks.iter().map(|(path, _)| path.as_path());
    [request.dem].into_iter().chain(request.minus).chain(masks).chain(request.reading.noise_reference.as_deref())
}

/// Writes the background that the fit removed, if requested.
fn write_background(
    request: &Request<'_>,
    outcome: &FitOutcome,
    heights: &dyn Heights,
    crs: &Crs,
) -> Result<(), Error> {
    let Some(path) = request.background else { return Ok(()) };
    let [background, _] = outcome.rasters(heights)?;
    dem::write(path, &background, crs, &Default::default()).map_err(super::write_error)?;
    Ok(())
}

struct Fitted {
    outcome: Result<FitOutcome, Error>,
    notes: Vec<String>,
    masked_share: Option<f64>,
    noise: Option<ReferenceNoise>,
    minus: Option<Minus>,
}

/// Fits transects, a raster that is read in parts, or a DEM in memory.
fn fitted(request: &Request<'_>, settings: &FitSettings) -> Result<Fitted, Error> {
    let streams = Streams::for_seed(request.seed, STAGE);
    let whole = |heights: &dyn Heights, settings: &FitSettings, crs: &Crs, mut notes: Vec<String>| {
        // A fit and its replicates may take minutes, so refuse impossible maps first.
        let checked = request.local.as_ref().map_or(Ok(()), |local| local.check(settings, heights));
        let outcome = checked.and_then(|()| sastrugi_texture::fit(heights, settings, &streams).map_err(Error::from));
        let mapped = |outcome: FitOutcome| {
            let said = request.local.as_ref().map(|local| local.write(&outcome, heights, crs)).transpose()?;
            notes.extend(said);
            Ok(outcome)
        };
        let outcome = outcome.and_then(mapped);
        let outcome = outcome.and_then(|outcome| write_background(request, &outcome, heights, crs).map(|()| outcome));
        Fitted { outcome, notes, masked_share: None, noise: None, minus: None }
    };
    if let Some(path) = request.minus {
        let (difference, Read { masked_share, notes, dem, .. }, minus) = subtracted(request, path)?;
        return Ok(Fitted { masked_share, minus: Some(minus), ..whole(&difference, settings, &dem.info.crs, notes) });
    }
    if let Some(found) = transects(request.dem, &request.reading)? {
        let profiles = Profiles::new(found.spacing_m, &found.profiles)?;
        if let Some(path) = request.background {
            let message = format!("{}: transects have no background raster; omit `--background`", path.display());
            return Err(Error::Usage(message));
        }
        let note = format!("{}, spacing {} m", counted(found.names.len(), "transect"), found.spacing_m);
        return Ok(whole(&profiles, settings, &Crs::default(), vec![note]));
    }
    if let Some((parts, notes)) = Parts::of_large(request.dem, &request.reading)? {
        return Ok(whole(&parts, settings, &parts.crs()?, notes));
    }
    let Read { dem, notes, masked_share, noise } = read(request.dem, &request.reading)?;
    let settings = match &noise {
        Some(noise) => settings.with_noise(&noise.noise)?,
        None => settings.clone(),
    };
    Ok(Fitted { masked_share, noise, ..whole(&dem.grid, &settings, &dem.info.crs, notes) })
}

/// Number of cells above which a GeoTIFF is read in parts: half a gigabyte of heights.
const PARTS_CELLS: usize = 1 << 26;

/// A raster that is read in parts, on demand.
struct Parts {
    reader: Mutex<BlockReader>,
    geometry: Geometry,
}

impl Parts {
    /// Opens a GeoTIFF that is too large to hold in memory, with notes on how it is read.
    fn of_large(path: &Path, reading: &Reading) -> Result<Option<(Self, Vec<String>)>, Error> {
        let whole = Reading { cell_m: reading.cell_m, gridding: reading.gridding, ..Reading::default() };
        if Format::of_name(path) != Some(Format::GeoTiff) || *reading != whole {
            return Ok(None);
        }
        let options = ReadOptions { cell_m: reading.cell_m };
        let reader = dem::open(path, &options).map_err(|e| Error::from(input_error(e)))?;
        let (own, mut notes) = (reader.geometry(), reader.info().notes.clone());
        if own.len() <= PARTS_CELLS {
            return Ok(None);
        }
        let mut geometry = own;
        if reader.info().crs.geographic {
            geometry = in_metres(&own);
            notes.push(metres_note(&own, &geometry));
        }
        notes.push(format!("{} x {} cells, read in parts", own.rows, own.cols));
        Ok(Some((Self { reader: Mutex::new(reader), geometry }, notes)))
    }
}

impl Parts {
    fn crs(&self) -> Result<Crs, Error> {
        let reader = self.reader.lock().map_err(|_| Error::failed("reading of the raster was aborted"))?;
        Ok(reader.info().crs.clone())
    }
}

impl Heights for Parts {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn read(&self, rows: Range<usize>, cols: Range<usize>, part: &mut Vec<f64>) -> Result<(), String> {
        let mut reader = self.reader.lock().map_err(|_| "reading of the raster was aborted".to_owned())?;
        *part = reader.read_part(rows, cols).map_err(|e| e.to_string())?.values;
        Ok(())
    }
}

/// The input files, as recorded in the fit file.
fn source_of(request: &Request<'_>, noise: Option<&ReferenceNoise>) -> Result<Source, Error> {
    let mask = |(path, excludes): &(PathBuf, bool)| {
        named(path).map(|(file, sha256)| MaskSource { file, sha256, excludes: *excludes })
    };
    let (file, sha256) = named(request.dem)?;
    let reference = request.reading.noise_reference.as_deref().map(named).transpose()?;
    let noise_reference = reference.zip(noise).map(|((file, sha256), noise)| noise_reference(&file, &sha256, noise));
    let masks = request.reading.masks.iter().map(mask).collect::<Result<_, _>>()?;
    Ok(Source { file, sha256, window: request.reading.window, masks, noise_reference, ..Source::default() })
}

/// The difference of two DEMs, written if requested, with how the first was read and a record of the second.
fn subtracted(request: &Request<'_>, path: &Path) -> Result<(Grid, Read, Minus), Error> {
    let (mut read, other) = pair(request.dem, path, &request.reading)?;
    let Coregistered { difference, coregistration } = coregistered(&read.dem, &other.dem)?;
    if let Some(path) = request.difference {
        let lost =
            dem::write(path, &difference, &read.dem.info.crs, &Default::default()).map_err(super::write_error)?;
        read.notes.extend(lost);
    }
    let (file, sha256) = named(path)?;
    let minus = Minus { file, sha256, coregistration };
    read.notes.push(coregistration::sentence(&minus));
    Ok((difference, read, minus))
}

/// Name of a file without its folder, and its SHA-256.
fn named(path: &Path) -> Result<(String, String), Error> {
    let (_, sha256) = digest::of_file(path).map_err(|e| Error::unreadable(path, &e))?;
    Ok((path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()), sha256))
}
