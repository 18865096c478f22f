//! Partial windows: see [`super::filtered`].
//!
//! The window of a cell is cut into blocks, and each block to the rectangle that holds its data. Its share of the data is
//! exact; it stands at one of its cells, which moves from pair to pair. The two cells of a pair have data, which scattered
//! holes make more than the share of their block: they stand as points of their own. Where the windows overlap, a cell
//! lacks data in both or in none: `m^2 = m` adds the variance of m at distance 0, and takes it off at the distances within
//! the block, whose count is given. So the border, holes of a window's size and scattered cells are accounted
//! for. Pairs and cells follow a low-discrepancy sequence (Kronecker with powers of the generalised golden ratio: Roberts,
//! 2018): nothing is random.

use super::bins::{LagBins, Member, length_m};
use super::filtered::LagField;
use crate::bitmap::Bitmap;
use crate::detrend::BoxWindow;
use rayon::prelude::*;
use std::ops::Range;

/// Pairs with a partial window that are averaged over in each bin (about): the correction is good to 1e-4 of the variance.
pub const PAIRS_FINE: f64 = 2048.0;
/// The same where half that precision is enough.
pub const PAIRS_ROUGH: f64 = 512.0;
/// Most pairs looked at in each bin.
const PAIRS_MAX: f64 = 32_768.0;
/// Blocks along a window for its covariance with a cell.
const FINE_BLOCKS: usize = 8;
/// Blocks along a window for its covariance with another window, which is smoother.
const COARSE_BLOCKS: usize = 4;

/// Most cells counted at once, besides those within reach.
const STRIP_CELLS: usize = 1 << 22;

/// The raster's cells as the detrender saw them.
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

/// What partial windows add to the covariance of the residual in each bin, as weights of the surface's covariance by lag.
/// Memory: 4 bytes per cell of a strip of 4 million cells or six reaches (lag and two half windows), and 8 bytes per bin and
/// lag within the largest lag and two windows, one of two opposite lags.
pub struct PartialWindows {
    /// Largest lag with a weight, in cells.
    reach: [isize; 2],
    /// Weights of each bin; empty when all windows are complete.
    weights: Vec<Vec<f64>>,
}

impl PartialWindows {
    /// The weights for the bins of a raster, from about `pairs` pairs with a partial window for each bin.
    pub fn new(cells: &DetrendedCells, window: BoxWindow, bins: &LagBins, pairs: f64) -> Self {
        let centres = centres(cells, pairs);
        let largest = |axis: usize| bins.members.iter().map(|m| m.lag[axis].abs()).max().unwrap_or(0);
        let reach = [0, 1].map(|axis| largest(axis) + 2 * window.half[axis] as isize);
        if centres.is_empty() {
            return Self { reach, weights: vec![Vec::new(); bins.len()] };
        }
        let members: Vec<&[Member]> = bins.members.chunk_by(|a, b| a.bin == b.bin).collect();
        let mut sums: Vec<LagWeights> = members.iter().map(|_| LagWeights::new(reach)).collect();
        let step = (STRIP_CELLS / cells.cols).max(4 * reach[0] as usize).max(1);
        for top in (0..cells.rows).step_by(step) {
            let strip = |row: usize| centres.partition_point(|&cell| cell < row * cells.cols);
            let samples = strip(top)..strip(top + step);
            if samples.is_empty() {
                continue;
            }
            let around = top.saturating_sub(reach[0] as usize)..(top + step + reach[0] as usize).min(cells.rows);
            let data = DataCount::new(cells, around);
            let sampler = Sampler { cells, window, complete: CompleteTiles::new(&data, window), data };
            sums.par_iter_mut().zip(&members).enumerate().for_each(|(bin, (line, members))| {
                for s in samples.clone() {
                    let draw = Draw { index: s * bins.len() + bin };
                    let lag = members[draw.below(0, members.len())].lag;
                    line.pairs += usize::from(sampler.add_pair(centres[s], lag, &draw, line));
                }
            });
        }
        Self { reach, weights: sums.into_iter().map(LagWeights::mean).collect() }
    }

    /// What is added in each bin for a surface with the covariance `measured`, m2.
    pub fn correction(&self, measured: &LagField) -> Vec<f64> {
        if self.is_empty() {
            return vec![0.0; self.weights.len()];
        }
        let [rows, cols] = self.reach;
        let covariance: Vec<f64> = (0..=rows).flat_map(|r| (-cols..=cols).map(move |c| measured.at([r, c]))).collect();
        self.weights.iter().map(|line| line.iter().zip(&covariance).map(|(w, c)| w * c).sum()).collect()
    }

    /// The same for surfaces whose covariance depends on the distance only, on cells of `cell_m`.
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

