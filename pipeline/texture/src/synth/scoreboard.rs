//! Compares all methods on one fit: predicted properties, and those measured on a few realisations.
//!
//! * covariance: largest and root mean square difference between a method's mean covariance and the target, over the lags of
//!   [`Synthesis::covariance`], as shares of the variance;
//! * variance of each realisation about zero: its mean and spread over all realisations, as shares of the target variance;
//! * anisotropy: range across over range along, from the lags at which the mean covariance of the realisations has fallen to
//!   0.3 of its value at lag 0, in 18 directions, by a least-squares ellipse;
//! * seam: mean square step from the last row or column to the first, over that between neighbours inside: 1 without a seam;
//! * operations and bytes as predicted: measured times differ between machines and are in the benches.
//!
//! Source: Vecherin et al. 2022, section 4, whose conclusions this puts into numbers. Cost: the realisations, and two
//! transforms of each.

use super::fft_ma::torus_covariance;
use super::{Cost, LagCovariance, Synthesis, SynthesisError};
use crate::covariance::masked_covariance;
use sastrugi_numeric::{Geometry, Grid, Streams, sums};
use std::f64::consts::PI;

/// Share of the covariance at lag 0 at which the contour for the anisotropy is taken.
const CONTOUR: f64 = 0.3;
/// Directions in half a turn.
const DIRECTIONS: usize = 18;
/// Number of consecutive lags of a curve; larger ones are spaced by a tenth.
const DENSE_LAGS: usize = 40;

/// Results of a method on one fit.
#[derive(Clone, Debug)]
pub struct Score {
    /// Largest error of the mean covariance, share of the variance; NaN if the method does not know its mean covariance.
    pub error_max: f64,
    /// Root mean square error of the mean covariance, share of the variance; NaN likewise.
    pub error_rms: f64,
    /// Mean of the realisations' variances over the target variance.
    pub variance_mean: f64,
    /// Standard deviation of the realisations' variances over the target variance.
    pub variance_spread: f64,
    /// Target ratio of range across to range along; NaN if the method has none.
    pub ratio_wanted: f64,
    /// The ratio measured on the realisations; NaN if the contour extends beyond half a tile.
    pub ratio_found: f64,
    /// Mean square step across the edges over that inside.
    pub seam_jump_ratio: f64,
    /// Predicted cost of one realisation.
    pub cost: Cost,
    /// Covariance along rows.
    pub curve: Vec<CurvePoint>,
}

/// Covariance at a lag along rows, m2.
#[derive(Clone, Copy, Debug)]
pub struct CurvePoint {
    /// Lag, m.
    pub lag_m: f64,
    /// Target.
    pub wanted_m2: f64,
    /// Mean of the method; NaN if unknown.
    pub achieved_m2: f64,
    /// Mean over the realisations.
    pub measured_m2: f64,
}

/// The score of a method over some realisations.
///
/// # Errors
/// See [`SynthesisError`].
pub fn score(synthesis: &dyn Synthesis, streams: &Streams, realisations: u32) -> Result<Score, SynthesisError> {
    let lags = synthesis.covariance();
    let variance_m2 = lags[0].wanted_m2;
    let errors: Vec<f64> = lags.iter().map(|l| (l.achieved_m2 - l.wanted_m2).abs() / variance_m2).collect();
    let along_rows = thinned(&lags);
    let mut tally = Tally::new(along_rows.len(), &synthesis.geometry());
    for k in 0..realisations {
        let grid = synthesis.generate(&streams.child(&format!("realisation-{k}")))?.grid;
        tally.add(&grid, &along_rows, synthesis.is_periodic());
    }
    let share = f64::from(realisations);
    let curve = along_rows.iter().zip(&tally.measured).map(|((_, lag), sum)| CurvePoint {
        lag_m: lag.lag_m[0],
        wanted_m2: lag.wanted_m2,
        achieved_m2: lag.achieved_m2,
        measured_m2: sum / share,
    });
    Ok(Score {
        error_max: if errors.iter().any(|e| e.is_nan()) {
            f64::NAN
        } else {
            errors.iter().copied().fold(0.0, f64::max)
        },
        error_rms: sums::mean(&errors.iter().map(|e| e * e).collect::<Vec<_>>()).sqrt(),
        variance_mean: sums::mean(&tally.variances) / variance_m2,
        variance_spread: spread(&tally.variances) / variance_m2,
        ratio_wanted: synthesis.ratio(),
        ratio_found: tally.map.ratio(synthesis.geometry().cell).unwrap_or(f64::NAN),
        seam_jump_ratio: tally.seam / tally.inside,
        cost: synthesis.cost(),
        curve: curve.collect(),
    })
}

