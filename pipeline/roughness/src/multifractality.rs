//! Variation of roughness with place and scale.
//!
//! The structure function of order q, `S_q(r) = <|z(x + r) - z(x)|^q>` over pairs of cells `r` apart along rows and along
//! columns, grows as `r^zeta(q)`. A monofractal has `zeta(q) = q H`; a concave zeta indicates a multifractal
//! (Frisch, Turbulence, 1995, chapter 8). Two simpler statistics complement it: the flatness `S_4 / S_2^2` of increments
//! between neighbours (3 for normal increments), and the variation of roughness between tiles.

use crate::hurst::is_finite;
use rayon::prelude::*;
use sastrugi_numeric::{Grid, sums};
use serde::Serialize;

/// Orders of the structure functions.
const ORDERS: usize = 4;
/// Tiles along each axis of the surface; the jackknife leaves out one at a time.
const JACKKNIFE_SIDE: usize = 4;
/// Smallest lag of the fit, cells.
const LAG_MIN: usize = 1;
/// The largest lag of the fit is the shorter side divided by this.
const LAG_SHARE_MAX: usize = 8;

/// A scaling exponent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ScalingExponent {
    /// Order q.
    pub order: u32,
    /// Exponent zeta(q).
    pub zeta: f64,
    /// Standard error from leaving out one of 16 tiles of the surface at a time (delete-one jackknife): sampling error
    /// within this surface, not misfit of the power law.
    pub standard_error: f64,
}

/// Exponents zeta(1) to zeta(4), fitted over lags that double from 1 cell to an eighth of the shorter side. A pair needs data
/// in both cells and lies within one of the 4 x 4 tiles of the grid. Cells are treated as square.
///
/// `None` if a side of the grid is below 64 cells, or if some lag has no pairs or only zero increments, with all tiles or
/// with one left out.
pub fn scaling_exponents(dem: &Grid) -> Option<[ScalingExponent; ORDERS]> {
    let side = dem.rows().min(dem.cols());
    let lag_max = side / LAG_SHARE_MAX;
    let lags: Vec<usize> =
        std::iter::successors(Some(LAG_MIN), |l| Some(2 * l)).take_while(|&l| l <= lag_max).collect();
    if lags.len() < 4 {
        return None;
    }
    let tiles: Vec<Vec<Sums>> = tiles(dem, JACKKNIFE_SIDE)
        .par_iter()
        .map(|tile| lags.iter().map(|&lag| Sums::of(tile, lag)).collect())
        .collect();
    let without = |left_out: usize| -> Option<[f64; ORDERS]> {
        let kept: Vec<&Vec<Sums>> = (0..tiles.len()).filter(|&t| t != left_out).map(|t| &tiles[t]).collect();
        exponents(&lags, &kept)
    };
    let all = exponents(&lags, &tiles.iter().collect::<Vec<_>>())?;
    let partial: Vec<[f64; ORDERS]> = (0..tiles.len()).map(without).collect::<Option<_>>()?;
    Some(std::array::from_fn(|q| {
        let values: Vec<f64> = partial.iter().map(|p| p[q]).collect();
        let standard_error = ((values.len() - 1) as f64 * sums::variance(&values)).sqrt();
        ScalingExponent { order: q as u32 + 1, zeta: all[q], standard_error }
    }))
}

/// `S_4 / S_2^2` of the increments between neighbouring cells along rows and columns; NaN if there are none.
pub fn increment_flatness(dem: &Grid) -> f64 {
    let s = Sums::of(dem, 1);
    s.powers[3] * s.pairs / (s.powers[1] * s.powers[1])
}

/// Coefficient of variation, over complete tiles of `tile_m`, of the root mean square Moore-neighbourhood gradient. NaN with
/// fewer than two tiles.
pub fn tile_variation(gradient: &Grid, tile_m: f64) -> f64 {
    let g = &gradient.geometry;
    let [cols, rows] = g.cell.map(|cell| ((tile_m / cell).round() as usize).max(1));
    let corners = (0..g.rows / rows).flat_map(|r| (0..g.cols / cols).map(move |c| (r * rows, c * cols)));
    let rms = |(r, c): (usize, usize)| {
        let squares = sums::finite(&gradient.window(r, c, rows, cols).values).iter().map(|v| v * v).collect::<Vec<_>>();
        sums::mean(&squares).sqrt()
    };
    let tiles = sums::finite(&corners.map(rms).collect::<Vec<_>>());
    // A variation needs at least two values.
    if tiles.len() < 2 { f64::NAN } else { sums::variance(&tiles).sqrt() / sums::mean(&tiles) }
}

/// Sums of powers of absolute increments, and the number of increments.
#[derive(Clone, Copy, Default)]
struct Sums {
    powers: [f64; ORDERS],
    pairs: f64,
}

