//! What is shown of a fit beside its file: which cells were used, how much the covariance scatters over the site, the curve
//! of every candidate, and a texture treated as the measured surface was. None of it decides a parameter.

use crate::covariance::filtered::{DetrendFilter, Measurement};
use crate::covariance::trimmed::TrimmedNormal;
use crate::covariance::{Covariance, masked_covariance};
use crate::detrend::{BoxWindow, box_mean};
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid, sums};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::{Candidate, FitFile};
use sastrugi_statistics::normal;

/// Code of a cell that entered the covariance.
pub const USED: u8 = 0;
/// Code of a cell beyond the trimming threshold, or taken for an object.
pub const TRIMMED: u8 = 1;
/// Code of a cell whose window has too little data, or that lies beside an object.
pub const BESIDE: u8 = 2;
/// Code of a cell without data.
pub const NO_DATA: u8 = 255;

/// Most rings of a fit's bins beside lag zero.
const RINGS_MAX: f64 = 32.0;
/// Fewest tiles that tell how a site scatters.
const TILES_MIN: usize = 9;
/// Most tiles along a side.
const TILES_ALONG: usize = 8;
/// Level of the band.
const LEVEL: f64 = 0.95;

/// What became of each cell of the DEM that was fitted.
pub fn uses(dem: &Grid, background: &Grid, residual: &Grid, fit: &FitFile) -> Grid<u8> {
    let threshold = fit.trim.map_or(f64::INFINITY, |t| t.threshold_m);
    let window = fit.window_m.map(|size_m| window_of(size_m, dem.geometry.cell));
    let count = window.map_or_else(Vec::new, |w| box_mean(&dem.values, dem.cols(), w).count);
    let needed = min_valid_share(fit) * window.map_or(0, |w| w.area()) as f64;
    let lacks_data = |k: usize| count.get(k).is_some_and(|n| f64::from(*n) <= needed);
    let code = |k: usize| {
        let (z, away) = (dem.values[k], (dem.values[k] - background.values[k]).abs());
        match (z.is_finite(), residual.values[k].is_finite()) {
            (false, _) => NO_DATA,
            (true, true) => USED,
            (true, false) if away > threshold && !lacks_data(k) => TRIMMED,
            (true, false) => BESIDE,
        }
    };
    Grid::new(dem.geometry, (0..dem.values.len()).map(code).collect())
}

/// The window of a true size east-west and north-south on its own cells.
fn window_of(size_m: [f64; 2], cell_m: [f64; 2]) -> BoxWindow {
    BoxWindow { half: [1, 0].map(|axis: usize| (size_m[axis] / cell_m[axis]).round() as usize / 2) }
}

/// Share of a window that must hold data.
fn min_valid_share(fit: &FitFile) -> f64 {
    fit.diagnostics.get("min_valid_share").and_then(|v| v.as_f64()).unwrap_or(0.5)
}

/// The rings of a fit's bins: bin 0 is lag zero, ring k the lags whose length rounds to k widths.
struct Rings {
    width_m: f64,
    lag_max_m: f64,
    cell_m: [f64; 2],
}

impl Rings {
    /// `None` for a fit file that does not say.
    fn of(fit: &FitFile) -> Option<Self> {
        let cell_m = fit.cell_m?;
        let lag_max_m = fit.diagnostics.get("lag_max_m")?.as_f64()?;
        Some(Self { width_m: cell_m[0].max(cell_m[1]).max(lag_max_m / RINGS_MAX), lag_max_m, cell_m })
    }

    /// Largest lag in cells, rows and columns.
    fn max_lag(&self) -> [usize; 2] {
        [1, 0].map(|axis: usize| (self.lag_max_m / self.cell_m[axis] * (1.0 + 1e-9)) as usize)
    }

    /// Ring of a lag in cells; `None` beyond the largest.
    fn place(&self, [row, col]: [isize; 2]) -> Option<usize> {
        let (y, x) = (row as f64 * self.cell_m[1], col as f64 * self.cell_m[0]);
        let length = (x * x + y * y).sqrt();
        (length <= self.lag_max_m * (1.0 + 1e-9)).then(|| (length / self.width_m).round() as usize)
    }