/// Sums over realisations.
struct Tally {
    variances: Vec<f64>,
    measured: Vec<f64>,
    map: Map,
    seam: f64,
    inside: f64,
}

impl Tally {
    fn new(lags: usize, tile: &Geometry) -> Self {
        let half = [tile.rows / 2, tile.cols / 2];
        let map = Map { half, values: vec![0.0; (half[0] + 1) * (2 * half[1] + 1)] };
        Self { variances: Vec::new(), measured: vec![0.0; lags], map, seam: 0.0, inside: 0.0 }
    }

    fn add(&mut self, grid: &Grid, lags: &[(usize, LagCovariance)], periodic: bool) {
        let squares: Vec<f64> = grid.values.iter().map(|z| z * z).collect();
        self.variances.push(sums::mean(&squares));
        self.measured.iter_mut().zip(lags).for_each(|(sum, (cells, _))| *sum += along_rows(grid, *cells, periodic));
        self.map.add(grid, periodic);
        let [seam, inside] = steps(grid);
        self.seam += seam;
        self.inside += inside;
    }
}

/// Lags along rows for a curve, with their numbers of cells.
fn thinned(lags: &[LagCovariance]) -> Vec<(usize, LagCovariance)> {
    let mut kept: Vec<(usize, LagCovariance)> = Vec::new();
    for (cells, lag) in lags.iter().enumerate().take_while(|(k, l)| *k == 0 || l.lag_m[0] > 0.0 && l.lag_m[1] == 0.0) {
        if cells < DENSE_LAGS || kept.last().is_some_and(|(last, _)| 10 * cells >= 11 * last) {
            kept.push((cells, *lag));
        }
    }
    kept
}

/// Mean product of cells `lag` apart in a row; across the edge, if the field is periodic.
fn along_rows(grid: &Grid, lag: usize, periodic: bool) -> f64 {
    let pairs = if periodic { grid.cols() } else { grid.cols() - lag };
    let of_row = |r: usize| {
        let row = grid.row(r);
        sums::mean(&(0..pairs).map(|c| row[c] * row[(c + lag) % row.len()]).collect::<Vec<_>>())
    };
    sums::mean(&(0..grid.rows()).map(of_row).collect::<Vec<_>>())
}

/// Mean square step across the edges, and between neighbours inside.
fn steps(grid: &Grid) -> [f64; 2] {
    let (rows, cols) = (grid.rows(), grid.cols());
    let square = |a: (usize, usize), b: (usize, usize)| {
        let step = grid.at(a.0, a.1) - grid.at(b.0, b.1);
        step * step
    };
    let east = |c: usize| (0..rows).map(move |r| ((r, c), (r, (c + 1) % cols)));
    let south = |r: usize| (0..cols).map(move |c| ((r, c), ((r + 1) % rows, c)));
    let mean = |columns: std::ops::Range<usize>, lines: std::ops::Range<usize>| {
        let pairs = columns.flat_map(east).chain(lines.flat_map(south));
        sums::mean(&pairs.map(|(a, b)| square(a, b)).collect::<Vec<_>>())
    };
    [mean(cols - 1..cols, rows - 1..rows), mean(0..cols - 1, 0..rows - 1)]
}

/// Standard deviation with n - 1; 0 for a single value.
fn spread(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    if n < 2.0 { 0.0 } else { (sums::variance(values) * n / (n - 1.0)).sqrt() }
}

/// Sum of covariances at lags up to half a tile: cells south from 0 on (outer), cells east from `-half` on (inner).
struct Map {
    half: [usize; 2],
    values: Vec<f64>,
}

