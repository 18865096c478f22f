//! Background computed row by row with running sums.

use super::moments::Moments;
use super::{AtPartial, BoxWindow};
use std::ops::Range;

/// Background row by row, from north to south.
pub struct RunningBackground<'a> {
    values: &'a [f64],
    window: BoxWindow,
    at_partial: AtPartial,
    columns: ColumnSums,
    /// First moments down the columns; updated only where windows are partial.
    slopes: ColumnSlopes,
    /// Next row.
    row: usize,
}

impl<'a> RunningBackground<'a> {
    /// Starts the background of row-major `values` in rows of `cols` at row `first`.
    pub fn from(values: &'a [f64], cols: usize, window: BoxWindow, at_partial: AtPartial, first: usize) -> Self {
        let half = window.half[0];
        let mut columns = ColumnSums { sum: vec![0.0; cols], count: vec![0; cols] };
        let rows = values.len() / cols;
        // Includes the row that the step to the first row removes.
        for r in first.saturating_sub(half + 1)..(first + half).min(rows) {
            columns.enter(&values[r * cols..(r + 1) * cols]);
        }
        Self { values, window, at_partial, columns, slopes: ColumnSlopes::new(cols), row: first }
    }

    /// Writes the background, and the number of cells with data in the window, of the next row.
    pub fn next_row(&mut self, height_m: &mut [f64], count: &mut [u32]) {
        let (cols, half) = (self.columns.sum.len(), self.window.half[0]);
        let line = |row: usize| self.values.get(row * cols..(row + 1) * cols);
        if let Some(entering) = line(self.row + half) {
            self.columns.enter(entering);
        }
        if let Some(leaving) = self.row.checked_sub(half + 1).and_then(line) {
            self.columns.leave(leaving);
        }
        let half = self.window.half[1];
        // Grouped so that the difference does not depend on the previous sum.
        along_row(&self.columns.sum, half, height_m, |sum, entering, leaving| sum + (entering - leaving));
        along_row(&self.columns.count, half, count, |sum, entering, leaving| sum + entering - leaving);
        for (z, &n) in height_m.iter_mut().zip(count.iter()) {
            *z = if n > 0 { *z / f64::from(n) } else { f64::NAN };
        }
        if self.at_partial == AtPartial::Plane {
            self.planes(height_m, count);
        }
        self.row += 1;
    }

    /// Replaces the means of partial windows by planes.
    fn planes(&mut self, height_m: &mut [f64], count: &[u32]) {
        let area = self.window.area();
        let full = self.window.cells()[0] as u32;
        // If only complete columns are missing (western and eastern border), moments down the columns vanish or are not needed.
        if self.columns.count.iter().any(|&n| n < full) {
            self.slopes.follow(self.values, self.window.half[0], self.row);
        } else {
            self.slopes.balance(self.window.half[0]);
        }
        let mut next = 0;
        while let Some(start) = (next..count.len()).find(|&c| (count[c] as usize) < area) {
            let end = (start..count.len()).find(|&c| count[c] as usize == area).unwrap_or(count.len());
            // Sums along the row restart after each window width.
            let width = self.window.cells()[1];
            (start..end).step_by(width).for_each(|c| self.planes_of(c..(c + width).min(end), height_m));
            next = end;
        }
    }

    /// Planes of a run of cells of the row.
    fn planes_of(&self, run: Range<usize>, height_m: &mut [f64]) {
        let (cols, half) = (height_m.len(), self.window.half[1]);
        let mut sums = WindowSums::default();
        for column in run.start.saturating_sub(half)..(run.start + half).min(cols) {
            self.add(&mut sums, column, column as f64 - run.start as f64, 1.0);
        }
        for c in run {
            if c + half < cols {
                self.add(&mut sums, c + half, half as f64, 1.0);
            }
            let Moments { n, .. } = sums.moments;
            if n > 0.0 {
                let weights = sums.moments.weights();
                height_m[c] = weights.map_or(f64::NAN, |w| w.sum(sums.z, sums.xz, sums.yz));
            }
            if c >= half {
                self.add(&mut sums, c - half, -(half as f64), -1.0);
            }
            sums.step_east();
        }
    }

