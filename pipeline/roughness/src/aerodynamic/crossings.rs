//! Upcrossings of the mean level along the wind.
//!
//! Profiles are parallel lines one cell apart. A line steps from column to column, or from row to row if that is the finer
//! step along the wind, and interpolates heights linearly between two cells of a column, where the bilinear surface is linear.
//! Lines are placed about the middle of the raster, so that rotating the raster rotates the lines. Counts are integers, so the
//! order of summation does not matter.

use super::Wind;
use super::partition::{SIDE, block_of};
use crate::band::transposed;
use rayon::prelude::*;
use sastrugi_numeric::Grid;

/// Heights below this share of the standard deviation have no sign, so that rounding errors do not count as obstacles.
const SIGN_MIN: f64 = 1e-6;
/// A point this close to a cell's centre, in cells, counts as the centre.
const CENTRE_TOLERANCE: f64 = 1e-9;

/// Crossings and steps of the profiles through one block, or several.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Profiled {
    /// Upcrossings and downcrossings.
    crossings: u64,
    steps: u64,
    /// Length of a step, m.
    step_m: f64,
}

impl Profiled {
    pub fn add(&mut self, other: &Self) {
        self.crossings += other.crossings;
        self.steps += other.steps;
        self.step_m = self.step_m.max(other.step_m);
    }

    pub fn upcrossings_per_m(&self) -> f64 {
        0.5 * self.crossings as f64 / (self.steps as f64 * self.step_m)
    }
}

type Blocks = [Profiled; SIDE * SIDE];

/// Crossings and steps of the profiles along each wind, block by block.
pub(super) fn along(surface: &Grid, winds: &[Wind], sigma_m: f64) -> Vec<Blocks> {
    let (rows, cols) = (surface.rows(), surface.cols());
    let threshold_m = SIGN_MIN * sigma_m;
    let by_row = Lines { values: &surface.values, rows, cols, threshold_m };
    let turned = transposed(&surface.values, rows, cols);
    let by_col = Lines { values: &turned, rows: cols, cols: rows, threshold_m };
    let [east_m, north_m] = surface.geometry.cell;
    let of_wind = |wind: &Wind| {
        // Columns and rows (southwards) crossed per metre towards the wind's origin.
        let [cols_per_m, rows_per_m] = [wind.sin / east_m, -wind.cos / north_m];
        if cols_per_m.abs() >= rows_per_m.abs() {
            by_row.blocks(rows_per_m / cols_per_m, 1.0 / cols_per_m.abs())
        } else {
            let blocks = by_col.blocks(cols_per_m / rows_per_m, 1.0 / rows_per_m.abs());
            std::array::from_fn(|block| blocks[block % SIDE * SIDE + block / SIDE])
        }
    };
    winds.iter().map(of_wind).collect()
}

/// A raster whose lines step from column to column.
struct Lines<'a> {
    values: &'a [f64],
    rows: usize,
    cols: usize,
    threshold_m: f64,
}

impl Lines<'_> {
    /// Counts along lines that advance by `slope` rows (at most 1 either way) and `step_m` metres per column.
    fn blocks(&self, slope: f64, step_m: f64) -> Blocks {
        let middle = 0.5 * (self.cols as f64 - 1.0);
        let beyond = (slope.abs() * middle).ceil() as i64;
        let counts = (-beyond..self.rows as i64 + beyond)
            .into_par_iter()
            .map(|line| {
                let mut counts = [[0u64; 2]; SIDE * SIDE];
                self.follow(|col| line as f64 + slope * (col as f64 - middle), &mut counts);
                counts
            })
            .reduce(|| [[0; 2]; SIDE * SIDE], |a, b| std::array::from_fn(|k| [a[k][0] + b[k][0], a[k][1] + b[k][1]]));
        counts.map(|[crossings, steps]| Profiled { crossings, steps, step_m })
    }

    /// Adds crossings and steps of one line, given as row over column, to the blocks.
    fn follow(&self, row_at: impl Fn(usize) -> f64, counts: &mut [[u64; 2]; SIDE * SIDE]) {
        let mut above: Option<bool> = None;
        let mut before = false;
        for col in 0..self.cols {
            let row = row_at(col);
            let Some(z) = self.height(row, col) else {
                (above, before) = (None, false);
                continue;
            };
            let count = &mut counts[block_of(row.round() as usize, col, self.rows, self.cols)];
            count[1] += u64::from(before);
            if z.abs() > self.threshold_m {
                count[0] += u64::from(above == Some(z < 0.0));
                above = Some(z > 0.0);
            }
            before = true;
        }
    }

    /// Height at a point between two cells of a column; `None` in a hole or beyond the raster.
    fn height(&self, row: f64, col: usize) -> Option<f64> {
        let nearest = row.round();
        let on_centre = (row - nearest).abs() < CENTRE_TOLERANCE;
        let north = if on_centre { nearest } else { row.floor() };
        let south = if on_centre { nearest } else { north + 1.0 };
        if north < 0.0 || south >= self.rows as f64 {
            return None;
        }
        let share = row - north;
        let [a, b] = [north, south].map(|row| self.values[row as usize * self.cols + col]);
        let z = if on_centre { a } else { a + share * (b - a) };
        z.is_finite().then_some(z)
    }
}