impl Map {
    /// Adds a realisation; across the edges, if it is periodic.
    fn add(&mut self, grid: &Grid, periodic: bool) {
        let [south, east] = self.half;
        let cols = grid.cols();
        let lags = (0..=south).flat_map(|r| (-(east as isize)..=east as isize).map(move |c| (r, c)));
        if periodic {
            let torus = torus_covariance(grid);
            let at = |(r, c): (usize, isize)| torus[r * cols + c.rem_euclid(cols as isize) as usize];
            self.values.iter_mut().zip(lags).for_each(|(sum, lag)| *sum += at(lag));
        } else {
            let pairs = masked_covariance(&grid.values, cols, self.half);
            let at = |(r, c): (usize, isize)| pairs.covariance(r as isize, c).unwrap_or(0.0);
            self.values.iter_mut().zip(lags).for_each(|(sum, lag)| *sum += at(lag));
        }
    }

    fn at(&self, south: isize, east: isize) -> Option<f64> {
        let (south, east) = if south < 0 { (-south, -east) } else { (south, east) };
        let [max_south, max_east] = self.half.map(|h| h as isize);
        let inside = south <= max_south && east.abs() <= max_east;
        inside.then(|| self.values[(south * (2 * max_east + 1) + east + max_east) as usize])
    }

    /// Logarithm of the covariance over that at lag 0, interpolated bilinearly between four lags; the logarithm of an exponential is
    /// closer to linear. Correlations below a thousandth count as a thousandth.
    fn log_at(&self, south: f64, east: f64) -> Option<f64> {
        let (r, c) = (south.floor(), east.floor());
        let (v, u) = (south - r, east - c);
        let origin = self.at(0, 0)?;
        let corner =
            |i: isize, j: isize| Some(libm::log((self.at(r as isize + i, c as isize + j)? / origin).max(1e-3)));
        let north = (1.0 - u) * corner(0, 0)? + u * corner(0, 1)?;
        Some((1.0 - v) * north + v * ((1.0 - u) * corner(1, 0)? + u * corner(1, 1)?))
    }

    /// Short over long axis of the contour; `None` if it leaves the map.
    fn ratio(&self, [dx, dy]: [f64; 2]) -> Option<f64> {
        let level = libm::log(CONTOUR);
        let step = 0.25 * dx.min(dy);
        let last = (2.0 * (self.half[0] as f64 * dy + self.half[1] as f64 * dx) / step) as usize;
        let mut points = Vec::with_capacity(DIRECTIONS);
        for k in 0..DIRECTIONS {
            let (sin, cos) = libm::sincos(PI * k as f64 / DIRECTIONS as f64);
            let along = |n: usize| self.log_at(-(n as f64) * step * sin / dy, n as f64 * step * cos / dx);
            let beyond = (1..last).map_while(|n| along(n).map(|c| (n, c))).find(|(_, c)| *c < level)?.0;
            let (before, after) = (along(beyond - 1)?, along(beyond)?);
            let distance = (beyond as f64 - (level - after) / (before - after)) * step;
            points.push([distance * cos, distance * sin]);
        }
        Some(axes_ratio(&points))
    }
}

