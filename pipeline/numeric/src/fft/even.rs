//! Transform of an even field, which is real and even too: a quarter of it is computed.

use super::plane::{GROUP, gathered, store_lines};
use super::quads::{Buffers, QuadTransform};
use rayon::prelude::*;

/// Transform of the field of `rows` by `cols` that is even in both directions and whose rows `0..=rows / 2` `fill` writes,
/// each at columns `0..=cols / 2`. The value at column frequency `kx <= cols / 2` and row frequency `ky <= rows / 2` is at
/// `kx * (rows / 2 + 1) + ky`.
///
/// Eight lines run side by side, in pairs that share a complex transform. Memory: the result.
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
            // A line that is not there is zero: what an earlier group left would change the rounding of its partner.
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

/// Continues the values 0 to `len / 2` of even sequences of `len`.
fn mirror(buffers: &mut Buffers, len: usize) {
    (1..len.div_ceil(2)).for_each(|k| buffers.data[len - k] = buffers.data[k]);
}