    /// Ring of each bin of the fit.
    fn of_bins(&self, fit: &FitFile) -> Vec<usize> {
        fit.lags_m.iter().map(|lag| (lag / self.width_m).round() as usize).collect()
    }

    /// Number of rings, lag zero counted.
    fn count(&self) -> usize {
        (self.lag_max_m * (1.0 + 1e-9) / self.width_m).round() as usize + 1
    }
}

/// A 95 % band about the empirical covariance of each bin, m2: standard errors by a delete-one jackknife over tiles of the
/// residual at least two largest lags wide (Efron and Stein, 1981), which need no model. Empty with fewer than 9 tiles.
pub fn covariance_band(residual: &Grid, fit: &FitFile) -> Vec<[f64; 2]> {
    let Some(rings) = Rings::of(fit) else { return Vec::new() };
    let max_lag = rings.max_lag();
    let along = [residual.rows(), residual.cols()];
    let along = [0, 1].map(|k| (along[k] / (2 * max_lag[k]).max(1)).min(TILES_ALONG));
    let places: Vec<[usize; 2]> = (0..along[0]).flat_map(|r| (0..along[1]).map(move |c| [r, c])).collect();
    let of_tile = |place: &[usize; 2]| -> Vec<(f64, f64)> {
        let [r0, c0] = [place[0] * residual.rows() / along[0], place[1] * residual.cols() / along[1]];
        let [r1, c1] = [(place[0] + 1) * residual.rows() / along[0], (place[1] + 1) * residual.cols() / along[1]];
        let tile = residual.window(r0, c0, r1 - r0, c1 - c0);
        let estimate = masked_covariance(&tile.values, tile.cols(), max_lag);
        let mut sums = vec![(0.0, 0.0); rings.count()];
        for lag in estimate.lags() {
            if let (Some(ring), Some((pairs, sum))) = (rings.place([lag.0, lag.1]), estimate.at(lag.0, lag.1)) {
                sums[ring] = (sums[ring].0 + sum, sums[ring].1 + pairs as f64);
            }
        }
        sums
    };
    let tiles: Vec<Vec<(f64, f64)>> = places.par_iter().map(of_tile).filter(|t| t[0].1 > 0.0).collect();
    if tiles.len() < TILES_MIN {
        return Vec::new();
    }
    let reach = normal::quantile(0.5 + 0.5 * LEVEL);
    let band = |(ring, value): (usize, &f64)| {
        let of_ring: Vec<(f64, f64)> = tiles.iter().filter_map(|t| t.get(ring).copied()).collect();
        let error = jackknife_error(&of_ring);
        [value - reach * error, value + reach * error]
    };
    rings.of_bins(fit).into_iter().zip(&fit.covariance_m2).map(band).collect()
}

/// Standard error of `sum of s / sum of n` over parts `(s, n)`.
fn jackknife_error(parts: &[(f64, f64)]) -> f64 {
    let total = |f: fn(&(f64, f64)) -> f64| sums::sum(&parts.iter().map(f).collect::<Vec<_>>());
    let (s, n) = (total(|p| p.0), total(|p| p.1));
    let without: Vec<f64> = parts.iter().map(|p| (s - p.0) / (n - p.1)).collect();
    ((parts.len() - 1) as f64 * sums::variance(&without)).sqrt()
}

/// Every candidate of a fit in the fit's bins, as the estimator sees it, m2. Windows are taken as complete; what partial
/// ones change (a few hundredths of the covariance on a small DEM) is added as it is for the model that was chosen.
///
/// # Errors
/// A candidate whose parameters its model does not take.
pub fn candidate_curves(
    fit: &FitFile,
    dem: &Geometry,
    measurement: Measurement,
) -> Result<Vec<Vec<f64>>, ParameterError> {
    let mut curves = with_complete_windows(fit, dem, measurement)?;
    let chosen = fit.candidates.first().is_some_and(|c| c.model == fit.model && c.parameters == fit.parameters);
    if let Some(first) = curves.first().filter(|_| chosen) {
        let partial: Vec<f64> = fit.model_m2.iter().zip(first).map(|(model, curve)| model - curve).collect();
        curves.iter_mut().for_each(|curve| curve.iter_mut().zip(&partial).for_each(|(c, p)| *c += p));
    }
    Ok(curves)
}

