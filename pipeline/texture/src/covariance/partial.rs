//! Partial windows: see [`super::filtered`].
//!
//! The window is divided into blocks. A block is represented by two of its cells with data, opposite each other about its middle, which
//! change from pair to pair; its number of cells is exact. At a border the weights of a window's cells fall linearly across it, from 4 / n
//! to -2 / n: each point has the weight of its place in the plane through all points ([`Moments::plane`]; using only a block's share of
//! the cells would cause errors of 1 to 7 % of the variance there). This accounts for the border, holes of a window's size and scattered
//! cells.
//! Pairs and cells follow a low-discrepancy sequence (Kronecker with powers of the generalised golden ratio: Roberts, 2018);
//! nothing is random. All bins have the same first cells and the same points, and a first cell counts in a bin by the share of the
//! bin's lags that lead to a used cell, so that the sampling error varies smoothly from bin to bin, as covariances do. Errors of
//! the same size but independent from bin to bin would look like structure to generalised least squares: 1e-4 of the variance moves
//! sigma and b of a Gaussian surface by a quarter.

use super::bins::{LagBins, Member};
use super::filtered::LagField;
use super::lag::length_m;
use crate::bitmap::Bitmap;
use rayon::prelude::*;
use sastrugi_roughness::background::{BoxWindow, Moments};
use std::hint::select_unpredictable;
use std::ops::Range;

/// Approximate number of pairs with a partial window averaged over in each bin: the correction is accurate to 2e-4 of the variance, and
/// relative to neighbouring bins to some 1e-5.
pub const PAIRS_FINE: f64 = 8192.0;
/// The same where lower accuracy is enough.
pub const PAIRS_ROUGH: f64 = 1024.0;
/// Most lags of a bin, evenly spread in direction, that are tried from a first cell.
const LAGS_TRIED: usize = 32;
/// Most pairs examined in each bin.
const PAIRS_MAX: f64 = 65_536.0;
/// Blocks along a window for its covariance with a cell.
const FINE_BLOCKS: usize = 6;
/// Blocks along a window for its covariance with another window, which is smoother.
const COARSE_BLOCKS: usize = 3;

/// Number of pairs whose first windows are in memory at once.
const SAMPLES_AT_ONCE: usize = 512;
/// Most cells counted at once, apart from those within reach.
const STRIP_CELLS: usize = 1 << 22;

/// The raster's cells as used by the detrending filter.
pub struct DetrendedCells<'a> {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// Cells that entered the moving average, row-major.
    pub trusted: &'a Bitmap,
    /// Cells with a residual.
    pub used: &'a Bitmap,
    /// Number of cells with a residual.
    pub detrended: usize,
    /// How many of them have a partial window.
    pub partial: usize,
}

/// Contribution of partial windows to the covariance of the residual in each bin, as weights of the surface's covariance by lag.
/// Memory: 4 bytes per cell of a strip of 4 million cells or six reaches (lag and two half windows), and 8 bytes per bin and
/// lag within the largest lag and two windows, one of two opposite lags.
#[derive(Clone)]
pub struct PartialWindows {
    /// Largest lag with a weight, in cells.
    reach: [isize; 2],
    /// Weights of each bin; empty when all windows are complete.
    weights: Vec<Vec<f64>>,
    /// Share of each bin's pairs with a partial window.
    shares: Vec<f64>,
}

