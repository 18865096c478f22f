//! Stage `fit`: the covariance of a measured DEM.

use super::coregistration;
use super::dem::{HEIGHTS, PLACE, Place, input_error};
use super::mask::{self, Mask};
use super::surface::{Surface, SurfaceRows};
use crate::builder::{BuildError, Builder, unknown_id};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::Entry;
use sastrugi_numeric::{Grid, Streams};
use sastrugi_schemas::coregistration::Minus;
use sastrugi_schemas::fit::{Candidate, DirectionBin, FitFile, Intervals, MaskSource, NoiseReference, Source};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::FitItem;
use sastrugi_schemas::tables::{CandidateCurveRow, CandidateRow, CovarianceRow, FitRow, LikelihoodProfileRow};
use sastrugi_schemas::{Kind, ParameterError};
use sastrugi_store::dem::{Crs, Dem};
use sastrugi_store::{dem, digest};
use sastrugi_texture::coregister::Coregistered;
use sastrugi_texture::noise::{Noise, ReferenceNoise};
use sastrugi_texture::{FitError, FitParameters, FitSettings, shown};
use serde_json::{Value, json};

/// Name of the stage.
pub const STAGE: &str = "fit";
/// Fit file.
pub const FIT: &str = "fit.json";
/// The background that was taken off.
pub const BACKGROUND: &str = "background.tif";
const RESIDUAL: &str = "residual.tif";
const MASK: &str = "mask.tif";
/// Covariance at every lag; the raster's coordinates are the lag.
const MAP: &str = "covariance.tif";

/// The one kind of fit.
pub fn kinds() -> Vec<Kind> {
    sastrugi_texture::kinds().into_iter().filter(|k| k.family == STAGE).collect()
}

struct FitJob {
    id: String,
    dem_id: String,
    dem: ItemRef,
    masks: Vec<Mask>,
    source: Source,
    noise_reference: Option<Mask>,
    minus: Option<Subtrahend>,
    settings: FitSettings,
    streams: Streams,
    cells: u64,
    cell_m: Option<f64>,
}

/// A DEM that is co-registered to the fitted one and subtracted.
#[derive(Clone)]
struct Subtrahend {
    id: String,
    dem: ItemRef,
    source: Source,
}

impl Subtrahend {
    fn of(builder: &Builder<'_>, entry: &Entry<'_>, id: &str) -> Result<Self, BuildError> {
        let Some(field) = builder.heightfields.get(id) else {
            return Err(unknown_id(entry, "minus", id, builder.heightfields.keys()).into());
        };
        Ok(Self { id: id.to_owned(), dem: field.item.clone(), source: builder.source_of(id, field) })
    }

    /// The DEM of an item less this one.
    fn subtract(&self, item: &ItemRef, dem: &Dem, work: &Work<'_>) -> Result<(Grid, Minus), JobError> {
        let other = dem::read(&work.parent(&self.dem, HEIGHTS)?).map_err(input_error)?;
        for (item, heights) in [(item, &dem.grid), (&self.dem, &other.grid)] {
            let place = Place::read(&work.parent(item, PLACE)?, &heights.geometry)?;
            if place.was_converted(&heights.geometry) {
                return Err(JobError::input(format!("{}: {}", item.id, coregistration::IN_DEGREES)));
            }
        }
        let Coregistered { difference, coregistration } = coregistration::coregistered(dem, &other)?;
        let Source { file, sha256, .. } = self.source.clone();
        Ok((difference, Minus { file, sha256, coregistration }))
    }
}

/// The fit of a DEM with its source, and a warning where co-registration failed.
pub fn with_source(fit: FitFile, source: Source) -> FitFile {
    let warning = source.minus.as_ref().and_then(|m| coregistration::warning(&m.coregistration));
    let warnings = warning.into_iter().chain(fit.warnings).collect();
    FitFile { source: Some(source), warnings, ..fit }
}

