//! Structure function, autocorrelation length and texture aspect ratio.
//!
//! * Structure function `D(h) = <(z(x + h) - z(x))^2>` in m2 over all pairs of cells with data (twice the semivariance):
//!   over rings of |h| in all directions, and along x and y. Rings are a quarter of an octave wide; lags along an axis have
//!   the same spacing, rounded to whole cells. White noise of variance s^2 has `D = 2 s^2`, a self-affine surface
//!   `D ~ |h|^(2H)`.
//! * Autocorrelation `f(h) = C(h) / C(0)`, `C(h) = <z(x) z(x + h)>` over the same pairs.
//! * Sal: the shortest distance, over all directions, at which f falls to 0.2. Str: that distance over the longest one, in
//!   (0, 1], 1 for an isotropic texture (ISO 25178-2:2021, 4.5.1 and 4.5.2). Directions are one degree apart, f is
//!   bilinear between whole lags, and the first crossing counts. Str is NaN if f stays above 0.2 in some direction within
//!   the lags searched, Sal if it does so in all of them.
//!
//! Lags reach half of each side, and at most [`LAG_CELLS_MAX`] cells. Heights must be centred on zero: the caller removes mean
//! and plane first ([`crate::level`]). Cost: that of [`LagSums`].

use crate::lags::{LagSums, PairSum};
use sastrugi_numeric::Grid;
use serde::Serialize;

/// Longest lag, cells.
pub const LAG_CELLS_MAX: usize = 1024;
/// Rings, and lags along an axis, per octave of lag.
const LAGS_PER_OCTAVE: f64 = 4.0;
/// Autocorrelation at which Sal and Str are read.
const DECAYED: f64 = 0.2;
/// Directions in half a turn.
const DIRECTIONS: u32 = 180;

/// Direction of the pairs in a structure function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// All directions.
    All,
    /// East-west.
    X,
    /// North-south.
    Y,
}

impl Direction {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::X => "x",
            Self::Y => "y",
        }
    }
}

/// One lag of a structure function.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StructureBin {
    /// Direction.
    pub direction: Direction,
    /// Mean lag of the pairs, m.
    pub lag_m: f64,
    /// Mean squared increment, m2.
    pub value_m2: f64,
    /// Number of pairs.
    pub pairs: u64,
}

/// Half of each side in cells, at most `LAG_CELLS_MAX`.
pub fn lags_of(dem: &Grid) -> [usize; 2] {
    [dem.rows(), dem.cols()].map(|n| (n / 2).min(LAG_CELLS_MAX))
}

/// Structure function over all directions, then along x, then along y, each by increasing lag. Lags without pairs are omitted.
///
/// # Examples
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_roughness::{Direction, LagSums, lags_of, structure_function};
///
/// // A slope eastwards, centred on zero: increments are the lag along x, and zero along y.
/// let geometry = Geometry::square(20, 30, 0.5);
/// let dem = Grid::new(geometry, (0..600).map(|k| geometry.x(k % 30) - 7.5).collect());
/// let bins = structure_function(&LagSums::of(&dem, lags_of(&dem)), geometry.cell);
/// let along = |direction| bins.iter().filter(move |b| b.direction == direction);
/// assert!(along(Direction::X).count() > 5 && along(Direction::Y).count() > 5);
/// assert!(along(Direction::X).all(|b| (b.value_m2 - b.lag_m * b.lag_m).abs() < 1e-9));
/// assert!(along(Direction::Y).all(|b| b.value_m2 < 1e-9));
/// ```
pub fn structure_function(sums: &LagSums, cell_m: [f64; 2]) -> Vec<StructureBin> {
    let [max_row, max_col] = sums.max_lag;
    let along_x = along(max_col).map(|lag| bin(Direction::X, lag as f64 * cell_m[0], sums.at(0, lag as isize)));
    let along_y = along(max_row).map(|lag| bin(Direction::Y, lag as f64 * cell_m[1], sums.at(lag as isize, 0)));
    rings(sums, cell_m).into_iter().chain(along_x).chain(along_y).filter(|b| b.pairs > 0).collect()
}

