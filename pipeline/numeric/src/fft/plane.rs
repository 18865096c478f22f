//! Two-dimensional transforms of real fields.
//!
//! Two rows share a complex transform (one is its real part, the other its imaginary part), and four such pairs, or four columns,
//! are transformed side by side. Between the two directions, the numbers are stored in blocks of [`GROUP`] rows by [`LANES`] columns
//! inside the vector of the result, which avoids both a complete transposition and a second vector.

use super::Complex64;
use super::quads::{Buffers, LANES, Quad, QuadTransform};
use rayon::prelude::*;
use std::slice::ChunksMut;

/// Number of rows transformed together.
pub const GROUP: usize = 2 * LANES;

/// Transforms of fields of one shape.
#[derive(Clone)]
pub struct Plane {
    rows: usize,
    cols: usize,
    along_row: QuadTransform,
    along_col: QuadTransform,
}

impl Plane {
    pub fn new(rows: usize, cols: usize) -> Self {
        let along_row = QuadTransform::new(cols);
        let along_col = if rows == cols { along_row.clone() } else { QuadTransform::new(rows) };
        Self { rows, cols, along_row, along_col }
    }

    /// The half spectrum of a field of which the first rows are given; the others are zero, and so are their transforms.
    pub fn forward(&self, field: &[f64]) -> Vec<Complex64> {
        let Self { rows, cols, .. } = *self;
        let half = cols / 2 + 1;
        let mut values = vec![Complex64::default(); rows * half.next_multiple_of(LANES)];
        let strips = values.chunks_mut(LANES * rows);
        let groups = gathered(strips.map(|strip| strip.chunks_mut(LANES * GROUP)));
        field.par_chunks(GROUP * cols).zip(groups).for_each_init(
            || self.along_row.buffers(),
            |buffers, (rows, mut blocks)| self.forward_rows(rows, &mut blocks, buffers),
        );
        values
            .par_chunks_mut(LANES * rows)
            .for_each_init(|| self.along_col.buffers(), |buffers, strip| self.forward_columns(strip, buffers));
        values.truncate(rows * half);
        values
    }

    /// The first `wanted` rows of the field of the half spectrum whose columns are written by `fill`.
    pub fn inverse_of(&self, wanted: usize, fill: impl Fn(usize, &mut [Complex64]) + Sync) -> Vec<f64> {
        let Self { rows, cols, .. } = *self;
        let wanted = wanted.min(rows);
        // Columns 0 and `cols / 2` are real after their transforms, so one complex column holds both.
        let packed = cols.next_multiple_of(2 * LANES);
        let last = cols.is_multiple_of(2).then(|| self.column_alone(cols / 2, &fill));
        let mut field = vec![0.0; rows * packed];
        let groups = field.chunks_mut(GROUP * packed);
        let strips = gathered(groups.map(|group| group.chunks_mut(group.len() / packed * 2 * LANES)));
        strips.into_par_iter().enumerate().for_each_init(
            || (vec![Complex64::default(); LANES * rows], self.along_col.buffers()),
            |(columns, buffers), (strip, mut blocks)| {
                let stored = (strip * LANES..cols.div_ceil(2)).zip(columns.chunks_exact_mut(rows));
                stored.for_each(|(kx, column)| fill(kx, column));
                let last = last.as_deref().filter(|_| strip == 0);
                self.inverse_columns(columns, last, &mut blocks, buffers);
            },
        );
        // Rows are transformed in complete groups, whose members share transforms.
        field[..wanted.next_multiple_of(GROUP).min(rows) * packed]
            .par_chunks_mut(GROUP * packed)
            .for_each_init(|| self.along_row.buffers(), |buffers, group| self.inverse_rows(group, packed, buffers));
        if packed > cols {
            (1..wanted).for_each(|row| field.copy_within(row * packed..row * packed + cols, row * cols));
        }
        field.truncate(wanted * cols);
        field
    }

