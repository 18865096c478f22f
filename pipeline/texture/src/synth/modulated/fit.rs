//! Variance and range of the amplitude from the logarithms of wavelets.
//!
//! The residual is mapped to products `y = A G` first, by the quantiles that a log variance v implies ([`transform::quantiles`]): whatever
//! monotone map the heights went through drops out. Their mixed differences d over blocks of 2 x 2 cells (Haar's diagonal wavelet, 4 x 4 cells in all), which
//! no slope reaches and white noise little, are normal given A, with a standard deviation that is proportional to A where patches are wider. Hence
//!
//! `Cov(ln |d|, ln |d'|) = v rho~(h) + asin^2(r_d(h)) / 2`, `r_d(h) = c_d(h) exp(v (1 - rho(h)))`
//!
//! rho~ the correlation of ln A averaged over the cells of d and d', c_d the correlation of d. The second term is exact for normal variables:
//! a quarter of the sum of `(2 r)^(2 k) / (k^2 C(2 k, k))`, from `<ln x^2 He_2k(x)> = (-1)^(k - 1) 2^k (k - 1)!`. v is the slope of a least-squares fit over all lags but 0,
//! at the range with the least misfit. The mean that is subtracted is that of a finite site: rho~ is taken less its mean over all pairs of cells.
//! This v must be the one that y was made with, which a secant iteration finds.
//!
//! On smooth ground the map to products dominates d: with f the map, d has the term `f'' z_x z_y` beside `f' z_xy`, so that almost any v reproduces
//! itself. The smoothness of the ground is measured on normal products (v = 0): `Q = <d_x^2> <d_y^2> / (256 <d^2> <y^2>)`, where d_x and d_y are the
//! differences of the same blocks along rows and along columns. Q is 1 for waves much longer than the blocks, and 1/16 for independent cells.
//!
//! Where Q is above 0.5, v is compared with v_0, the log variance found in normal products: v_0 / v is 1 less the mean slope of the iteration between 0
//! and v. If v_0 is less than a quarter of v, or v is the largest allowed, v_0 is taken instead, and the difference counts as error. On rough ground
//! with strong patches the ratio is just as small, but v is right. With numpy, 256 x 256 cells, patches of 8 cells:
//!
//! | ground | truth | Q | v by the iteration | v_0 | v_0 / v |
//! |---|---|---|---|---|---|
//! | exponential, 4 cells | 0.1, 0.3, 0.8, 1.6 | 0.23 to 0.24 | 0.09 to 0.11, 0.27 to 0.35, 0.72 to 0.90, 1.3 to 1.9 | 0.06 to 0.08, 0.15 to 0.17, 0.29 to 0.33, 0.41 to 0.47 | 0.72 to 0.76, 0.48 to 0.59, 0.35 to 0.43, 0.24 to 0.32 |
//! | Matern 3/2, 4 cells | 0.3, 0.8, 1.6 | 0.37 to 0.41 | 0.29 to 0.32, 0.75 to 1.08, 1.5 to 2.0 | 0.17, 0.30 to 0.34, 0.45 to 0.50 | 0.52 to 0.60, 0.32 to 0.44, 0.25 to 0.33 |
//! | normal field low-passed over 2 cells | 0, 0.3 | 0.69 to 0.75 | 0.00 to 0.01, 0.33 to 0.40 | 0.00 to 0.01, 0.17 to 0.19 | , 0.41 to 0.54 |
//! | over 4 cells | 0, 0.3, 0.8 | 0.87 to 0.93, 0.70 to 0.72, 0.53 to 0.56 | 0.30 to 0.98, 1.24 to 2.00, 2.00 | 0.02 to 0.10, 0.29 to 0.43, 0.55 to 0.79 | 0.02 to 0.22, 0.15 to 0.27, 0.28 to 0.39 |
//! | over 6 cells | 0, 0.3 | 0.88 to 1.01, 0.65 to 0.70 | 0.62 to 1.66, 1.64 to 2.00 | 0.05 to 0.23, 0.25 to 0.45 | 0.04 to 0.25, 0.12 to 0.28 |
//!
//! (3 to 8 fields each.) On smooth ground v_0 itself is near the truth, but normal ground low-passed over 6 cells or more gives up to 0.3.
//!
//! The standard error counts patches: n = the site's cells over those of `rho^2`, and of the squared correlation of y, whose quantiles are as uncertain;
//! `sqrt(2 / n) (v + pi^2 / 8 / cells of a patch) / (1 - s)`, s the slope of the iteration: the last one where v hardly matters, otherwise the mean, for which
//! 1 - s is v_0 / v. On smooth ground where that is below a third, the error is at least v - v_0.