fn with_complete_windows(
    fit: &FitFile,
    dem: &Geometry,
    measurement: Measurement,
) -> Result<Vec<Vec<f64>>, ParameterError> {
    let (Some(rings), Some(window_m)) = (Rings::of(fit), fit.window_m) else { return Ok(Vec::new()) };
    let window = window_of(window_m, rings.cell_m);
    let filter = DetrendFilter::new(window, rings.cell_m, rings.max_lag(), measurement);
    let threshold_m = fit.trim.map_or(f64::INFINITY, |t| t.threshold_m);
    let curve = |candidate: &Candidate| {
        let (model, parameters) = (candidate.model.clone(), candidate.parameters.clone());
        let model = Covariance::of_fit(&FitFile { model, parameters, ..FitFile::default() })?;
        let residual = filter.residual_covariance(&filter.measured_covariance(&model));
        let variance = residual.at([0, 0]);
        let trimmed = TrimmedNormal::new(threshold_m / variance.sqrt());
        let seen = |lag: [isize; 2]| variance * trimmed.covariance(residual.at(lag) / variance);
        Ok(ring_means(&rings, fit, dem, seen))
    };
    fit.candidates.iter().map(curve).collect()
}

/// A function of the lag averaged over the rings of the bins, weighted by the pairs of a DEM without holes.
fn ring_means(rings: &Rings, fit: &FitFile, dem: &Geometry, f: impl Fn([isize; 2]) -> f64) -> Vec<f64> {
    let [max_row, max_col] = rings.max_lag().map(|l| l as isize);
    let mut totals = vec![(0.0, 0.0); rings.count()];
    for lag in (0..=max_row).flat_map(|r| (-max_col..=max_col).map(move |c| [r, c])) {
        if let Some(ring) = rings.place(lag) {
            let [rows, cols] = [dem.rows as f64 - lag[0] as f64, dem.cols as f64 - lag[1].unsigned_abs() as f64];
            let pairs = rows.max(0.0) * cols.max(0.0);
            totals[ring] = (totals[ring].0 + pairs * f(lag), totals[ring].1 + pairs);
        }
    }
    let means: Vec<f64> = totals.into_iter().map(|(sum, pairs)| sum / pairs).collect();
    rings.of_bins(fit).into_iter().map(|ring| means.get(ring).copied().unwrap_or(f64::NAN)).collect()
}

