//! Covariance of the texture of a measured DEM.
//!
//! 1. Objects are found and left out ([`crate::objects`]; not in `paper` mode).
//! 2. The background is the moving average over the outer scale ([`sastrugi_roughness::background`]); the residual is height
//!    minus background, on cells whose window has enough data.
//! 3. Residuals beyond a symmetric threshold are trimmed at the significance level.
//! 4. The covariance of all remaining pairs is binned in rings, and by direction ([`crate::covariance::masked`]).
//! 5. `corrected`: the model *after the same measurement, detrending and trimming* is fitted to the bins by generalised least
//!    squares (`expectation.rs`, `estimator.rs`); of several models the one with the lowest AICc is chosen.
//!    `paper`: ordinary least squares of the model itself.
//! 6. Intervals by parametric and block bootstrap (`resampling.rs`), and tests of the fit against the data: other windows,
//!    misfit, anisotropy, stationarity, normality (`verdicts.rs`).
//!
//! Source: Vecherin et al. 2022, section 2 and Figure 4a. The paper's order of steps and its plain least squares are kept
//! as `paper`: on surfaces that are exactly exponential it gives sigma 19 % and b 42 % too small at b = 0.14 windows,
//! 43 % and 76 % at half a window (`docs/papers/vecherin.md`).
//!
//! 7. On request, statistics of the residual for textures that repeat more than its covariance ([`crate::synth::statistics`]): of the middle
//!    of the DEM, at most a million cells or seven windows a side.
//!
//! Cost without intervals: dominated by the moving averages of the object search and four real transforms of the raster.
//! A replicate costs one surface of four times as many cells (at most a million) and another such fit. Memory: the
//! strips of `survey.rs`, which grow with the raster's width only, plus two bits per cell, plus 300 bytes for each of up to a
//! million cells of every replicate in progress. Heights are read in parts, a few times ([`Heights`]).

mod block_places;
mod carried;
pub(crate) mod case;
mod cost;
mod error;
pub(crate) mod estimator;
pub(crate) mod expectation;
mod heights;
pub(crate) mod least_squares;
mod local;
mod memory;
pub(crate) mod null_surfaces;
mod params;
mod profile;
pub(crate) mod report;
pub(crate) mod resampling;
pub(crate) mod residual;
mod search;
pub(crate) mod simulate;
pub(crate) mod survey;
mod verdicts;

pub use error::FitError;
pub use heights::{Heights, Profiles};
pub use local::LocalMaps;
pub use params::{FitParameters, FitSettings, Mode};

use crate::covariance::bins::Layout;
use crate::covariance::{Form, LagBins};
use crate::synth::marginal::quantiles_m;
use crate::synth::{EMPIRICAL, statistics};
use case::Case;
use estimator::{Estimate, Estimator, best, ordinary};
use report::Findings;
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::statistics::Statistics;
use std::ops::Range;
use survey::Survey;
use verdicts::Area;

/// A fit, with what is needed to recompute its rasters.
#[derive(Clone)]
pub struct FitOutcome {
    /// The fit; the caller fills in its `source`.
    pub fit: FitFile,
    settings: FitSettings,
    pub(crate) survey: Survey,
    /// The rings of the fit file.
    pub(crate) bins: LagBins,
    cell_m: [f64; 2],
}

impl FitOutcome {
    /// The covariance of the residual at every lag, m2: a raster centred on lag zero, whose coordinates are the lag (x east,
    /// y north, m). NaN at lags without pairs.
    pub fn covariance_map(&self) -> Grid {
        let Self { survey, cell_m, .. } = self;
        let [max_row, max_col] = survey.covariance.max_lag.map(|l| l as isize);
        let origin = [-(max_col as f64 + 0.5) * cell_m[0], -(max_row as f64 + 0.5) * cell_m[1]];
        let geometry =
            Geometry { rows: 2 * max_row as usize + 1, cols: 2 * max_col as usize + 1, cell: *cell_m, origin };
        let lags = (-max_row..=max_row).flat_map(|r| (-max_col..=max_col).map(move |c| (r, c)));
        Grid::new(geometry, lags.map(|(r, c)| survey.covariance.covariance(r, c).unwrap_or(f64::NAN)).collect())
    }

