//! Mean and covariance of the binned covariance that a model predicts after detrending and trimming.
//!
//! Mean: the model's covariance is passed through the moving average ([`crate::covariance::filtered`]), then, lag by lag, through
//! trimming ([`crate::covariance::trimmed`]), with pairs that have partial windows treated separately, and is then binned like the data.
//!
//! Covariance of two estimates at lags h and h' for a normal field (Bartlett, 1946), for N cells used:
//! `B[C](h, h') = 1 / N * [Q(h - h') + Q(h + h')]`, `Q = sum over u of C(u) C(u + .)`.
//! Trimming turns the products into other functions of the four heights. Their second-order part (second Wiener
//! chaos) is the response of the trimmed covariance to small changes of the untrimmed one, `J B[C_f] J'`, J the derivative of
//! the mean with respect to C_f(h) and C_f(0). The higher-order parts are approximated by treating the products of the trimmed
//! field as those of a normal field, minus their second-order part: `(B[s^2 N] - B[a_1^2 C_f]) / (P P)` (symbols of
//! [`crate::covariance::trimmed`]). At lag zero and 5 % this gives 0.770 s^4 per independent cell; the exact value is 0.735.
//!
//! Each bin is represented by at most [`BIN_LAGS`] of its lags.

use crate::covariance::Covariance;
use crate::covariance::bins::{LagBins, Member};
use crate::covariance::filtered::{DetrendFilter, LagField, Measurement};
use crate::covariance::partial::{ByDistance, PartialWindows};
use crate::covariance::trimmed::TrimmedNormal;
use rayon::prelude::*;

/// Most lags that represent a bin in the covariance of the bins.
const BIN_LAGS: usize = 16;
/// Relative step of the finite differences.
const DIFFERENCE: f64 = 1e-4;
/// Share of the variance added on the diagonal, so that rounding cannot make the matrix indefinite.
const RIDGE: f64 = 1e-9;
/// Standard error of the computed mean in each bin where windows are partial, over the variance. It limits the weight of the bins
/// of a smooth surface, which hardly scatter among themselves.
const MEAN_ERROR: f64 = 3e-4;

/// Expected bins and their covariance as a function of the model.
pub struct Expectation<'a> {
    /// The detrending filter for complete windows.
    pub filter: DetrendFilter,
    /// The same, out to the lags at which residuals are still correlated.
    pub wide: DetrendFilter,
    /// The correction for partial windows.
    pub partial: PartialWindows,
    /// The same for isotropic models of surfaces that are not blurred.
    pub partial_by_distance: ByDistance,
    /// The bins of the data.
    pub bins: &'a LagBins,
    /// Number of residuals before trimming.
    pub cells: usize,
}