use super::transform::{self, Transform};
use super::{
    ERROR_MAX, INCREMENT_RATIO_MAX, LOG_VARIANCE_MAX, Modulated, NOTED_MIN, RANGE_CELLS_FITTED, RANGE_CELLS_MIN,
};
use crate::covariance::masked_covariance;
use crate::synth::statistics::{lags, spectrum, tails};
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid, sums};
use sastrugi_schemas::statistics::{Modulation, Statistics};
use std::f64::consts::PI;

/// Longest lag of the flatness, cells.
const LAG_MAX: usize = 64;
/// Ranges that are tried, in equal steps of their logarithm.
const RANGES: usize = 64;
/// Lags of the logarithms reach this share of a side,
const LAG_SHARE: usize = 3;
/// and ranges this share.
const RANGE_SHARE: f64 = 1.0 / 6.0;
/// Rows and columns of cells that a mixed difference holds.
const SUPPORT: usize = 4;
/// Log variance and range, in the longer side of a cell, from which the iteration starts.
const START: [f64; 2] = [0.3, 8.0];
/// Most steps of the iteration.
const STEPS: usize = 8;
/// Slopes of the iteration are clamped to this range.
const SLOPES: [f64; 2] = [-0.5, 0.75];
/// Ground is smooth where [`smoothness`] is above this.
const SMOOTH: f64 = 0.5;
/// Least ratio of the log variances of normal and of implied products on smooth ground, if patches are visible: below the first the latter is not
/// accepted, below the second it is not well known.
const SHOWN_SHARES: [f64; 2] = [0.25, 1.0 / 3.0];
/// Change of the log variance at which the iteration ends: absolute, and relative.
const TOLERANCES: [f64; 2] = [2e-3, 5e-3];
/// Smallest magnitude of a difference whose logarithm is told apart, over the mean magnitude.
const FLOOR: f64 = 1e-3;
/// Rows and columns of the torus on which the error of the covariance is foreseen.
const SIDE: usize = 320;
/// Bisections of the log variance that keeps the covariance.
const BISECTIONS: usize = 6;

/// The amplitude of a residual whose heights and covariance `statistics` holds already.
pub fn measure(residual: &Grid, statistics: &Statistics) -> Modulation {
    let longest = lags::reach(&statistics.covariance).into_iter().min().unwrap_or(1).clamp(1, LAG_MAX);
    let octaves = std::iter::successors(Some(1_usize), |lag| Some(lag * 2)).take_while(|lag| *lag <= longest);
    let measured: Vec<(usize, f64)> =
        octaves.map(|lag| (lag, flatness_at(residual, lag))).take_while(|(_, f)| f.is_finite() && *f > 0.0).collect();
    let site = Site { residual, statistics };
    let found = site.solved();
    Modulation {
        log_variance: site.keeping_covariance(found.log_variance, found.range),
        measured_log_variance: found.log_variance,
        log_variance_error: found.error,
        range_m: found.range * site.unit_m(),
        patches: found.patches,
        lags: measured.iter().map(|(lag, _)| *lag as u32).collect(),
        flatness: measured.iter().map(|(_, flatness)| *flatness).collect(),
    }
}

