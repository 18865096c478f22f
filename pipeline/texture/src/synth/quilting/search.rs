//! Search for the place of a site whose patch best fits the patches already laid.
//!
//! # Mismatch
//! With t the known heights of a patch and z(s) the site's at the same cells of a patch from s, as vectors over these cells:
//!
//! `mismatch(s) = |t - z(s)|^2 / (|t| |z(s)|) = a + 1/a - 2 r`
//!
//! where a is the ratio of `|z(s)|` to `|t|`, and r their correlation. The sum `|t - z|^2` of Efros and Freeman is `|t|^2 (1 + a^2 - 2 a r)`,
//! least at a = r: of patches whose correlation with their surroundings is r, it prefers those that are calmer than these by the factor r, so that each
//! patch is calmer than those before. The mismatch is least at a = 1, and 1/a fits as well as a does.
//!
//! # Use
//! With this mismatch alone, the roughest or the calmest part of a site takes over, because like fits like. It is therefore multiplied by
//! a cost,
//!
//! `1 + evenness max(0, u(s) - v)`
//!
//! with u(s) the number of times that the cells of the patch from s have been laid, on average, and v the same of all cells of the site. A limit on u
//! instead of the cost gave equal statistics on four sites, and bad joins on one whose few complete patches cover half of it.
//!
//! # Transforms
//! The products t . z(s) of all places are one correlation, by transforms; `|z(s)|^2` is a difference of prefix sums, because
//! the unknown cells of a patch are a rectangle. A large site is searched on block means of `factor` cells a side; the best [`CANDIDATES`] places are
//! then compared exactly, at every cell of their blocks.
//!
//! Blocks cannot be wider than a third of the overlap, nor so wide that the exact comparison outweighs the transforms. Where they leave too many, each
//! patch is sought only in a part of the site, around a random place. For patches of 18 cells on a site of 1024 x 1024 the least root mean square
//! difference in such a part, 101 x 101 cells, is 1.15 (exponential covariance) to 1.26 times (Gaussian) that in all of the site (simulated), as much as a
//! tolerance of 0.15 to 0.26 would give.

use crate::synth::measured::Holes;
use sastrugi_numeric::fft::{HalfSpectrum, RealFft2, smooth_length};
use sastrugi_numeric::{Grid, Stream};

/// Places that are compared exactly.
pub const CANDIDATES: usize = 32;
/// Most blocks that are searched for a patch,
const BLOCKS_MAX: usize = 1 << 14;
/// and most for each cell of the patch, so that small patches, of which a texture has many, cost no more per cell than large ones.
pub const BLOCKS_PER_CELL: usize = 32;
/// Widest block, cells: each candidate is compared at all its cells.
pub const FACTOR_MAX: usize = 4;
/// An overlap is at least this many blocks wide.
const BLOCKS_IN_OVERLAP: usize = 3;
/// A part of a site is at least this many patches wide.
const PATCHES_IN_PART: usize = 2;
/// Parts that are tried until one has enough places.
const PARTS_MAX: usize = 8;
/// Stands for the uses of a block at which no complete patch starts.
const NO_PLACE: u32 = u32::MAX;
/// Added to sums of squares for each cell, as a share of the site's mean square: level ground fits level ground.
const LEAST_SQUARE: f64 = 1e-6;
/// The same on a site without relief, m2.
const LEAST_SQUARE_M2: f64 = 1e-100;

/// The search of one site for patches of one shape.
pub struct Search<'a> {
    site: &'a Grid,
    holes: &'a Holes,
    /// Rows and columns of a patch.
    patch: [usize; 2],
    /// Side of a block, cells.
    factor: usize,
    /// Rows and columns of the site, blocks.
    blocks: [usize; 2],
    /// Means of the blocks, row-major, m; NaN for those with a gap.
    means: Vec<f64>,
    /// Blocks at whose first cell a complete patch starts.
    places: Vec<u32>,
    /// Cells of the patch at each of these, each as often as it was laid; [`NO_PLACE`] for the other blocks. Enough for textures a thousand
    /// times as large as the site.
    uses: Vec<u32>,
    /// Patches that were laid.
    laid: usize,
    /// Cells of the site with data.
    cells: usize,
    fft: RealFft2,
    /// Rows and columns of the transforms.
    torus: [usize; 2],
    part: Part,
    /// Squares of the means.
    squares: Squares,
    /// Added to sums of squares for each cell, m2.
    least_square_m2: f64,
    tolerance: f64,
    evenness: f64,
}

