//! Search of the place of a site whose patch fits best onto what lies there already.
//!
//! The sum of squared differences over the cells that are known, for all places at once, is two correlations:
//!
//! `e(s) = sum over p of m(p) (z(s + p) - t(p))^2 = (m * z^2)(s) - 2 (m t * z)(s) + sum of m t^2`
//!
//! with t the known heights, m their mask, z the site and `*` the correlation, by transforms. A large site is searched on block means of
//! `factor` cells a side; the best [`CANDIDATES`] places are then compared exactly, at every cell of their blocks.
//!
//! Blocks cannot be wider than a third of the overlap, nor so wide that the exact comparison outweighs the transforms. Where they leave too
//! many, each patch is sought in a part of the site only, the surroundings of a place at random. For patches of 18 cells on a site of 1024 x 1024
//! the least root mean square difference in such a part, 101 x 101 cells, is 1.15 (exponential covariance) to 1.26 times (Gaussian) that in all of the site
//! (simulated), as much as a tolerance of 0.15 to 0.26 would give.

use crate::synth::measured::Holes;
use sastrugi_numeric::fft::{HalfSpectrum, RealFft2, smooth_length};
use sastrugi_numeric::{Grid, Stream};

/// Places that are compared exactly.
pub const CANDIDATES: usize = 32;
/// Most blocks that are searched for a patch,
const BLOCKS_MAX: usize = 1 << 16;
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
/// Uses of a block at which no complete patch starts.
const NO_PLACE: u32 = u32::MAX;

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
    /// How many patches start near each of these; [`NO_PLACE`] for the other blocks.
    uses: Vec<u32>,
    fft: RealFft2,
    /// Rows and columns of the transforms.
    torus: [usize; 2],
    part: Part,
    /// The blocks that the last patch knew, and their spectrum; most patches of a row know the same.
    mask: (Vec<bool>, HalfSpectrum),
    /// Most patches that may start near a place.
    uses_max: u32,
    tolerance: f64,
}

/// The part of a site that is searched: all of it, unless that is too large.
struct Part {
    /// First block.
    at: [usize; 2],
    /// Rows and columns, blocks.
    shape: [usize; 2],
    /// Spectra of the means and of their squares.
    heights: HalfSpectrum,
    squares: HalfSpectrum,
}

/// What a search looks for.
pub struct Wanted<'a> {
    /// Heights of the patch, row-major, m; NaN where nothing lies yet.
    pub known: &'a [f64],
    /// Places that would continue a neighbouring patch as the site does, and the distance from them that is avoided, cells.
    pub continuations: &'a [[i64; 2]],
    /// The distance, cells.
    pub clearance: usize,
}

/// Which places may be chosen, in the order in which rules are given up where nothing is left.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Rule {
    /// Those that are not used up and do not continue a neighbour.
    All,
    /// Those that do not continue a neighbour.
    NoContinuation,
    /// Any.
    AnyPlace,
}

