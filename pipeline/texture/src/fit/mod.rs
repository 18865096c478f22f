//! Covariance of the texture of a measured DEM.
//!
//! 1. Cells that are no texture are found and left out ([`crate::outliers`]; not in `paper` mode).
//! 2. Background: the moving average over the outer scale ([`crate::detrend`]); residual: height less background, on
//!    cells whose window has data enough.
//! 3. Residuals beyond a symmetric threshold are trimmed at the significance level.
//! 4. Covariance of all pairs of what is left, in isotropic lag bins ([`crate::covariance::masked`]).
//! 5. `corrected`: sigma and b such that the model, *after the same detrending and trimming*, agrees with the bins by
//!    generalised least squares (`expectation.rs`). `paper`: ordinary least squares of the model itself.
//!
//! Source: Vecherin et al. 2022, section 2 and Figure 4a. The paper's order of steps and its plain least squares are kept
//! as `paper`: on surfaces that are exactly exponential it gives sigma 19 % and b 42 % too small at b = 0.14 windows,
//! 43 % and 76 % at half a window (`docs/papers/vecherin.md`).
//!
//! Cost: dominated by the moving averages of the outlier search and four real transforms of the raster. Memory: about
//! 60 bytes per cell.

mod error;
mod expectation;
mod least_squares;
mod params;
mod report;

pub use error::FitError;
pub use params::{FitParameters, FitSettings, Mode};

use crate::covariance::filtered::DetrendFilter;
use crate::covariance::partial::{DetrendedCells, PartialWindows};
use crate::covariance::{Covariance, LagBins, masked_covariance};
use crate::detrend::{BoxWindow, box_mean};
use crate::outliers;
use expectation::Expectation;
use least_squares::{Cholesky, Minimum, minimise};
use sastrugi_numeric::{Grid, sums};
use sastrugi_schemas::fit::FitFile;
use sastrugi_statistics::normal;

/// Rounds of weighting by the covariance of the bins.
const WEIGHTING_ROUNDS: usize = 4;
/// Largest range the search may reach, in windows.
const RANGE_MAX_WINDOWS: f64 = 20.0;
/// Fewest bins for two parameters.
const BINS_MIN: usize = 3;

/// A fit and the rasters behind it.
#[derive(Clone, Debug)]
pub struct FitOutcome {
    /// The fit; its `source` is left to the caller.
    pub fit: FitFile,
    /// Moving average, m; NaN where the window has no data.
    pub background: Grid,
    /// Height less background, m, on the cells that entered the covariance; NaN elsewhere.
    pub residual: Grid,
}

/// Fits the covariance of the DEM's texture. Heights and cells are in m.
///
/// # Errors
/// See [`FitError`].
pub fn fit(dem: &Grid, settings: &FitSettings) -> Result<FitOutcome, FitError> {
    let case = Case::new(dem, settings)?;
    let naive = case.naive();
    let estimate = match settings.mode() {
        Mode::Paper => naive.clone(),
        Mode::Corrected => case.corrected(&naive),
    };
    let cell = dem.geometry.cell[0].max(dem.geometry.cell[1]);
    if estimate.model.range_m <= cell {
        return Err(FitError::White { range_m: estimate.model.range_m, cell_m: cell });
    }
    let fit = report::fit_file(&case, &naive, &estimate);
    let Case { detrended, trimmed, .. } = case;
    Ok(FitOutcome {
        fit,
        background: Grid::new(dem.geometry, detrended.background),
        residual: Grid::new(dem.geometry, trimmed.residual),
    })
}

/// A DEM split into background and residual.
struct Detrended {
    /// Heights that entered the moving average; NaN elsewhere.
    trusted: Vec<f64>,
    background: Vec<f64>,
    /// Data in each cell's window.
    count: Vec<u32>,
    /// NaN where the cell is not trusted or its window lacks data.
    residual: Vec<f64>,
    /// Cells with data in the DEM.
    measured: usize,
}