    /// Adds a column at an offset of `dx` to the sums of a window, or subtracts it (sign -1).
    fn add(&self, sums: &mut WindowSums, column: usize, dx: f64, sign: f64) {
        let (n, z) = (sign * f64::from(self.columns.count[column]), sign * self.columns.sum[column]);
        let (y, yy, yz) = self.slopes.centred(column, self.columns.count[column], self.columns.sum[column], self.row);
        let m = &mut sums.moments;
        m.n += n;
        m.x += dx * n;
        m.xx += dx * dx * n;
        m.y += sign * y;
        m.xy += sign * dx * y;
        m.yy += sign * yy;
        sums.z += z;
        sums.xz += dx * z;
        sums.yz += sign * yz;
    }
}

/// Sums of a window about its centre: cell offsets, heights, and heights times offset.
#[derive(Default)]
struct WindowSums {
    moments: Moments,
    z: f64,
    xz: f64,
    yz: f64,
}

impl WindowSums {
    /// Moves the centre one column to the east, for the same cells.
    fn step_east(&mut self) {
        let m = &mut self.moments;
        m.xx += m.n - 2.0 * m.x;
        m.x -= m.n;
        m.xy -= m.y;
        self.xz -= self.z;
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

/// Sums of r, r^2 and r z down each column, over the rows r of the window, counted from a nearby row.
struct ColumnSlopes {
    y: Vec<f64>,
    yy: Vec<f64>,
    yz: Vec<f64>,
    /// Row from which r is counted.
    origin: usize,
    /// Row whose window the sums cover; `None` while they are not updated.
    row: Option<usize>,
    /// Sum of r^2 about the centre of a complete column; replaces the other sums while it is set.
    balanced: Option<f64>,
}

impl ColumnSlopes {
    fn new(cols: usize) -> Self {
        let zeros = || vec![0.0; cols];
        Self { y: zeros(), yy: zeros(), yz: zeros(), origin: 0, row: None, balanced: None }
    }

    /// For rows whose columns are all complete: cells balance about the centre, and no plane tilts north-south.
    fn balance(&mut self, half: usize) {
        let half = half as f64;
        self.balanced = Some(half * (half + 1.0) * (2.0 * half + 1.0) / 3.0);
        self.row = None;
    }

    /// Updates the sums to the window of a row.
    fn follow(&mut self, values: &[f64], half: usize, row: usize) {
        let cols = self.y.len();
        let line = |row: usize| values.get(row * cols..(row + 1) * cols);
        self.balanced = None;
        if row > 0 && self.row == Some(row - 1) {
            line(row + half).into_iter().for_each(|entering| self.add(entering, row + half, 1.0));
            let leaving = row.checked_sub(half + 1);
            leaving.and_then(|r| Some((r, line(r)?))).into_iter().for_each(|(r, line)| self.add(line, r, -1.0));
        } else {
            [&mut self.y, &mut self.yy, &mut self.yz].into_iter().for_each(|sums| sums.fill(0.0));
            self.origin = row;
            (row.saturating_sub(half)..=row + half)
                .map_while(|r| Some((r, line(r)?)))
                .for_each(|(r, line)| self.add(line, r, 1.0));
        }
        self.row = Some(row);
    }

    fn add(&mut self, line: &[f64], row: usize, sign: f64) {
        let r = row as f64 - self.origin as f64;
        let (one, two) = (sign * r, sign * r * r);
        for (((y, yy), yz), z) in self.y.iter_mut().zip(&mut self.yy).zip(&mut self.yz).zip(line) {
            let data = !z.is_nan();
            *y += if data { one } else { 0.0 };
            *yy += if data { two } else { 0.0 };
            *yz += if data { one * z } else { 0.0 };
        }
    }

    /// The sums of a column of `n` cells with total height `z`, about a row.
    fn centred(&self, column: usize, n: u32, z: f64, row: usize) -> (f64, f64, f64) {
        if let Some(yy) = self.balanced {
            return (0.0, yy, 0.0);
        }
        let (n, by) = (f64::from(n), row as f64 - self.origin as f64);
        let y = self.y[column];
        (y - by * n, self.yy[column] - by * (2.0 * y - by * n), self.yz[column] - by * z)
    }
}

/// Sums of `values` over up to `half` neighbours on both sides of each; `moved(sum, entering, leaving)` returns the next sum.
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