impl PartialWindows {
    /// The weights for the bins of a raster, from about `pairs` pairs with a partial window for each bin.
    pub fn new(cells: &DetrendedCells, window: BoxWindow, bins: &LagBins, pairs: f64) -> Self {
        let centres = centres(cells, pairs);
        let largest = |axis: usize| bins.members.iter().map(|m| m.lag[axis].abs()).max().unwrap_or(0);
        let reach = [0, 1].map(|axis| largest(axis) + 2 * window.half[axis] as isize);
        if centres.is_empty() {
            return Self { reach, weights: vec![Vec::new(); bins.len()], shares: vec![0.0; bins.len()] };
        }
        let bin_lags: Vec<Vec<[isize; 2]>> = bins.members.chunk_by(|a, b| a.bin == b.bin).map(by_direction).collect();
        let mut sums: Vec<LagWeights> = bin_lags.iter().map(|_| LagWeights::new(reach)).collect();
        let step = (STRIP_CELLS / cells.cols).max(4 * reach[0] as usize).max(1);
        for top in (0..cells.rows).step_by(step) {
            let strip = |row: usize| centres.partition_point(|&cell| cell < row * cells.cols);
            let samples = strip(top)..strip(top + step);
            if samples.is_empty() {
                continue;
            }
            let around = top.saturating_sub(reach[0] as usize)..(top + step + reach[0] as usize).min(cells.rows);
            let data = DataCount::new(cells, around);
            let sampler = Sampler {
                cells,
                window,
                reach,
                stride: stride(reach),
                complete: CompleteTiles::new(&data, window),
                data,
            };
            for first in samples.clone().step_by(SAMPLES_AT_ONCE) {
                let some = first..(first + SAMPLES_AT_ONCE).min(samples.end);
                let near: Vec<Option<Near>> =
                    some.clone().into_par_iter().map(|s| sampler.near(centres[s], s)).collect();
                sums.par_iter_mut().zip(&bin_lags).for_each(|(line, lags)| {
                    for (s, near) in some.clone().zip(&near) {
                        match near {
                            Some(near) => sampler.add_pair(near, lags, &Draw { index: s }, line),
                            None => line.pairs += 1.0,
                        }
                    }
                });
            }
        }
        let shares = sums.iter().map(|line| line.partial / line.pairs.max(f64::MIN_POSITIVE)).collect();
        Self { reach, shares, weights: sums.into_iter().map(LagWeights::mean).collect() }
    }

    /// Contribution to each bin for a surface with the covariance `measured`, m2.
    pub fn correction(&self, measured: &LagField) -> Vec<f64> {
        if self.is_empty() {
            return vec![0.0; self.weights.len()];
        }
        let [rows, cols] = self.reach;
        let covariance: Vec<f64> = (0..=rows).flat_map(|r| (-cols..=cols).map(move |c| measured.at([r, c]))).collect();
        weighted_sums(&self.weights, &covariance)
    }

    /// The same for surfaces whose covariance depends only on distance, on cells of `cell_m`.
    pub fn by_distance(&self, cell_m: [f64; 2]) -> ByDistance {
        let step_m = cell_m[0].min(cell_m[1]) / STEPS_PER_CELL;
        let [rows, cols] = self.reach;
        let longest = length_m([rows, cols], cell_m);
        let nodes = (longest / step_m) as usize + 2;
        let spread = |line: &Vec<f64>| {
            let mut weights = vec![0.0; if line.is_empty() { 0 } else { nodes }];
            let lags = (0..=rows).flat_map(|r| (-cols..=cols).map(move |c| [r, c]));
            for (lag, weight) in lags.zip(line) {
                let place = length_m(lag, cell_m) / step_m;
                let (node, part) = (place as usize, fraction(place));
                weights[node] += (1.0 - part) * weight;
                weights[node + 1] += part * weight;
            }
            weights
        };
        ByDistance { step_m, weights: self.weights.iter().map(spread).collect() }
    }

    /// Share of each bin's pairs with one or two partial windows.
    pub fn shares(&self) -> &[f64] {
        &self.shares
    }

    /// True if all windows are complete.
    pub fn is_empty(&self) -> bool {
        self.weights.iter().all(Vec::is_empty)
    }
}

/// Nodes per cell for linear interpolation of a covariance: for a range of four cells the error is 1e-4 of the correction.
const STEPS_PER_CELL: f64 = 8.0;

/// [`PartialWindows`] as weights of the covariance by distance: hundreds of numbers instead of tens of thousands.
pub struct ByDistance {
    step_m: f64,
    weights: Vec<Vec<f64>>,
}

impl ByDistance {
    /// Contribution to each bin for a surface with this covariance as a function of distance in m, m2.
    pub fn correction(&self, covariance_m2: impl Fn(f64) -> f64) -> Vec<f64> {
        let nodes = self.weights.iter().map(Vec::len).max().unwrap_or(0);
        let at: Vec<f64> = (0..nodes).map(|k| covariance_m2(k as f64 * self.step_m)).collect();
        weighted_sums(&self.weights, &at)
    }
}

