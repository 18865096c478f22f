//! A DEM split into background and residual, and the residual trimmed.

use super::{FitError, FitSettings, Mode};
use crate::detrend::{BoxWindow, box_mean};
use crate::outliers;
use sastrugi_numeric::{Grid, sums};
use sastrugi_statistics::normal;

/// A DEM split into background and residual.
pub struct Detrended {
    /// Heights that entered the moving average; NaN elsewhere.
    pub trusted: Vec<f64>,
    /// Moving average.
    pub background: Vec<f64>,
    /// Data in each cell's window.
    pub count: Vec<u32>,
    /// NaN where the cell is not trusted or its window lacks data.
    pub residual: Vec<f64>,
    /// Cells with data in the DEM.
    pub measured: usize,
}

impl Detrended {
    /// Splits a DEM; outliers are found first, except in `paper` mode.
    pub fn new(dem: &Grid, settings: &FitSettings, window: BoxWindow) -> Result<Self, FitError> {
        let Some((low, high)) = dem.range() else { return Err(FitError::NoData { cells: dem.values.len() }) };
        let trusted = trusted_heights(dem, settings.mode(), window);
        let split = Self { measured: dem.finite_count(), ..Self::of_trusted(trusted, dem.cols(), settings, window) };
        if split.residual.iter().all(|r| r.is_nan()) {
            let best = split.count.iter().copied().max().unwrap_or(0);
            let best_share = f64::from(best) / window.area() as f64;
            return Err(FitError::NoWindow { needed_share: settings.min_valid_share, best_share });
        }
        // Rounding of the running sums is far below 1e-11 of the heights.
        let rounding = 1e-11 * low.abs().max(high.abs());
        if split.residual.iter().all(|r| r.is_nan() || r.abs() <= rounding) {
            return Err(FitError::Constant { height_m: low });
        }
        Ok(split)
    }

    /// Splits heights without outliers.
    pub fn of_trusted(trusted: Vec<f64>, cols: usize, settings: &FitSettings, window: BoxWindow) -> Self {
        let average = box_mean(&trusted, cols, window);
        let needed = settings.min_valid_share * window.area() as f64;
        let residual: Vec<f64> = (0..trusted.len())
            .map(|k| if f64::from(average.count[k]) > needed { trusted[k] - average.mean[k] } else { f64::NAN })
            .collect();
        let measured = trusted.iter().filter(|z| !z.is_nan()).count();
        Self { trusted, background: average.mean, count: average.count, residual, measured }
    }

    /// The residual without what lies beyond the threshold.
    pub fn trimmed(&self, settings: &FitSettings) -> Trimmed {
        let used = sums::finite(&self.residual);
        let (centre, threshold_m) = match settings.mode() {
            Mode::Paper => paper_threshold(&used, settings.trim()),
            Mode::Corrected => (0.0, share_threshold(&used, settings.trim())),
        };
        let keep = |r: f64| if (r - centre).abs() <= threshold_m { r } else { f64::NAN };
        let mut residual: Vec<f64> = self.residual.iter().map(|&r| keep(r)).collect();
        if settings.mode() == Mode::Paper {
            let mean = sums::mean(&sums::finite(&residual));
            residual.iter_mut().for_each(|r| *r -= mean);
        }
        let kept = residual.iter().filter(|r| !r.is_nan()).count();
        Trimmed { residual, threshold_m, median_size_m: share_threshold(&used, 0.5), detrended: used.len(), kept }
    }
}

/// Heights that enter the moving average.
fn trusted_heights(dem: &Grid, mode: Mode, window: BoxWindow) -> Vec<f64> {
    let heights: Vec<f64> = dem.values.iter().map(|&z| if z.is_finite() { z } else { f64::NAN }).collect();
    if mode == Mode::Paper {
        return heights;
    }
    let outlier = outliers::find(&heights, dem.cols(), window);
    heights.into_iter().zip(outlier).map(|(z, out)| if out { f64::NAN } else { z }).collect()
}

/// Mean of the residual and the normal threshold about it: `z(1 - level / 2)` standard deviations.
fn paper_threshold(residual: &[f64], level: f64) -> (f64, f64) {
    (sums::mean(residual), normal::quantile(1.0 - 0.5 * level) * sums::variance(residual).sqrt())
}

/// The absolute value that a share `level` of the residuals exceeds.
fn share_threshold(residual: &[f64], level: f64) -> f64 {
    let mut sizes: Vec<f64> = residual.iter().map(|r| r.abs()).collect();
    let rank = ((1.0 - level) * sizes.len() as f64) as usize;
    let rank = rank.min(sizes.len().saturating_sub(1));
    if sizes.is_empty() { f64::NAN } else { *sizes.select_nth_unstable_by(rank, f64::total_cmp).1 }
}

/// Residuals that entered the covariance.
pub struct Trimmed {
    /// NaN where trimmed or not used.
    pub residual: Vec<f64>,
    /// Residuals beyond this were trimmed, m.
    pub threshold_m: f64,
    /// Median absolute residual before trimming, m.
    pub median_size_m: f64,
    /// Residuals before trimming.
    pub detrended: usize,
    /// Residuals after trimming.
    pub kept: usize,
}
