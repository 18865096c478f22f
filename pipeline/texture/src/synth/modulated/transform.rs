//! Heights from a normal field times a log-normal amplitude, and the covariance that follows.
//!
//! `z = T(A G)`, `A = exp(s W - s^2)`, G and W independent unit normal fields, so that `<A^2> = 1`. T maps the quantiles of `A G` to those of
//! the heights ([`quantiles`]) and is linear in the product between them, so that heights that are distributed as the product stay as they
//! are. Linear in the probability it would spread the heights beyond the last quantile evenly up to the extreme one: of a product with
//! `s^2 = 0.3` the kurtosis would be 20 instead of 10. With `T(A(w) g) = sum d_kj h_k(g) h_j(w)` in normalised Hermite polynomials,
//!
//! `C_z(r, rho) = sum over (k, j) != (0, 0) of d_kj^2 r^k rho^j`
//!
//! at a correlation r of G and rho of W (Mehler 1866, twice). [`Transform::normal_correlation`] solves it for r, and
//! [`Transform::height_correlation`] tabulates it.

use crate::synth::statistics::tails;
use sastrugi_statistics::normal;

/// Degrees of the series in G and in W; the variance beyond them is counted as that of the highest degree.
const DEGREES: [usize; 2] = [48, 16];
/// Points of the quadrature over G and over W, between plus and minus [`BOUND`].
const POINTS: [usize; 2] = [320, 64];
const BOUND: f64 = 7.0;
/// Tabulated heights on each side of 0, and the largest product, in standard deviations.
const HALF_NODES: usize = 2048;
const PRODUCT_MAX: f64 = 40.0;
/// Bisections of a quantile of the product, to 1e-9.
const QUANTILE_BISECTIONS: usize = 36;
/// Tabulated correlations of the heights or of G, and of W, denser towards 1, where those of neighbouring cells lie.
const CORRELATIONS: [usize; 2] = [257, 33];
/// Range of these correlations: from -1, and from 0, to 1.
const SPANS: [f64; 2] = [2.0, 1.0];
/// Bisections of a correlation.
const BISECTIONS: usize = 24;

/// Heights as a function of the product, and their covariance as a function of correlations.
#[derive(Clone)]
pub struct Transform {
    /// Heights at equally spaced products from `-PRODUCT_MAX` to `PRODUCT_MAX`, mean 0, m.
    heights_m: Vec<f64>,
    /// Variance of the heights, m2.
    variance_m2: f64,
    /// `d_kj^2`, m2; `squares[j][k]`.
    squares: Vec<Vec<f64>>,
}

impl Transform {
    /// Heights with the quantiles `quantiles_m` at `probabilities`, measured on so many `cells`, shifted to mean 0 and scaled to `variance_m2`,
    /// for an amplitude whose logarithm has the variance `log_variance`. At least two of the quantiles must differ.
    pub fn new(probabilities: &[f64], quantiles_m: &[f64], cells: u64, variance_m2: f64, log_variance: f64) -> Self {
        let amplitudes = amplitudes(log_variance);
        let products = quantiles(probabilities, cells, log_variance);
        let node = |k: usize| PRODUCT_MAX * (k as f64 / HALF_NODES as f64 - 1.0);
        let heights_m = (0..=2 * HALF_NODES).map(|k| tails::interpolated(&products, quantiles_m, node(k))).collect();
        let mut own = Self { heights_m, variance_m2: 0.0, squares: Vec::new() };
        let (mean_m, raw_m2) = own.moments(&amplitudes);
        let scale = (variance_m2 / raw_m2).sqrt();
        own.heights_m.iter_mut().for_each(|z| *z = (*z - mean_m) * scale);
        own.squares = own.expanded(&amplitudes);
        own.squares[0][0] = 0.0;
        let found_m2: f64 = own.squares.iter().flatten().sum();
        let last = &mut own.squares[DEGREES[1] - 1][DEGREES[0] - 1];
        *last += (variance_m2 - found_m2).max(0.0);
        own.variance_m2 = own.squares.iter().flatten().sum();
        own
    }

