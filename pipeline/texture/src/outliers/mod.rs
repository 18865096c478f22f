//! Cells that are no texture: trees, rocks, water, structures.
//!
//! They must be found before the moving average, which would smear them over a window, and against a background that
//! they do not move. So detection and background alternate: the residual to the moving average of the cells still
//! trusted is compared with a robust scale (1.4826 times the median absolute residual, the standard deviation of
//! normal data: Hampel, 1974); cells beyond [`SEED_SCALES`] are outliers, and so are the cells joined to them through
//! cells beyond [`GROWTH_SCALES`] (the skirt of a tree), with a margin of one cell. Every round judges all cells
//! afresh, so that a cell pulled down by a tree nearby is taken back once the tree is out.
//!
//! An object stands out from its own surroundings. The scale is that of the whole raster or, where it is larger, of the
//! place: the median over nine blocks of a window each ([`Scales`]). Against the raster's scale alone the steep fifth of a bare
//! site would be taken for objects, because the texture of slopes is larger than that of flats. An object of up to about two
//! windows that stands alone fills less than half of the blocks and does not hide itself; a thicket does, and is better
//! masked by hand.
//!
//! On normal data 6e-7 of the cells pass the first bound, so a surface without objects is left as it is.
//!
//! Cost: a moving average, a count and a selection per round; rounds end when nothing changes, at most `ROUNDS`.

use crate::detrend::{BoxWindow, deviations};
use crate::sizes::{NORMAL_CONSISTENCY, Sizes};
use std::ops::Range;

/// Robust standard deviations beyond which a cell is an outlier by itself.
pub const SEED_SCALES: f64 = 5.0;
/// Robust standard deviations beyond which a neighbour of an outlier is one too.
pub const GROWTH_SCALES: f64 = 2.5;
/// Blocks of a window whose median says what the surroundings of a cell are like.
const BLOCKS: usize = 9;
/// Most rounds of detection.
const ROUNDS: usize = 12;

/// True for the outliers of the row-major `values` (rows of `cols`, NaN where no data) about the moving average over
/// `window`.
pub fn find(values: &[f64], cols: usize, window: BoxWindow) -> Vec<bool> {
    let mut outlier = vec![false; values.len()];
    for _ in 0..ROUNDS {
        let next = judge(values, &outlier, cols, window);
        if next == outlier {
            break;
        }
        outlier = next;
    }
    outlier
}

/// Outliers about the background of the cells not marked in `outlier`.
fn judge(values: &[f64], outlier: &[bool], cols: usize, window: BoxWindow) -> Vec<bool> {
    let deviation = deviations(values, outlier, cols, window);
    let scales = Scales::of(&deviation, cols, window);
    let joined = scales.exceeded(&deviation, GROWTH_SCALES);
    let grown = grow(scales.exceeded(&deviation, SEED_SCALES), cols, &joined);
    with_margin(&grown, values, cols)
}

/// Robust standard deviation of the deviations about each place: the median over [`BLOCKS`] blocks of their own, and no less
/// than that of the whole raster.
struct Scales {
    /// Blocks that a row and a column of the raster fall into.
    block_of_row: Vec<usize>,
    block_of_col: Vec<usize>,
    /// By rows of blocks.
    values: Vec<f64>,
    /// Blocks in a row of them.
    across: usize,
}

impl Scales {
    fn of(deviation: &[f64], cols: usize, window: BoxWindow) -> Self {
        let [tall, wide] = window.cells();
        let (block_of_row, block_of_col) = (blocks(deviation.len() / cols, tall), blocks(cols, wide));
        let count = |of: &[usize]| of.last().map_or(0, |last| last + 1);
        let (down, across) = (count(&block_of_row), count(&block_of_col));
        let mut within = vec![Vec::new(); down * across];
        for (line, block) in deviation.chunks_exact(cols).zip(&block_of_row) {
            line.iter().zip(&block_of_col).for_each(|(d, b)| within[block * across + b].push(*d));
        }
        let own: Vec<f64> = within.into_iter().map(median).collect();
        let raster = Sizes::of(deviation).exceeded_by(0.5);
        // A narrow raster has as many blocks along it.
        let near_across = (BLOCKS / down.clamp(1, 3)).min(across);
        let near_down = (BLOCKS / near_across.max(1)).min(down);
        let local = |row: usize, col: usize| {
            let places =
                around(row, near_down, down).flat_map(|r| around(col, near_across, across).map(move |c| (r, c)));
            median(places.map(|(r, c)| own[r * across + c]).collect())
        };
        let all = (0..down).flat_map(|r| (0..across).map(move |c| (r, c)));
        let values = all.map(|(r, c)| NORMAL_CONSISTENCY * raster.max(local(r, c))).collect();
        Self { block_of_row, block_of_col, values, across }
    }

    /// The cells that deviate by more than so many scales.
    fn exceeded(&self, deviation: &[f64], times: f64) -> Vec<bool> {
        let lines = deviation.chunks_exact(self.block_of_col.len().max(1)).zip(&self.block_of_row);
        let of_line = |(line, block): (_, &usize)| {
            let scales = &self.values[block * self.across..];
            std::iter::zip::<&[f64], _>(line, &self.block_of_col).map(move |(d, b)| *d > times * scales[*b])
        };
        lines.flat_map(of_line).collect()
    }
}

/// The block of a window's side that each cell of a line falls into; the last one takes the rest.
fn blocks(cells: usize, side: usize) -> Vec<usize> {
    let last = (cells / side).max(1) - 1;
    (0..cells).map(|cell| (cell / side).min(last)).collect()
}

/// `near` blocks about block `at` of `end`, all within.
fn around(at: usize, near: usize, end: usize) -> Range<usize> {
    let first = at.saturating_sub(near / 2).min(end - near);
    first..first + near
}

/// Median of what is a number (the upper one of an even count); NaN without any.
fn median(mut values: Vec<f64>) -> f64 {
    values.retain(|v| !v.is_nan());
    let middle = values.len() / 2;
    if values.is_empty() { f64::NAN } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// Flood fill from the marked cells to neighbours (eight) that are `joined`.
fn grow(mut marked: Vec<bool>, cols: usize, joined: &[bool]) -> Vec<bool> {
    let mut front: Vec<usize> = (0..marked.len()).filter(|&k| marked[k]).collect();
    while let Some(k) = front.pop() {
        for neighbour in neighbours(k, cols, marked.len()) {
            if !marked[neighbour] && joined[neighbour] {
                marked[neighbour] = true;
                front.push(neighbour);
            }
        }
    }
    marked
}

/// The marked cells and their neighbours that have data.
fn with_margin(marked: &[bool], values: &[f64], cols: usize) -> Vec<bool> {
    let mut wider = marked.to_vec();
    for k in (0..marked.len()).filter(|&k| marked[k]) {
        for neighbour in neighbours(k, cols, marked.len()) {
            wider[neighbour] |= !values[neighbour].is_nan();
        }
    }
    wider
}

/// The up to eight neighbours of cell `k` in a raster of `len` cells.
fn neighbours(k: usize, cols: usize, len: usize) -> impl Iterator<Item = usize> {
    let (row, col, rows) = (k / cols, k % cols, len / cols);
    let near = |centre: usize, end: usize| centre.saturating_sub(1)..(centre + 2).min(end);
    near(row, rows).flat_map(move |r| near(col, cols).map(move |c| r * cols + c)).filter(move |&n| n != k)
}

#[cfg(test)]
mod tests;
