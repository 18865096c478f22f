//! Background of a raster with holes: moving average where the window is complete, local plane where it is not.
//!
//! `background(i) = sum of w(j) z(j)` over the cells j with data in the centred box window of cell i. Cells beyond the border
//! count as no data.
//!
//! * Complete windows: `w = 1 / n`, the box mean.
//! * Partial windows (border, holes), [`AtPartial::Plane`]: height at the centre of the least-squares plane through the window's
//!   cells, `w(j) = (1, 0, 0) M^-1 (1, dx, dy)`, `M = sum of (1, dx, dy)' (1, dx, dy)`, with dx and dy the offset of j from i
//!   (local linear regression: Fan and Gijbels, 1996, section 2.3). The mean of a partial window belongs to the centroid of
//!   its cells, not to its centre, and on a slope is off by slope times offset. The plane reproduces slopes exactly; in a complete
//!   window the two agree.
//! * [`AtPartial::Mean`]: the plain mean of the window's cells, as published (Vecherin et al., 2022).
//!
//! The variance of the regression is `sum of w^2` times that of white heights: `1 / n` for a complete window, `4 / n` for one
//! cut by a straight border through its centre, `7 / n` in a corner. Beyond [`LEVERAGE_MAX`]` / n`, where the data lies to one
//! side and the plane is extrapolated, the background is undefined.
//!
//! The box is an odd number of cells wide each way, so that it has a centre cell. Cost: two running sums for each cell with a
//! complete window, nine for the others, whatever the window size. Sums run down the columns, then along the rows, and restart
//! on every band of rows, so that rounding errors do not accumulate and the result does not depend on the number of threads.
//! Memory: 12 bytes per cell of result, and seven rows per band.

mod moments;
mod running;

pub use moments::{Moments, Weights};
pub use running::RunningBackground;

use rayon::prelude::*;
use sastrugi_numeric::Grid;
use std::borrow::Cow;

/// A band has at least this many rows, and at least four times the window's.
const BAND_ROWS: usize = 64;
/// Largest accepted variance of a background, as a multiple of that of the mean of the same number of cells; corners have 7.
pub const LEVERAGE_MAX: f64 = 8.0;

/// Background of a partial window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtPartial {
    /// Mean of the cells with data.
    Mean,
    /// Least-squares plane through the cells with data, evaluated at the centre.
    Plane,
}

/// A centred box, an odd number of cells wide each way.
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

/// Odd number of cells nearest to `size_m / cell_m`, at least 1 and at most 2e9 + 1.
///
/// # Examples
/// ```
/// use sastrugi_roughness::odd_cells;
///
/// assert_eq!([odd_cells(2.0, 0.06), odd_cells(2.0, 0.1), odd_cells(0.0, 0.1)], [33, 21, 1]);
/// ```
pub fn odd_cells(size_m: f64, cell_m: f64) -> usize {
    let half = ((size_m / cell_m - 1.0) / 2.0).round().clamp(0.0, 1e9);
    2 * half as usize + 1
}

/// Background of a raster.
#[derive(Clone, Debug)]
pub struct Background {
    /// Height of the background, m, row-major; NaN where the window has no data, or too little around its centre.
    pub height_m: Vec<f64>,
    /// Number of cells with data in the window.
    pub count: Vec<u32>,
}

/// Background of row-major `values` in rows of `cols`; NaN means no data.
///
/// # Examples
/// ```
/// use sastrugi_roughness::background::{AtPartial, BoxWindow, background};
///
/// // One row that rises by 1 per cell, and a window of three cells: at the ends, where two are left, their mean is off by half a cell's
/// // rise, and the line through them is not.
/// let row = [0.0, 1.0, 2.0, 3.0];
/// let window = BoxWindow { half: [0, 1] };
/// assert_eq!(background(&row, 4, window, AtPartial::Mean).height_m, [0.5, 1.0, 2.0, 2.5]);
/// let plane = background(&row, 4, window, AtPartial::Plane);
/// assert_eq!(plane.count, [2, 3, 3, 2]);
/// assert!(plane.height_m.iter().zip(row).all(|(found, z)| (found - z).abs() < 1e-12));
/// ```
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

/// Background of the cells with data whose window is more than `filled_share_min` full; NaN elsewhere. Infinite values count
/// as no data.
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

/// Absolute differences between row-major `values` in rows of `cols` and the background of the cells not marked in `left_out`;
/// NaN where there is no data or no background.
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

/// Rows after which running sums restart.
pub fn band_rows(window: BoxWindow) -> usize {
    BAND_ROWS.max(4 * window.cells()[0])
}

#[cfg(test)]
mod tests;