/// The sum of `values` with the weights of each of some lines of the same length. Each sum is added in order; four lines are summed side by
/// side, because one addition takes as long as four that do not wait for each other.
fn weighted_sums(lines: &[Vec<f64>], values: &[f64]) -> Vec<f64> {
    let mut all = Vec::with_capacity(lines.len());
    let (fours, others) = lines.as_chunks::<4>();
    for [a, b, c, d] in fours {
        // As a sum of an iterator begins.
        let mut sums = [-0.0; 4];
        for ((((v, a), b), c), d) in values.iter().zip(a).zip(b).zip(c).zip(d) {
            sums[0] += a * v;
            sums[1] += b * v;
            sums[2] += c * v;
            sums[3] += d * v;
        }
        all.extend(sums);
    }
    all.extend(others.iter().map(|line| weighted_sum(line, values)));
    all
}

fn weighted_sum(line: &[f64], values: &[f64]) -> f64 {
    line.iter().zip(values).map(|(w, v)| w * v).sum()
}

/// The lags of a bin and their opposites, by direction.
fn by_direction(members: &[Member]) -> Vec<[isize; 2]> {
    let mut lags: Vec<[isize; 2]> = members.iter().flat_map(|m| [m.lag, m.lag.map(|l| -l)]).collect();
    let direction = |[row, col]: [isize; 2]| libm::atan2(row as f64, col as f64);
    lags.sort_by(|a, b| direction(*a).total_cmp(&direction(*b)));
    lags
}

/// First cells of the pairs, spread evenly over the used cells: more of them the fewer windows are partial, none if all
/// are complete.
fn centres(cells: &DetrendedCells, pairs: f64) -> Vec<usize> {
    if cells.partial == 0 {
        return Vec::new();
    }
    let samples = (pairs * cells.detrended as f64 / cells.partial as f64).min(PAIRS_MAX) as usize;
    let mut ranks: Vec<usize> = (0..samples).map(|index| Draw { index }.below(5, cells.detrended)).collect();
    ranks.sort_unstable();
    cells.used.select(&ranks)
}

/// Distance between the places of two neighbouring rows of lags.
fn stride(reach: [isize; 2]) -> isize {
    2 * reach[1] + 1
}

/// Sums of weights by lag: `row` in `-reach[0]..=reach[0]` (outer), `col` in `-reach[1]..=reach[1]` (inner).
struct LagWeights {
    reach: [isize; 2],
    weights: Vec<f64>,
    /// Number of pairs added, weighted by the shares of lags that lead to used cells.
    pairs: f64,
    /// Those of them with a partial window.
    partial: f64,
}

impl LagWeights {
    fn new(reach: [isize; 2]) -> Self {
        Self { reach, weights: vec![0.0; ((2 * reach[0] + 1) * stride(reach)) as usize], pairs: 0.0, partial: 0.0 }
    }

    /// Adds `times` the weights of points at their offsets from a place.
    fn add(&mut self, from: isize, sign: isize, points: &[Point], times: f64) {
        for p in points {
            self.weights[(from + sign * p.at) as usize] += times * p.weight;
        }
    }

    /// Adds `times` the products of the weights of two windows' points.
    fn add_product(&mut self, from: isize, near: &[Point], far: &[Point], times: f64) {
        near.iter().for_each(|n| self.add(from - n.at, 1, far, times * n.weight));
    }

    /// Place of a lag.
    fn place(&self, [row, col]: [isize; 2]) -> isize {
        (row + self.reach[0]) * stride(self.reach) + col + self.reach[1]
    }

    /// Mean over the pairs, with opposite lags combined: `row` in `0..=reach[0]` (outer), `col` in `-reach[1]..=reach[1]`.
    fn mean(self) -> Vec<f64> {
        let middle = self.place([0, -self.reach[1]]) as usize;
        let (north, south) = self.weights.split_at(middle);
        let mut mean = south.to_vec();
        let opposite = north.iter().rev();
        mean[stride(self.reach) as usize..].iter_mut().zip(opposite).for_each(|(w, other)| *w += other);
        mean.iter_mut().for_each(|w| *w /= self.pairs.max(f64::MIN_POSITIVE));
        mean
    }
}

/// A cell that represents a part of a window.
#[derive(Clone, Copy)]
struct Point {
    /// Weight in the background.
    weight: f64,
    /// Place of its offset.
    at: isize,
}