fn bin(direction: Direction, lag_m: f64, sum: PairSum) -> StructureBin {
    StructureBin { direction, lag_m, value_m2: sum.increment(), pairs: sum.pairs as u64 }
}

/// Lags in whole cells up to `max`, a quarter of an octave apart where that exceeds one cell.
pub(crate) fn along(max: usize) -> impl Iterator<Item = usize> {
    let rounded = |k: u32| libm::exp2(f64::from(k) / LAGS_PER_OCTAVE).round() as usize;
    let mut last = 0;
    (0..).map(rounded).filter(move |&lag| std::mem::replace(&mut last, lag) != lag).take_while(move |&lag| lag <= max)
}

/// Rings of lags, up to the largest lag available in every direction.
fn rings(sums: &LagSums, cell_m: [f64; 2]) -> Vec<StructureBin> {
    let base = cell_m[0].min(cell_m[1]);
    let reach = (sums.max_lag[0] as f64 * cell_m[1]).min(sums.max_lag[1] as f64 * cell_m[0]) * (1.0 + 1e-9);
    // For each ring: sum of lag times pairs, and the sums over the pairs.
    let mut totals: Vec<(f64, PairSum)> = Vec::new();
    for ([drow, dcol], sum) in sums.half() {
        let (x, y) = (dcol as f64 * cell_m[0], drow as f64 * cell_m[1]);
        let length = (x * x + y * y).sqrt();
        if length > reach {
            continue;
        }
        let ring = (LAGS_PER_OCTAVE * libm::log2(length / base)).round().max(0.0) as usize;
        if totals.len() <= ring {
            totals.resize(ring + 1, (0.0, PairSum::default()));
        }
        let total = &mut totals[ring];
        total.0 += length * sum.pairs;
        total.1.pairs += sum.pairs;
        total.1.products += sum.products;
        total.1.squares += sum.squares;
    }
    totals.into_iter().map(|(lag, sum)| bin(Direction::All, lag / sum.pairs, sum)).collect()
}

/// Autocorrelation length and texture aspect ratio.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Autocorrelation {
    /// Sal, m.
    pub sal_m: f64,
    /// Str.
    pub aspect_ratio: f64,
}

/// Sal and Str of pair sums.
pub fn autocorrelation(sums: &LagSums, cell_m: [f64; 2]) -> Autocorrelation {
    let variance = sums.at(0, 0).covariance();
    let falls: Vec<f64> = (0..DIRECTIONS)
        .map(|degrees| {
            let (sin, cos) = libm::sincos(f64::from(degrees).to_radians());
            fall(sums, [sin / cell_m[0], -cos / cell_m[1]], cell_m[0].min(cell_m[1]), DECAYED * variance)
        })
        .collect();
    let shortest = falls.iter().copied().fold(f64::NAN, f64::min);
    let longest = if falls.iter().any(|f| f.is_nan()) { f64::NAN } else { falls.iter().copied().fold(0.0, f64::max) };
    Autocorrelation { sal_m: shortest, aspect_ratio: shortest / longest }
}

/// Distance in m at which the covariance first falls to `level`, in the direction given as `[columns, rows]` per metre; NaN if
/// it does not within the lags available.
fn fall(sums: &LagSums, [east, south]: [f64; 2], step_m: f64, level: f64) -> f64 {
    let (mut from, mut at_from) = (0.0, sums.at(0, 0).covariance());
    if at_from <= 0.0 || !at_from.is_finite() {
        return f64::NAN;
    }
    for k in 1.. {
        let to = f64::from(k) * step_m;
        let Some(at_to) = bilinear(sums, east * to, south * to) else { return f64::NAN };
        if at_to <= level {
            return from + (to - from) * (at_from - level) / (at_from - at_to);
        }
        (from, at_from) = (to, at_to);
    }
    f64::NAN
}