    /// Real part of one column's inverse transform.
    fn column_alone(&self, kx: usize, fill: &impl Fn(usize, &mut [Complex64])) -> Vec<f64> {
        let (mut column, mut buffers) = (vec![Complex64::default(); self.rows], self.along_col.buffers());
        fill(kx, &mut column);
        for (quad, v) in buffers.data.iter_mut().zip(&column) {
            (quad.re[0], quad.im[0]) = (v.re, v.im);
        }
        let out = self.along_col.process::<true>(&mut buffers);
        out[..self.rows].iter().map(|quad| quad.re[0]).collect()
    }

    /// Transforms up to eight `rows` into one block per strip of columns.
    fn forward_rows(&self, rows: &[f64], blocks: &mut [&mut [Complex64]], buffers: &mut Buffers) {
        let cols = self.cols;
        load_lines(rows, cols, &mut buffers.data);
        let out = self.along_row.process::<false>(buffers);
        for (strip, block) in blocks.iter_mut().enumerate() {
            let mut tile = [[Complex64::default(); LANES]; GROUP];
            for lane in 0..LANES.min(cols / 2 + 1 - strip * LANES) {
                let k = strip * LANES + lane;
                let rows = separated(&out[k], &out[(cols - k) % cols]);
                tile.iter_mut().zip(rows).for_each(|(line, v)| line[lane] = v);
            }
            block.as_chunks_mut().0.iter_mut().zip(tile).for_each(|(to, line)| *to = line);
        }
    }

    /// Transforms the four columns stored row by row in `strip`, and stores them there column by column.
    fn forward_columns(&self, strip: &mut [Complex64], buffers: &mut Buffers) {
        for (quad, values) in buffers.data.iter_mut().zip(strip.as_chunks::<LANES>().0) {
            *quad = Quad { re: values.map(|v| v.re), im: values.map(|v| v.im) };
        }
        let out = self.along_col.process::<false>(buffers);
        for (lane, column) in strip.chunks_exact_mut(self.rows).enumerate() {
            for (v, quad) in column.iter_mut().zip(out) {
                *v = Complex64::new(quad.re[lane], quad.im[lane]);
            }
        }
    }

    /// Transforms four `columns` into one block per group of rows. Each row holds the real parts, then the imaginary parts,
    /// the first of which is replaced by `last`.
    fn inverse_columns(
        &self,
        columns: &[Complex64],
        last: Option<&[f64]>,
        blocks: &mut [&mut [f64]],
        buffers: &mut Buffers,
    ) {
        let rows = self.rows;
        let columns: [&[Complex64]; LANES] = std::array::from_fn(|lane| &columns[lane * rows..(lane + 1) * rows]);
        for (row, quad) in buffers.data[..rows].iter_mut().enumerate() {
            *quad = Quad { re: columns.map(|c| c[row].re), im: columns.map(|c| c[row].im) };
        }
        let out = self.along_col.process::<true>(buffers);
        let lines = blocks.iter_mut().flat_map(|block| block.as_chunks_mut::<{ 2 * LANES }>().0);
        for (row, (line, quad)) in lines.zip(out).enumerate() {
            line[..LANES].copy_from_slice(&quad.re);
            line[LANES..].copy_from_slice(&quad.im);
            if let Some(last) = last {
                line[LANES] = last[row];
            }
        }
    }

    /// Transforms up to eight rows from the blocks in `group` to lines, in place.
    fn inverse_rows(&self, group: &mut [f64], packed: usize, buffers: &mut Buffers) {
        let cols = self.cols;
        let height = group.len() / packed;
        for (strip, block) in group.chunks_exact(height * 2 * LANES).enumerate() {
            let lines = block.as_chunks().0;
            let mut padded = [[0.0; 2 * LANES]; GROUP];
            let lines = <&[_; GROUP]>::try_from(lines).unwrap_or_else(|_| {
                padded[..height].copy_from_slice(lines);
                &padded
            });
            for lane in 0..LANES.min(cols.div_ceil(2) - strip * LANES) {
                let (ahead, behind) = combined(lines, lane);
                match strip * LANES + lane {
                    0 => self.unpack(lines, &mut buffers.data),
                    k => (buffers.data[k], buffers.data[cols - k]) = (ahead, behind),
                }
            }
        }
        let scale = 1.0 / (self.rows * cols) as f64;
        let out = self.along_row.process::<true>(buffers);
        store_lines(&out[..cols], scale, group, packed);
    }

