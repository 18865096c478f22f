//! Transform of an even field. The result is real and even too, so only a quarter of it is computed.

use super::plane::{GROUP, gathered, store_lines};
use super::quads::{Buffers, QuadTransform};
use rayon::prelude::*;

/// Transform of a field of `rows` by `cols` that is even in both directions. `fill` writes its rows `0..=rows / 2`, each at
/// columns `0..=cols / 2`. The value at column frequency `kx <= cols / 2` and row frequency `ky <= rows / 2` is stored at
/// `kx * (rows / 2 + 1) + ky`.
///
/// Eight lines are transformed side by side, in pairs that share a complex transform. Memory: the result.
///
/// ```
/// use sastrugi_numeric::fft::even_spectrum;
///
/// // White noise of variance 2: the covariance is 2 at lag 0 and 0 elsewhere, so the spectrum is 2 everywhere.
/// let spectrum = even_spectrum([6, 8], |row, line| {
///     line.fill(0.0);
///     if row == 0 {
///         line[0] = 2.0;
///     }
/// });
/// assert_eq!(spectrum.len(), (6 / 2 + 1) * (8 / 2 + 1));
/// assert!(spectrum.iter().all(|power| (power - 2.0).abs() < 1e-12));
/// ```
pub fn even_spectrum([rows, cols]: [usize; 2], fill: impl Fn(usize, &mut [f64]) + Sync) -> Vec<f64> {
    let (half_rows, half_cols) = (rows / 2 + 1, cols / 2 + 1);
    let along_row = QuadTransform::new(cols);
    let along_col = if rows == cols { along_row.clone() } else { QuadTransform::new(rows) };
    let mut values = vec![0.0; half_rows * half_cols.next_multiple_of(GROUP)];
    let strips = values.chunks_mut(GROUP * half_rows);
    let groups = gathered(strips.map(|strip| strip.chunks_mut(GROUP * GROUP)));
    groups.into_par_iter().enumerate().for_each_init(
        || (vec![0.0; half_cols], along_row.buffers()),
        |(line, buffers), (group, mut blocks)| {
            let mut empty = true;
            // Missing lines are set to zero: values left by an earlier group would change the rounding of their partners.
            let there = GROUP.min(half_rows - group * GROUP);
            buffers.data[..half_cols]
                .iter_mut()
                .for_each(|quad| (there..GROUP).for_each(|lane| *quad.part_mut(lane) = 0.0));
            for (lane, row) in (group * GROUP..half_rows).take(GROUP).enumerate() {
                fill(row, line);
                empty &= line.iter().all(|v| *v == 0.0);
                buffers.data.iter_mut().zip(line.iter()).for_each(|(quad, v)| *quad.part_mut(lane) = *v);
            }
            if empty {
                // The blocks are zero already.
                return;
            }
            mirror(buffers, cols);
            for (k, quad) in along_row.process::<false>(buffers)[..half_cols].iter().enumerate() {
                let column = blocks[k / GROUP].iter_mut().skip(k % GROUP).step_by(GROUP);
                column.enumerate().for_each(|(lane, v)| *v = quad.part(lane));
            }
        },
    );
    values.par_chunks_mut(GROUP * half_rows).for_each_init(
        || along_col.buffers(),
        |buffers, strip| {
            for (quad, line) in buffers.data.iter_mut().zip(strip.as_chunks::<GROUP>().0) {
                (0..GROUP).for_each(|lane| *quad.part_mut(lane) = line[lane]);
            }
            mirror(buffers, rows);
            let out = along_col.process::<false>(buffers);
            store_lines(&out[..half_rows], 1.0, strip, half_rows);
        },
    );
    values.truncate(half_rows * half_cols);
    values
}

/// Completes even sequences of length `len` from their values 0 to `len / 2`.
fn mirror(buffers: &mut Buffers, len: usize) {
    (1..len.div_ceil(2)).for_each(|k| buffers.data[len - k] = buffers.data[k]);
}