/// A texture as the fit would see it: less its moving average over the fit's window, and without the share of it that the
/// fit trimmed. `None` when the fit does not say its window, or the texture is below two windows wide.
pub fn alike(texture: &Grid, fit: &FitFile) -> Option<Grid> {
    let [window_x, window_y] = fit.window_m?;
    let [size_x, size_y] = texture.geometry.size();
    if size_x < 2.0 * window_x || size_y < 2.0 * window_y {
        return None;
    }
    let window = BoxWindow::nearest(0.5 * (window_x + window_y), texture.geometry.cell);
    let needed = min_valid_share(fit) * window.area() as f64;
    let average = box_mean(&texture.values, texture.cols(), window);
    let full = |k: usize| f64::from(average.count[k]) > needed;
    let residual = |k: usize| if full(k) { texture.values[k] - average.mean[k] } else { f64::NAN };
    let values: Vec<f64> = (0..texture.values.len()).map(residual).collect();
    let mut sizes: Vec<f64> = sums::finite(&values).into_iter().map(f64::abs).collect();
    let level = fit.trim.map_or(0.0, |t| t.level);
    let rank = (((1.0 - level) * sizes.len() as f64) as usize).min(sizes.len().checked_sub(1)?);
    let threshold = *sizes.select_nth_unstable_by(rank, f64::total_cmp).1;
    let keep = |v: f64| if v.abs() <= threshold { v } else { f64::NAN };
    Some(Grid::new(texture.geometry, values.into_iter().map(keep).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{FitParameters, FitSettings, fit};
    use sastrugi_numeric::Streams;
    use serde_json::json;
    use std::sync::LazyLock;

    /// A texture of known covariance with holes, and its fit with two candidates.
    static FITTED: LazyLock<(Grid, [Grid; 2], FitFile)> = LazyLock::new(|| {
        let truth = FitFile {
            model: "exponential".into(),
            parameters: [("sigma_m".to_owned(), 0.02), ("range_m".to_owned(), 0.28)].into(),
            ..FitFile::default()
        };
        let size = json!({ "size_m": [16.0, 16.0], "cell_m": 0.1 });
        let synthesis = crate::prepare("fft_ma", &size, &truth).unwrap();
        let mut dem = synthesis.generate(&Streams::for_seed(1, "shown-test")).unwrap().grid;
        (0..dem.values.len()).step_by(31).for_each(|k| dem.values[k] = f64::NAN);
        let parameters: FitParameters =
            serde_json::from_value(json!({ "outer_scale_m": 1.5, "bootstrap": 0, "model": "exponential,gaussian" }))
                .unwrap();
        let settings = FitSettings::try_from(parameters).unwrap();
        let outcome = fit(&dem, &settings, &Streams::for_seed(1, "fit")).unwrap();
        let rasters = outcome.rasters(&dem).unwrap();
        (dem, rasters, outcome.fit)
    });

    #[test]
    fn prop_what_is_shown_agrees_with_the_fit() {
        let (dem, [background, residual], fit) = &*FITTED;
        let codes = uses(dem, background, residual, fit);
        let count = |code: u8| codes.values.iter().filter(|c| **c == code).count();
        assert_eq!(count(USED), residual.finite_count());
        assert_eq!(count(NO_DATA), dem.values.len() - dem.finite_count());
        assert!(count(TRIMMED) > dem.values.len() / 25);

        // The first candidate is the fit: its curve differs by what partial windows do.
        let complete = with_complete_windows(fit, &dem.geometry, Measurement::default()).unwrap();
        assert_eq!(complete.len(), 2);
        for (curve, model) in complete[0].iter().zip(&fit.model_m2) {
            assert!((curve - model).abs() < 0.03 * fit.model_m2[0], "{curve} {model}");
        }
        let curves = candidate_curves(fit, &dem.geometry, Measurement::default()).unwrap();
        assert!(curves[0].iter().zip(&fit.model_m2).all(|(c, m)| (c - m).abs() < 1e-12 * fit.model_m2[0]));
        assert!(curves[1].iter().zip(&curves[0]).any(|(a, b)| (a - b).abs() > 1e-3 * fit.model_m2[0]));

        let band = covariance_band(residual, fit);
        assert_eq!(band.len(), fit.lags_m.len());
        for (k, [low, high]) in band.iter().enumerate() {
            let value = fit.covariance_m2[k];
            assert!(low < &value && &value < high && high - low < 0.3 * fit.covariance_m2[0], "{k}: {low} {high}");
        }
    }

    /// The standard error of a mean of n values, each its own part, is the usual one.
    #[test]
    fn val_jackknife_of_a_mean() {
        let parts = [1.0, 2.0, 4.0, 9.0].map(|v| (v, 1.0));
        let deviations: f64 = parts.iter().map(|p| (p.0 - 4.0) * (p.0 - 4.0)).sum();
        assert!((jackknife_error(&parts) - (deviations / 3.0 / 4.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn val_a_texture_is_treated_as_the_residual_was() {
        let (dem, [_, residual], fit) = &*FITTED;
        let texture = dem.map(|z| if z.is_nan() { 0.0 } else { z });
        let alike = alike(&texture, fit).unwrap();
        let used = alike.finite_count() as f64 / alike.values.len() as f64;
        assert!((used - 0.95).abs() < 0.02, "{used}");
        let rms = |g: &Grid| sums::variance(&sums::finite(&g.values)).sqrt();
        assert!((rms(&alike) / rms(residual) - 1.0).abs() < 0.05);
        assert!(super::alike(&texture.window(0, 0, 29, 29), fit).is_none());
        assert!(super::alike(&texture, &FitFile::default()).is_none());
    }
}