/// The part of a site that is searched: all of it, unless that is too large.
struct Part {
    /// First block.
    at: [usize; 2],
    /// Rows and columns, blocks.
    shape: [usize; 2],
    /// Spectrum of the means.
    heights: HalfSpectrum,
}

/// Sums of squared heights over windows.
struct Squares {
    cols: usize,
    /// Sums north-west of each corner of a cell, row-major, m2.
    sums_m2: Vec<f64>,
}

/// Known block means of a patch, compared with all places of a part.
struct Comparison {
    /// Rows and columns of the patch, blocks.
    patch: [usize; 2],
    /// First block, rows and columns of what is not known.
    unknown: [[usize; 2]; 2],
    /// Sum of the known means' squares, m2.
    known_m2: f64,
    /// Sums of their products with the site's means, by torus cell, m2.
    products_m2: Vec<f64>,
    /// Added to sums of squares, m2.
    least_m2: f64,
}

/// What a search looks for.
pub struct Wanted<'a> {
    /// Heights of the patch, row-major, m; NaN where nothing lies yet, which is a rectangle.
    pub known: &'a [f64],
    /// Places that would continue a neighbouring patch as the site does, and the distance from them that is avoided, cells.
    pub continuations: &'a [[i64; 2]],
    /// The distance, cells.
    pub clearance: usize,
}

impl<'a> Search<'a> {
    /// A search for patches that overlap by `overlap` cells. `evenness` is the cost of a use above the mean.
    pub fn new(
        site: &'a Grid,
        holes: &'a Holes,
        patch: [usize; 2],
        overlap: [usize; 2],
        [tolerance, evenness]: [f64; 2],
    ) -> Self {
        let sides = [site.rows(), site.cols()];
        let coarsest = (overlap[0].min(overlap[1]) / BLOCKS_IN_OVERLAP).clamp(1, FACTOR_MAX);
        let wanted = (1..coarsest).find(|f| site.values.len() / (f * f) <= BLOCKS_MAX).unwrap_or(coarsest);
        // Among gaps, few complete patches start at the first cell of a block.
        let has_choice = |factor: &usize| {
            let blocks = sides.map(|side| side / factor);
            let [all, searched] = [blocks, part_shape(blocks, patch, *factor)].map(|[rows, cols]| rows * cols);
            holes.complete_windows(patch, *factor).count() * searched >= CANDIDATES * all
        };
        let factor = (1..=wanted).rev().find(has_choice).unwrap_or(1);
        let blocks = sides.map(|side| side / factor);
        let means = block_means(&site.values, sides, factor);
        let number = |[row, col]: [usize; 2]| (row / factor * blocks[1] + col / factor) as u32;
        let places: Vec<u32> = holes.complete_windows(patch, factor).map(number).collect();
        let mut uses = vec![NO_PLACE; means.len()];
        places.iter().for_each(|&place| uses[place as usize] = 0);
        let squares = Squares::of(&means, blocks[1]);
        let complete = means.iter().filter(|z| z.is_finite()).count().max(1);
        let mean_square_m2 = squares.over([0, 0], blocks) / complete as f64;
        let shape = part_shape(blocks, patch, factor);
        let torus = shape.map(smooth_length);
        let fft = RealFft2::new(torus[0], torus[1]);
        let part = Part::new([0, 0], shape, &means, blocks[1], &fft);
        Self {
            site,
            holes,
            patch,
            factor,
            blocks,
            means,
            places,
            uses,
            laid: 0,
            cells: site.finite_count(),
            fft,
            torus,
            part,
            squares,
            least_square_m2: (LEAST_SQUARE * mean_square_m2).max(LEAST_SQUARE_M2),
            tolerance,
            evenness,
        }
    }

    /// A place at random.
    pub fn any(&mut self, stream: &mut Stream) -> [usize; 2] {
        let at = self.any_block(stream).map(|k| k * self.factor);
        self.count(at);
        at
    }

    fn any_block(&self, stream: &mut Stream) -> [usize; 2] {
        let place = self.places[stream.below(self.places.len() as u64) as usize] as usize;
        [place / self.blocks[1], place % self.blocks[1]]
    }

