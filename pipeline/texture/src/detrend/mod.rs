//! Moving average over the cells with data.
//!
//! `mean(i) = sum of z(j) m(j) / n(i)`, `n(i) = sum of m(j)`, over the cells j of the centred box window of cell i, with
//! m = 1 on cells with data, else 0. Cells beyond the border have no data.
//!
//! The box is an odd number of cells wide each way, so that it has a centre. Cost: a few additions per cell whatever the
//! window (running sums down the columns, then along the rows, started afresh on every strip of rows so that neither
//! rounding nor the number of threads shows). Memory: 12 bytes per cell of result and three rows per strip.

use rayon::prelude::*;

/// Strips are at least this many rows, and four times the window.
const STRIP_ROWS: usize = 64;

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
        let half = |cell: f64| (0.5 * (size_m / cell - 1.0)).max(0.0).round() as usize;
        Self { half: [half(cell_m[1]), half(cell_m[0])] }
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

/// Moving average of a raster.
#[derive(Clone, Debug)]
pub struct BoxMean {
    /// Mean of the window's cells with data; NaN where there is none. Row-major.
    pub mean: Vec<f64>,
    /// Number of the window's cells with data.
    pub count: Vec<u32>,
}

/// Moving average of row-major `values` in rows of `cols`; NaN is no data.
pub fn box_mean(values: &[f64], cols: usize, window: BoxWindow) -> BoxMean {
    let mut mean = vec![f64::NAN; values.len()];
    let mut count = vec![0; values.len()];
    let strip = cols * STRIP_ROWS.max(4 * window.cells()[0]);
    mean.par_chunks_mut(strip.max(1)).zip(count.par_chunks_mut(strip.max(1))).enumerate().for_each(
        |(k, (mean, count))| {
            let first = k * strip / cols;
            let mut columns = ColumnSums::above(values, cols, first, window.half[0]);
            for (r, (mean, count)) in mean.chunks_exact_mut(cols).zip(count.chunks_exact_mut(cols)).enumerate() {
                columns.move_to(values, first + r, window.half[0]);
                along_row(&columns.sum, &columns.count, window.half[1], mean, count);
            }
        },
    );
    BoxMean { mean, count }
}

/// Sums down each column over the rows of the window.
struct ColumnSums {
    sum: Vec<f64>,
    count: Vec<u32>,
}

impl ColumnSums {
    /// Sums for the row above `row`, from which [`Self::move_to`] steps down.
    fn above(values: &[f64], cols: usize, row: usize, half: usize) -> Self {
        let mut sums = Self { sum: vec![0.0; cols], count: vec![0; cols] };
        let rows = values.len() / cols;
        for r in row.saturating_sub(half + 1)..(row + half).min(rows) {
            sums.enter(&values[r * cols..(r + 1) * cols]);
        }
        sums
    }

    fn move_to(&mut self, values: &[f64], row: usize, half: usize) {
        let cols = self.sum.len();
        if let Some(entering) = values.get((row + half) * cols..(row + half + 1) * cols) {
            self.enter(entering);
        }
        if let Some(leaving) = row.checked_sub(half + 1) {
            self.leave(&values[leaving * cols..(leaving + 1) * cols]);
        }
    }

    fn enter(&mut self, row: &[f64]) {
        for ((s, n), v) in self.sum.iter_mut().zip(&mut self.count).zip(row) {
            let data = !v.is_nan();
            *s += if data { *v } else { 0.0 };
            *n += u32::from(data);
        }
    }

    fn leave(&mut self, row: &[f64]) {
        for ((s, n), v) in self.sum.iter_mut().zip(&mut self.count).zip(row) {
            let data = !v.is_nan();
            *s -= if data { *v } else { 0.0 };
            *n -= u32::from(data);
        }
    }
}

/// Means along one row from the column sums.
fn along_row(sums: &[f64], counts: &[u32], half: usize, mean: &mut [f64], count: &mut [u32]) {
    let cols = sums.len();
    let (mut s, mut n) = (0.0, 0);
    for c in 0..half.min(cols) {
        s += sums[c];
        n += counts[c];
    }
    for c in 0..cols {
        if let Some(entering) = sums.get(c + half) {
            s += entering;
            n += counts[c + half];
        }
        if let Some(leaving) = c.checked_sub(half + 1) {
            s -= sums[leaving];
            n -= counts[leaving];
        }
        count[c] = n;
        mean[c] = if n > 0 { s / f64::from(n) } else { f64::NAN };
    }
}

#[cfg(test)]
mod tests;