    /// The two real columns that share the first lane of the first strip.
    fn unpack(&self, lines: &[[f64; 2 * LANES]; GROUP], work: &mut [Quad]) {
        let column = |at: usize| Quad {
            re: std::array::from_fn(|pair| lines[2 * pair][at]),
            im: std::array::from_fn(|pair| lines[2 * pair + 1][at]),
        };
        if self.cols.is_multiple_of(2) {
            work[self.cols / 2] = column(LANES);
        }
        work[0] = column(0);
    }
}

/// Combines four pairs of rows `a` and `b` at one column frequency to `a + i b`, and their conjugates likewise at the opposite
/// frequency.
#[inline(always)]
fn combined(lines: &[[f64; 2 * LANES]; GROUP], lane: usize) -> (Quad, Quad) {
    let (mut ahead, mut behind) = (Quad::default(), Quad::default());
    for pair in 0..LANES {
        let (a, b) = (&lines[2 * pair], &lines[2 * pair + 1]);
        (ahead.re[pair], ahead.im[pair]) = (a[lane] - b[LANES + lane], a[LANES + lane] + b[lane]);
        (behind.re[pair], behind.im[pair]) = (a[lane] + b[LANES + lane], b[lane] - a[LANES + lane]);
    }
    (ahead, behind)
}

/// Separates the rows of four pairs `a + i b` whose transforms are `ahead` and, at the opposite frequency, `behind`.
#[inline(always)]
fn separated(ahead: &Quad, behind: &Quad) -> [Complex64; GROUP] {
    let mut rows = [Complex64::default(); GROUP];
    for pair in 0..LANES {
        let a = Complex64::new(ahead.re[pair], ahead.im[pair]);
        let b = Complex64::new(behind.re[pair], -behind.im[pair]);
        let d = (a - b) * 0.5;
        (rows[2 * pair], rows[2 * pair + 1]) = ((a + b) * 0.5, Complex64::new(d.im, -d.re));
    }
    rows
}

/// Loads up to eight lines of `len` as four pairs; missing lines are zero.
fn load_lines(lines: &[f64], len: usize, quads: &mut [Quad]) {
    let nothing = vec![0.0; if lines.len() < GROUP * len { len } else { 0 }];
    let line = |k: usize| lines.get(k * len..(k + 1) * len).unwrap_or(&nothing);
    let even: [&[f64]; LANES] = std::array::from_fn(|pair| line(2 * pair));
    let odd: [&[f64]; LANES] = std::array::from_fn(|pair| line(2 * pair + 1));
    for (k, quad) in quads[..len].iter_mut().enumerate() {
        *quad = Quad { re: even.map(|line| line[k]), im: odd.map(|line| line[k]) };
    }
}

/// Stores four pairs, multiplied by `scale`, as up to eight lines that start `pitch` apart, one cache line of each at a time.
pub fn store_lines(quads: &[Quad], scale: f64, lines: &mut [f64], pitch: usize) {
    for (tile, quads) in quads.chunks(GROUP).enumerate() {
        for (k, line) in lines.chunks_mut(pitch).enumerate() {
            let line = line[tile * GROUP..].iter_mut().zip(quads);
            match k % 2 {
                0 => line.for_each(|(v, quad)| *v = quad.re[k / 2] * scale),
                _ => line.for_each(|(v, quad)| *v = quad.im[k / 2] * scale),
            }
        }
    }
}

/// The first block of every part, then the second block of every part, and so on.
pub fn gathered<'a, T>(parts: impl Iterator<Item = ChunksMut<'a, T>>) -> Vec<Vec<&'a mut [T]>> {
    let mut all = Vec::new();
    for blocks in parts {
        for (k, block) in blocks.enumerate() {
            if k == all.len() {
                all.push(Vec::new());
            }
            all[k].push(block);
        }
    }
    all
}