/// Flatness `<d^4> / <d^2>^2` of increments of a normal field times a log-normal amplitude, over a lag at which the product has the
/// correlation `c` and the logarithm of the amplitude the correlation `rho`.
///
/// With r the correlation of the normal field, `c = r exp(-s^2 (1 - rho))`, and the moments
/// `<A^p A'^q> = exp(s^2 (p^2 + q^2 + 2 p q rho - 2 p - 2 q) / 2)`.
///
/// ```
/// use sastrugi_texture::synth::modulated::flatness;
///
/// // Without modulation it is 3 at every lag; neighbours in wide patches have 3 exp(4 s^2).
/// assert!((flatness(0.6, 0.3, 0.0) - 3.0).abs() < 1e-12);
/// assert!((flatness(0.6, 1.0, 0.5) / 3.0 - 7.389_056).abs() < 1e-6);
/// ```
pub fn flatness(c: f64, rho: f64, log_variance: f64) -> f64 {
    let moment =
        |p: f64, q: f64| libm::exp(0.5 * log_variance * (p * p + q * q + 2.0 * p * q * rho - 2.0 * p - 2.0 * q));
    let r = c * libm::exp(log_variance * (1.0 - rho));
    let fourth = 6.0 * moment(4.0, 0.0) - 24.0 * r * moment(3.0, 1.0) + 6.0 * (1.0 + 2.0 * r * r) * moment(2.0, 2.0);
    let second = 2.0 * (1.0 - c);
    fourth / (second * second)
}

/// Flatness of the increments of a surface over `lag` cells, eastwards and northwards together; NaN without any.
pub fn flatness_at(z: &Grid, lag: usize) -> f64 {
    let axes = [[0, lag], [lag, 0]].map(|[south, east]| {
        let rows: Vec<[f64; 3]> = (south..z.rows())
            .map(|r| {
                let (here, there) = (z.row(r), &z.row(r - south)[east.min(z.cols())..]);
                let increments = here.iter().zip(there).map(|(a, b)| b - a).filter(|d| d.is_finite());
                increments.fold([0.0; 3], |[n, second, fourth], d| [n + 1.0, second + d * d, fourth + d * d * d * d])
            })
            .collect();
        let [n, second, fourth] = [0, 1, 2].map(|k| sums::sum(&rows.iter().map(|m| m[k]).collect::<Vec<_>>()));
        [second / n, fourth / n]
    });
    let [second, fourth] = [0, 1].map(|k| 0.5 * (axes[0][k] + axes[1][k]));
    fourth / (second * second)
}

/// A residual and its statistics.
struct Site<'a> {
    residual: &'a Grid,
    statistics: &'a Statistics,
}

/// An amplitude, and how well it is known.
struct Found {
    log_variance: f64,
    /// Range in the longer side of a cell.
    range: f64,
    /// Standard error of the log variance.
    error: f64,
    /// Standard deviation of the log variance at a given map to products.
    spread: f64,
    /// Number of independent patches that the site holds.
    patches: f64,
}

/// A least-squares fit to the covariance of logarithms.
struct Step {
    log_variance: f64,
    range: f64,
    /// Mean of the squared correlation of ln A over all pairs of cells.
    patch_share: f64,
}

/// A lag and what is measured at it.
struct Lag {
    /// Rows and columns, without sign.
    at: [usize; 2],
    /// Pairs of cells at this lag and at its opposite.
    pairs: f64,
    /// Covariance of the logarithms.
    logs: f64,
    /// Correlation of the mixed differences.
    differences: f64,
}