/// Short over long axis of the least-squares ellipse about the origin through the points.
fn axes_ratio(points: &[[f64; 2]]) -> f64 {
    let (mut normal, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
    for [x, y] in points {
        let terms = [x * x, 2.0 * x * y, y * y];
        (0..3).for_each(|i| {
            right[i] += terms[i];
            (0..3).for_each(|j| normal[i][j] += terms[i] * terms[j]);
        });
    }
    let [a, b, c] = solve(normal, right);
    let (middle, half) = (0.5 * (a + c), (0.25 * (a - c) * (a - c) + b * b).sqrt());
    ((middle - half) / (middle + half)).sqrt()
}

/// Solves three equations by Cramer's rule.
fn solve(m: [[f64; 3]; 3], right: [f64; 3]) -> [f64; 3] {
    let det = |m: &[[f64; 3]; 3]| {
        let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
        m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
    };
    [0, 1, 2].map(|k| {
        let mut replaced = m;
        (0..3).for_each(|row| replaced[row][k] = right[row]);
        det(&replaced) / det(&m)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::prepare;
    use sastrugi_schemas::fit::FitFile;
    use serde_json::{Value, json};

    fn scored(method: &str, parameters: Value) -> Score {
        let parameters_of_fit = [("sigma_m", 0.05), ("range_m", 0.5)].map(|(k, v)| (k.to_owned(), v)).into();
        let fit = FitFile { model: "exponential".to_owned(), parameters: parameters_of_fit, ..FitFile::default() };
        let synthesis = prepare(method, &parameters, &fit).unwrap();
        score(synthesis.as_ref(), &Streams::for_seed(1, "texture"), 6).unwrap()
    }

    /// By hand on two rows of three cells, 1 2 4 above 1 0 3. Steps across the edges: 3 and 2 in the rows, 0, 2 and 1 in the columns. Inside: 1
    /// and 2, 1 and 3 in the rows, the same in the columns.
    #[test]
    fn val_steps_and_products_by_hand() {
        let grid = Grid::new(Geometry::square(2, 3, 1.0), vec![1.0, 2.0, 4.0, 1.0, 0.0, 3.0]);
        let [seam, inside] = steps(&grid);
        assert!((seam - (9.0 + 4.0 + 0.0 + 4.0 + 1.0) / 5.0).abs() < 1e-14, "{seam}");
        assert!((inside - (1.0 + 4.0 + 1.0 + 9.0 + 0.0 + 4.0 + 1.0) / 7.0).abs() < 1e-14, "{inside}");
        // Products of neighbours in a row: 2, 8 and across the edge 4; 0, 0 and 3.
        assert!((along_rows(&grid, 1, false) - (2.0 + 8.0) / 4.0).abs() < 1e-14);
        assert!((along_rows(&grid, 1, true) - (2.0 + 8.0 + 4.0 + 3.0) / 6.0).abs() < 1e-14);
        assert_eq!((spread(&[1.0, 3.0]), spread(&[7.0])), (2f64.sqrt(), 0.0));
    }

    /// Points on an ellipse with axes 3 and 1 at any angle give their ratio.
    #[test]
    fn val_ratio_of_an_ellipse() {
        for turn in [0.0, 0.4, 1.2, 2.9] {
            let (sin, cos) = libm::sincos(turn);
            let point = |k: usize| {
                let (y, x) = libm::sincos(PI * k as f64 / 18.0);
                [3.0 * x * cos - y * sin, 3.0 * x * sin + y * cos]
            };
            let found = axes_ratio(&(0..18).map(point).collect::<Vec<_>>());
            assert!((found - 1.0 / 3.0).abs() < 1e-9, "{turn}: {found}");
        }
    }

    /// FFT-MA with unit phases: no error, no spread of the variance, no seam (200 x 6 steps of two edges: standard error
    /// about 5 %, limit 30 %), and the ratio of ranges within 2 % of the target.
    #[test]
    fn val_fft_ma_is_exact() {
        let s = scored("fft_ma", json!({ "size_m": [20.0, 20.0], "ratio": 0.5, "azimuth_deg": 30.0 }));
        assert!(s.error_max < 1e-12 && s.error_rms < 1e-12 && s.variance_spread < 1e-12, "{s:?}");
        assert!((s.variance_mean - 1.0).abs() < 1e-12);
        assert!((s.seam_jump_ratio - 1.0).abs() < 0.3, "{}", s.seam_jump_ratio);
        assert!((s.ratio_found / 0.5 - 1.0).abs() < 0.02, "{}", s.ratio_found);
        assert!(s.curve.iter().all(|p| (p.measured_m2 - p.wanted_m2).abs() < 1e-12 * 0.0025));
    }

    /// Cholesky: exact on average, but with a seam where its edges meet: mean square steps of `2 C(0)` instead of `2 (C(0) - C(1))`,
    /// 5.5 times as large.
    #[test]
    fn stat_cholesky_has_a_seam() {
        let s = scored("cholesky", json!({ "size_m": [3.0, 2.0] }));
        assert!(s.error_max < 1e-12 && s.variance_spread > 0.02, "{s:?}");
        assert!(s.seam_jump_ratio > 2.0, "{}", s.seam_jump_ratio);
    }

    /// The paper's ranking: Gaussians miss the exponential covariance, quasi-wavelets reproduce it, FFT-MA costs least.
    #[test]
    fn val_the_ranking_of_the_paper() {
        let size = || json!({ "size_m": [12.0, 12.0] });
        let [fft, gaussians, quasi] = ["fft_ma", "gaussians", "quasi_wavelets"].map(|m| scored(m, size()));
        assert!(gaussians.error_max > 0.05 && quasi.error_max < 0.02, "{} {}", gaussians.error_max, quasi.error_max);
        assert!(fft.cost.operations < quasi.cost.operations);
    }
}