/// Adds the items of `[[fit]]`.
///
/// # Errors
/// A wrong item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    for entry in builder.study.entries(STAGE)? {
        let (item, params): (FitItem, Value) = entry.read()?;
        entry.check_keys::<FitItem>(&params, &schema_of::<FitParameters>())?;
        let Some(field) = builder.heightfields.get(&item.dem).cloned() else {
            return Err(unknown_id(&entry, "dem", &item.dem, builder.heightfields.keys()).into());
        };
        check_noise_reference(item.noise_reference.is_some(), item.minus.is_some()).map_err(|e| entry.refuse(e))?;
        let masks = mask::add(builder, &entry, &item)?;
        let noise_reference = mask::add_noise_reference(builder, &entry, &item)?;
        let mask_sources = masks.iter().map(|m| m.source.clone()).collect();
        let source = Source { masks: mask_sources, ..builder.source_of(&item.dem, &field) };
        let minus = item.minus.as_ref().map(|id| Subtrahend::of(builder, &entry, id)).transpose()?;
        let others = masks.iter().chain(&noise_reference).map(|m| &m.item).chain(minus.iter().map(|m| &m.dem));
        let parents: Vec<ItemRef> = [&field.item].into_iter().chain(others).cloned().collect();
        for one in entry.expand(&item.id, None, &item.sweep, &params)? {
            builder.claim(&entry, STAGE, &one.id)?;
            let raw: FitParameters = read_parameters(&one.params).map_err(|e| entry.refuse(e))?;
            let settings = FitSettings::try_from(raw).map_err(|e| entry.refuse(e))?;
            if noise_reference.is_some() {
                // What the reference holds is known when it is read; whether the fit takes it, now.
                settings
                    .with_noise(&Noise { white_sigma_m: f64::MIN_POSITIVE, ..Noise::default() })
                    .map_err(|e| entry.refuse(e))?;
            }
            let job = FitJob {
                id: one.id.clone(),
                dem_id: item.dem.clone(),
                dem: field.item.clone(),
                masks: masks.clone(),
                source: source.clone(),
                noise_reference: noise_reference.clone(),
                minus: minus.clone(),
                settings,
                streams: builder.streams(STAGE, &one.id, item.seed, 0),
                cells: field.cells,
                cell_m: field.cell_m,
            };
            let node = Node {
                item: ItemRef::new(STAGE, &one.id),
                parents: parents.clone(),
                inputs: Vec::new(),
                stream: Some(job.streams.label()),
                job: Box::new(job),
            };
            builder.node(node)?;
            builder.fits.push(one.id);
        }
    }
    Ok(())
}