    fn is_empty(&self) -> bool {
        self.weights.iter().all(Vec::is_empty)
    }
}

/// Nodes per cell between which a covariance is taken for a straight line: for a range of four cells that errs by 1e-4 of
/// the correction.
const STEPS_PER_CELL: f64 = 8.0;

/// [`PartialWindows`] as weights of the covariance by distance: some hundred numbers instead of some ten thousand.
pub struct ByDistance {
    step_m: f64,
    weights: Vec<Vec<f64>>,
}

impl ByDistance {
    /// What is added in each bin for a surface with this covariance at a distance in m, m2.
    pub fn correction(&self, covariance_m2: impl Fn(f64) -> f64) -> Vec<f64> {
        let nodes = self.weights.iter().map(Vec::len).max().unwrap_or(0);
        let at: Vec<f64> = (0..nodes).map(|k| covariance_m2(k as f64 * self.step_m)).collect();
        self.weights.iter().map(|line| line.iter().zip(&at).map(|(w, c)| w * c).sum()).collect()
    }
}

/// First cells of the pairs, spread evenly over the cells used: the more, the fewer windows are partial; none when all
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

/// Weights by lag, one of two opposite lags: `row` in `0..=reach[0]` (outer), `col` in `-reach[1]..=reach[1]` (inner).
struct LagWeights {
    reach: [isize; 2],
    weights: Vec<f64>,
    /// Pairs added.
    pairs: usize,
}

impl LagWeights {
    fn new(reach: [isize; 2]) -> Self {
        Self { reach, weights: vec![0.0; ((reach[0] + 1) * (2 * reach[1] + 1)) as usize], pairs: 0 }
    }

    fn add(&mut self, [row, col]: [isize; 2], weight: f64) {
        let (row, col) = if row < 0 { (-row, -col) } else { (row, col) };
        self.weights[(row * (2 * self.reach[1] + 1) + col + self.reach[1]) as usize] += weight;
    }

    /// Mean over the pairs.
    fn mean(mut self) -> Vec<f64> {
        self.weights.iter_mut().for_each(|w| *w /= self.pairs.max(1) as f64);
        self.weights
    }
}

/// A block of a window, or one of the pair's cells.
#[derive(Clone, Copy)]
struct Part {
    /// Share of the moving average's weight.
    share: f64,
    /// Offset of the cell it stands at.
    offset: [isize; 2],
    /// Share when the window is complete.
    complete_share: f64,
    /// Offset of the cell it stands at when the window is complete.
    complete_offset: [isize; 2],
    /// Number of cells times the variance of `D_i` in them.
    scatter: f64,
    /// Lag between two of its cells.
    spread: [isize; 2],
}

impl Part {
    /// True when it stands at the same cell as in a complete window.
    fn in_place(&self) -> bool {
        self.offset == self.complete_offset
    }
}

struct Sampler<'a> {
    cells: &'a DetrendedCells<'a>,
    window: BoxWindow,
    data: DataCount,
    complete: CompleteTiles,
}