impl Site<'_> {
    /// The longer side of a cell, m.
    fn unit_m(&self) -> f64 {
        self.statistics.cell_m[0].max(self.statistics.cell_m[1])
    }

    /// A range in the longer side of a cell as cells along columns and along rows.
    fn range_cells(&self, range: f64) -> [f64; 2] {
        let [dx, dy] = self.statistics.cell_m;
        [dy, dx].map(|side| range * self.unit_m() / side)
    }

    /// Largest lags, rows and columns, cells.
    fn reach(&self) -> [usize; 2] {
        let longest = self.range_cells(RANGE_CELLS_FITTED);
        let sides = [self.residual.rows(), self.residual.cols()];
        [0, 1].map(|axis| (longest[axis].ceil() as usize).min(sides[axis] / LAG_SHARE).max(1))
    }

    /// Ranges that the site may show.
    fn ranges(&self) -> Vec<f64> {
        let [dx, dy] = self.statistics.cell_m;
        let side = (self.residual.rows() as f64 * dy).min(self.residual.cols() as f64 * dx) / self.unit_m();
        let longest = (RANGE_SHARE * side).clamp(RANGE_CELLS_MIN, RANGE_CELLS_FITTED);
        let step = libm::log(longest / RANGE_CELLS_MIN) / (RANGES - 1) as f64;
        (0..RANGES).map(|k| RANGE_CELLS_MIN * libm::exp(step * k as f64)).collect()
    }

    /// The log variance that is found in the products that it implies, or in normal ones if that one is not accepted.
    fn solved(&self) -> Found {
        match self.iterated() {
            Some(found) => self.believed(found),
            None => Found { log_variance: 0.0, range: RANGE_CELLS_MIN, error: 0.0, spread: 0.0, patches: 0.0 },
        }
    }

    /// The modulation found, unless the map to products alone may explain it; with the error that such a map leaves.
    fn believed(&self, found: Found) -> Found {
        let normal = (found.log_variance >= NOTED_MIN).then(|| self.step(0.0, found.range)).flatten();
        let Some(normal) = normal else { return found };
        let shown = normal.log_variance / found.log_variance;
        // No more than what a log variance can be.
        let error = (found.spread / shown).min(LOG_VARIANCE_MAX);
        let is_smooth = smoothness(&self.products(0.0)) > SMOOTH;
        if !is_smooth || (shown >= SHOWN_SHARES[1] && found.log_variance < LOG_VARIANCE_MAX) {
            return Found { error, ..found };
        }
        let error = error.max(found.log_variance - normal.log_variance);
        if shown >= SHOWN_SHARES[0] && found.log_variance < LOG_VARIANCE_MAX {
            return Found { error, ..found };
        }
        Found {
            log_variance: normal.log_variance,
            range: normal.range,
            error,
            patches: 1.0 / normal.patch_share,
            ..found
        }
    }

    /// The log variance that is found in the products that it implies; `None` if the residual has no mixed differences, or none but 0.
    fn iterated(&self) -> Option<Found> {
        let [mut before, range] = START;
        let mut step = self.step(before, range)?;
        let (mut found_before, mut now, mut slope) = (step.log_variance, step.log_variance, 0.0);
        for _ in 0..STEPS {
            step = self.step(now, step.range)?;
            if (now - before).abs() > 1e-9 {
                slope = ((step.log_variance - found_before) / (now - before)).clamp(SLOPES[0], SLOPES[1]);
            }
            let next = (now + (step.log_variance - now) / (1.0 - slope)).clamp(0.0, LOG_VARIANCE_MAX);
            (before, found_before) = (now, step.log_variance);
            let change = (next - now).abs();
            now = next;
            if change < TOLERANCES[0] + TOLERANCES[1] * now {
                break;
            }
        }
        let shares = step.patch_share + share_of_heights(&self.products(now), self.reach());
        let [down, across] = self.range_cells(step.range);
        let own_noise = PI * PI / 8.0 / (0.5 * PI * down * across);
        let spread = (2.0 * shares).sqrt() * (now + own_noise);
        Some(Found {
            log_variance: now,
            range: step.range,
            error: spread / (1.0 - slope),
            spread,
            patches: 1.0 / step.patch_share,
        })
    }

    /// The residual as products `A G`.
    fn products(&self, log_variance: f64) -> Grid {
        let Statistics { probabilities, heights_m, cells, .. } = self.statistics;
        let (from, to) = distinct(heights_m, &transform::quantiles(probabilities, *cells, log_variance));
        self.residual.map(|z| if z.is_finite() { tails::interpolated(&from, &to, z) } else { f64::NAN })
    }

    /// The amplitude in the products that a log variance implies; the range is that of the correlation between differences.
    fn step(&self, log_variance: f64, range: f64) -> Option<Step> {
        let differences = mixed_differences(&self.products(log_variance));
        let lags = measured_lags(&differences, self.reach())?;
        let [down, across] = self.lines(range, |line, k| line(k));
        let wanted: Vec<f64> = lags
            .iter()
            .map(|lag| {
                let rho = down[lag.at[0]] * across[lag.at[1]];
                let r = (lag.differences * libm::exp(log_variance * (1.0 - rho))).clamp(-1.0, 1.0);
                lag.logs - 0.5 * libm::asin(r) * libm::asin(r)
            })
            .collect();
        let fits = self.ranges().into_iter().map(|range| self.at_range(&lags, &wanted, range));
        let (_, log_variance, range) = fits.reduce(|best, next| if next.0 < best.0 { next } else { best })?;
        let squared = self.lines(range / 2f64.sqrt(), |line, k| line(k));
        let log_variance = log_variance.min(LOG_VARIANCE_MAX);
        Some(Step { log_variance, range, patch_share: share(&lags, &squared) })
    }

    /// Misfit and log variance of a range, and the range.
    fn at_range(&self, lags: &[Lag], wanted: &[f64], range: f64) -> (f64, f64, f64) {
        let mean = share(lags, &self.lines(range, |line, k| line(k)));
        // Two differences hold each other's cells at these distances, in rows and in columns.
        let [down, across] = self.lines(range, |line, k| {
            let pair = |apart: f64| line(k - apart) + line(k + apart);
            (4.0 * line(k) + 3.0 * pair(1.0) + 2.0 * pair(2.0) + pair(3.0)) / 16.0
        });
        let [gg, ge, ee] = lags.iter().zip(wanted).skip(1).fold([0.0; 3], |[gg, ge, ee], (lag, e)| {
            let g = down[lag.at[0]] * across[lag.at[1]] - mean;
            [gg + g * g, ge + g * e, ee + e * e]
        });
        let log_variance = if gg > 0.0 { (ge / gg).max(0.0) } else { 0.0 };
        (ee - log_variance * ge, log_variance, range)
    }

    /// A function of the correlation of ln A along columns and along rows, at each lag up to the largest.
    fn lines(&self, range: f64, f: impl Fn(&dyn Fn(f64) -> f64, f64) -> f64) -> [Vec<f64>; 2] {
        let (ranges, reach) = (self.range_cells(range), self.reach());
        [0, 1].map(|axis| {
            let line = |k: f64| libm::exp(-(k / ranges[axis]) * (k / ranges[axis]));
            (0..=reach[axis]).map(|k| f(&line, k as f64)).collect()
        })
    }

    /// A log variance, or the part of it with which the covariance of a texture can be kept.
    fn keeping_covariance(&self, log_variance: f64, range: f64) -> f64 {
        let s = self.statistics;
        let covariance_m2 = spectrum::covariance_on_torus(s, [SIDE; 2]);
        let keeps = |log_variance: f64| {
            let variance_m2 = s.covariance.variance();
            let transform = Transform::new(&s.probabilities, &s.heights_m, s.cells, variance_m2, log_variance);
            let table = transform.normal_correlation();
            let shapes = [[SIDE; 2]; 2];
            let range_cells = self.range_cells(range);
            let made = Modulated::of_transform(&covariance_m2, shapes, transform, &table, log_variance, range_cells);
            made.covariance_error() <= ERROR_MAX && made.increment_ratio(&covariance_m2) <= INCREMENT_RATIO_MAX
        };
        if log_variance == 0.0 || keeps(log_variance) {
            return log_variance;
        }
        let halved = (0..BISECTIONS).fold([0.0, log_variance], |[low, high], _| {
            let middle = 0.5 * (low + high);
            if keeps(middle) { [middle, high] } else { [low, middle] }
        });
        halved[0]
    }
}

