//! Variance and range of the amplitude from the flatness of increments.

use super::transform::{NormalCorrelation, Transform};
use super::{LOG_VARIANCE_MAX, Modulated, RANGE_CELLS_FITTED, RANGE_CELLS_MIN};
use crate::synth::statistics::{lags, spectrum};
use sastrugi_numeric::{Geometry, Grid, Streams, sums};
use sastrugi_schemas::statistics::{Modulation, Statistics};

/// Rows and columns of the fields that are synthesised for a candidate.
const SIDE: usize = 320;
/// Longest lag of the flatness, cells.
const LAG_MAX: usize = 64;
/// Variances of the logarithm and ranges, cells, of the first candidates, beside 0.
const LOG_VARIANCES: [f64; 7] = [0.1, 0.25, 0.45, 0.7, 1.0, 1.4, 1.9];
const RANGES: [f64; 6] = [RANGE_CELLS_MIN, 3.0, 6.0, 12.0, 24.0, RANGE_CELLS_FITTED];
/// Largest error of the covariance that a candidate may have, as a share of the variance,
const ERROR_MAX: f64 = 0.05;
/// and largest variance of its one-cell increments, over the measured one.
const INCREMENT_RATIO_MAX: f64 = 1.1;
/// Rounds of refinement: each moves to the best neighbour, or halves the steps.
const ROUNDS: usize = 5;
/// First steps of the refinement: of the variance, and of the logarithm of the range.
const STEPS: [f64; 2] = [0.12, 0.35];

/// The amplitude of a residual whose heights, probabilities and covariance `statistics` holds already.
pub fn measure(residual: &Grid, statistics: &Statistics) -> Modulation {
    let longest = lags::reach(&statistics.covariance).into_iter().min().unwrap_or(1).clamp(1, LAG_MAX);
    let octaves = std::iter::successors(Some(1_usize), |lag| Some(lag * 2)).take_while(|lag| *lag <= longest);
    let measured: Vec<(usize, f64)> =
        octaves.map(|lag| (lag, flatness_at(residual, lag))).take_while(|(_, f)| f.is_finite() && *f > 0.0).collect();
    let covariance_m2 = spectrum::covariance_on_torus(statistics, [SIDE; 2]);
    let search = Search { statistics, covariance_m2: &covariance_m2, measured: &measured };
    let best = search.best();
    Modulation {
        log_variance: best.log_variance,
        range_m: best.range * search.unit_m(),
        lags: measured.iter().map(|(lag, _)| *lag as u32).collect(),
        flatness: measured.iter().map(|(_, flatness)| *flatness).collect(),
        fitted_flatness: best.flatness,
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

/// A variance and a range, and what they give.
#[derive(Clone)]
struct Candidate {
    log_variance: f64,
    /// Range in the longer side of a cell.
    range: f64,
    flatness: Vec<f64>,
    /// Sum of squared differences of the logarithms of the flatness.
    misfit: f64,
}

/// What all candidates with a variance of the logarithm share.
struct Tables {
    log_variance: f64,
    transform: Transform,
    correlation: NormalCorrelation,
}

struct Search<'a> {
    statistics: &'a Statistics,
    /// Covariance on the torus of the candidates, m2.
    covariance_m2: &'a [f64],
    /// Lags in cells, and the flatness.
    measured: &'a [(usize, f64)],
}

impl Search<'_> {
    /// The longer side of a cell, m.
    fn unit_m(&self) -> f64 {
        self.statistics.cell_m[0].max(self.statistics.cell_m[1])
    }

    fn tables(&self, log_variance: f64) -> Tables {
        let s = self.statistics;
        let transform = Transform::new(&s.probabilities, &s.heights_m, s.cells, s.covariance.variance(), log_variance);
        Tables { log_variance, correlation: transform.normal_correlation(), transform }
    }

    fn candidate(&self, tables: &Tables, range: f64) -> Candidate {
        let [dx, dy] = self.statistics.cell_m;
        let range_cells = [dy, dx].map(|side| range * self.unit_m() / side);
        let Tables { log_variance, transform, correlation } = tables;
        let shapes = [[SIDE; 2]; 2];
        let made = Modulated::of_transform(
            self.covariance_m2,
            shapes,
            transform.clone(),
            correlation,
            *log_variance,
            range_cells,
        );
        // The same random numbers for every candidate, so that only the parameters differ.
        let heights_m = made.make(&Streams::for_seed(0, "modulation-fit"));
        let field = Grid::new(Geometry::square(SIDE, SIDE, 1.0), heights_m);
        let flatness: Vec<f64> = self.measured.iter().map(|(lag, _)| flatness_at(&field, *lag)).collect();
        let off = |(made, (_, wanted)): (&f64, &(usize, f64))| libm::log(made / wanted);
        let keeps_covariance =
            made.covariance_error() <= ERROR_MAX && made.increment_ratio(self.covariance_m2) <= INCREMENT_RATIO_MAX;
        let misfit = match keeps_covariance {
            true => flatness.iter().zip(self.measured).map(off).map(|d| d * d).sum(),
            false => f64::INFINITY,
        };
        Candidate { log_variance: *log_variance, range, flatness, misfit }
    }

    /// The best candidate: of a grid, then of its neighbourhood.
    fn best(&self) -> Candidate {
        let mut best = self.candidate(&self.tables(0.0), RANGES[0]);
        for log_variance in LOG_VARIANCES {
            let tables = self.tables(log_variance);
            best = RANGES.iter().map(|&range| self.candidate(&tables, range)).fold(best, better);
        }
        let mut steps = STEPS;
        for _ in 0..ROUNDS {
            let next = self.around(&best, steps).into_iter().fold(best.clone(), better);
            if next.misfit == best.misfit {
                steps = steps.map(|step| 0.5 * step);
            }
            best = next;
        }
        best
    }

    /// Four neighbours of a candidate: smaller and larger variances, shorter and longer ranges.
    fn around(&self, centre: &Candidate, [vary, stretch]: [f64; 2]) -> [Candidate; 4] {
        let [below, here, above] =
            [-vary, 0.0, vary].map(|by| self.tables((centre.log_variance + by).clamp(0.0, LOG_VARIANCE_MAX)));
        let range = |by: f64| (centre.range * libm::exp(by)).clamp(RANGE_CELLS_MIN, RANGES[RANGES.len() - 1]);
        [
            self.candidate(&below, centre.range),
            self.candidate(&above, centre.range),
            self.candidate(&here, range(-stretch)),
            self.candidate(&here, range(stretch)),
        ]
    }
}

/// The candidate with the smaller misfit; the first if equal.
fn better(a: Candidate, b: Candidate) -> Candidate {
    if b.misfit < a.misfit { b } else { a }
}
