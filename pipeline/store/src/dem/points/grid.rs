//! Statistics of the points of each cell.

use super::lattice::Lattice;
use super::settings::{MAX_RANKED_POINTS, Statistic};
use super::survey::Chosen;
use crate::dem::raster::Refusal;

/// Heights (`NaN` without points) and numbers of points for each cell.
pub(super) struct Cells {
    pub heights: Vec<f64>,
    pub counts: Vec<u32>,
}

/// Height of every cell; `points` is the number of selected points.
pub(super) fn cells(
    chosen: &Chosen<'_>,
    lattice: &Lattice,
    statistic: Statistic,
    points: u64,
) -> Result<Cells, Refusal> {
    match statistic {
        Statistic::Mean => means(chosen, lattice),
        Statistic::Min => extremes(chosen, lattice, i32::min),
        Statistic::Max => extremes(chosen, lattice, i32::max),
        Statistic::Median => percentiles(chosen, lattice, 50.0, points),
        Statistic::Percentile(p) => percentiles(chosen, lattice, p, points),
    }
}

/// Calls `f` with the cell and the stored height of every point.
fn for_each_height(chosen: &Chosen<'_>, lattice: &Lattice, mut f: impl FnMut(usize, i32)) -> Result<(), Refusal> {
    chosen.for_each(|point| {
        let (row, col) = lattice.cell(chosen.cloud.place(&point));
        f(row * lattice.cols + col, point.stored[2]);
    })
}

fn height(chosen: &Chosen<'_>, stored: f64) -> f64 {
    chosen.cloud.coordinate(2, stored)
}

fn means(chosen: &Chosen<'_>, lattice: &Lattice) -> Result<Cells, Refusal> {
    let mut counts = vec![0_u32; lattice.rows * lattice.cols];
    // Fewer than 2^32 points of 32 bits each: the sum fits.
    let mut sums = vec![0_i64; counts.len()];
    for_each_height(chosen, lattice, |cell, z| {
        counts[cell] += 1;
        sums[cell] += i64::from(z);
    })?;
    let mean = |(&sum, &n): (&i64, &u32)| if n == 0 { f64::NAN } else { height(chosen, sum as f64 / f64::from(n)) };
    Ok(Cells { heights: sums.iter().zip(&counts).map(mean).collect(), counts })
}

fn extremes(chosen: &Chosen<'_>, lattice: &Lattice, further: fn(i32, i32) -> i32) -> Result<Cells, Refusal> {
    let mut counts = vec![0_u32; lattice.rows * lattice.cols];
    let mut found = vec![0_i32; counts.len()];
    for_each_height(chosen, lattice, |cell, z| {
        found[cell] = if counts[cell] == 0 { z } else { further(found[cell], z) };
        counts[cell] += 1;
    })?;
    let value = |(&z, &n): (&i32, &u32)| if n == 0 { f64::NAN } else { height(chosen, f64::from(z)) };
    Ok(Cells { heights: found.iter().zip(&counts).map(value).collect(), counts })
}

fn percentiles(chosen: &Chosen<'_>, lattice: &Lattice, percentile: f64, points: u64) -> Result<Cells, Refusal> {
    if points > MAX_RANKED_POINTS {
        return Err(Refusal::new(format!(
            "has {points} points; medians and percentiles are limited to {MAX_RANKED_POINTS}"
        )));
    }
    // Cell and height packed into one number that sorts by cell, then by height.
    let mut keys = Vec::with_capacity(points as usize);
    for_each_height(chosen, lattice, |cell, z| keys.push((cell as u64) << 32 | u64::from(z.cast_unsigned() ^ SIGN)))?;
    keys.sort_unstable();
    let mut counts = vec![0_u32; lattice.rows * lattice.cols];
    let mut heights = vec![f64::NAN; counts.len()];
    for group in keys.chunk_by(|a, b| a >> 32 == b >> 32) {
        let cell = (group[0] >> 32) as usize;
        counts[cell] = group.len() as u32;
        heights[cell] = height(chosen, ranked(group, percentile));
    }
    Ok(Cells { heights, counts })
}

/// Flipping this bit makes signed integers sort correctly as unsigned ones.
const SIGN: u32 = 1 << 31;

/// The percentile of sorted keys of one cell.
fn ranked(keys: &[u64], percentile: f64) -> f64 {
    let stored = |at: usize| f64::from((keys[at] as u32 ^ SIGN).cast_signed());
    let rank = (keys.len() - 1) as f64 * (percentile / 100.0);
    let below = rank.floor();
    let (low, high) = (stored(below as usize), stored(rank.ceil() as usize));
    low + (rank - below) * (high - low)
}