    /// Background (moving average, m; NaN where the window has no data) and residual (height minus background, m, on the
    /// cells that entered the covariance; NaN elsewhere) of the fitted heights.
    ///
    /// # Errors
    /// Heights that cannot be read.
    pub fn rasters(&self, heights: &dyn Heights) -> Result<[Grid; 2], FitError> {
        let geometry = heights.geometry();
        let background = self.survey.background(heights, &self.settings)?;
        let mut residual = self.survey.residual(heights, &self.settings, 0..geometry.rows, 0..geometry.cols)?;
        self.survey.trim.apply(&mut residual);
        Ok([Grid::new(geometry, background), Grid::new(geometry, residual)])
    }
}

/// Fits the covariance of the texture of a DEM or of transects. Heights and cells are in m; `streams` drive the bootstrap
/// replicates. The front page of the crate has an example of a fit; a surface that has no texture is refused:
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid, Streams};
/// use sastrugi_texture::{FitError, FitParameters, FitSettings, fit};
///
/// let settings: FitSettings = FitParameters { outer_scale_m: 1.0, ..FitParameters::default() }.try_into().unwrap();
/// let level = Grid::filled(Geometry::square(60, 60, 0.1), 1234.0);
/// let refused = fit(&level, &settings, &Streams::for_seed(1, "fit")).err().unwrap();
/// assert_eq!(refused, FitError::Constant { height_m: 1234.0, objects: 0 });
/// // Six metres are less than three windows of 2.5 m.
/// let wide: FitSettings = FitParameters { outer_scale_m: 2.5, ..FitParameters::default() }.try_into().unwrap();
/// assert!(matches!(fit(&level, &wide, &Streams::for_seed(1, "fit")).err(), Some(FitError::OuterScaleTooLarge { .. })));
/// ```
///
/// # Errors
/// See [`FitError`].
pub fn fit(heights: &dyn Heights, settings: &FitSettings, streams: &Streams) -> Result<FitOutcome, FitError> {
    let settings = &if heights.are_profiles() { settings.of_transects() } else { settings.clone() };
    let case = Case::new(heights, settings)?;
    let (rows, cols) = middle(&case);
    // The height distribution and the statistics are those of the residual before trimming.
    let geometry = case.geometry.window(rows.start, cols.start, rows.len(), cols.len());
    let residual = Grid::new(geometry, case.survey.residual(heights, settings, rows, cols)?);
    let statistics = settings.has_statistics().then(|| statistics_of(&case, &residual).map(Box::new)).transpose()?;
    let naive = ordinary(&case, &Form::parse("exponential")?);
    let fit = match settings.mode() {
        Mode::Paper => paper(&case, &naive)?,
        Mode::Corrected => corrected(&case, &naive, streams)?,
    };
    let fit = readable(FitFile { height_quantiles_m: quantiles_m(&residual.values), statistics, ..fit })?;
    Ok(FitOutcome { fit, settings: settings.clone(), survey: case.survey, bins: case.bins, cell_m: case.geometry.cell })
}

/// Refuses a fit whose file could not be read: JSON has no numbers that are not finite.
fn readable(fit: FitFile) -> Result<FitFile, FitError> {
    let read = serde_json::to_value(&fit).and_then(serde_json::from_value::<FitFile>);
    read.map_err(|_| FitError::NoFit { model: fit.model.clone() })?;
    Ok(fit)
}