    /// Moves the searched part, unless it is the complete site, to the surroundings of a place at random: of some, the first with enough places
    /// that may be chosen, or the one with most.
    fn move_part(&mut self, wanted: &Wanted<'_>, stream: &mut Stream) {
        if self.part.shape == self.blocks {
            return;
        }
        let (mut best, mut most) = ([0, 0], 0);
        for _ in 0..PARTS_MAX {
            let at = self.part_around(self.any_block(stream), stream);
            let found = self.places_in(at).filter(|&block| !self.continues(block, wanted)).take(CANDIDATES);
            let count = found.count();
            if most == 0 || count > most {
                (best, most) = (at, count);
            }
            if count == CANDIDATES {
                break;
            }
        }
        self.part = Part::new(best, self.part.shape, &self.means, self.blocks[1], &self.fft);
    }

    /// First block of a part that holds the patch at a block, at random.
    fn part_around(&self, block: [usize; 2], stream: &mut Stream) -> [usize; 2] {
        [0, 1].map(|axis| {
            let (side, part) = (self.blocks[axis], self.part.shape[axis]);
            let before = stream.below((part - self.patch[axis] / self.factor) as u64 + 1) as usize;
            block[axis].saturating_sub(before).min(side - part)
        })
    }

    /// Blocks of the part from `at` at whose first cell a complete patch starts that lies in the part, row by row.
    fn places_in(&self, at: [usize; 2]) -> impl Iterator<Item = [usize; 2]> {
        let lines = move |axis: usize| at[axis]..at[axis] + self.part.shape[axis] + 1 - self.patch[axis] / self.factor;
        let all = lines(0).flat_map(move |row| lines(1).map(move |col| [row, col]));
        all.filter(move |&[row, col]| self.uses[row * self.blocks[1] + col] != NO_PLACE)
    }

    /// What the mismatch of a block is multiplied by: more than 1 if its cells have been laid more often than those of the site.
    fn cost(&self, block: [usize; 2]) -> f64 {
        let area = (self.patch[0] * self.patch[1]) as f64;
        let uses = f64::from(self.uses[block[0] * self.blocks[1] + block[1]]) / area;
        1.0 + self.evenness * (uses - self.laid as f64 * area / self.cells as f64).max(0.0)
    }

    /// The first cell of a patch that fits: one of those whose relative difference, with its cost, is at most `1 + tolerance` times the least,
    /// at random.
    pub fn choose(&mut self, wanted: &Wanted<'_>, stream: &mut Stream) -> [usize; 2] {
        self.move_part(wanted, stream);
        let candidates = self.candidates(wanted);
        let cells = self.site.cols();
        let known: Vec<(usize, f64)> = (0..wanted.known.len())
            .filter(|&k| !wanted.known[k].is_nan())
            .map(|k| (k / self.patch[1] * cells + k % self.patch[1], wanted.known[k]))
            .collect();
        let known_m2: f64 = known.iter().map(|(_, z)| z * z).sum();
        let least_m2 = known.len().max(1) as f64 * self.least_square_m2;
        let of = |&(at, cost): &([usize; 2], f64)| {
            let [error_m2, own_m2] = self.sums_m2(at, &known);
            cost * mismatch(error_m2, [known_m2, own_m2], least_m2)
        };
        let mismatches: Vec<f64> = candidates.iter().map(of).collect();
        let least = mismatches.iter().copied().fold(f64::INFINITY, f64::min);
        let bound = least * (1.0 + self.tolerance) * (1.0 + self.tolerance);
        let good: Vec<[usize; 2]> =
            candidates.into_iter().zip(mismatches).filter(|(_, m)| *m <= bound).map(|((at, _), _)| at).collect();
        let at = good[stream.below(good.len() as u64) as usize];
        self.count(at);
        at
    }

    /// Sums of squared differences from the known heights, given by their distance in the site from the first cell, and of the site's squared
    /// heights there, m2. Four of each side by side, which the processor need not wait for.
    fn sums_m2(&self, at: [usize; 2], known: &[(usize, f64)]) -> [f64; 2] {
        let site = &self.site.values[at[0] * self.site.cols() + at[1]..];
        let squares = |&(k, z): &(usize, f64)| [(site[k] - z) * (site[k] - z), site[k] * site[k]];
        let add = |sums: [f64; 2], more: [f64; 2]| [sums[0] + more[0], sums[1] + more[1]];
        let fours = known.chunks_exact(4);
        let rest = fours.remainder().iter().map(squares).fold([0.0; 2], add);
        let sums = fours
            .fold([[0.0; 2]; 4], |sums: [[f64; 2]; 4], four| [0, 1, 2, 3].map(|k| add(sums[k], squares(&four[k]))));
        add(add(add(sums[0], sums[1]), add(sums[2], sums[3])), rest)
    }