impl Detrended {
    fn new(dem: &Grid, settings: &FitSettings, window: BoxWindow) -> Result<Self, FitError> {
        let measured = dem.finite_count();
        let Some((low, high)) = dem.range() else { return Err(FitError::NoData { cells: dem.values.len() }) };
        let trusted = trusted_heights(dem, settings.mode(), window);
        let average = box_mean(&trusted, dem.cols(), window);
        let needed = settings.min_valid_share * window.area() as f64;
        let residual: Vec<f64> = (0..trusted.len())
            .map(|k| if f64::from(average.count[k]) > needed { trusted[k] - average.mean[k] } else { f64::NAN })
            .collect();
        if residual.iter().all(|r| r.is_nan()) {
            let best = average.count.iter().copied().max().unwrap_or(0);
            let best_share = f64::from(best) / window.area() as f64;
            return Err(FitError::NoWindow { needed_share: settings.min_valid_share, best_share });
        }
        // Rounding of the running sums is far below 1e-11 of the heights.
        let rounding = 1e-11 * low.abs().max(high.abs());
        if residual.iter().all(|r| r.is_nan() || r.abs() <= rounding) {
            return Err(FitError::Constant { height_m: low });
        }
        Ok(Self { trusted, background: average.mean, count: average.count, residual, measured })
    }

    /// The residual without what lies beyond the threshold.
    fn trimmed(&self, settings: &FitSettings) -> Trimmed {
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
        Trimmed { residual, threshold_m, detrended: used.len(), kept }
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
    *sizes.select_nth_unstable_by(rank, f64::total_cmp).1
}

/// Residuals that entered the covariance.
struct Trimmed {
    residual: Vec<f64>,
    threshold_m: f64,
    /// Residuals before trimming.
    detrended: usize,
    /// Residuals after trimming.
    kept: usize,
}

/// Everything a fit is made of.
struct Case<'a> {
    settings: &'a FitSettings,
    cols: usize,
    window: BoxWindow,
    cell_m: [f64; 2],
    max_lag: [usize; 2],
    max_lag_m: f64,
    detrended: Detrended,
    trimmed: Trimmed,
    bins: LagBins,
}

/// Fitted parameters and what they say about the bins.
#[derive(Clone)]
struct Estimate {
    model: Covariance,
    /// The model in each bin as the estimator sees it, m2.
    binned: Vec<f64>,
    iterations: usize,
    /// Generalised sum of squares at the minimum, and how much more it is at three times the range.
    objective: Option<Objective>,
}

#[derive(Clone, Copy)]
struct Objective {
    value: f64,
    rise_at_3b: f64,
}

impl<'a> Case<'a> {
    /// Detrends, trims and correlates.
    fn new(dem: &Grid, settings: &'a FitSettings) -> Result<Self, FitError> {
        let window = settings.window(&dem.geometry)?;
        let detrended = Detrended::new(dem, settings, window)?;
        let trimmed = detrended.trimmed(settings);
        let cell_m = dem.geometry.cell;
        let max_lag_m = settings.max_lag_m(&dem.geometry);
        let max_lag = [1, 0].map(|axis: usize| (max_lag_m / cell_m[axis] * (1.0 + 1e-9)) as usize);
        let bins = LagBins::of(&masked_covariance(&trimmed.residual, dem.cols(), max_lag), cell_m, max_lag_m);
        if bins.len() < BINS_MIN {
            return Err(FitError::TooFewLags { found: bins.len(), needed: BINS_MIN });
        }
        Ok(Self { settings, cols: dem.cols(), window, cell_m, max_lag, max_lag_m, detrended, trimmed, bins })
    }