impl Sampler<'_> {
    /// Adds the pair of `cell` and the cell a lag away; false when that one is not used.
    fn add_pair(&self, cell: usize, lag: [isize; 2], draw: &Draw, line: &mut LagWeights) -> bool {
        let at = [cell / self.cells.cols, cell % self.cells.cols].map(|k| k as isize);
        let partner = [at[0] + lag[0], at[1] + lag[1]];
        if !self.index(partner).is_some_and(|k| self.cells.used.get(k)) {
            return false;
        }
        if self.complete.at(at) && self.complete.at(partner) {
            return true;
        }
        let counts = [at, partner].map(|[r, c]| self.data.within([self.span(0, r), self.span(1, c)]));
        let partial = counts.map(|n| (n as usize) < self.window.area());
        if partial.contains(&true) {
            let shifts = [[draw.unit(1), draw.unit(2)], [draw.unit(3), draw.unit(4)]];
            let near = |blocks| self.parts(at, counts[0], lag, blocks, shifts[0]);
            let far = |blocks| self.parts(partner, counts[1], lag.map(|l| -l), blocks, shifts[1]);
            // A complete window changes nothing by itself.
            if partial[0] {
                add_cell_window(lag, -1, &near(FINE_BLOCKS), line);
            }
            if partial[1] {
                add_cell_window(lag, 1, &far(FINE_BLOCKS), line);
            }
            self.add_window_window(lag, [&near(COARSE_BLOCKS), &far(COARSE_BLOCKS)], line);
        }
        true
    }

    /// Rows or columns of the window about one, `from..to`.
    fn span(&self, axis: usize, centre: isize) -> [isize; 2] {
        let half = self.window.half[axis] as isize;
        [centre - half, centre + half + 1]
    }

    /// `D_i(j) D_(i+h)(k) C(h + k - j)`, less the same of complete windows.
    fn add_window_window(&self, lag: [isize; 2], [near, far]: [&[Part]; 2], line: &mut LagWeights) {
        let half = self.window.half.map(|h| h as isize);
        let apart = |n: [isize; 2], f: [isize; 2]| [lag[0] + f[0] - n[0], lag[1] + f[1] - n[1]];
        for n in near {
            for f in far {
                let (share, complete) = (n.share * f.share, n.complete_share * f.complete_share);
                if n.in_place() && f.in_place() {
                    line.add(apart(n.offset, f.offset), share - complete);
                } else {
                    line.add(apart(n.offset, f.offset), share);
                    line.add(apart(n.complete_offset, f.complete_offset), -complete);
                }
            }
            if n.scatter > 0.0 && (0..2).all(|k| (n.offset[k] - lag[k]).abs() <= half[k]) {
                line.add([0, 0], n.scatter);
                line.add(n.spread, -n.scatter);
            }
        }
    }

    /// The parts of the window of the cell `at`, which has data as the cell `other` away has: its blocks, `blocks` each
    /// way, at cells given by `shift`, and the two cells.
    fn parts(&self, at: [isize; 2], count: u32, other: [isize; 2], blocks: usize, shift: [f64; 2]) -> Vec<Part> {
        let known: &[[isize; 2]] = if other == [0, 0] { &[[0, 0]] } else { &[[0, 0], other] };
        let axes = [Axis::new(self.window.half[0], blocks), Axis::new(self.window.half[1], blocks)];
        let cell_share = 1.0 / f64::from(count);
        let counts = self.data.blocks(at, &axes);
        let mut parts = Vec::with_capacity(blocks * blocks + 2);
        for index in 0..axes[0].blocks * axes[1].blocks {
            let (row, col) = (index / axes[1].blocks, index % axes[1].blocks);
            let whole = [axes[0].span(row), axes[1].span(col)];
            let place =
                [fraction(shift[0] + index as f64 * LATTICE[0]), fraction(shift[1] + index as f64 * LATTICE[1])];
            let complete_share = cells(whole) / self.window.area() as f64;
            let complete_offset = [point(whole[0], place[0]), point(whole[1], place[1])];
            let data = counts[row][col];
            if data == 0 || f64::from(data) == cells(whole) {
                let (share, offset) = (f64::from(data) * cell_share, complete_offset);
                parts.push(Part { share, offset, complete_share, complete_offset, scatter: 0.0, spread: [0, 0] });
                continue;
            }
            let filled = self.data.shrink(at, whole, data);
            let here = known.iter().filter(|cell| (0..2).all(|k| (filled[k][0]..filled[k][1]).contains(&cell[k])));
            let known_count = here.clone().count() as f64;
            let others = cells(filled) - known_count;
            let density = if others > 0.0 { (f64::from(data) - known_count) / others } else { 1.0 };
            let offset = [0, 1].map(|k| point(filled[k], place[k]));
            let mate = [0, 1].map(|k| point(filled[k], fraction(place[k] + MATE_STEPS * LATTICE[k])));
            parts.push(Part {
                share: density * cells(filled) * cell_share,
                offset,
                complete_share,
                complete_offset,
                scatter: scatter(density, cells(filled)) * cell_share * cell_share,
                spread: [offset[0] - mate[0], offset[1] - mate[1]],
            });
            let share = (1.0 - density) * cell_share;
            parts.extend(here.map(|&offset| Part {
                share,
                offset,
                complete_share: 0.0,
                complete_offset: offset,
                scatter: 0.0,
                spread: [0, 0],
            }));
        }
        parts
    }

    /// Index of a cell, `None` beyond the raster.
    fn index(&self, [row, col]: [isize; 2]) -> Option<usize> {
        let inside = row >= 0 && col >= 0 && row < self.cells.rows as isize && col < self.cells.cols as isize;
        inside.then(|| row as usize * self.cells.cols + col as usize)
    }
}

/// `- D_i(j) C(h - j)` (sign -1) or `- D_(i+h)(k) C(h + k)` (sign 1), less the same of a complete window.
fn add_cell_window(lag: [isize; 2], sign: isize, parts: &[Part], line: &mut LagWeights) {
    for p in parts {
        let moved = |o: [isize; 2]| [lag[0] + sign * o[0], lag[1] + sign * o[1]];
        line.add(moved(p.offset), -p.share);
        line.add(moved(p.complete_offset), p.complete_share);
    }
}