    /// First cells of the patches to compare exactly, and their costs.
    fn candidates(&self, wanted: &Wanted<'_>) -> Vec<([usize; 2], f64)> {
        let comparison = self.comparison(wanted.known);
        let order = |a: &(f64, [usize; 2]), b: &(f64, [usize; 2])| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        let ranked = |may_continue: bool| {
            let of = |block: [usize; 2]| (self.cost(block) * self.mismatch_at(block, &comparison), block);
            let allowed = self.places_in(self.part.at).filter(|&block| may_continue || !self.continues(block, wanted));
            let mut all: Vec<(f64, [usize; 2])> = allowed.map(of).collect();
            if all.len() > CANDIDATES {
                all.select_nth_unstable_by(CANDIDATES, order);
                all.truncate(CANDIDATES);
            }
            all.sort_unstable_by(order);
            all
        };
        // On a small site nothing else may be left to choose from.
        let best = [false, true].into_iter().map(ranked).find(|all| !all.is_empty()).unwrap_or_default();
        let around = |block: [usize; 2]| self.around(block).into_iter().map(move |at| (at, self.cost(block)));
        best.into_iter().flat_map(|(_, block)| around(block)).collect()
    }

    /// The complete patches that start up to half a block from a block's first cell.
    fn around(&self, block: [usize; 2]) -> Vec<[usize; 2]> {
        let (half, factor) = (self.factor / 2, self.factor);
        let starts = |axis: usize| {
            let first = (block[axis] * factor).saturating_sub(half);
            let side = if axis == 0 { self.site.rows() } else { self.site.cols() };
            first..(block[axis] * factor + factor - half).min(side + 1 - self.patch[axis])
        };
        let all = starts(0).flat_map(|row| starts(1).map(move |col| [row, col]));
        all.filter(|&at| self.holes.is_complete(at, self.patch)).collect()
    }

    /// Whether a patch from this block would continue a neighbour.
    fn continues(&self, block: [usize; 2], wanted: &Wanted<'_>) -> bool {
        let at = block.map(|k| (k * self.factor) as i64);
        let near = |of: &[i64; 2]| (0..2).all(|axis| (at[axis] - of[axis]).unsigned_abs() < wanted.clearance as u64);
        wanted.continuations.iter().any(near)
    }

    /// Notes that a patch was taken from `at`.
    fn count(&mut self, at: [usize; 2]) {
        // Lines of blocks whose patches share cells with this one, and on how many lines.
        let shared = [0, 1].map(|axis| {
            let (start, patch) = (at[axis], self.patch[axis]);
            let first = (start + 1).saturating_sub(patch).div_ceil(self.factor);
            let end = ((start + patch - 1) / self.factor + 1).min(self.blocks[axis]);
            let lines = (first..end).map(|line| (line, patch - start.abs_diff(line * self.factor)));
            lines.collect::<Vec<(usize, usize)>>()
        });
        for &(row, down) in &shared[0] {
            for &(col, across) in &shared[1] {
                let uses = &mut self.uses[row * self.blocks[1] + col];
                if *uses != NO_PLACE {
                    *uses += (down * across) as u32;
                }
            }
        }
        self.laid += 1;
    }

    /// Compares the known heights of a patch with all places of the part, on block means.
    fn comparison(&self, known: &[f64]) -> Comparison {
        let patch = self.patch.map(|n| n / self.factor);
        let means = block_means(known, self.patch, self.factor);
        let heights = spectrum(&self.fft, self.torus, &means, patch[1]);
        let products_m2 = self.fft.inverse_of(|kx, column| {
            for (ky, value) in column.iter_mut().enumerate() {
                let k = kx * self.torus[0] + ky;
                *value = heights.values[k].conj() * self.part.heights.values[k];
            }
        });
        let known: Vec<f64> = means.iter().filter(|z| z.is_finite()).map(|z| z * z).collect();
        let unknown = unknown(&means, patch[1]);
        assert_eq!(unknown[1][0] * unknown[1][1], means.len() - known.len(), "what is unknown must be a rectangle");
        let least_m2 = known.len().max(1) as f64 * self.least_square_m2;
        Comparison { patch, unknown, known_m2: known.iter().sum(), products_m2, least_m2 }
    }

