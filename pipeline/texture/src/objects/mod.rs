//! Cells that are no texture: trees, rocks, water, structures.
//!
//! They must be found before the moving average, which would smear them over a window, and against a background that
//! they do not move. So detection and background alternate: the residual to the moving average of the cells still
//! trusted is compared with a robust scale (1.4826 times the median absolute residual, the standard deviation of
//! normal data: Hampel, 1974); cells beyond [`SEED_SCALES`] are objects, and so are the cells joined to them through
//! cells beyond [`GROWTH_SCALES`] (the skirt of a tree), with a margin of one cell. Every round judges all cells
//! afresh, so that a cell pulled down by a tree nearby is taken back once the tree is out.
//!
//! An object stands out from its own surroundings. The scale is that of the whole raster or, where it is larger, of the
//! place: the median over nine blocks of a window each (`Scales`). Against the raster's scale alone the steep fifth of a bare
//! site would be taken for objects, because the texture of slopes is larger than that of flats. An object of up to about two
//! windows that stands alone fills less than half of the blocks and does not hide itself; a thicket does, and is better
//! masked by hand.
//!
//! On normal data 6e-7 of the cells pass the first bound, so a surface without objects is left as it is.
//!
//! Cost: a moving average and a count per round, and medians about what stands out; rounds end when nothing changes, at most
//! `ROUNDS`.

use crate::sizes::{NORMAL_CONSISTENCY, Sizes};
use sastrugi_roughness::background::{BoxWindow, deviations};
use std::cell::OnceCell;
use std::ops::Range;

/// Robust standard deviations beyond which a cell is an object by itself.
pub const SEED_SCALES: f64 = 5.0;
/// Robust standard deviations beyond which a neighbour of an object is one too.
pub const GROWTH_SCALES: f64 = 2.5;
/// Blocks of a window whose median says what the surroundings of a cell are like.
const BLOCKS: usize = 9;
/// Most rounds of detection.
const ROUNDS: usize = 12;

/// True for the objects of the row-major `values` (rows of `cols`, NaN where no data) about the moving average over
/// `window`.
pub fn find(values: &[f64], cols: usize, window: BoxWindow) -> Vec<bool> {
    let mut object = vec![false; values.len()];
    for _ in 0..ROUNDS {
        let next = judge(values, &object, cols, window);
        if next == object {
            break;
        }
        object = next;
    }
    object
}

/// Objects about the background of the cells not marked in `object`.
fn judge(values: &[f64], object: &[bool], cols: usize, window: BoxWindow) -> Vec<bool> {
    let deviation = deviations(values, object, cols, window);
    let scales = Scales::of(&deviation, cols, window);
    // Where nothing is left to judge by, a cell stays what it was.
    let stays = |k: usize| object[k] && deviation[k].is_nan();
    let seeds = (0..deviation.len()).map(|k| scales.exceeded(k, SEED_SCALES) || stays(k)).collect();
    let grown = grow(seeds, cols, |k| scales.exceeded(k, GROWTH_SCALES));
    with_margin(&grown, values, cols)
}

/// Robust standard deviation of the deviations about each place: the median over [`BLOCKS`] blocks of their own, and no less
/// than that of the whole raster. What cells beyond the latter do not ask for is not computed.
struct Scales<'a> {
    deviation: &'a [f64],
    cols: usize,
    /// Rows and columns of a block; the last ones take the rest.
    side: [usize; 2],
    /// Blocks down and across the raster.
    blocks: [usize; 2],
    /// Blocks down and across of which the median is taken.
    near: [usize; 2],
    /// Robust standard deviation of the whole raster.
    raster: f64,
    /// Median deviation of each block, and scale of each.
    medians: Vec<OnceCell<f64>>,
    scales: Vec<OnceCell<f64>>,
}

impl<'a> Scales<'a> {
    fn of(deviation: &'a [f64], cols: usize, window: BoxWindow) -> Self {
        let side = window.cells();
        let shape = [deviation.len() / cols, cols];
        let blocks = [0, 1].map(|k| (shape[k] / side[k]).max(1));
        // A narrow raster has as many blocks along it.
        let near_across = (BLOCKS / blocks[0].min(3)).min(blocks[1]);
        let near = [(BLOCKS / near_across).min(blocks[0]), near_across];
        let raster = NORMAL_CONSISTENCY * Sizes::of(deviation).exceeded_by(0.5);
        let [medians, scales] = [(); 2].map(|()| vec![OnceCell::new(); blocks[0] * blocks[1]]);
        Self { deviation, cols, side, blocks, near, raster, medians, scales }
    }

    /// True for a cell that deviates by more than so many scales.
    fn exceeded(&self, cell: usize, times: f64) -> bool {
        let deviation = self.deviation[cell];
        deviation > times * self.raster && deviation > times * self.scale(cell)
    }

    fn scale(&self, cell: usize) -> f64 {
        let place = [cell / self.cols, cell % self.cols];
        let [row, col] = [0, 1].map(|k| (place[k] / self.side[k]).min(self.blocks[k] - 1));
        *self.scales[row * self.blocks[1] + col].get_or_init(|| {
            let rows = around(row, self.near[0], self.blocks[0]);
            let places = rows.flat_map(|r| around(col, self.near[1], self.blocks[1]).map(move |c| [r, c]));
            self.raster.max(NORMAL_CONSISTENCY * median(places.map(|block| self.median(block)).collect()))
        })
    }

    /// Median deviation of a block.
    fn median(&self, block: [usize; 2]) -> f64 {
        *self.medians[block[0] * self.blocks[1] + block[1]].get_or_init(|| {
            let end = [self.deviation.len() / self.cols, self.cols];
            let span = |k: usize| {
                let last = block[k] + 1 == self.blocks[k];
                block[k] * self.side[k]..if last { end[k] } else { (block[k] + 1) * self.side[k] }
            };
            let line = |row: usize| &self.deviation[row * self.cols..][span(1)];
            median(span(0).flat_map(|row| line(row).iter().copied()).collect())
        })
    }
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
fn grow(mut marked: Vec<bool>, cols: usize, joined: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut front: Vec<usize> = (0..marked.len()).filter(|&k| marked[k]).collect();
    while let Some(k) = front.pop() {
        for neighbour in neighbours(k, cols, marked.len()) {
            if !marked[neighbour] && joined(neighbour) {
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
