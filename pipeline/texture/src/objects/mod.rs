//! Finds objects: cells that are not texture, such as trees, rocks, water and structures.
//!
//! Objects must be found before the moving average, which would smear them over a window, and against a background that
//! they do not affect. Detection and background therefore alternate: the residual from the moving average of the cells still
//! trusted is compared with a robust scale (1.4826 times the median absolute residual, the standard deviation of
//! normal data: Hampel, 1974). Cells beyond [`SEED_SCALES`] are objects, and so are the cells connected to them through
//! cells beyond [`GROWTH_SCALES`] (the skirt of a tree), with a margin of one cell. Every round classifies all cells
//! again, so that a cell whose residual a nearby tree had lowered becomes trusted again once the tree is removed.
//!
//! An object stands out from its own surroundings. The scale is that of the complete raster or, if larger, the local one:
//! the median over nine blocks of one window each (`Scales`). Against the raster's scale alone the steep fifth of a bare
//! site would count as objects, because the texture of slopes is larger than that of flats. An isolated object of up to about two
//! windows fills less than half of the blocks and does not mask itself; a thicket does, and is better masked by hand.
//!
//! On normal data 6e-7 of the cells exceed the first bound, so a surface without objects is left unchanged.
//!
//! Cost: a moving average and a count per round, and medians around the cells that stand out; rounds end when nothing changes, at most
//! `ROUNDS`.

use crate::sizes::{NORMAL_CONSISTENCY, Sizes};
use sastrugi_roughness::background::{BoxWindow, deviations};
use std::cell::OnceCell;
use std::ops::Range;

/// Robust standard deviations beyond which a cell is an object by itself.
pub const SEED_SCALES: f64 = 5.0;
/// Robust standard deviations beyond which a neighbour of an object belongs to it.
pub const GROWTH_SCALES: f64 = 2.5;
/// Number of blocks, one window each, whose median gives the local scale of a cell.
const BLOCKS: usize = 9;
/// Most rounds of detection.
const ROUNDS: usize = 12;

/// Marks the objects in row-major `values` (rows of `cols`, NaN where no data), relative to the moving average over
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

/// Objects relative to the background of the cells not marked in `object`.
fn judge(values: &[f64], object: &[bool], cols: usize, window: BoxWindow) -> Vec<bool> {
    let deviation = deviations(values, object, cols, window);
    let scales = Scales::of(&deviation, cols, window);
    // Where no trusted cell is left to compare with, an object stays one.
    let stays = |k: usize| object[k] && deviation[k].is_nan();
    let seeds = (0..deviation.len()).map(|k| scales.exceeded(k, SEED_SCALES) || stays(k)).collect();
    let grown = grow(seeds, cols, |k| scales.exceeded(k, GROWTH_SCALES));
    with_margin(&grown, values, cols)
}

/// Local robust standard deviation of the deviations: the median over [`BLOCKS`] blocks of each block's own, but at least that of
/// the complete raster. Computed lazily, only for cells that exceed the latter.
struct Scales<'a> {
    deviation: &'a [f64],
    cols: usize,
    /// Rows and columns of a block; the last blocks take the remainder.
    side: [usize; 2],
    /// Blocks down and across the raster.
    blocks: [usize; 2],
    /// Blocks down and across that enter the median.
    near: [usize; 2],
    /// Robust standard deviation of the complete raster.
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
        // A narrow raster uses the same number of blocks along its length.
        let near_across = (BLOCKS / blocks[0].min(3)).min(blocks[1]);
        let near = [(BLOCKS / near_across).min(blocks[0]), near_across];
        let raster = NORMAL_CONSISTENCY * Sizes::of(deviation).exceeded_by(0.5);
        let [medians, scales] = [(); 2].map(|()| vec![OnceCell::new(); blocks[0] * blocks[1]]);
        Self { deviation, cols, side, blocks, near, raster, medians, scales }
    }

    /// True if a cell deviates by more than `times` its scale.
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

/// Range of `near` blocks around block `at`, shifted to lie within `0..end`.
fn around(at: usize, near: usize, end: usize) -> Range<usize> {
    let first = at.saturating_sub(near / 2).min(end - near);
    first..first + near
}

/// Median of the values that are not NaN (the upper one of an even count); NaN without any.
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