impl Sums {
    /// Over all pairs `lag` cells apart along rows and along columns.
    fn of(dem: &Grid, lag: usize) -> Self {
        let mut by_row: Vec<Self> = Vec::with_capacity(dem.rows());
        for r in 0..dem.rows() {
            let row = dem.row(r);
            let along = Self::default().and_increments(row, &row[lag.min(row.len())..]);
            let below = (r + lag < dem.rows()).then(|| dem.row(r + lag));
            by_row.push(along.and_increments(row, below.unwrap_or_default()));
        }
        Self::joined(&by_row)
    }

    /// Adds the increments between `a` and `b`, up to the length of the shorter one.
    fn and_increments(self, a: &[f64], b: &[f64]) -> Self {
        let Self { powers: [mut first, mut second, mut third, mut fourth], mut pairs } = self;
        for (a, b) in a.iter().zip(b) {
            // An increment without data adds zeros, which change no sum.
            let d = (a - b).abs();
            let (d, pair) = if is_finite(d) { (d, 1.0) } else { (0.0, 0.0) };
            first += d;
            second += d * d;
            third += d * d * d;
            fourth += d * d * (d * d);
            pairs += pair;
        }
        Self { powers: [first, second, third, fourth], pairs }
    }

    fn joined(parts: &[Self]) -> Self {
        let total = |of: &dyn Fn(&Self) -> f64| sums::sum(&parts.iter().map(of).collect::<Vec<_>>());
        Self { powers: std::array::from_fn(|q| total(&|s| s.powers[q])), pairs: total(&|s| s.pairs) }
    }
}

/// The grid cut into `side` by `side` tiles of equal size (remaining cells at the south and east are dropped).
fn tiles(dem: &Grid, side: usize) -> Vec<Grid> {
    let (rows, cols) = (dem.rows() / side, dem.cols() / side);
    (0..side * side).map(|k| dem.window(k / side * rows, k % side * cols, rows, cols)).collect()
}

/// Exponents from the joined sums of several tiles.
fn exponents(lags: &[usize], tiles: &[&Vec<Sums>]) -> Option<[f64; ORDERS]> {
    let joined: Vec<Sums> =
        (0..lags.len()).map(|k| Sums::joined(&tiles.iter().map(|t| t[k]).collect::<Vec<_>>())).collect();
    let slope = |q: usize| {
        let points =
            lags.iter().zip(&joined).map(|(&lag, s)| [libm::log(lag as f64), libm::log(s.powers[q] / s.pairs)]);
        line_slope(&points.collect::<Vec<_>>())
    };
    let all: [f64; ORDERS] = std::array::from_fn(slope);
    all.iter().all(|z| z.is_finite()).then_some(all)
}