/// Distinct heights and the mean product of each.
fn distinct(heights_m: &[f64], products: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let pairs: Vec<(f64, f64)> = heights_m.iter().copied().zip(products.iter().copied()).collect();
    let mean = |same: &[(f64, f64)]| (same[0].0, sums::mean(&same.iter().map(|(_, y)| *y).collect::<Vec<f64>>()));
    pairs.chunk_by(|a, b| a.0 == b.0).map(mean).unzip()
}

/// Haar's diagonal wavelet of 4 x 4 cells: the mixed difference of four blocks of 2 x 2 cells; NaN around cells without data. At least 4 x 4 cells.
pub(super) fn mixed_differences(y: &Grid) -> Grid {
    signed_sums(y, [-1.0; 2])
}

/// Sums over 4 x 4 cells, the two southern rows and the two eastern columns with these signs; NaN around cells without data. At least 4 x 4 cells.
fn signed_sums(y: &Grid, [south, east]: [f64; 2]) -> Grid {
    let geometry = Geometry { rows: y.rows() + 1 - SUPPORT, cols: y.cols() + 1 - SUPPORT, ..y.geometry };
    let line = |r: usize| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| y.row(r + k));
        let down: Vec<f64> = (0..y.cols()).map(|k| (a[k] + b[k]) + south * (c[k] + d[k])).collect();
        (0..geometry.cols).map(move |k| (down[k] + down[k + 1]) + east * (down[k + 2] + down[k + 3]))
    };
    Grid::new(geometry, (0..geometry.rows).into_par_iter().flat_map_iter(line).collect())
}