impl Expectation<'_> {
    /// Expected covariance of each bin when residuals beyond `threshold_m` are trimmed, m2.
    pub fn mean(&self, model: &Covariance, threshold_m: f64) -> Vec<f64> {
        let measured = self.filter.measured_covariance(model);
        let members = &self.bins.members;
        // Of two opposite lags, bins have the one to the south.
        let rows = members.iter().map(|m| m.lag[0] as usize + 1).max().unwrap_or(1);
        let residual = self.filter.residual_rows(&measured, rows);
        let partial = self.correction(model, &measured);
        let complete = not_negative(residual.at([0, 0]));
        // Pairs with partial windows have their own variance and covariance, and trimming removes a different share of them.
        let shares = self.partial.shares();
        let added = |k: usize, bin: usize| if shares[bin] > 0.0 { partial[k] / shares[bin] } else { 0.0 };
        let maps = [complete, complete + added(0, 0)].map(|variance| trimmed(variance, threshold_m));
        let covariances: Vec<f64> = members.iter().map(|m| residual.at(m.lag)).collect();
        let whole = maps[0].moments_of_each(&covariances.iter().map(|c| correlation(*c, complete)).collect::<Vec<_>>());
        let variance = |bin: usize| not_negative(complete + added(0, bin));
        let in_partial = |(m, c): (&Member, &f64)| correlation(c + added(m.bin, m.bin), variance(m.bin));
        let in_partial: Vec<f64> = match self.partial.is_empty() {
            true => Vec::new(),
            false => members.iter().zip(&covariances).map(in_partial).collect(),
        };
        let [low, high] = maps.map(|map| map.moments_of_each(&in_partial));
        let mut mean = vec![0.0; self.bins.len()];
        for (k, (m, whole)) in members.iter().zip(whole).enumerate() {
            let share = shares[m.bin];
            let mut sums = [(1.0 - share) * complete * whole.0, (1.0 - share) * whole.1];
            if share > 0.0 {
                // The variance lies between those of the two maps: interpolate.
                let place = shares[0] / share;
                let between = |low: f64, high: f64| low + (high - low) * place;
                sums[0] += share * variance(m.bin) * between(low[k].0, high[k].0);
                sums[1] += share * between(low[k].1, high[k].1);
            }
            mean[m.bin] += m.weight * sums[0] / sums[1];
        }
        mean
    }

    /// Variance of the residual before trimming, m2.
    pub fn variance_m2(&self, model: &Covariance) -> f64 {
        let measured = self.filter.measured_covariance(model);
        self.filter.residual_covariance(&measured).at([0, 0]) + self.correction(model, &measured)[0]
    }

    /// Contribution of partial windows to each bin, m2.
    fn correction(&self, model: &Covariance, measured: &LagField) -> Vec<f64> {
        let Measurement { inner_scale_m, noise } = self.filter.measurement();
        if inner_scale_m > 0.0 || !model.is_isotropic() {
            return self.partial.correction(measured);
        }
        let (model, noise) = (model.by_distance(), noise.covariance());
        self.partial_by_distance.correction(|distance_m| model(distance_m) + noise.at_distance(distance_m))
    }

    /// Covariance of the bins' estimates, row-major, m4.
    pub fn covariance(&self, model: &Covariance, threshold_m: f64) -> Vec<f64> {
        let residual = self.wide.residual_within_reach(&self.wide.measured_covariance(model));
        let variance = residual.at([0, 0]);
        let trimmed = trimmed(variance, threshold_m);
        let products = residual.map_all(|all| {
            let moments = trimmed.moments_of_each(&all.iter().map(|c| c / variance).collect::<Vec<_>>());
            moments.into_iter().map(|(product, _)| variance * product).collect()
        });
        let linear = residual.map(|c| trimmed.linear_share() * c);
        let [second, product_orders, linear_order] =
            [&residual, &products, &linear].map(|field| self.bartlett(&self.wide.autocorrelation(field)));

        let bin_covariance = self.bins.average(|lag| residual.at(lag));
        let responses: Vec<[f64; 2]> =
            (0..self.bins.len()).map(|k| response(k, bin_covariance[k], variance, threshold_m)).collect();
        let pairs: Vec<f64> = bin_covariance.iter().map(|c| trimmed.moments(c / variance).1).collect();
        let n = self.bins.len();
        let mut matrix = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                let ([ci, vi], [cj, vj]) = (responses[i], responses[j]);
                let second_order =
                    ci * cj * second[i * n + j] + ci * vj * second[i * n] + vi * cj * second[j] + vi * vj * second[0];
                let higher = (product_orders[i * n + j] - linear_order[i * n + j]) / (pairs[i] * pairs[j]);
                matrix[i * n + j] = second_order + higher;
            }
        }
        let mean_error = if self.partial.is_empty() { 0.0 } else { MEAN_ERROR * variance };
        (0..n).for_each(|k| matrix[k * n + k] = matrix[k * n + k] * (1.0 + RIDGE) + mean_error * mean_error);
        matrix
    }

    /// `B` between all bins from `Q`.
    fn bartlett(&self, autocorrelation: &LagField) -> Vec<f64> {
        let n = self.bins.len();
        let lags: Vec<Vec<[isize; 2]>> =
            self.bins.members.chunk_by(|a, b| a.bin == b.bin).map(representatives).collect();
        let up_to = |i: usize| -> Vec<f64> {
            let mean = |j: usize| {
                mean_over_pairs(&lags[i], &lags[j], |[r, c], [s, d]| {
                    autocorrelation.at([r - s, c - d]) + autocorrelation.at([r + s, c + d])
                })
            };
            (0..=i).map(|j| mean(j) / self.cells as f64).collect()
        };
        let lower: Vec<Vec<f64>> = (0..n).into_par_iter().map(up_to).collect();
        let mut matrix = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                matrix[i * n + j] = lower[i][j];
                matrix[j * n + i] = lower[i][j];
            }
        }
        matrix
    }
}

fn trimmed(variance: f64, threshold_m: f64) -> TrimmedNormal {
    TrimmedNormal::new(threshold_m / not_negative(variance).sqrt())
}

/// A variance that rounding may have left below 0, where the window removes the surface.
fn not_negative(variance: f64) -> f64 {
    // `f64::max` would hide a NaN.
    if variance < 0.0 { 0.0 } else { variance }
}

/// A covariance over the variance; 0 where nothing varies.
fn correlation(covariance: f64, variance: f64) -> f64 {
    if variance == 0.0 { 0.0 } else { covariance / variance }
}

/// Derivatives of a bin's mean with respect to its own untrimmed covariance `c` and to the variance.
fn response(bin: usize, c: f64, variance: f64, threshold_m: f64) -> [f64; 2] {
    let mean = |c: f64, variance: f64| variance * trimmed(variance, threshold_m).covariance(c / variance);
    let step = DIFFERENCE * variance;
    if bin == 0 {
        let [above, below] = [variance + step, variance - step].map(|v| mean(v, v));
        return [0.0, (above - below) / (2.0 * step)];
    }
    let own = (mean(c, variance) - mean(c - step, variance)) / step;
    [own, (mean(c, variance + step) - mean(c, variance)) / step]
}

/// At most [`BIN_LAGS`] lags of a bin, evenly spread.
fn representatives(members: &[Member]) -> Vec<[isize; 2]> {
    let count = members.len().min(BIN_LAGS);
    (0..count).map(|k| members[(2 * k + 1) * members.len() / (2 * count)].lag).collect()
}

fn mean_over_pairs(a: &[[isize; 2]], b: &[[isize; 2]], f: impl Fn([isize; 2], [isize; 2]) -> f64) -> f64 {
    let total: f64 = a.iter().map(|&x| b.iter().map(|&y| f(x, y)).sum::<f64>()).sum();
    total / (a.len() * b.len()) as f64
}