impl Job for FitJob {
    fn recipe(&self) -> Value {
        let minus = self.minus.as_ref().map(|m| json!({ "dem": m.id, "source": m.source }));
        let noise_reference = self.noise_reference.as_ref().map(|n| &n.source);
        json!({
            "dem": self.dem_id,
            "source": self.source,
            "noise_reference": noise_reference,
            "minus": minus,
            "fit": self.settings.parameters(),
        })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Roughness, Room::Statistics, Room::Texture]
    }

    fn memory_bytes(&self) -> u64 {
        // Background, residual, mask and what describes the residual take 81 bytes a cell, after the fit.
        let fit = self.settings.memory_bytes(self.cells, self.cell_m, rayon::current_num_threads() as u64);
        8 * self.cells + fit.max((256 << 20) + 81 * self.cells)
    }

    fn estimate(&self) -> Estimate {
        // Of a measured DEM the cells are known when it is read; each replicate fits a surface of at most a million.
        let replicate = 1.5e-6 * self.cells.min(1 << 20) as f64;
        let replicates = f64::from(self.settings.parameters().bootstrap);
        Estimate { seconds: 0.5 + replicate * replicates, bytes: 1e6 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let mut read = dem::read(&work.parent(&self.dem, HEIGHTS)?).map_err(input_error)?;
        let mut settings = self.settings.clone();
        let mut notes = Vec::new();
        let mut source = self.source.clone();
        if let Some(reference) = &self.noise_reference {
            let noise = mask::noise_of_item(&read.grid, &self.dem, reference, work)?;
            settings = settings.with_noise(&noise.noise).map_err(JobError::input)?;
            notes.push(mask::noise_note(&noise));
            let MaskSource { file, sha256, .. } = &reference.source;
            source.noise_reference = Some(noise_reference(file, sha256, &noise));
        }
        source.masked_share = mask::of_item(&mut read.grid, &self.dem, &self.masks, work)?;
        notes.extend(source.masked_share.map(mask::share_note));
        if let Some(subtrahend) = &self.minus {
            let (difference, minus) = subtrahend.subtract(&self.dem, &read, work)?;
            read.grid = difference;
            notes.push(coregistration::sentence(&minus));
            source.minus = Some(minus);
        }
        // A co-registration is a result whatever the fit says.
        let failed = |e: FitError| match &source.minus {
            Some(minus) => JobError::new(format!("{e}; {}", coregistration::sentence(minus))),
            None => JobError::new(e),
        };
        let outcome = sastrugi_texture::fit(&read.grid, &settings, &self.streams).map_err(failed)?;
        let [background, residual] = outcome.rasters(&read.grid).map_err(JobError::new)?;
        let mask = shown::uses(&read.grid, &residual, &outcome);
        let band = shown::covariance_band(&residual, &outcome);
        let map = outcome.covariance_map();
        let fit = with_source(outcome.fit, source);
        work.write(FIT, to_json(&fit)?.as_bytes())?;
        let id = &self.id;
        let mut products = vec![Product::released(FIT, format!("fit/{id}.json"), None)];
        for (file, grid) in [(BACKGROUND, &background), (RESIDUAL, &residual)] {
            dem::write(&work.output(file), grid, &read.info.crs, &Default::default()).map_err(JobError::io)?;
            products.push(Product::released(file, format!("fit/{id}.{file}"), Some(digest::heights(grid))));
        }
        dem::write(&work.output(MAP), &map, &Crs::default(), &Default::default()).map_err(JobError::io)?;
        products.push(Product::released(MAP, format!("fit/{id}.{MAP}"), Some(digest::heights(&map))));
        dem::write_classes(&work.output(MASK), &mask, &read.info.crs).map_err(JobError::io)?;
        products.push(Product::released(MASK, format!("fit/{id}.{MASK}"), Some(digest::classes(&mask))));
        let surface = Surface { id, stage: STAGE, fit_id: Some(id), grid: &residual };
        let mut outcome = Outcome { products, notes };
        outcome.write_rows(work, [fit_row(id, &self.dem_id, &fit)])?;
        outcome.write_rows(work, covariance_rows(id, &fit, &band))?;
        outcome.write_rows(work, candidate_rows(id, &fit))?;
        outcome.write_rows(work, curve_rows(id, &fit))?;
        outcome.write_rows(work, profile_rows(id, &fit))?;
        SurfaceRows::of_residual(&surface, &fit).write(work, &mut outcome)?;
        outcome.notes.extend(fit.warnings);
        Ok(outcome)
    }
}

/// A noise reference as the fit file names it.
pub fn noise_reference(file: &str, sha256: &str, found: &ReferenceNoise) -> NoiseReference {
    NoiseReference {
        file: file.to_owned(),
        sha256: sha256.to_owned(),
        sigma_m: found.noise.white_sigma_m,
        correlated_sigma_m: found.noise.correlated_sigma_m,
        correlated_range_m: found.noise.correlated_range_m,
        unresolved_to_m: found.unresolved_to_m,
        differences: found.differences,
    }
}

/// A noise reference cannot be combined with `minus`: it holds the noise of one DEM, not that of a difference.
///
/// # Errors
/// When both are given.
pub fn check_noise_reference(reference: bool, minus: bool) -> Result<(), ParameterError> {
    let message = "is given with `minus`: the noise of a difference is not that of one DEM; state noise_sigma_m";
    if reference && minus { Err(ParameterError::new("noise_reference", message)) } else { Ok(()) }
}

