//! Background of a raster with holes: moving average where a window is complete, local plane where it is not.
//!
//! `background(i) = sum of w(j) z(j)` over the cells j with data in the centred box window of cell i. Cells beyond the border have
//! no data.
//!
//! * Complete windows: `w = 1 / n`, the box mean.
//! * Partial windows (border, holes), [`AtPartial::Plane`]: the least-squares plane through the window's cells, at its centre,
//!   `w(j) = (1, 0, 0) M^-1 (1, dx, dy)`, `M = sum of (1, dx, dy)' (1, dx, dy)`, dx and dy the offset of j from i (local linear
//!   regression: Fan and Gijbels, 1996, section 2.3). The mean of a partial window lies off its centre, so that on a slope it
//!   is off by slope times offset; planes pass through this background exactly, and where a window is complete the two agree.
//! * [`AtPartial::Mean`]: the plain mean of the window's cells, as published (Vecherin et al., 2022).
//!
//! The variance of the regression is `sum of w^2` times that of white heights: `1 / n` for a complete window, `4 / n` for one
//! cut by a straight border through its centre, `7 / n` in a corner. Beyond [`LEVERAGE_MAX`]` / n`, where the data lies to one side and
//! the plane is extrapolated, there is no background.
//!
//! The box is an odd number of cells wide each way, so that it has a centre. Cost: two running sums for each cell with a
//! complete window, nine for the others, whatever the window (down the columns, then along the rows, started afresh on every
//! band of rows so that neither rounding nor the number of threads shows). Memory: 12 bytes per cell of result and seven rows
//! per band.

mod moments;
mod running;

pub use moments::{Moments, Weights};
pub use running::RunningBackground;

use rayon::prelude::*;
use sastrugi_numeric::Grid;
use std::borrow::Cow;

/// Bands are at least this many rows, and four times the window.
const BAND_ROWS: usize = 64;
/// Largest variance of a background that is used, as a multiple of that of the mean of as many cells: corners have 7.
pub const LEVERAGE_MAX: f64 = 8.0;

/// What the background of a partial window is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtPartial {
    /// The mean of its cells with data.
    Mean,
    /// The least-squares plane through them, at the centre.
    Plane,
}

/// A centred box of an odd number of cells each way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoxWindow {
    /// Cells on each side of the centre, north-south and east-west.
    pub half: [usize; 2],
}

impl BoxWindow {
    /// The box whose width is the odd number of cells nearest to `size_m`, at least one cell, for cells of
    /// `cell_m = [east-west, north-south]`.
    pub fn nearest(size_m: f64, cell_m: [f64; 2]) -> Self {
        let [east_west, north_south] = cell_m.map(|cell_m| odd_cells(size_m, cell_m) / 2);
        Self { half: [north_south, east_west] }
    }

    /// Width in cells, north-south and east-west.
    pub fn cells(&self) -> [usize; 2] {
        self.half.map(|h| 2 * h + 1)
    }

    /// Number of cells in the box.
    pub fn area(&self) -> usize {
        self.cells()[0] * self.cells()[1]
    }

    /// Width in m, east-west and north-south (the order of cell sizes).
    pub fn size_m(&self, cell_m: [f64; 2]) -> [f64; 2] {
        let [rows, cols] = self.cells();
        [cols as f64 * cell_m[0], rows as f64 * cell_m[1]]
    }
}

/// Odd number of cells nearest to `size_m / cell_m`, at least 1; beyond the whole numbers that a float can count, that
/// many.
pub fn odd_cells(size_m: f64, cell_m: f64) -> usize {
    let half = ((size_m / cell_m - 1.0) / 2.0).round().clamp(0.0, 1e9);
    2 * half as usize + 1
}

/// Background of a raster.
#[derive(Clone, Debug)]
pub struct Background {
    /// Height of the background, m; NaN where the window has no data, or too little around its centre. Row-major.
    pub height_m: Vec<f64>,
    /// Number of the window's cells with data.
    pub count: Vec<u32>,
}

/// Background of row-major `values` in rows of `cols`; NaN is no data.
pub fn background(values: &[f64], cols: usize, window: BoxWindow, at_partial: AtPartial) -> Background {
    let mut height_m = vec![0.0; values.len()];
    let mut count = vec![0; values.len()];
    let band = band_rows(window);
    let cells = (band * cols).max(1);
    height_m.par_chunks_mut(cells).zip(count.par_chunks_mut(cells)).enumerate().for_each(|(k, (height_m, count))| {
        let mut rows = RunningBackground::from(values, cols, window, at_partial, k * band);
        height_m.chunks_exact_mut(cols).zip(count.chunks_exact_mut(cols)).for_each(|(z, n)| rows.next_row(z, n));
    });
    Background { height_m, count }
}

/// Background of the cells with data whose window is more than `filled_share_min` full; NaN elsewhere. Infinite values are
/// no data.
pub(crate) fn background_of(dem: &Grid, window: BoxWindow, at_partial: AtPartial, filled_share_min: f64) -> Grid {
    let finite = dem.map(|z| if z.is_finite() { z } else { f64::NAN });
    let Background { mut height_m, count } = background(&finite.values, dem.cols(), window, at_partial);
    let filled_min = filled_share_min * window.area() as f64;
    for ((m, &n), z) in height_m.iter_mut().zip(&count).zip(&finite.values) {
        if z.is_nan() || f64::from(n) <= filled_min {
            *m = f64::NAN;
        }
    }
    Grid { geometry: dem.geometry, values: height_m }
}

/// Absolute differences of row-major `values` in rows of `cols` from the background of those not marked in `left_out`; NaN
/// where there is no data, or no background.
pub fn deviations(values: &[f64], left_out: &[bool], cols: usize, window: BoxWindow) -> Vec<f64> {
    let averaged = match left_out.contains(&true) {
        true => Cow::from_iter(values.iter().zip(left_out).map(|(&v, &out)| if out { f64::NAN } else { v })),
        false => Cow::from(values),
    };
    let band = band_rows(window);
    let mut deviations = vec![0.0; values.len()];
    deviations.par_chunks_mut((band * cols).max(1)).enumerate().for_each(|(k, lines)| {
        let mut rows = RunningBackground::from(&averaged, cols, window, AtPartial::Plane, k * band);
        let (mut height_m, mut count) = (vec![0.0; cols], vec![0; cols]);
        for (line, own) in lines.chunks_exact_mut(cols).zip(values[k * band * cols..].chunks_exact(cols)) {
            rows.next_row(&mut height_m, &mut count);
            line.iter_mut().zip(own).zip(&height_m).for_each(|((d, v), m)| *d = (v - m).abs());
        }
    });
    deviations
}

/// Rows after which sums are started afresh.
pub fn band_rows(window: BoxWindow) -> usize {
    BAND_ROWS.max(4 * window.cells()[0])
}

#[cfg(test)]
mod tests;
