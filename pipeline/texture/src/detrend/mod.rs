//! Moving average over the cells with data.
//!
//! `mean(i) = sum of z(j) m(j) / n(i)`, `n(i) = sum of m(j)`, over the cells j of the centred box window of cell i, with
//! m = 1 on cells with data, else 0. Cells beyond the border have no data.
//!
//! The box is an odd number of cells wide each way, so that it has a centre. Cost: a few additions per cell whatever the
//! window (running sums down the columns, then along the rows, started afresh on every band of rows so that neither
//! rounding nor the number of threads shows). Memory: 12 bytes per cell of result and two rows per band.

use rayon::prelude::*;
use std::borrow::Cow;

/// Bands are at least this many rows, and four times the window.
const BAND_ROWS: usize = 64;

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
    let mut mean = vec![0.0; values.len()];
    let mut count = vec![0; values.len()];
    let band = band_rows(window);
    let cells = (band * cols).max(1);
    mean.par_chunks_mut(cells).zip(count.par_chunks_mut(cells)).enumerate().for_each(|(k, (mean, count))| {
        let mut average = RunningMean::from(values, cols, window, k * band);
        mean.chunks_exact_mut(cols).zip(count.chunks_exact_mut(cols)).for_each(|(m, n)| average.next_row(m, n));
    });
    BoxMean { mean, count }
}

/// Absolute differences of row-major `values` in rows of `cols` from the moving average over those not marked in `left_out`;
/// NaN where there is no data, or none in the window.
pub(crate) fn deviations(values: &[f64], left_out: &[bool], cols: usize, window: BoxWindow) -> Vec<f64> {
    let averaged = match left_out.contains(&true) {
        true => Cow::from_iter(values.iter().zip(left_out).map(|(&v, &out)| if out { f64::NAN } else { v })),
        false => Cow::from(values),
    };
    let band = band_rows(window);
    let mut deviations = vec![0.0; values.len()];
    deviations.par_chunks_mut((band * cols).max(1)).enumerate().for_each(|(k, lines)| {
        let mut average = RunningMean::from(&averaged, cols, window, k * band);
        let (mut mean, mut count) = (vec![0.0; cols], vec![0; cols]);
        for (line, own) in lines.chunks_exact_mut(cols).zip(values[k * band * cols..].chunks_exact(cols)) {
            average.next_row(&mut mean, &mut count);
            line.iter_mut().zip(own).zip(&mean).for_each(|((d, v), m)| *d = (v - m).abs());
        }
    });
    deviations
}

/// Rows after which sums are started afresh.
pub(crate) fn band_rows(window: BoxWindow) -> usize {
    BAND_ROWS.max(4 * window.cells()[0])
}

/// Moving average row by row, from the north to the south.
pub(crate) struct RunningMean<'a> {
    values: &'a [f64],
    window: BoxWindow,
    columns: ColumnSums,
    /// The row that comes next.
    row: usize,
}

impl<'a> RunningMean<'a> {
    /// The average of row-major `values` in rows of `cols`, from row `first` on.
    pub fn from(values: &'a [f64], cols: usize, window: BoxWindow, first: usize) -> Self {
        let half = window.half[0];
        let mut columns = ColumnSums { sum: vec![0.0; cols], count: vec![0; cols] };
        let rows = values.len() / cols;
        // What the step to the first row takes off enters as well.
        for r in first.saturating_sub(half + 1)..(first + half).min(rows) {
            columns.enter(&values[r * cols..(r + 1) * cols]);
        }
        Self { values, window, columns, row: first }
    }

    /// Mean and count of data in the windows of the next row.
    pub fn next_row(&mut self, mean: &mut [f64], count: &mut [u32]) {
        let (cols, half) = (self.columns.sum.len(), self.window.half[0]);
        let line = |row: usize| self.values.get(row * cols..(row + 1) * cols);
        if let Some(entering) = line(self.row + half) {
            self.columns.enter(entering);
        }
        if let Some(leaving) = self.row.checked_sub(half + 1).and_then(line) {
            self.columns.leave(leaving);
        }
        self.row += 1;
        let half = self.window.half[1];
        // The difference does not wait for the sum.
        along_row(&self.columns.sum, half, mean, |sum, entering, leaving| sum + (entering - leaving));
        along_row(&self.columns.count, half, count, |sum, entering, leaving| sum + entering - leaving);
        for (m, &n) in mean.iter_mut().zip(count.iter()) {
            *m = if n > 0 { *m / f64::from(n) } else { f64::NAN };
        }
    }
}

/// Sums down each column over the rows of the window.
struct ColumnSums {
    sum: Vec<f64>,
    count: Vec<u32>,
}

impl ColumnSums {
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

/// Sums of `values` over as many as `half` to both sides of each; `moved(sum, entering, leaving)` is the next sum.
fn along_row<T: Copy + Default>(values: &[T], half: usize, sums: &mut [T], moved: impl Fn(T, T, T) -> T) {
    let (cols, zero) = (values.len(), T::default());
    let mut sum = values[..half.min(cols)].iter().fold(zero, |sum, &v| moved(sum, v, zero));
    let (first, others) = sums.split_at_mut((half + 1).min(cols));
    for (c, out) in first.iter_mut().enumerate() {
        sum = moved(sum, values.get(c + half).copied().unwrap_or(zero), zero);
        *out = sum;
    }
    let entering = &values[(2 * half + 1).min(cols)..];
    let (middle, last) = others.split_at_mut(entering.len());
    for ((out, &entering), &leaving) in middle.iter_mut().zip(entering).zip(values) {
        sum = moved(sum, entering, leaving);
        *out = sum;
    }
    for (out, &leaving) in last.iter_mut().zip(&values[entering.len()..]) {
        sum = moved(sum, zero, leaving);
        *out = sum;
    }
}

#[cfg(test)]
mod tests;