/// A block of a window, and the two cells that represent it.
struct Block {
    /// Its cells, as offsets.
    span: Rectangle,
    /// Where in the block the first of the two lies.
    place: [f64; 2],
    /// Both, as offsets, if the block is complete.
    both: [[isize; 2]; 2],
}

/// A complete window in blocks, wherever it lies.
struct Pattern {
    axes: [Axis; 2],
    /// Row by row.
    blocks: Vec<Block>,
    points: Vec<Point>,
}

/// The window of a cell as points, and as the points it would have if it were complete.
struct Window {
    points: Vec<Point>,
    complete: Pattern,
}

/// The first cell of pairs.
struct Near {
    cell: [isize; 2],
    /// Its window in coarse blocks.
    coarse: Window,
    /// The same in fine blocks, if it is partial.
    fine: Option<Window>,
    /// A complete window in coarse blocks, as the second cells of the pairs have.
    far: Pattern,
}

struct Sampler<'a> {
    cells: &'a DetrendedCells<'a>,
    window: BoxWindow,
    /// Largest lag with a weight, in cells.
    reach: [isize; 2],
    /// [`stride`] of the lags.
    stride: isize,
    data: DataCount,
    complete: CompleteTiles,
}

impl Sampler<'_> {
    /// The first cell of the pairs of a sample; `None` if all its pairs have complete windows.
    fn near(&self, cell: usize, sample: usize) -> Option<Near> {
        let cell = [cell / self.cells.cols, cell % self.cells.cols].map(|k| k as isize);
        let reach = [0, 1].map(|k| self.reach[k] - self.window.half[k] as isize);
        let around = [0, 1].map(|k| [cell[k] - reach[k], cell[k] + reach[k] + 1]);
        if f64::from(self.data.within(around)) == cells(around) {
            return None;
        }
        let draw = Draw { index: sample };
        let shift = [draw.unit(1), draw.unit(2)];
        let window = |blocks: usize| {
            let complete = self.pattern(blocks, shift);
            Window { points: self.points(cell, &complete).unwrap_or_else(|| complete.points.clone()), complete }
        };
        Some(Near {
            cell,
            coarse: window(COARSE_BLOCKS),
            fine: self.is_partial(cell).then(|| window(FINE_BLOCKS)),
            far: self.pattern(COARSE_BLOCKS, [draw.unit(3), draw.unit(4)]),
        })
    }

    /// Adds a pair of `near` and a used cell at one of the lags of a bin, if there is such a cell.
    fn add_pair(&self, near: &Near, lags: &[[isize; 2]], draw: &Draw, line: &mut LagWeights) {
        let tried = lags.len().min(LAGS_TRIED);
        let start = draw.unit(0);
        let lag_at = |k: usize| {
            let place = (k as f64 + start) * lags.len() as f64;
            // Division by a constant power of two is quick, and by it most are divided.
            let place = if tried == LAGS_TRIED { place / LAGS_TRIED as f64 } else { place / tried as f64 };
            lags[place as u32 as usize]
        };
        let partner_at = |lag: [isize; 2]| [near.cell[0] + lag[0], near.cell[1] + lag[1]];
        let mut used = 0u64;
        for k in 0..tried {
            let cell = self.index(partner_at(lag_at(k)));
            used |= u64::from(cell.is_some() & self.cells.used.get(cell.unwrap_or(0))) << k;
        }
        let found = used.count_ones() as usize;
        let Some(lag) = (0..tried).filter(|k| used >> k & 1 == 1).nth(draw.below(6, found)).map(lag_at) else { return };
        let (partner, share) = (partner_at(lag), found as f64 / tried as f64);
        line.pairs += share;
        let from = line.place(lag);
        // - D_i(j) C(h - j); on average equal to - D_(i+h)(k) C(h + k), whose pairs are those of the opposite lag.
        if let Some(fine) = &near.fine {
            line.add(from, -1, &fine.points, -2.0 * share);
            line.add(from, -1, &fine.complete.points, 2.0 * share);
        }
        // D_i(j) D_(i+h)(k) C(h + k - j).
        if near.fine.is_some() || self.is_partial(partner) {
            line.partial += share;
            let (coarse, far) = (&near.coarse, self.points(partner, &near.far));
            line.add_product(from, &coarse.points, far.as_ref().unwrap_or(&near.far.points), share);
            line.add_product(from, &coarse.complete.points, &near.far.points, -share);
        }
    }

    /// Whether the window of a cell lacks data.
    fn is_partial(&self, at: [isize; 2]) -> bool {
        let span = |k: usize| [at[k] - self.window.half[k] as isize, at[k] + self.window.half[k] as isize + 1];
        !self.complete.at(at) && (self.data.within([span(0), span(1)]) as usize) < self.window.area()
    }

    /// A complete window with `blocks` blocks in each direction, at cells given by `shift`.
    fn pattern(&self, blocks: usize, shift: [f64; 2]) -> Pattern {
        let axes = [Axis::new(self.window.half[0], blocks), Axis::new(self.window.half[1], blocks)];
        let block = |index: usize| {
            let span = [axes[0].span(index / axes[1].blocks), axes[1].span(index % axes[1].blocks)];
            let place = [0, 1].map(|k| fraction(shift[k] + index as f64 * LATTICE[k]));
            let one = [0, 1].map(|k| point(span[k], place[k]));
            Block { span, place, both: [one, [0, 1].map(|k| span[k][0] + span[k][1] - 1 - one[k])] }
        };
        let blocks: Vec<Block> = (0..axes[0].blocks * axes[1].blocks).map(block).collect();
        let counted = |b: &Block| b.both.map(|offset| (offset, 0.5 * cells(b.span)));
        let points = self.weighted(&blocks.iter().flat_map(counted).collect::<Vec<_>>());
        Pattern { axes, blocks, points }
    }

    /// The window of the cell `at`; `None` if it is complete. Weights are those of the plane through the points, so that the model's background
    /// reproduces planes as the data's does.
    fn points(&self, at: [isize; 2], complete: &Pattern) -> Option<Vec<Point>> {
        let Pattern { axes, blocks, .. } = complete;
        let counts = self.data.blocks(at, axes);
        let counts = counts[..axes[0].blocks].iter().flat_map(|row| &row[..axes[1].blocks]);
        let mut own = Vec::with_capacity(2 * blocks.len());
        let mut is_complete = true;
        for (Block { span, place, both }, &data) in blocks.iter().zip(counts) {
            let whole = f64::from(data) == cells(*span);
            is_complete &= whole;
            if data > 0 {
                let pick = |place: [f64; 2]| self.data.pick(at, *span, data, place);
                let picked = if whole { *both } else { [*place, place.map(|p| 1.0 - p)].map(pick) };
                own.extend(picked.map(|offset| (offset, 0.5 * f64::from(data))));
            }
        }
        (!is_complete).then(|| self.weighted(&own))
    }

    /// Points with the weights of the plane through them, from offsets and the number of cells that each represents.
    fn weighted(&self, points: &[([isize; 2], f64)]) -> Vec<Point> {
        let mut moments = Moments::default();
        points.iter().for_each(|&(offset, count)| moments.add(offset, count));
        let (weights, _) = moments.plane();
        let of = |&(offset, count): &([isize; 2], f64)| Point {
            weight: count * weights.at(offset),
            at: offset[0] * self.stride + offset[1],
        };
        points.iter().map(of).collect()
    }

    /// Index of a cell; `None` beyond the raster.
    fn index(&self, [row, col]: [isize; 2]) -> Option<usize> {
        let inside = row >= 0 && col >= 0 && row < self.cells.rows as isize && col < self.cells.cols as isize;
        inside.then(|| row as usize * self.cells.cols + col as usize)
    }
}