/// The residual of a DEM, heights minus background, as a fit with these settings computes it, before trimming, m; NaN where there is no data,
/// an object was left out, or a window has too little data.
///
/// # Errors
/// As [`fit()`], as far as the residual is concerned.
///
/// # Examples
/// ```
/// use sastrugi_numeric::{Geometry, Grid, Streams, sums};
/// use sastrugi_texture::{FitParameters, residual};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // Noise of 2 cm on a slope of 1 : 10, and windows of 11 x 11 cells.
/// let geometry = Geometry::square(80, 80, 0.1);
/// let mut stream = Streams::for_seed(1, "example").stream("noise");
/// let heights = (0..geometry.len()).map(|k| 0.1 * geometry.x(k % 80) + 0.02 * stream.normal()).collect();
/// let settings = FitParameters { outer_scale_m: 1.1, ..FitParameters::default() }.try_into()?;
/// let found = residual(&Grid::new(geometry, heights), &settings)?;
/// // The slope is background.
/// let rms_m = sums::variance(&sums::finite(&found.values)).sqrt();
/// assert!((rms_m / 0.02 - 1.0).abs() < 0.1, "{rms_m}");
/// # Ok(())
/// # }
/// ```
pub fn residual(heights: &dyn Heights, settings: &FitSettings) -> Result<Grid, FitError> {
    // The search for objects depends on how the raster is cut into strips, and that on the lags of the fit.
    let case = Case::new(heights, settings)?;
    Ok(Grid::new(case.geometry, case.residual()?))
}

/// The residual as [`residual()`] computes it, and quantiles of its heights as a fit states them, m.
pub(crate) fn residual_with_quantiles(
    heights: &dyn Heights,
    settings: &FitSettings,
) -> Result<(Grid, Vec<f64>), FitError> {
    let case = Case::new(heights, settings)?;
    let residual = Grid::new(case.geometry, case.residual()?);
    let (rows, cols) = middle(&case);
    let quantiles_m = quantiles_m(&residual.window(rows.start, cols.start, rows.len(), cols.len()).values);
    Ok((residual, quantiles_m))
}

/// The statistics of a residual, for lags of up to one and a half windows.
fn statistics_of(case: &Case, residual: &Grid) -> Result<Statistics, FitError> {
    if case.heights.are_profiles() {
        let message = "is true, but transects have only one direction; statistics need a raster";
        return Err(ParameterError::new("statistics", message).into());
    }
    Ok(statistics::measure(residual, case.window.cells().map(|cells| (3 * cells).div_ceil(2)))?)
}

fn paper(case: &Case, naive: &Estimate) -> Result<FitFile, FitError> {
    let estimate = ordinary(case, &case.settings.forms[0]);
    refuse_white(case, &estimate)?;
    let binned = estimator::at_lags(case, &estimate.covariance);
    Ok(report::fit_file(case, naive, &estimate, binned, &Findings::default()))
}