    /// The height of a product, m.
    pub fn height_m(&self, product: f64) -> f64 {
        let place = ((product / PRODUCT_MAX + 1.0) * HALF_NODES as f64).clamp(0.0, (2 * HALF_NODES) as f64);
        let low = (place as usize).min(2 * HALF_NODES - 1);
        self.heights_m[low] + (self.heights_m[low + 1] - self.heights_m[low]) * (place - low as f64)
    }

    /// Covariance of the heights at a correlation `r` of G and `rho` of W, m2.
    #[cfg(test)]
    pub fn covariance_m2(&self, r: f64, rho: f64) -> f64 {
        polynomial(&self.at_amplitude_correlation(rho), r)
    }

    /// Variance of the difference of two heights at a correlation `r` of G and `rho` of W, over that of the heights.
    pub fn increment(&self, r: f64, rho: f64) -> f64 {
        2.0 * (1.0 - polynomial(&self.at_amplitude_correlation(rho), r) / self.variance_m2)
    }

    /// Coefficients of the covariance as a polynomial in r.
    fn at_amplitude_correlation(&self, rho: f64) -> Vec<f64> {
        (0..DEGREES[0]).map(|k| self.squares.iter().rev().fold(0.0, |sum, of_j| sum * rho + of_j[k])).collect()
    }

    /// The correlation of G that gives the heights a correlation, as a table; 1 where none gives it.
    pub fn normal_correlation(&self) -> Correlations {
        self.tabulated(|coefficients, c| solve(coefficients, c * self.variance_m2))
    }

    /// The correlation of the heights by that of G, as a table.
    pub fn height_correlation(&self) -> Correlations {
        self.tabulated(|coefficients, r| polynomial(coefficients, r) / self.variance_m2)
    }

    /// A function of the coefficients at a correlation of W, and of another correlation.
    fn tabulated(&self, value: impl Fn(&[f64], f64) -> f64) -> Correlations {
        let [nodes, rows] = CORRELATIONS;
        let row = |i: usize| {
            let coefficients = self.at_amplitude_correlation(node(i, rows, SPANS[1]));
            (0..nodes).map(|k| value(&coefficients, node(k, nodes, SPANS[0]))).collect::<Vec<f64>>()
        };
        Correlations { rows: (0..rows).map(row).collect() }
    }

    /// Mean and variance of the heights.
    fn moments(&self, amplitudes: &[(f64, f64)]) -> (f64, f64) {
        let mut sums = [0.0; 2];
        for (a, of_w) in amplitudes {
            for (g, of_g) in points(POINTS[0]) {
                let height = self.height_m(a * g);
                sums[0] += of_w * of_g * height;
                sums[1] += of_w * of_g * height * height;
            }
        }
        (sums[0], sums[1] - sums[0] * sums[0])
    }

    /// `d_kj^2` by the midpoint rule.
    fn expanded(&self, amplitudes: &[(f64, f64)]) -> Vec<Vec<f64>> {
        let mut coefficients = vec![vec![0.0; DEGREES[0]]; DEGREES[1]];
        for ((a, of_w), (w, _)) in amplitudes.iter().zip(points(POINTS[1])) {
            let mut of_g = vec![0.0; DEGREES[0]];
            for (g, weight) in points(POINTS[0]) {
                let height = weight * self.height_m(a * g);
                hermite(g, DEGREES[0], |k, h| of_g[k] += height * h);
            }
            hermite(w, DEGREES[1], |j, h| {
                coefficients[j].iter_mut().zip(&of_g).for_each(|(sum, c)| *sum += of_w * h * c);
            });
        }
        coefficients.iter_mut().flatten().for_each(|d| *d *= *d);
        coefficients
    }
}