    /// The mismatch of a block of the part.
    fn mismatch_at(&self, block: [usize; 2], of: &Comparison) -> f64 {
        let [row, col] = [0, 1].map(|axis| block[axis] - self.part.at[axis]);
        let [first, shape] = of.unknown;
        let unknown = [block[0] + first[0], block[1] + first[1]];
        let own_m2 = (self.squares.over(block, of.patch) - self.squares.over(unknown, shape)).max(0.0);
        let error_m2 = of.known_m2 + own_m2 - 2.0 * of.products_m2[row * self.torus[1] + col];
        mismatch(error_m2.max(0.0), [of.known_m2, own_m2], of.least_m2)
    }
}

/// The sum of squared differences over the geometric mean of two sums of squares, each with `least_m2` added.
fn mismatch(error_m2: f64, squares_m2: [f64; 2], least_m2: f64) -> f64 {
    let [known_m2, own_m2] = squares_m2.map(|square| square + least_m2);
    error_m2 / (known_m2 * own_m2).sqrt()
}

impl Squares {
    /// Of heights in rows of `cols`; NaN counts 0.
    fn of(heights: &[f64], cols: usize) -> Self {
        let width = cols + 1;
        let mut sums_m2 = vec![0.0; width];
        for row in heights.chunks_exact(cols) {
            let above = sums_m2.len() - width;
            let mut in_row = 0.0;
            sums_m2.push(0.0);
            for (c, z) in row.iter().enumerate() {
                in_row += if z.is_finite() { z * z } else { 0.0 };
                sums_m2.push(sums_m2[above + c + 1] + in_row);
            }
        }
        Self { cols: width, sums_m2 }
    }

    /// The sum over a window.
    fn over(&self, [row, col]: [usize; 2], [rows, cols]: [usize; 2]) -> f64 {
        let at = |r: usize, c: usize| self.sums_m2[r * self.cols + c];
        (at(row + rows, col + cols) - at(row + rows, col)) - (at(row, col + cols) - at(row, col))
    }
}

/// First block, rows and columns of the rectangle of unknown means, in rows of `cols`.
fn unknown(means: &[f64], cols: usize) -> [[usize; 2]; 2] {
    let is_unknown = |k: &usize| means[*k].is_nan();
    let Some(first) = (0..means.len()).find(is_unknown) else { return [[0, 0], [0, 0]] };
    let last = (first..means.len()).rev().find(is_unknown).unwrap_or(first);
    let [start, end] = [first, last].map(|k| [k / cols, k % cols]);
    [start, [0, 1].map(|axis| end[axis] + 1 - start[axis])]
}

impl Part {
    /// The part of a site of `means`, in rows of `cols`.
    fn new(at: [usize; 2], shape: [usize; 2], means: &[f64], cols: usize, fft: &RealFft2) -> Self {
        let lines = (at[0]..at[0] + shape[0]).map(|row| row * cols + at[1]);
        let own: Vec<f64> = lines.flat_map(|first| &means[first..first + shape[1]]).copied().collect();
        let torus = shape.map(smooth_length);
        Self { at, shape, heights: spectrum(fft, torus, &own, shape[1]) }
    }
}

/// Rows and columns of the part of a site that is searched, in blocks of `factor` cells: the site's, or as many as are affordable, in its
/// proportions unless a side would be narrower than two patches.
fn part_shape(blocks: [usize; 2], patch: [usize; 2], factor: usize) -> [usize; 2] {
    let most = BLOCKS_MAX.min(BLOCKS_PER_CELL * patch[0] * patch[1]);
    let share = (most as f64 / (blocks[0] as f64 * blocks[1] as f64)).sqrt().min(1.0);
    let side = |axis: usize, wanted: usize| {
        let least = (PATCHES_IN_PART * patch[axis]).div_ceil(factor);
        wanted.max(least).min(blocks[axis])
    };
    let [rows, cols] = [0, 1].map(|axis| side(axis, (blocks[axis] as f64 * share) as usize));
    // A side that is held at its least leaves fewer blocks for the other.
    [side(0, rows.min(most / cols)), side(1, cols.min(most / rows))]
}

/// Transform of block means, in rows of `cols`, on a torus; blocks with a gap count 0.
fn spectrum(fft: &RealFft2, torus: [usize; 2], means: &[f64], cols: usize) -> HalfSpectrum {
    let mut field = vec![0.0; torus[0] * torus[1]];
    for (k, &z) in means.iter().enumerate().filter(|(_, z)| z.is_finite()) {
        field[k / cols * torus[1] + k % cols] = z;
    }
    fft.forward(&field)
}