/// Covariance between whole lags; `None` beyond them, or next to a lag without pairs.
fn bilinear(sums: &LagSums, col: f64, row: f64) -> Option<f64> {
    let [r0, c0] = [row, col].map(f64::floor);
    let (v, u) = (row - r0, col - c0);
    let at = |dr: isize, dc: isize, weight: f64| {
        let value = sums.at(r0 as isize + dr, c0 as isize + dc).covariance();
        // A lag with zero weight may be undefined.
        if weight == 0.0 { 0.0 } else { weight * value }
    };
    let value = at(0, 0, (1.0 - u) * (1.0 - v)) + at(0, 1, u * (1.0 - v)) + at(1, 0, (1.0 - u) * v) + at(1, 1, u * v);
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};
    use std::f64::consts::TAU;

    fn field(geometry: Geometry, value: impl FnMut(f64, f64) -> f64) -> Grid {
        let mut value = value;
        let cell = |k: usize| value(geometry.x(k % geometry.cols), geometry.y(k / geometry.cols));
        Grid::new(geometry, (0..geometry.len()).map(cell).collect())
    }

    fn described(dem: &Grid) -> (LagSums, Vec<StructureBin>) {
        let sums = LagSums::of(dem, lags_of(dem));
        let bins = structure_function(&sums, dem.geometry.cell);
        (sums, bins)
    }

    #[test]
    fn val_lags_along_an_axis() {
        assert_eq!(along(20).collect::<Vec<_>>(), [1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 13, 16, 19]);
        assert_eq!(along(0).count(), 0);
    }

    /// Rings and axes agree with loops over all pairs, with holes and oblong cells.
    #[test]
    fn val_equals_loops_over_pairs() {
        let g = Geometry { rows: 14, cols: 18, cell: [0.5, 0.8], origin: [0.0; 2] };
        let mut s = Streams::for_seed(1, "structure-test").stream("noise");
        let dem = field(g, |x, _| if s.uniform() < 0.2 { f64::NAN } else { s.normal() + x });
        let (_, bins) = described(&dem);
        let cells: Vec<(f64, f64, f64)> =
            (0..g.len()).map(|k| (g.x(k % 18), g.y(k / 18), dem.values[k])).filter(|c| c.2.is_finite()).collect();
        for b in &bins {
            let (mut total, mut lag, mut pairs) = (0.0, 0.0, 0u64);
            for (i, p) in cells.iter().enumerate() {
                for q in &cells[i + 1..] {
                    let (dx, dy) = ((p.0 - q.0).abs(), (p.1 - q.1).abs());
                    let length = (dx * dx + dy * dy).sqrt();
                    let ring = |length: f64| (4.0 * libm::log2(length / 0.5)).round().max(0.0);
                    let inside = match b.direction {
                        Direction::X => dy < 1e-9 && (dx - b.lag_m).abs() < 1e-9,
                        Direction::Y => dx < 1e-9 && (dy - b.lag_m).abs() < 1e-9,
                        Direction::All => length < 4.5 + 1e-9 && ring(length) == ring(b.lag_m),
                    };
                    if inside {
                        total += (p.2 - q.2) * (p.2 - q.2);
                        lag += length;
                        pairs += 1;
                    }
                }
            }
            assert_eq!(b.pairs, pairs, "{b:?}");
            assert!((b.value_m2 - total / pairs as f64).abs() < 1e-11, "{b:?}");
            assert!((b.lag_m - lag / pairs as f64).abs() < 1e-9, "{b:?}");
        }
        assert!([Direction::All, Direction::X, Direction::Y].iter().all(|d| bins.iter().any(|b| b.direction == *d)));
    }

    /// White noise of variance 4: D = 8 at every lag. A bin of n pairs has a relative standard error of about sqrt(3 / n) (pairs
    /// share cells); threshold 8 standard errors, about 80 bins: false-alarm rate below 1e-9. A semivariance (a factor of 2)
    /// fails at once.
    #[test]
    fn stat_white_noise_has_no_structure() {
        let g = Geometry { rows: 256, cols: 200, cell: [0.5, 0.25], origin: [0.0; 2] };
        let mut s = Streams::for_seed(1, "structure-test").stream("white");
        let (sums, bins) = described(&field(g, |_, _| 2.0 * s.normal()));
        for b in bins {
            // Pairs at long lags share the same few cells: count at most 1 in 4 cells as independent.
            let allowed = 8.0 * (3.0 / (b.pairs as f64).min(12_800.0)).sqrt();
            assert!((b.value_m2 / 8.0 - 1.0).abs() < allowed, "{b:?}");
        }
        let found = autocorrelation(&sums, g.cell);
        // f falls linearly from 1 to 0 within a cell, so Sal is 0.8 of the smaller cell side, and Str the ratio of the sides.
        assert!((found.sal_m - 0.2).abs() < 0.02 && (found.aspect_ratio - 0.5).abs() < 0.05, "{found:?}");
    }

    /// `z = sin(k x)`: D = 1 - cos(k h) over whole periods, f = cos(k h) falls to 0.2 at acos(0.2) / k, and never along the
    /// ridges.
    #[test]
    fn val_a_wave() {
        let g = Geometry::square(120, 400, 0.05);
        let k = TAU / 2.0;
        let (sums, bins) = described(&field(g, |x, _| libm::sin(k * x)));
        for b in bins.iter().filter(|b| b.direction == Direction::X) {
            let periods = (20.0 - b.lag_m) / 2.0;
            let allowed = 1.1 / (std::f64::consts::PI * periods);
            assert!((b.value_m2 - (1.0 - libm::cos(k * b.lag_m))).abs() < allowed, "{b:?}");
        }
        assert!(bins.iter().filter(|b| b.direction == Direction::Y).all(|b| b.value_m2 < 1e-12));
        let found = autocorrelation(&sums, g.cell);
        assert!((found.sal_m - libm::acos(0.2) / k).abs() < 0.01, "{found:?}");
        assert!(found.aspect_ratio.is_nan());
    }

    /// Two crossed waves of different wavelength: `C = cos(k x) / 2 + cos(k y / 2) / 2`, whose fall to 0.2 is known in closed
    /// form in every direction.
    #[test]
    fn val_aspect_ratio_of_crossed_waves() {
        let g = Geometry::square(400, 400, 0.05);
        let k = TAU;
        let dem = field(g, |x, y| libm::sin(k * x) + libm::sin(0.5 * k * y));
        let found = autocorrelation(&LagSums::of(&dem, lags_of(&dem)), g.cell);
        let fall = |degrees: f64| {
            let (sin, cos) = libm::sincos(degrees.to_radians());
            let f = |r: f64| 0.5 * (libm::cos(k * r * sin) + libm::cos(0.5 * k * r * cos));
            (1..).map(|n| 1e-4 * f64::from(n)).find(|r| f(*r) <= 0.2).unwrap()
        };
        let falls: Vec<f64> = (0..180).map(|d| fall(f64::from(d))).collect();
        let (short, long) = falls.iter().fold((f64::MAX, 0.0f64), |(s, l), f| (s.min(*f), l.max(*f)));
        assert!((found.sal_m / short - 1.0).abs() < 0.02, "{found:?} {short}");
        assert!((found.aspect_ratio / (short / long) - 1.0).abs() < 0.04, "{found:?} {}", short / long);
    }

    #[test]
    fn val_flat_and_empty() {
        for value in [0.0, f64::NAN] {
            let dem = Grid::filled(Geometry::square(9, 9, 1.0), value);
            let (sums, bins) = described(&dem);
            assert!(autocorrelation(&sums, [1.0; 2]).sal_m.is_nan());
            assert!(bins.iter().all(|b| b.value_m2 == 0.0) && bins.is_empty() == value.is_nan());
        }
    }
}