impl<'a> Search<'a> {
    /// A search for `patches` patches that overlap by `overlap` cells. Places are used up to `reuse` times their mean use.
    pub fn new(
        site: &'a Grid,
        holes: &'a Holes,
        patch: [usize; 2],
        overlap: [usize; 2],
        patches: usize,
        [tolerance, reuse]: [f64; 2],
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
        let near = patch.map(|n| (n / factor).max(1));
        let mean_uses = (patches * near[0] * near[1]) as f64 / places.len() as f64;
        let uses_max = (reuse * mean_uses).ceil().max(1.0) as u32;
        let shape = part_shape(blocks, patch, factor);
        let torus = shape.map(smooth_length);
        let fft = RealFft2::new(torus[0], torus[1]);
        let part = Part::new([0, 0], shape, &means, blocks[1], &fft);
        let none = part.heights.clone();
        Self {
            site,
            holes,
            patch,
            factor,
            blocks,
            means,
            places,
            uses,
            fft,
            torus,
            part,
            mask: (Vec::new(), none),
            uses_max,
            tolerance,
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
            let found = self.places_in(at).filter(|&block| self.is_allowed(block, Rule::All, wanted)).take(CANDIDATES);
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

    /// Whether a patch may start at a block.
    fn is_allowed(&self, block: [usize; 2], rule: Rule, wanted: &Wanted<'_>) -> bool {
        let is_left = self.uses[block[0] * self.blocks[1] + block[1]] < self.uses_max;
        (rule > Rule::All || is_left) && (rule > Rule::NoContinuation || !self.continues(block, wanted))
    }

    /// The first cell of a patch that fits: one of those whose error is at most `1 + tolerance` times the least, at random.
    pub fn choose(&mut self, wanted: &Wanted<'_>, stream: &mut Stream) -> [usize; 2] {
        self.move_part(wanted, stream);
        let candidates = self.candidates(wanted);
        let cells = self.site.cols();
        let known: Vec<(usize, f64)> = (0..wanted.known.len())
            .filter(|&k| !wanted.known[k].is_nan())
            .map(|k| (k / self.patch[1] * cells + k % self.patch[1], wanted.known[k]))
            .collect();
        let errors: Vec<f64> = candidates.iter().map(|&at| self.error_m2(at, &known)).collect();
        let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
        let bound = least * (1.0 + self.tolerance) * (1.0 + self.tolerance);
        let good: Vec<[usize; 2]> =
            candidates.into_iter().zip(errors).filter(|(_, e)| *e <= bound).map(|(at, _)| at).collect();
        let at = good[stream.below(good.len() as u64) as usize];
        self.count(at);
        at
    }

    /// Sum of squared differences from the known heights, given by their distance in the site from the first cell, m2. Four sums side by side,
    /// which the processor need not wait for.
    fn error_m2(&self, at: [usize; 2], known: &[(usize, f64)]) -> f64 {
        let site = &self.site.values[at[0] * self.site.cols() + at[1]..];
        let square = |&(k, z): &(usize, f64)| (site[k] - z) * (site[k] - z);
        let fours = known.chunks_exact(4);
        let rest: f64 = fours.remainder().iter().map(square).sum();
        let sums = fours.fold([0.0; 4], |sums: [f64; 4], four| [0, 1, 2, 3].map(|k| sums[k] + square(&four[k])));
        (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
    }

    /// First cells of the patches to compare exactly.
    fn candidates(&mut self, wanted: &Wanted<'_>) -> Vec<[usize; 2]> {
        let errors = self.block_errors(wanted.known);
        let order = |a: &(f64, [usize; 2]), b: &(f64, [usize; 2])| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        let ranked = |rule: Rule| {
            let of = |block: [usize; 2]| {
                let [row, col] = [0, 1].map(|axis| block[axis] - self.part.at[axis]);
                (errors[row * self.torus[1] + col], block)
            };
            let allowed = self.places_in(self.part.at).filter(|&block| self.is_allowed(block, rule, wanted));
            let mut all: Vec<(f64, [usize; 2])> = allowed.map(of).collect();
            if all.len() > CANDIDATES {
                all.select_nth_unstable_by(CANDIDATES, order);
                all.truncate(CANDIDATES);
            }
            all.sort_unstable_by(order);
            all
        };
        // On a small site nothing may be left to choose from.
        let rules = [Rule::All, Rule::NoContinuation, Rule::AnyPlace];
        let best = rules.into_iter().map(ranked).find(|all| !all.is_empty()).unwrap_or_default();
        best.into_iter().flat_map(|(_, block)| self.around(block)).collect()
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
        let near = [0, 1].map(|axis| {
            let (start, patch) = (at[axis], self.patch[axis]);
            let lines =
                start.saturating_sub(patch) / self.factor..((start + patch) / self.factor + 1).min(self.blocks[axis]);
            lines.filter(|line| 2 * start.abs_diff(line * self.factor) < patch).collect::<Vec<usize>>()
        });
        for row in &near[0] {
            for col in &near[1] {
                let uses = &mut self.uses[row * self.blocks[1] + col];
                *uses += u32::from(*uses != NO_PLACE);
            }
        }
    }

    /// Errors of the blocks' means at all places of the part, without their common term, by torus cell.
    fn block_errors(&mut self, known: &[f64]) -> Vec<f64> {
        let means = block_means(known, self.patch, self.factor);
        let of_means = |of: fn(f64) -> f64| spectrum(&self.fft, self.torus, &means, self.patch[1] / self.factor, of);
        let heights = of_means(|z| z);
        let is_known: Vec<bool> = means.iter().map(|z| z.is_finite()).collect();
        if is_known != self.mask.0 {
            let mask = of_means(|_| 1.0);
            self.mask = (is_known, mask);
        }
        self.fft.inverse_of(|kx, column| {
            for (ky, value) in column.iter_mut().enumerate() {
                let k = kx * self.torus[0] + ky;
                *value = self.mask.1.values[k].conj() * self.part.squares.values[k]
                    - heights.values[k].conj() * self.part.heights.values[k] * 2.0;
            }
        })
    }
}

impl Part {
    /// The part of a site of `means`, in rows of `cols`.
    fn new(at: [usize; 2], shape: [usize; 2], means: &[f64], cols: usize, fft: &RealFft2) -> Self {
        let lines = (at[0]..at[0] + shape[0]).map(|row| row * cols + at[1]);
        let own: Vec<f64> = lines.flat_map(|first| &means[first..first + shape[1]]).copied().collect();
        let torus = shape.map(smooth_length);
        let functions: [fn(f64) -> f64; 2] = [|z| z, |z| z * z];
        let [heights, squares] = functions.map(|of| spectrum(fft, torus, &own, shape[1], of));
        Self { at, shape, heights, squares }
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

/// Transform of a function of block means, in rows of `cols`, on a torus; blocks with a gap count 0.
fn spectrum(fft: &RealFft2, torus: [usize; 2], means: &[f64], cols: usize, of: fn(f64) -> f64) -> HalfSpectrum {
    let mut field = vec![0.0; torus[0] * torus[1]];
    for (k, &z) in means.iter().enumerate().filter(|(_, z)| z.is_finite()) {
        field[k / cols * torus[1] + k % cols] = of(z);
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

    /// Errors by transforms against the sum by its definition, at every complete place of a site with gaps.
    #[test]
    fn val_errors_by_transforms_equal_the_sum() {
        let site = noise(37, 41, 0.01);
        let holes = Holes::of(&site);
        let patch = [7, 9];
        let mut search = Search::new(&site, &holes, patch, [3, 3], 4, [0.1, 2.0]);
        assert_eq!(search.factor, 1);
        let mut known = noise(7, 9, 0.0).values;
        known[20..50].fill(f64::NAN);
        let errors = search.block_errors(&known);
        let common: f64 = known.iter().filter(|z| z.is_finite()).map(|z| z * z).sum();
        assert!(search.places.len() > 200, "{}", search.places.len());
        for place in &search.places {
            let [row, col] = [*place as usize / 41, *place as usize % 41];
            let squares = site.window(row, col, 7, 9).values.into_iter().zip(&known).map(|(z, t)| (z - t) * (z - t));
            let direct: f64 = squares.filter(|e| e.is_finite()).sum();
            let fast = errors[row * search.torus[1] + col] + common;
            assert!((fast - direct).abs() < 1e-9, "{row} {col}: {fast} {direct}");
        }
    }

    /// A patch cut from the site is found again, at any cell, on blocks of one cell and of several.
    #[test]
    fn val_a_patch_of_the_site_is_found() {
        for (side, patch, overlap, factor) in [(60, 20, 8, 1), (512, 48, 16, 2), (1024, 96, 24, 4)] {
            let mut site = noise(side, side, 0.0);
            // Blocks of white noise have no memory of a shift; a moving mean of some cells has.
            for _ in 0..8 {
                let last = site.values.len() - side - 1;
                (0..last).for_each(|k| site.values[k] += site.values[k + 1] + site.values[k + side]);
            }
            let holes = Holes::of(&site);
            for at in [[3, 7], [side - patch - 5, 10], [11, side - patch - 2]] {
                let mut search = Search::new(&site, &holes, [patch; 2], [overlap; 2], 4, [0.0, 2.0]);
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
                let mut search = Search::new(&site, &holes, [patch; 2], [overlap; 2], 4, [0.0, 2.0]);
                let other = search.choose(&wanted, &mut Streams::for_seed(1, "test").stream("patches"));
                assert!((0..2).any(|axis| other[axis].abs_diff(at[axis]) + factor >= 9), "{other:?} {at:?}");
            }
        }
    }

    /// With a tolerance of 0 and one use for each place, twelve searches for one patch give twelve places that are at least half a patch
    /// apart.
    #[test]
    fn prop_places_are_not_used_too_often() {
        let site = noise(80, 80, 0.0);
        let holes = Holes::of(&site);
        let mut search = Search::new(&site, &holes, [16; 2], [5; 2], 12, [0.0, 1.0]);
        assert_eq!(search.uses_max, 1);
        let mut stream = Streams::for_seed(1, "test").stream("patches");
        let mut known = noise(16, 16, 0.0).values;
        known[80..].fill(f64::NAN);
        let wanted = Wanted { known: &known, continuations: &[], clearance: 0 };
        let found: Vec<[usize; 2]> = (0..12).map(|_| search.choose(&wanted, &mut stream)).collect();
        for (k, a) in found.iter().enumerate() {
            assert!(found[..k].iter().all(|b| (0..2).any(|axis| 2 * a[axis].abs_diff(b[axis]) >= 16)), "{found:?}");
        }
    }

    /// A site of 300 x 300 cells is too large for patches of 12 x 12 cells: each is sought in a part of 32 times its cells, which lies elsewhere
    /// for each, and the best place of the part is found, against the sum by its definition.
    #[test]
    fn val_large_sites_are_searched_in_parts() {
        let site = noise(300, 300, 0.0002);
        let holes = Holes::of(&site);
        let mut search = Search::new(&site, &holes, [12; 2], [3; 2], 50, [0.0, 2.0]);
        assert_eq!((search.factor, search.blocks, search.part.shape), (1, [300; 2], [67; 2]));
        let mut known = noise(12, 12, 0.0).values;
        known[48..].fill(f64::NAN);
        let wanted = Wanted { known: &known, continuations: &[], clearance: 0 };
        let mut stream = Streams::for_seed(1, "test").stream("patches");
        let mut parts = Vec::new();
        for _ in 0..8 {
            let uses = search.uses.clone();
            let found = search.choose(&wanted, &mut stream);
            let at = search.part.at;
            let error = |[row, col]: [usize; 2]| {
                let squares =
                    site.window(row, col, 4, 12).values.into_iter().zip(&known).map(|(z, t)| (z - t) * (z - t));
                squares.sum::<f64>()
            };
            let starts = (0..56 * 56).map(|k| [at[0] + k / 56, at[1] + k % 56]);
            let allowed = starts.filter(|&[row, col]| uses[row * 300 + col] < search.uses_max);
            let least = allowed.map(error).fold(f64::INFINITY, f64::min);
            assert!(holes.is_complete(found, [12; 2]) && (0..2).all(|k| (at[k]..at[k] + 56).contains(&found[k])));
            assert!((error(found) - least).abs() < 1e-9, "{found:?}: {} {least}", error(found));
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
        let mut search = Search::new(&site, &holes, [12; 2], [3; 2], 1000, [0.1, 2.0]);
        let known = vec![0.0; 144];
        let wanted = Wanted { known: &known, continuations: &[], clearance: 0 };
        let mut stream = Streams::for_seed(2, "test").stream("patches");
        for _ in 0..20 {
            let [row, col] = search.choose(&wanted, &mut stream);
            assert!(row + 12 <= 30 && col >= 460, "{row} {col}");
        }
    }

    /// By hand: parts in the proportions of the site; a strip keeps twice the width of a patch; 65 536 blocks at most, and 32 for each cell of a
    /// patch.
    #[test]
    fn val_shapes_of_parts() {
        assert_eq!(part_shape([200, 300], [48, 48], 1), [200, 300]);
        assert_eq!(part_shape([2000, 500], [48, 48], 1), [512, 128]);
        assert_eq!(part_shape([500, 500], [12, 12], 1), [67, 67]);
        assert_eq!(part_shape([60, 8000], [24, 24], 1), [48, 384]);
        assert_eq!(part_shape([60, 8000], [24, 24], 2), [24, 768]);
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