/// Smoothness Q of a surface with mean 0: the product of its two slopes relative to its mixed difference, from 1/16 for independent cells to 1 for waves
/// much longer than four cells.
pub(super) fn smoothness(y: &Grid) -> f64 {
    let mean_square = |z: &Grid| sums::mean(&sums::finite(&z.map(|v| v * v).values));
    let [southwards, eastwards, mixed] =
        [[-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].map(|signs| mean_square(&signed_sums(y, signs)));
    let cells = (SUPPORT * SUPPORT) as f64;
    southwards * eastwards / (cells * cells * mixed * mean_square(y))
}

/// Logarithms of magnitudes about their mean; `None` if all are 0 or there are none.
fn logarithms(differences: &Grid) -> Option<Grid> {
    let mean_of = |values: &Grid| sums::mean(&sums::finite(&values.values));
    let floor = FLOOR * mean_of(&differences.map(f64::abs));
    if floor.is_nan() || floor == 0.0 {
        return None;
    }
    let logs = differences.map(|d| if d.is_finite() { libm::log(d.abs().max(floor)) } else { f64::NAN });
    let mean = mean_of(&logs);
    Some(logs.map(|v| v - mean))
}

/// Covariances of logarithms and of differences at half of all lags, the first of which is 0.
fn measured_lags(differences: &Grid, reach: [usize; 2]) -> Option<Vec<Lag>> {
    let logs = logarithms(differences)?;
    let [logs, differences] = [&logs, differences].map(|grid| masked_covariance(&grid.values, grid.cols(), reach));
    let variance = differences.covariance(0, 0)?;
    let at = |(row, col): (isize, isize)| {
        let (pairs, sum) = logs.at(row, col).filter(|(pairs, _)| *pairs > 0)?;
        Some(Lag {
            at: [row.unsigned_abs(), col.unsigned_abs()],
            pairs: both_ways((row, col)) * pairs as f64,
            logs: sum / pairs as f64,
            differences: differences.covariance(row, col)? / variance,
        })
    };
    Some(logs.lags().filter_map(at).collect())
}

/// A lag and its opposite; one at lag 0.
fn both_ways(lag: (isize, isize)) -> f64 {
    if lag == (0, 0) { 1.0 } else { 2.0 }
}

/// Mean of a correlation over all pairs of cells; it is 0 beyond the lags.
fn share(lags: &[Lag], [down, across]: &[Vec<f64>; 2]) -> f64 {
    let cells = lags[0].pairs;
    lags.iter().map(|lag| lag.pairs * down[lag.at[0]] * across[lag.at[1]]).sum::<f64>() / (cells * cells)
}

/// Mean of the squared correlation of products over all pairs of cells.
fn share_of_heights(products: &Grid, reach: [usize; 2]) -> f64 {
    let found = masked_covariance(&products.values, products.cols(), reach);
    let Some((cells, squares)) = found.at(0, 0) else { return 0.0 };
    let of_lag = |(row, col): (isize, isize)| {
        let (pairs, sum) = found.at(row, col).filter(|(pairs, _)| *pairs > 0)?;
        let correlation = sum / pairs as f64 / (squares / cells as f64);
        Some(both_ways((row, col)) * pairs as f64 * correlation * correlation)
    };
    found.lags().filter_map(of_lag).sum::<f64>() / (cells as f64 * cells as f64)
}