/// 1 / g and 1 / g^2 of the plastic number g: a low-discrepancy lattice in the unit square.
const LATTICE: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// Rows and columns `from..to`, as offsets from a cell.
type Rectangle = [[isize; 2]; 2];

fn cells([rows, cols]: Rectangle) -> f64 {
    ((rows[1] - rows[0]) * (cols[1] - cols[0])) as f64
}

/// The offset at a fraction of a span.
fn point([from, to]: [isize; 2], fraction: f64) -> isize {
    from + (fraction * (to - from) as f64) as isize
}

/// A window's offsets along one axis, divided into blocks.
struct Axis {
    half: isize,
    width: usize,
    blocks: usize,
}

impl Axis {
    fn new(half: usize, blocks: usize) -> Self {
        let width = 2 * half + 1;
        Self { half: half as isize, width, blocks: blocks.min(width) }
    }

    /// Offsets of a block, `from..to`.
    fn span(&self, block: usize) -> [isize; 2] {
        [self.end(block), self.end(block + 1)]
    }

    /// Offset of the first cell after `blocks` blocks.
    fn end(&self, blocks: usize) -> isize {
        (blocks * self.width / self.blocks) as isize - self.half
    }
}

/// Number of cells with data in any rectangle within some rows, from a summed-area table (Crow, 1984). Sums of more than 2^32 cells wrap
/// around, but differences over a window's cells are still right.
struct DataCount {
    rows: Range<isize>,
    cols: isize,
    sums: Vec<u32>,
}