/// Slope of the least-squares line through points; NaN for fewer than two.
pub(crate) fn line_slope(points: &[[f64; 2]]) -> f64 {
    let mean = |axis: usize| sums::mean(&points.iter().map(|p| p[axis]).collect::<Vec<_>>());
    let (x0, y0) = (mean(0), mean(1));
    let covariance = sums::sum(&points.iter().map(|p| (p[0] - x0) * (p[1] - y0)).collect::<Vec<_>>());
    covariance / sums::sum(&points.iter().map(|p| (p[0] - x0) * (p[0] - x0)).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gradient::moore_gradient;
    use sastrugi_numeric::{Geometry, Streams};

    fn noise(side: usize) -> Grid {
        let mut s = Streams::for_seed(1, "multifractality-test").stream("noise");
        Grid::new(Geometry::square(side, side, 0.1), (0..side * side).map(|_| s.normal()).collect())
    }

    /// A plane has zeta(q) = q; a sum of two Brownian lines (one along each axis) has zeta(q) = q / 2. Tolerance for the
    /// lines: 6 jackknife standard errors.
    #[test]
    fn stat_exponents_of_a_plane_and_of_brownian_lines() {
        let g = Geometry::square(256, 256, 0.1);
        let plane = Grid::new(g, (0..g.len()).map(|k| (k % 256) as f64 + (k / 256) as f64).collect());
        for e in scaling_exponents(&plane).unwrap() {
            assert!((e.zeta - f64::from(e.order)).abs() < 1e-12 && e.standard_error < 1e-12, "{e:?}");
        }
        let mut s = Streams::for_seed(1, "multifractality-test").stream("walk");
        let mut walk = || {
            let mut z = 0.0;
            (0..1024)
                .map(|_| {
                    z += s.normal();
                    z
                })
                .collect::<Vec<f64>>()
        };
        let (east, south) = (walk(), walk());
        let g = Geometry::square(1024, 1024, 0.1);
        let lines = Grid::new(g, (0..g.len()).map(|k| east[k % 1024] + south[k / 1024]).collect());
        for e in scaling_exponents(&lines).unwrap() {
            assert!((e.zeta - 0.5 * f64::from(e.order)).abs() < 6.0 * e.standard_error, "{e:?}");
            assert!(e.standard_error < 0.1 * f64::from(e.order), "{e:?}");
        }
    }

    /// Sums are those of one increment after the other, by bits, with and without holes, at lags up to beyond the grid.
    #[test]
    fn prop_increments_are_added_in_order() {
        let mut holed = noise(24);
        holed.values.iter_mut().step_by(7).for_each(|z| *z = f64::NAN);
        for (dem, lag) in [noise(24), holed].iter().flat_map(|dem| [1, 5, 23, 24, 30].map(|lag| (dem, lag))) {
            let by_row = |r: usize| {
                let increment = |r2: usize, c2: usize, c: usize| (dem.at(r, c) - dem.at(r2, c2)).abs();
                let along = (0..24).filter(|c| c + lag < 24).map(|c| increment(r, c + lag, c));
                let below = (0..24).filter(|_| r + lag < 24).map(|c| increment(r + lag, c, c));
                along.chain(below).filter(|d| d.is_finite()).fold(Sums::default(), |s, d| Sums {
                    powers: [
                        s.powers[0] + d,
                        s.powers[1] + d * d,
                        s.powers[2] + d * d * d,
                        s.powers[3] + d * d * (d * d),
                    ],
                    pairs: s.pairs + 1.0,
                })
            };
            let (found, expected) = (Sums::of(dem, lag), Sums::joined(&(0..24).map(by_row).collect::<Vec<_>>()));
            assert_eq!(found.powers.map(f64::to_bits), expected.powers.map(f64::to_bits), "{lag}");
            assert_eq!(found.pairs, expected.pairs, "{lag}");
        }
    }

    /// Differences of normal noise are normal: flatness 3. Increments share cells, so n = 260 000 pairs count for about a
    /// third; the standard error sqrt(96 / n) is then 0.033. Threshold: 6 standard errors (1e-9). Catches 3.2.
    #[test]
    fn stat_flatness_of_noise() {
        let flatness = increment_flatness(&noise(512));
        assert!((flatness - 3.0).abs() < 0.2, "{flatness}");
    }

    #[test]
    fn val_tiles_of_two_slopes() {
        let g = Geometry::square(40, 80, 0.1);
        let z = |k: usize| (k % 80) as f64 * 0.1 * if k % 80 < 40 { 1.0 } else { 3.0 };
        let dem = Grid::new(g, (0..g.len()).map(z).collect());
        let mut gradient = moore_gradient(&dem);
        gradient.values.iter_mut().enumerate().for_each(|(k, v)| *v = if k % 80 < 40 { 1.0 } else { 3.0 });
        // Half 1, half 3: mean 2, deviation 1.
        assert!((tile_variation(&gradient, 1.0) - 0.5).abs() < 1e-12);
        assert!(tile_variation(&gradient, 9.0).is_nan());
    }

    /// The root mean square of 1 and 3 in equal parts is the root of 5; tiles of 1 m are 10 columns wide and 5 rows high on cells of
    /// 0.1 x 0.2 m.
    #[test]
    fn val_tiles_hold_root_mean_squares_of_oblong_cells() {
        let root = 5.0f64.sqrt();
        let mixed = |k: usize| if k % 20 >= 5 && k % 20 < 10 { 3.0 } else { 1.0 };
        let gradient = Grid::new(Geometry::square(10, 20, 0.1), (0..200).map(mixed).collect());
        assert!((tile_variation(&gradient, 1.0) - (root - 1.0) / (root + 1.0)).abs() < 1e-12);
        let g = Geometry { rows: 20, cols: 40, cell: [0.1, 0.2], origin: [0.0; 2] };
        let gradient = Grid::new(g, (0..800).map(|k| if k / 40 / 5 % 2 == 0 { 1.0 } else { 3.0 }).collect());
        assert!((tile_variation(&gradient, 1.0) - 0.5).abs() < 1e-12);
    }

    /// Increments of 1 and 2 along a row or a column: `<d^4> / <d^2>^2 = (17 / 2) / (5 / 2)^2`.
    #[test]
    fn val_flatness_of_two_increments() {
        for (rows, cols) in [(1, 3), (3, 1)] {
            let dem = Grid::new(Geometry::square(rows, cols, 1.0), vec![0.0, 1.0, 3.0]);
            assert!((increment_flatness(&dem) - 1.36).abs() < 1e-12, "{rows} x {cols}");
        }
    }

    #[test]
    fn val_too_small_or_empty() {
        assert!(scaling_exponents(&noise(63)).is_none());
        assert!(scaling_exponents(&Grid::filled(Geometry::square(64, 64, 1.0), f64::NAN)).is_none());
        assert!(increment_flatness(&Grid::filled(Geometry::square(1, 1, 1.0), 1.0)).is_nan());
    }
}