    /// The estimator as a function of the model.
    fn expectation(&self) -> Expectation<'_> {
        let cells = DetrendedCells {
            values: &self.detrended.trusted,
            cols: self.cols,
            count: &self.detrended.count,
            residual: &self.detrended.residual,
        };
        Expectation {
            filter: DetrendFilter::new(self.window, self.cell_m, self.max_lag),
            partial: PartialWindows::new(&cells, self.window, self.cell_m, &self.bins),
            bins: &self.bins,
            threshold_m: self.trimmed.threshold_m,
            cells: self.trimmed.detrended,
        }
    }

    /// Width of the window, m (the mean of both ways).
    fn window_m(&self) -> f64 {
        let [x, y] = self.window.size_m(self.cell_m);
        0.5 * (x + y)
    }

    fn covariance(&self, log: &[f64]) -> Covariance {
        Covariance::from_logarithms(self.settings.model, log[0], log[1])
    }

    /// Bounds of ln sigma and ln b.
    fn bounds(&self) -> [(f64, f64); 2] {
        let sigma = libm::log(self.bins.covariance_m2[0]) / 2.0;
        let cell = self.cell_m[0].min(self.cell_m[1]);
        [(sigma - 5.0, sigma + 7.0), (libm::log(0.05 * cell), libm::log(RANGE_MAX_WINDOWS * self.window_m()))]
    }

    /// Ordinary least squares of the model itself at the mean lags.
    fn naive(&self) -> Estimate {
        let scale = self.bins.covariance_m2[0];
        let at_lags = |model: &Covariance| -> Vec<f64> { self.bins.lag_m.iter().map(|&lag| model.at(lag)).collect() };
        let start = [libm::log(scale) / 2.0, libm::log(0.25 * self.max_lag_m)];
        let end = minimise(&start, &self.bounds(), |p| {
            difference(&at_lags(&self.covariance(p)), &self.bins.covariance_m2).iter().map(|d| d / scale).collect()
        });
        let model = self.covariance(&end.at);
        Estimate { binned: at_lags(&model), model, iterations: end.steps, objective: None }
    }

    /// Generalised least squares of the model as the estimator sees it.
    fn corrected(&self, naive: &Estimate) -> Estimate {
        let expectation = self.expectation();
        let start = [libm::log(1.2 * naive.model.sigma_m), libm::log(1.5 * naive.model.range_m)];
        let mut end = self.search(&start, &expectation, None);
        let mut iterations = end.steps;
        let mut weights = None;
        for _ in 0..WEIGHTING_ROUNDS {
            weights = Cholesky::new(&expectation.covariance(&self.covariance(&end.at)), self.bins.len());
            let next = self.search(&end.at, &expectation, weights.as_ref());
            iterations += next.steps;
            let moved = difference(&next.at, &end.at).iter().fold(0.0, |m, d| f64::max(m, d.abs()));
            end = next;
            if moved < 1e-6 {
                break;
            }
        }
        let objective = weights.map(|w| self.objective(&end, &expectation, &w));
        let model = self.covariance(&end.at);
        Estimate { binned: expectation.mean(&model), model, iterations, objective }
    }

    fn search(&self, start: &[f64], expectation: &Expectation, weights: Option<&Cholesky>) -> Minimum {
        let scale = self.bins.covariance_m2[0];
        minimise(start, &self.bounds(), |p| {
            let misfit = difference(&expectation.mean(&self.covariance(p)), &self.bins.covariance_m2);
            match weights {
                Some(w) => w.whiten(&misfit),
                None => misfit.iter().map(|d| d / scale).collect(),
            }
        })
    }

    /// The minimum beside the best fit with three times its range.
    fn objective(&self, end: &Minimum, expectation: &Expectation, weights: &Cholesky) -> Objective {
        let [sigma_bounds, range_bounds] = self.bounds();
        let far = (end.at[1] + libm::log(3.0)).min(range_bounds.1);
        let along = minimise(&[end.at[0] + 0.5 * (far - end.at[1])], &[sigma_bounds], |p| {
            weights.whiten(&difference(&expectation.mean(&self.covariance(&[p[0], far])), &self.bins.covariance_m2))
        });
        Objective { value: end.value, rise_at_3b: along.value - end.value }
    }
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x - y).collect()
}

#[cfg(test)]
mod tests;