/// A fit file's text.
///
/// # Errors
/// When a figure has no JSON form (a bug).
pub fn to_json(fit: &FitFile) -> Result<String, JobError> {
    serde_json::to_string_pretty(fit).map(|text| text + "\n").map_err(JobError::new)
}

/// A fit as a row of the table `fits`.
pub fn fit_row(id: &str, dem_id: &str, fit: &FitFile) -> FitRow {
    let parameter = |name: &str| fit.parameters.get(name).copied().unwrap_or(f64::NAN);
    let window = fit.window_m.unwrap_or([f64::NAN; 2]);
    // A sum of terms has no one sigma and b.
    let single = !fit.parameters.contains_key("sigma_2_m");
    let of_one = |name: &str| if single { parameter(name) } else { f64::NAN };
    let (sigma, range) = (of_one("sigma_m"), of_one("range_m"));
    let or = |name: &str, otherwise: f64| fit.parameters.get(name).copied().unwrap_or(otherwise);
    let found = &fit.diagnostics;
    let known = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let setting = |name: &str| fit.settings[name].as_f64().unwrap_or(f64::NAN);
    let ends = |intervals: &Option<Intervals>, name: &str| {
        let [low, high] = intervals.as_ref().and_then(|i| i.values.get(name).copied())?;
        // All these parameters are positive.
        Some([low.unwrap_or(0.0), high.unwrap_or(f64::INFINITY)])
    };
    let own = |name: &str| ends(&fit.intervals, name).unwrap_or([f64::NAN; 2]);
    let block = |name: &str| ends(&fit.block_intervals, name).unwrap_or([f64::NAN; 2]);
    let replicates = |intervals: &Option<Intervals>| intervals.as_ref().map_or(0, |i| i64::from(i.replicates));
    FitRow {
        fit_id: id.to_owned(),
        dem_id: dem_id.to_owned(),
        mode: fit.mode.clone(),
        model: fit.model.clone(),
        sigma_m: sigma,
        range_m: range,
        nugget_m2: or("nugget_m2", 0.0),
        sigma2_over_range_m: sigma * sigma / range,
        window_x_m: window[0],
        window_y_m: window[1],
        trim_level: fit.trim.map_or(0.0, |t| t.level),
        trim_threshold_m: fit.trim.map_or(f64::NAN, |t| t.threshold_m),
        used_share: fit.trim.map_or(f64::NAN, |t| 1.0 - t.masked_share),
        misfit_m2: misfit(fit),
        ratio: or("ratio", 1.0),
        azimuth_deg: or("azimuth_deg", f64::NAN),
        interval_level: fit.intervals.as_ref().map_or(f64::NAN, |i| i.level),
        replicates: replicates(&fit.intervals),
        sigma_low_m: own("sigma_m")[0],
        sigma_high_m: own("sigma_m")[1],
        range_low_m: own("range_m")[0],
        range_high_m: own("range_m")[1],
        sigma2_over_range_low_m: own("sigma2_over_range_m")[0],
        sigma2_over_range_high_m: own("sigma2_over_range_m")[1],
        block_replicates: replicates(&fit.block_intervals),
        block_sigma_low_m: block("sigma_m")[0],
        block_sigma_high_m: block("sigma_m")[1],
        block_range_low_m: block("range_m")[0],
        block_range_high_m: block("range_m")[1],
        block_sigma2_over_range_low_m: block("sigma2_over_range_m")[0],
        block_sigma2_over_range_high_m: block("sigma2_over_range_m")[1],
        misfit_chi2_per_freedom: known(found.misfit_chi2_per_freedom),
        misfit_p: known(found.misfit_p),
        isotropy_p: known(found.isotropy_p),
        isotropy_ratio: known(found.isotropy_ratio),
        isotropy_azimuth_deg: known(found.isotropy_azimuth_deg),
        stationarity_p: known(found.stationarity_p),
        block_sigma_max_over_min: known(found.block_sigma_max_over_min),
        normality_p: known(found.normality_p),
        window_disagreement_z: known(found.window_disagreement_z),
        naive_sigma_m: known(found.naive_sigma_m),
        naive_range_m: known(found.naive_range_m),
        band_rms_m: known(found.band_rms_m),
        increment_1m_m: known(found.increment_1m_m),
        hurst: known(found.hurst),
        noise_sigma_m: setting("noise_sigma_m"),
        correlated_noise_sigma_m: setting("correlated_noise_sigma_m"),
        correlated_noise_range_m: setting("correlated_noise_range_m"),
        effective_resolution_m: known(found.effective_resolution_m),
        warnings: fit.warnings.join("; "),
    }
}