/// 1 / g and 1 / g^2 of the plastic number g: a lattice in the square.
const LATTICE: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// Number of cells times the variance of `m` in a block whose count is given.
fn scatter(density: f64, cells: f64) -> f64 {
    if cells > 1.0 { density * (1.0 - density) * cells * cells / (cells - 1.0) } else { 0.0 }
}

/// Lattice steps to a second cell of a block.
const MATE_STEPS: f64 = 37.0;

/// Rows and columns `from..to`, as offsets from a cell.
type Rectangle = [[isize; 2]; 2];

fn cells([rows, cols]: Rectangle) -> f64 {
    ((rows[1] - rows[0]) * (cols[1] - cols[0])) as f64
}

/// The offset at a fraction of a span.
fn point([from, to]: [isize; 2], fraction: f64) -> isize {
    from + (fraction * (to - from) as f64) as isize
}

/// A window's offsets along one axis, cut into blocks.
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

    /// Offset of the first cell after so many blocks.
    fn end(&self, blocks: usize) -> isize {
        (blocks * self.width / self.blocks) as isize - self.half
    }
}

/// Number of cells with data in any rectangle within some rows, from sums over all cells above and to the left (Crow, 1984).
/// Sums of more than 2^32 cells wrap round; differences, of a window's cells, do not show it.
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

    /// Cells with data in each block of the window about the cell `at`.
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

    /// The smallest rectangle in the block about the cell `at` that holds the block's `data` cells.
    fn shrink(&self, at: [isize; 2], block: Rectangle, data: u32) -> Rectangle {
        let moved = |span: [isize; 2], by: isize| [span[0] + by, span[1] + by];
        let count = |r: Rectangle| self.within([moved(r[0], at[0]), moved(r[1], at[1])]);
        let mut filled = block;
        for axis in 0..2 {
            let [from, to] = block[axis];
            let with = |span: [isize; 2]| if axis == 0 { [span, filled[1]] } else { [filled[0], span] };
            let first = bisect(from, to - 1, |s| count(with([s + 1, to])) < data);
            let last = bisect(first, to - 1, |s| count(with([first, s + 1])) == data);
            filled[axis] = [first, last + 1];
        }
        filled
    }
}

/// Tiles of a window's size, and whether all their cells have data: most windows are known to be complete by the up to four
/// tiles that they touch.
struct CompleteTiles {
    /// First row of the first tiles.
    top: isize,
    half: [isize; 2],
    side: [isize; 2],
    /// Tiles in a row of them.
    across: isize,
    complete: Vec<bool>,
}

impl CompleteTiles {
    fn new(data: &DataCount, window: BoxWindow) -> Self {
        let (side, half) = (window.cells().map(|n| n as isize), window.half.map(|n| n as isize));
        // What is left over at the ends belongs to no tile: windows that reach there are counted.
        let (top, down, across) = (data.rows.start, (data.rows.end - data.rows.start) / side[0], data.cols / side[1]);
        let tile = |row: isize, col: isize| {
            let rows = top + row * side[0];
            data.within([[rows, rows + side[0]], [col * side[1], (col + 1) * side[1]]]) as usize == window.area()
        };
        let complete = (0..down).flat_map(|r| (0..across).map(move |c| (r, c))).map(|(r, c)| tile(r, c)).collect();
        Self { top, half, side, across, complete }
    }

    /// True only where the window about a cell is complete.
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

/// First of `from..=last` where `holds` turns true, and `last` when it does nowhere before.
fn bisect(mut from: isize, mut last: isize, holds: impl Fn(isize) -> bool) -> isize {
    while from < last {
        let middle = from + (last - from) / 2;
        if holds(middle) { last = middle } else { from = middle + 1 }
    }
    from
}

/// Point of a Kronecker sequence in six dimensions.
struct Draw {
    index: usize,
}

impl Draw {
    /// Coordinate in [0, 1).
    fn unit(&self, dimension: usize) -> f64 {
        /// Powers 1 to 6 of 1 / g, g^7 = g + 1.
        const STEPS: [f64; 6] = [
            0.898_653_712_628_699_2,
            0.807_578_495_221_344_7,
            0.725_733_412_969_759_7,
            0.652_183_025_943_971_5,
            0.586_086_697_577_967_9,
            0.526_688_986_700_735_7,
        ];
        fraction(0.5 + self.index as f64 * STEPS[dimension])
    }

    /// Integer below `n`.
    fn below(&self, dimension: usize, n: usize) -> usize {
        (self.unit(dimension) * n as f64) as usize
    }
}

/// Part of a positive number after the point.
fn fraction(x: f64) -> f64 {
    x - (x as u64) as f64
}
