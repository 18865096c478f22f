//! Cells that are no texture: trees, rocks, water, structures.
//!
//! They must be found before the moving average, which would smear them over a window, and against a background that
//! they do not move. So detection and background alternate: the residual to the moving average of the cells still
//! trusted is compared with a robust scale (1.4826 times the median absolute residual, the standard deviation of
//! normal data: Hampel, 1974); cells beyond [`SEED_SCALES`] are outliers, and so are the cells joined to them through
//! cells beyond [`GROWTH_SCALES`] (the skirt of a tree), with a margin of one cell. Every round judges all cells
//! afresh, so that a cell pulled down by a tree nearby is taken back once the tree is out.
//!
//! On normal data 6e-7 of the cells pass the first bound, so a surface without objects is left as it is.
//!
//! Cost: a moving average and a count per round; rounds end when nothing changes, at most `ROUNDS`.

use crate::detrend::{BoxWindow, deviations};
use crate::sizes::Sizes;

/// Robust standard deviations beyond which a cell is an outlier by itself.
pub const SEED_SCALES: f64 = 5.0;
/// Robust standard deviations beyond which a neighbour of an outlier is one too.
pub const GROWTH_SCALES: f64 = 2.5;
/// Most rounds of detection.
const ROUNDS: usize = 12;
/// Standard deviation of a normal variable by its median absolute value.
const NORMAL_CONSISTENCY: f64 = 1.482_602_218_505_602;

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
    let scale = NORMAL_CONSISTENCY * Sizes::of(&deviation).exceeded_by(0.5);
    let seeds = deviation.iter().map(|d| *d > SEED_SCALES * scale).collect();
    let grown = grow(seeds, cols, |k| deviation[k] > GROWTH_SCALES * scale);
    with_margin(&grown, values, cols)
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