impl DataCount {
    fn new(cells: &DetrendedCells, rows: Range<usize>) -> Self {
        let cols = cells.cols;
        let stride = cols + 1;
        let mut sums = vec![0u32; (rows.len() + 1) * stride];
        for row in rows.clone() {
            let mut data = 0;
            let (above, own) = sums[(row - rows.start) * stride..][..2 * stride].split_at_mut(stride);
            for ((c, own), above) in (0..cols).zip(&mut own[1..]).zip(&above[1..]) {
                data += u32::from(cells.trusted.get(row * cols + c));
                *own = above.wrapping_add(data);
            }
        }
        Self { rows: rows.start as isize..rows.end as isize, cols: cols as isize, sums }
    }

    /// Cells with data in the rows and columns `from..to`; cells beyond the raster have none.
    fn within(&self, [rows, cols]: Rectangle) -> u32 {
        let (top, bottom) = (self.line(rows[0]), self.line(rows[1]));
        let between = |col: isize| {
            let col = col.clamp(0, self.cols) as usize;
            self.sums[bottom + col].wrapping_sub(self.sums[top + col])
        };
        between(cols[1]).wrapping_sub(between(cols[0]))
    }

    /// Where the sums above a row start.
    fn line(&self, row: isize) -> usize {
        ((row.clamp(self.rows.start, self.rows.end) - self.rows.start) * (self.cols + 1)) as usize
    }

    /// Cells with data in each block of the window around the cell `at`.
    fn blocks(&self, at: [isize; 2], [down, across]: &[Axis; 2]) -> [[u32; FINE_BLOCKS]; FINE_BLOCKS] {
        let mut counts = [[0; FINE_BLOCKS]; FINE_BLOCKS];
        let mut above = [0; FINE_BLOCKS + 1];
        for r in 0..=down.blocks {
            let line = self.line(at[0] + down.end(r));
            let mut left = 0;
            for c in 0..=across.blocks {
                let sum = self.sums[line + (at[1] + across.end(c)).clamp(0, self.cols) as usize];
                // Data from the row above down, left of this end.
                let between = sum.wrapping_sub(above[c]);
                if r > 0 && c > 0 {
                    counts[r - 1][c - 1] = between.wrapping_sub(left);
                }
                (above[c], left) = (sum, between);
            }
        }
        counts
    }

    /// The offset of one of the `data` cells with data in a block around the cell `at`: its rank is a fraction of their number, and a
    /// fraction of the number in its row.
    fn pick(&self, at: [isize; 2], [rows, cols]: Rectangle, data: u32, place: [f64; 2]) -> [isize; 2] {
        let rank = |place: f64, of: u32| ((place * f64::from(of)) as u32).min(of - 1);
        let column = |col: isize| (at[1] + col).clamp(0, self.cols) as usize;
        // Above a row, between the sides of the block.
        let sides = cols.map(column);
        let above = |row: isize| {
            let line = self.line(at[0] + row);
            self.sums[line + sides[1]].wrapping_sub(self.sums[line + sides[0]])
        };
        let (first, wanted) = (above(rows[0]), rank(place[0], data));
        let row = bisect(rows[0], rows[1] - 1, |r| above(r + 1).wrapping_sub(first) > wanted);
        // In that row, left of a column.
        let lines = [row, row + 1].map(|row| self.line(at[0] + row));
        let left = |col: isize| {
            let col = column(col);
            self.sums[lines[1] + col].wrapping_sub(self.sums[lines[0] + col])
        };
        let first = left(cols[0]);
        let wanted = rank(place[1], left(cols[1]).wrapping_sub(first));
        [row, bisect(cols[0], cols[1] - 1, |c| left(c + 1).wrapping_sub(first) > wanted)]
    }
}