/// Means of the complete blocks of `factor` cells a side, row-major; NaN for those with a gap.
fn block_means(heights: &[f64], [rows, cols]: [usize; 2], factor: usize) -> Vec<f64> {
    let area = (factor * factor) as f64;
    let mean = |r: usize, c: usize| {
        let lines = (r * factor..(r + 1) * factor).map(|row| row * cols + c * factor);
        lines.flat_map(|k| &heights[k..k + factor]).sum::<f64>() / area
    };
    (0..rows / factor).flat_map(|r| (0..cols / factor).map(move |c| (r, c))).map(|(r, c)| mean(r, c)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    fn noise(rows: usize, cols: usize, gaps: f64) -> Grid {
        let mut stream = Streams::for_seed(5, "search-test").stream("heights");
        let height = |_| if stream.uniform() < gaps { f64::NAN } else { stream.normal() };
        Grid::new(Geometry::square(rows, cols, 1.0), (0..rows * cols).map(height).collect())
    }

    /// The mismatch of the patch from `[row, col]` by its definition, without the share that is added to sums of squares.
    fn mismatch_by_definition(site: &Grid, [row, col]: [usize; 2], known: &[f64], patch: [usize; 2]) -> f64 {
        let own = site.window(row, col, patch[0], patch[1]).values;
        let sum = |of: fn(f64, f64) -> f64| {
            let terms = own.iter().zip(known).filter(|(_, t)| !t.is_nan()).map(|(&z, &t)| of(z, t));
            terms.sum::<f64>()
        };
        sum(|z, t| (z - t) * (z - t)) / (sum(|z, _| z * z) * sum(|_, t| t * t)).sqrt()
    }

    /// By hand: the known heights twice as high, half as high, reversed, and themselves.
    #[test]
    fn val_mismatch_by_hand() {
        for (factor, expected) in [(2.0, 0.5), (0.5, 0.5), (-1.0, 4.0), (1.0, 0.0)] {
            let error_m2 = (factor - 1.0) * (factor - 1.0) * 3.0;
            let found = mismatch(error_m2, [3.0, factor * factor * 3.0], 1e-9);
            assert!((found - expected).abs() < 1e-8, "{factor}: {found}");
        }
        // Level ground.
        assert_eq!(mismatch(0.0, [0.0, 0.0], LEAST_SQUARE_M2), 0.0);
        assert!(mismatch(1.0, [1.0, 0.0], 1e-6) > 900.0);
    }

    /// By hand: of places that do not correlate with what is known, one that is calmer by a factor fits no better than one that is rougher by it, and
    /// one that is as rough fits best.
    #[test]
    fn val_calm_places_are_not_preferred() {
        let of = |ratio: f64| mismatch(1.0 + ratio * ratio, [1.0, ratio * ratio], 1e-12);
        for ratio in [1.2, 1.5, 2.0] {
            assert!((of(ratio) - of(1.0 / ratio)).abs() < 1e-9 && of(ratio) > of(1.0));
        }
    }

    /// Mismatches by transforms and prefix sums against their definition, at every complete place of a site with gaps.
    #[test]
    fn val_mismatches_by_transforms_equal_the_definition() {
        let site = noise(37, 41, 0.01);
        let holes = Holes::of(&site);
        let patch = [7, 9];
        let search = Search::new(&site, &holes, patch, [3, 3], [0.1, 4.0]);
        assert_eq!(search.factor, 1);
        // Known: two rows in the north, one in the south, three columns in the west; then everything.
        for rows in [2..6, 0..0] {
            let mut known = noise(7, 9, 0.0).values;
            rows.for_each(|row| known[row * 9 + 3..(row + 1) * 9].fill(f64::NAN));
            let comparison = search.comparison(&known);
            assert!(search.places.len() > 200, "{}", search.places.len());
            for place in &search.places {
                let at = [*place as usize / 41, *place as usize % 41];
                let (fast, direct) =
                    (search.mismatch_at(at, &comparison), mismatch_by_definition(&site, at, &known, patch));
                assert!((fast / direct - 1.0).abs() < 1e-4, "{at:?}: {fast} {direct}");
            }
        }
    }

    /// By hand, in rows of four: nothing, the middle, one corner, everything.
    #[test]
    fn val_unknown_rectangles_by_hand() {
        for (cells, expected) in [
            (vec![], [[0, 0], [0, 0]]),
            (vec![5, 6, 9, 10], [[1, 1], [2, 2]]),
            (vec![11], [[2, 3], [1, 1]]),
            ((0..12).collect::<Vec<usize>>(), [[0, 0], [3, 4]]),
        ] {
            let mut means = vec![1.0; 12];
            cells.iter().for_each(|&k| means[k] = f64::NAN);
            assert_eq!(unknown(&means, 4), expected);
        }
    }

    /// By hand: rows of 1, 2, 3 and 4, a gap, 6.
    #[test]
    fn val_squares_by_hand() {
        let squares = Squares::of(&[1.0, 2.0, 3.0, 4.0, f64::NAN, 6.0], 3);
        assert_eq!(squares.over([0, 0], [2, 3]), 66.0);
        assert_eq!(squares.over([1, 1], [1, 2]), 36.0);
        assert_eq!(squares.over([0, 1], [2, 1]), 4.0);
        assert_eq!(squares.over([1, 2], [0, 0]), 0.0);
    }

    /// A patch cut from the site is found again, at any cell, on blocks of one cell and of several.
    #[test]
    fn val_a_patch_of_the_site_is_found() {
        for (side, patch, overlap, factor) in [(60, 20, 8, 1), (256, 48, 16, 2), (512, 96, 24, 4)] {
            let mut site = noise(side, side, 0.0);
            // Blocks of white noise have no memory of a shift; a moving mean of some cells has.
            for _ in 0..8 {
                let last = site.values.len() - side - 1;
                (0..last).for_each(|k| site.values[k] += site.values[k + 1] + site.values[k + side]);
            }
            let holes = Holes::of(&site);
            for at in [[3, 7], [side - patch - 5, 10], [11, side - patch - 2]] {
                let mut search = Search::new(&site, &holes, [patch; 2], [overlap; 2], [0.0, 4.0]);
                assert_eq!(search.factor, factor);
                let mut known = site.window(at[0], at[1], patch, patch).values;
                (0..known.len())
                    .filter(|k| k / patch >= overlap && k % patch >= overlap)
                    .for_each(|k| known[k] = f64::NAN);
                let wanted = Wanted { known: &known, continuations: &[], clearance: 0 };
                let found = search.choose(&wanted, &mut Streams::for_seed(1, "test").stream("patches"));
                assert_eq!(found, at);
                // The same place is avoided where it would continue a neighbour.
                let own = [at.map(|k| k as i64)];
                let wanted = Wanted { known: &known, continuations: &own, clearance: 9 };
                let mut search = Search::new(&site, &holes, [patch; 2], [overlap; 2], [0.0, 4.0]);
                let other = search.choose(&wanted, &mut Streams::for_seed(1, "test").stream("patches"));
                assert!((0..2).any(|axis| other[axis].abs_diff(at[axis]) + factor >= 9), "{other:?} {at:?}");
            }
        }
    }

    /// By hand: after one patch of 16 x 16 cells at (20, 30), itself counts 256, the place 4 south and 5 west of it 12 x 11, and one 16 cells away
    /// 0. The site has 25 times the cells of a patch, so that costs are 1 + 4 (1 - 1/25), 1 + 4 (132 / 256 - 1/25), and 1.
    #[test]
    fn val_uses_by_hand() {
        let site = noise(80, 80, 0.0);
        let holes = Holes::of(&site);
        let mut search = Search::new(&site, &holes, [16; 2], [5; 2], [0.0, 4.0]);
        search.count([20, 30]);
        let uses = |row: usize, col: usize| search.uses[row * 80 + col];
        assert_eq!([uses(20, 30), uses(24, 25), uses(36, 30), uses(20, 14), uses(5, 15)], [256, 132, 0, 0, 1]);
        assert_eq!(uses(70, 70), NO_PLACE);
        for (place, cost) in [([20, 30], 4.84), ([24, 25], 2.9025), ([36, 30], 1.0)] {
            assert!((search.cost(place) - cost).abs() < 1e-12, "{place:?}");
        }
    }

    /// With a tolerance of 0, 100 searches for one and the same patch, four times the area of the site, are answered by places all over it. In an
    /// independent program, 94 % of the cells were laid, and none more than 9 times (mean 4).
    #[test]
    fn prop_places_are_used_equally_often() {
        let site = noise(80, 80, 0.0);
        let holes = Holes::of(&site);
        let mut search = Search::new(&site, &holes, [16; 2], [5; 2], [0.0, 4.0]);
        let mut stream = Streams::for_seed(1, "test").stream("patches");
        let mut known = noise(16, 16, 0.0).values;
        known[80..].fill(f64::NAN);
        let wanted = Wanted { known: &known, continuations: &[], clearance: 0 };
        let mut laid = vec![0; 80 * 80];
        for _ in 0..100 {
            let [row, col] = search.choose(&wanted, &mut stream);
            (0..256).for_each(|k| laid[(row + k / 16) * 80 + col + k % 16] += 1);
        }
        let (found, most) = (laid.iter().filter(|n| **n > 0).count(), laid.iter().max().copied().unwrap());
        assert!(found > 80 * 80 * 17 / 20 && most <= 12, "{found} {most}");
    }

    /// A site of 300 x 300 cells is too large for patches of 12 x 12 cells: each is sought in a part of 32 times its cells, which lies elsewhere
    /// for each, and the best place of the part is found, against the sum by its definition.
    #[test]
    fn val_large_sites_are_searched_in_parts() {
        let site = noise(300, 300, 0.0002);
        let holes = Holes::of(&site);
        let mut search = Search::new(&site, &holes, [12; 2], [3; 2], [0.0, 4.0]);
        assert_eq!((search.factor, search.blocks, search.part.shape), (1, [300; 2], [67; 2]));
        let mut known = noise(12, 12, 0.0).values;
        known[48..].fill(f64::NAN);
        let wanted = Wanted { known: &known, continuations: &[], clearance: 0 };
        let mut stream = Streams::for_seed(1, "test").stream("patches");
        let mut parts = Vec::new();
        for _ in 0..8 {
            let costs: Vec<f64> = (0..300 * 300).map(|k| search.cost([k / 300, k % 300])).collect();
            let found = search.choose(&wanted, &mut stream);
            let at = search.part.at;
            let of = |at: [usize; 2]| costs[at[0] * 300 + at[1]] * mismatch_by_definition(&site, at, &known, [12; 2]);
            let starts = (0..56 * 56).map(|k| [at[0] + k / 56, at[1] + k % 56]);
            let allowed = starts.filter(|&start| holes.is_complete(start, [12; 2]));
            let least = allowed.map(of).fold(f64::INFINITY, f64::min);
            assert!(holes.is_complete(found, [12; 2]) && (0..2).all(|k| (at[k]..at[k] + 56).contains(&found[k])));
            assert!((of(found) / least - 1.0).abs() < 1e-4, "{found:?}: {} {least}", of(found));
            parts.push(at);
        }
        parts.dedup();
        assert_eq!(parts.len(), 8);
    }

    /// Few places in one corner of a large site: they are found, wherever the part is drawn.
    #[test]
    fn prop_parts_hold_places() {
        let mut site = noise(400, 500, 0.0);
        (0..400 * 500).filter(|k| k / 500 >= 30 || k % 500 < 460).for_each(|k| site.values[k] = f64::NAN);
        let holes = Holes::of(&site);
        let mut search = Search::new(&site, &holes, [12; 2], [3; 2], [0.1, 4.0]);
        let known = vec![0.0; 144];
        let wanted = Wanted { known: &known, continuations: &[], clearance: 0 };
        let mut stream = Streams::for_seed(2, "test").stream("patches");
        for _ in 0..20 {
            let [row, col] = search.choose(&wanted, &mut stream);
            assert!(row + 12 <= 30 && col >= 460, "{row} {col}");
        }
    }

    /// By hand: parts in the proportions of the site; a strip keeps twice the width of a patch; 16 384 blocks at most, and 32 for each cell of a
    /// patch.
    #[test]
    fn val_shapes_of_parts() {
        assert_eq!(part_shape([100, 160], [48, 48], 1), [100, 160]);
        assert_eq!(part_shape([2000, 500], [30, 30], 1), [256, 64]);
        assert_eq!(part_shape([500, 500], [12, 12], 1), [67, 67]);
        assert_eq!(part_shape([60, 8000], [24, 24], 1), [48, 341]);
        assert_eq!(part_shape([60, 8000], [24, 24], 2), [24, 682]);
    }

    /// By hand: blocks of two cells; the last row and column are left over, and a gap empties its block.
    #[test]
    fn val_block_means_by_hand() {
        let mut heights: Vec<f64> = (0..25).map(f64::from).collect();
        heights[12] = f64::NAN;
        let means = block_means(&heights, [5, 5], 2);
        assert_eq!(means[..3], [3.0, 5.0, 13.0]);
        assert!(means.len() == 4 && means[3].is_nan());
    }
}