/// Products `A G` with so much probability below them; the lowest and highest of `cells` stand for half a cell.
pub fn quantiles(probabilities: &[f64], cells: u64, log_variance: f64) -> Vec<f64> {
    let amplitudes = amplitudes(log_variance);
    let below = |product: f64| -> f64 { amplitudes.iter().map(|(a, weight)| weight * normal::cdf(product / a)).sum() };
    let lower = |share: f64| {
        let (mut low, mut high) = (-PRODUCT_MAX, 0.0);
        for _ in 0..QUANTILE_BISECTIONS {
            let middle = 0.5 * (low + high);
            if below(middle) < share { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    };
    // An extreme lies farther out than its neighbour.
    let next = probabilities[1].min(1.0 - probabilities[probabilities.len() - 2]);
    let least = (0.5 / cells.max(1) as f64).min(0.5 * next);
    let at = |p: f64| match p {
        p if p < 0.5 => lower(p.max(least)),
        p if p > 0.5 => -lower((1.0 - p).max(least)),
        _ => 0.0,
    };
    probabilities.iter().map(|&p| at(p)).collect()
}

/// Amplitudes and their weights in a quadrature over W.
fn amplitudes(log_variance: f64) -> Vec<(f64, f64)> {
    points(POINTS[1]).map(|(w, weight)| (amplitude(log_variance, w), weight)).collect()
}

/// The amplitude at a standard normal `w`; its mean square is 1.
pub fn amplitude(log_variance: f64, w: f64) -> f64 {
    libm::exp(log_variance.sqrt() * w - log_variance)
}

/// Points of a quadrature over a standard normal variable, and their weights.
fn points(count: usize) -> impl Iterator<Item = (f64, f64)> {
    let step = 2.0 * BOUND / count as f64;
    (0..count).map(move |k| {
        let x = -BOUND + (k as f64 + 0.5) * step;
        (x, normal::pdf(x) * step)
    })
}

/// Calls `each` with the degree and value of the first `count` normalised Hermite polynomials at `x`.
fn hermite(x: f64, count: usize, mut each: impl FnMut(usize, f64)) {
    let (mut before, mut now) = (0.0, 1.0);
    for degree in 0..count {
        each(degree, now);
        let n = degree as f64;
        (before, now) = (now, (x * now - n.sqrt() * before) / (n + 1.0).sqrt());
    }
}

fn polynomial(coefficients: &[f64], r: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * r + c)
}

/// The argument in [-1, 1] at which an increasing polynomial has a value; the nearer end if it has it nowhere.
fn solve(coefficients: &[f64], wanted: f64) -> f64 {
    let (mut low, mut high) = (-1.0, 1.0);
    if polynomial(coefficients, high) <= wanted {
        return high;
    }
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if polynomial(coefficients, middle) < wanted { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The correlation at place `k` of `count`, the last of which is 1 and the first 1 less `span`: `1 - span t^2` for equally spaced t.
pub fn node(k: usize, count: usize, span: f64) -> f64 {
    let t = 1.0 - k as f64 / (count - 1) as f64;
    1.0 - span * t * t
}

/// The place at or below a correlation, and the share of the step to the next.
pub fn split(correlation: f64, count: usize, span: f64) -> (usize, f64) {
    let t = ((1.0 - correlation) / span).clamp(0.0, 1.0).sqrt();
    let low = (((1.0 - t) * (count - 1) as f64) as usize).min(count - 2);
    let (below, above) = (node(low, count, span), node(low + 1, count, span));
    (low, ((correlation - below) / (above - below)).clamp(0.0, 1.0))
}

/// A correlation of G or of the heights, by that of the other and that of W.
pub struct Correlations {
    /// For correlations of W from 0 to 1 ([`node`]), values at correlations of the other from -1 to 1.
    rows: Vec<Vec<f64>>,
}

impl Correlations {
    /// The value at a correlation `c` of the other and `rho` of W, bilinear in the table.
    pub fn at(&self, c: f64, rho: f64) -> f64 {
        let [nodes, rows] = CORRELATIONS;
        let (k, along) = split(c, nodes, SPANS[0]);
        let (i, down) = split(rho, rows, SPANS[1]);
        let mix = |row: &[f64]| row[k] + (row[k + 1] - row[k]) * along;
        let (above, below) = (mix(&self.rows[i]), mix(&self.rows[i + 1]));
        above + (below - above) * down
    }
}