/// Tiles of a window's size, and whether all their cells have data. Most complete windows are recognised by the up to four
/// tiles that they touch.
struct CompleteTiles {
    /// Topmost row of the tiles.
    top: isize,
    half: [isize; 2],
    side: [isize; 2],
    /// Tiles per row.
    across: isize,
    complete: Vec<bool>,
}

impl CompleteTiles {
    fn new(data: &DataCount, window: BoxWindow) -> Self {
        let (side, half) = (window.cells().map(|n| n as isize), window.half.map(|n| n as isize));
        // The remainder at the ends belongs to no tile: windows that extend there are counted cell by cell.
        let (top, down, across) = (data.rows.start, (data.rows.end - data.rows.start) / side[0], data.cols / side[1]);
        let tile = |row: isize, col: isize| {
            let rows = top + row * side[0];
            data.within([[rows, rows + side[0]], [col * side[1], (col + 1) * side[1]]]) as usize == window.area()
        };
        let complete = (0..down).flat_map(|r| (0..across).map(move |c| (r, c))).map(|(r, c)| tile(r, c)).collect();
        Self { top, half, side, across, complete }
    }

    /// True only if the window around a cell is complete; it may be complete even if this is false.
    fn at(&self, [row, col]: [isize; 2]) -> bool {
        let (row, [down, across]) = (row - self.top, self.half);
        if row < down || col < across {
            return false;
        }
        let rows = [(row - down) / self.side[0], (row + down) / self.side[0]];
        let cols = [(col - across) / self.side[1], (col + across) / self.side[1]];
        let tile = |r: isize, c: isize| self.complete.get((r * self.across + c) as usize).is_some_and(|tile| *tile);
        cols[1] < self.across && rows.iter().all(|&r| cols.iter().all(|&c| tile(r, c)))
    }
}

/// First of `from..=last` at which `holds` becomes true, or `last` if it is true nowhere before. How many steps it takes depends on the number
/// of places alone, and nothing branches on `holds`: half of these branches would be foreseen wrongly.
fn bisect(mut from: isize, last: isize, holds: impl Fn(isize) -> bool) -> isize {
    let mut places = last - from + 1;
    while places > 1 {
        let half = places / 2;
        from = select_unpredictable(holds(from + half - 1), from, from + half);
        places -= half;
    }
    from
}

/// Point of a Kronecker sequence in seven dimensions.
struct Draw {
    index: usize,
}

impl Draw {
    /// Coordinate in [0, 1).
    fn unit(&self, dimension: usize) -> f64 {
        /// Powers 1 to 7 of 1 / g, g^8 = g + 1.
        const STEPS: [f64; 7] = [
            0.911_592_353_482_054_9,
            0.831_000_618_926_951_9,
            0.757_533_809_952_664_3,
            0.690_562_028_656_977,
            0.629_511_064_928_756,
            0.573_857_473_221_399_4,
            0.523_124_084_577_160_8,
        ];
        fraction(0.5 + self.index as f64 * STEPS[dimension])
    }

    /// Integer below `n`.
    fn below(&self, dimension: usize, n: usize) -> usize {
        (self.unit(dimension) * n as f64) as usize
    }
}

/// Fractional part of a positive number below 2^63.
fn fraction(x: f64) -> f64 {
    x - (x as i64) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines side by side have the bits of each alone, for any number of lines, and empty ones too.
    #[test]
    fn prop_lines_are_summed_each_in_order() {
        let number = |k: usize| f64::from((k as u32).wrapping_mul(2_654_435_761)) / 4e9 - 0.5;
        for (count, length) in (0..10).flat_map(|count| [0, 1, 37].map(|length| (count, length))) {
            let lines: Vec<Vec<f64>> =
                (0..count).map(|line| (0..length).map(|k| number(100 * line + k)).collect()).collect();
            let values: Vec<f64> = (0..length).map(|k| 1e3 * number(7777 + k)).collect();
            let expected: Vec<u64> = lines.iter().map(|line| weighted_sum(line, &values).to_bits()).collect();
            let found: Vec<u64> = weighted_sums(&lines, &values).into_iter().map(f64::to_bits).collect();
            assert_eq!(found, expected, "{count} lines of {length}");
        }
    }
}