fn corrected(case: &Case, naive: &Estimate, streams: &Streams) -> Result<FitFile, FitError> {
    let settings = case.settings;
    let by_direction = case.bins_of(Layout::DIRECTIONAL);
    let directional = settings.forms.iter().any(Form::is_anisotropic);
    // Isotropic and anisotropic models are compared on the same bins.
    let bins = if directional { &by_direction } else { &case.bins };
    let needed = 1 + settings.forms.iter().map(|f| f.parameters().len()).max().unwrap_or(0);
    if bins.len() < needed {
        return Err(FitError::TooFewLags { found: bins.len(), needed });
    }
    let estimator = Estimator::new(case, bins);
    let rough_rings = directional.then(|| Estimator::rough(case, &case.bins));
    let on_rings = rough_rings.as_ref().unwrap_or(&estimator);
    let is_finite = |estimate: &Estimate| estimator.is_finite(estimate) && on_rings.is_finite(estimate);
    let (estimates, without): (Vec<_>, Vec<_>) = estimator.candidates(naive).into_iter().partition(is_finite);
    let without_values: Vec<String> = without.iter().map(|e| e.form.name().to_owned()).collect();
    let Some(estimate) = best(&estimates) else { return Err(FitError::NoFit { model: without_values.join(", ") }) };
    refuse_white(case, estimate)?;

    let replicates =
        (settings.bootstrap() > 0).then(|| resampling::parametric(&estimator, estimate, settings.bootstrap(), streams));
    let blocks = resampling::blocks(case, bins, settings.bootstrap() > 0)?;
    let resampled = resampling::block_replicates(&estimator, estimate, &blocks, settings.bootstrap(), streams);
    let (part, at_scales) = (examined(case)?, Area::settings(case));
    let area = Area::new(part.as_ref(), case, &at_scales)?;
    let rough = (!case.heights.are_profiles()).then(|| Estimator::rough(case, &by_direction));
    // Searches that do not depend on each other.
    let (windows, (profile, isotropy)) = rayon::join(
        || area.windows(estimate),
        || {
            let isotropy = || rough.as_ref().and_then(|rough| verdicts::isotropy(rough, estimate));
            rayon::join(|| profile::profile(&estimator, estimate), isotropy)
        },
    );
    let disagreement = verdicts::window_disagreement(&windows);
    let measured = settings.empirical.then(|| carried::by_map(case, estimate));
    let (map, carried) = measured.map_or_else(|| (None, carried::by_model(on_rings, estimate)), |(m, c)| (Some(m), c));
    let findings = Findings {
        scale_explicit: verdicts::no_scale_separation(disagreement)
            .then(|| verdicts::scale_explicit(on_rings, &estimates, &windows, &area)),
        intervals: replicates
            .as_ref()
            .and_then(|r| resampling::intervals(&estimator, estimate, &r.at))
            .map(|i| resampling::with_profile(i, &estimator, estimate)),
        block_intervals: resampling::intervals(&estimator, estimate, &resampled),
        candidates: verdicts::candidates(&estimates, on_rings),
        without_values,
        profile: profile.filter(profile::is_finite),
        disagreement,
        others: windows.others.iter().map(verdicts::other_window).collect(),
        isotropy,
        stationarity: verdicts::stationarity(&estimator, estimate, &blocks),
        misfit_p: verdicts::misfit_p(estimate, replicates.as_ref()),
        carried: Some(carried).filter(carried::is_finite),
        sill_over_range_spread: windows.sill_over_range_spread(),
        replicates: replicates.as_ref().map_or(0, |r| r.at.len()),
        normality_p: replicates.as_ref().and_then(|r| verdicts::normality_p(case, r)),
        directions: rough.map_or_else(Vec::new, |rough| report::directions(&rough, estimate)),
    };
    let file = report::fit_file(case, naive, estimate, on_rings.mean(&estimate.covariance), &findings);
    Ok(match map {
        Some(map) => FitFile { model: EMPIRICAL.to_owned(), map: Some(map), ..file },
        None => file,
    })
}

/// Refuses a residual that looks like white noise: the leading range is at most one cell, and neighbouring cells are hardly
/// correlated.
fn refuse_white(case: &Case, estimate: &Estimate) -> Result<(), FitError> {
    let cell = case.geometry.cell[0].max(case.geometry.cell[1]);
    let longest = estimate.covariance.range_m();
    if estimate.covariance.is_stationary() && longest <= cell && case.is_white() {
        return Err(FitError::White { range_m: longest, cell_m: cell });
    }
    Ok(())
}

/// The part of a DEM that is refitted at other windows: all of it, or its middle.
fn examined(case: &Case) -> Result<Box<dyn Heights>, FitError> {
    let (rows, cols) = middle(case);
    let geometry = case.geometry.window(rows.start, cols.start, rows.len(), cols.len());
    let mut heights = Vec::new();
    case.heights.read(rows, cols, &mut heights).map_err(FitError::Unreadable)?;
    let part = Grid::new(geometry, heights);
    Ok(if case.heights.are_profiles() { Box::new(Profiles::of(part)) } else { Box::new(part) })
}

/// Rows and columns of the part that is read a second time: the complete raster, or its middle, wide enough for windows of
/// twice the size.
fn middle(case: &Case) -> (Range<usize>, Range<usize>) {
    let Geometry { rows, cols, .. } = case.geometry;
    let [height, width] = resampling::shrunk([rows, cols], case.window.cells().map(|w| 7 * w));
    let span = |n: usize, part: usize| (n - part) / 2..(n - part) / 2 + part;
    (span(rows, height), span(cols, width))
}

#[cfg(test)]
mod tests;