/// Root mean square difference between bins and model.
fn misfit(fit: &FitFile) -> f64 {
    let squares: Vec<f64> =
        fit.covariance_m2.iter().zip(&fit.model_m2).map(|(c, m)| (c - m) * (c - m)).filter(|s| s.is_finite()).collect();
    sastrugi_numeric::sums::mean(&squares).sqrt()
}

/// Rings, then sectors.
pub fn covariance_rows(id: &str, fit: &FitFile, band: &[[f64; 2]]) -> Vec<CovarianceRow> {
    let at = |values: &[f64], bin: usize| values.get(bin).copied().unwrap_or(f64::NAN);
    let rings = fit.lags_m.len();
    let ring = |bin: usize| {
        let [low, high] = band.get(bin).copied().unwrap_or([f64::NAN; 2]);
        CovarianceRow {
            fit_id: id.to_owned(),
            bin: bin as i64,
            lag_m: at(&fit.lags_m, bin),
            azimuth_deg: None,
            covariance_m2: at(&fit.covariance_m2, bin),
            pairs: fit.pairs.get(bin).map_or(0, |&n| n as i64),
            model_m2: at(&fit.model_m2, bin),
            surface_model_m2: at(&fit.surface_model_m2, bin),
            covariance_low_m2: low,
            covariance_high_m2: high,
        }
    };
    let sector = |(k, bin): (usize, &DirectionBin)| CovarianceRow {
        fit_id: id.to_owned(),
        bin: (rings + k) as i64,
        lag_m: bin.lag_m,
        azimuth_deg: Some(bin.azimuth_deg),
        covariance_m2: bin.covariance_m2,
        pairs: bin.pairs as i64,
        model_m2: bin.model_m2,
        surface_model_m2: f64::NAN,
        covariance_low_m2: f64::NAN,
        covariance_high_m2: f64::NAN,
    };
    (0..rings).map(ring).chain(fit.directions.iter().enumerate().map(sector)).collect()
}

fn candidate_rows(id: &str, fit: &FitFile) -> Vec<CandidateRow> {
    let row = |(rank, c): (i64, &Candidate)| CandidateRow {
        fit_id: id.to_owned(),
        rank,
        model: c.model.clone(),
        parameters: json!(c.parameters).to_string(),
        free: i64::from(c.free),
        chi2: c.chi2,
        aicc_above_best: c.aicc_above_best,
    };
    (1..).zip(&fit.candidates).map(row).collect()
}

fn curve_rows(id: &str, fit: &FitFile) -> Vec<CandidateCurveRow> {
    let of_curve = |(rank, candidate): (i64, &Candidate)| {
        let row = |(bin, (&lag_m, &model_m2)): (i64, (&f64, &f64))| CandidateCurveRow {
            fit_id: id.to_owned(),
            rank,
            bin,
            lag_m,
            model_m2,
        };
        (0..).zip(fit.lags_m.iter().zip(&candidate.model_m2)).map(row).collect::<Vec<_>>()
    };
    (1..).zip(&fit.candidates).flat_map(of_curve).collect()
}

fn profile_rows(id: &str, fit: &FitFile) -> Vec<LikelihoodProfileRow> {
    let row = |(point, (&range_m, &chi2_rise)): (i64, (&f64, &f64))| LikelihoodProfileRow {
        fit_id: id.to_owned(),
        point,
        range_m,
        chi2_rise,
    };
    fit.profile.iter().flat_map(|p| (0..).zip(p.range_m.iter().zip(&p.chi2_rise)).map(row)).collect()
}
