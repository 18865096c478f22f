//! Search of the place of a site whose patch fits best onto what lies there already.
//!
//! The sum of squared differences over the cells that are known, for all places at once, is two correlations:
//!
//! `e(s) = sum over p of m(p) (z(s + p) - t(p))^2 = (m * z^2)(s) - 2 (m t * z)(s) + sum of m t^2`
//!
//! with t the known heights, m their mask, z the site and `*` the correlation, by transforms. A large site is searched on block means of
//! `factor` cells a side; the best [`CANDIDATES`] places are then compared exactly, at every cell of their blocks.

use crate::synth::measured::Holes;
use sastrugi_numeric::fft::{HalfSpectrum, RealFft2, smooth_length};
use sastrugi_numeric::{Grid, Stream};

/// Places that are compared exactly.
pub const CANDIDATES: usize = 32;
/// Blocks of a site beyond which it is searched on larger ones.
const BLOCKS_MAX: usize = 1 << 16;
/// An overlap is at least this many blocks wide.
const BLOCKS_IN_OVERLAP: usize = 3;

/// The search of one site for patches of one shape.
pub struct Search<'a> {
    site: &'a Grid,
    holes: &'a Holes,
    /// Rows and columns of a patch.
    patch: [usize; 2],
    /// Side of a block, cells.
    factor: usize,
    /// Blocks at which a complete patch starts, and how many patches start nearby.
    places: Vec<Place>,
    fft: RealFft2,
    /// Rows and columns of the transforms.
    torus: [usize; 2],
    heights: HalfSpectrum,
    squares: HalfSpectrum,
    /// The blocks that the last patch knew, and their spectrum; most patches of a row know the same.
    mask: (Vec<bool>, HalfSpectrum),
    /// Most patches that may start near a place.
    uses_max: u32,
    tolerance: f64,
}

/// A place, by the block at its north-west.
struct Place {
    block: [usize; 2],
    uses: u32,
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
        let coarsest = (overlap[0].min(overlap[1]) / BLOCKS_IN_OVERLAP).max(1);
        let wanted = (1..coarsest).find(|f| site.values.len() / (f * f) <= BLOCKS_MAX).unwrap_or(coarsest);
        // Among gaps, few complete patches start at the first cell of a block.
        let has_choice = |f: &usize| holes.complete_windows(patch, *f).len() >= CANDIDATES;
        let factor = (1..=wanted).rev().find(has_choice).unwrap_or(1);
        let blocks = [site.rows() / factor, site.cols() / factor];
        let torus = blocks.map(smooth_length);
        let fft = RealFft2::new(torus[0], torus[1]);
        let means = block_means(&site.values, [site.rows(), site.cols()], factor);
        let functions: [fn(f64) -> f64; 3] = [|z| z, |z| z * z, |_| 0.0];
        let [heights, squares, none] = functions.map(|of| spectrum(&fft, torus, &means, blocks[1], of));
        let starts = holes.complete_windows(patch, factor);
        let places: Vec<Place> =
            starts.into_iter().map(|at| Place { block: at.map(|k| k / factor), uses: 0 }).collect();
        let near = patch.map(|n| (n / factor).max(1));
        let mean_uses = (patches * near[0] * near[1]) as f64 / places.len() as f64;
        let uses_max = (reuse * mean_uses).ceil().max(1.0) as u32;
        Self {
            site,
            holes,
            patch,
            factor,
            places,
            fft,
            torus,
            heights,
            squares,
            mask: (Vec::new(), none),
            uses_max,
            tolerance,
        }
    }

    /// A place at random.
    pub fn any(&mut self, stream: &mut Stream) -> [usize; 2] {
        let chosen = &self.places[stream.below(self.places.len() as u64) as usize];
        let at = chosen.block.map(|k| k * self.factor);
        self.count(at);
        at
    }

    /// The first cell of a patch that fits: one of those whose error is at most `1 + tolerance` times the least, at random.
    pub fn choose(&mut self, wanted: &Wanted<'_>, stream: &mut Stream) -> [usize; 2] {
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
        let allowed = |place: &Place, relaxed: u32| {
            (relaxed > 0 || place.uses < self.uses_max) && (relaxed > 1 || !self.continues(place, wanted))
        };
        let order = |a: &(f64, [usize; 2]), b: &(f64, [usize; 2])| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        let ranked = |relaxed: u32| {
            let of = |place: &Place| (errors[place.block[0] * self.torus[1] + place.block[1]], place.block);
            let mut all: Vec<_> = self.places.iter().filter(|p| allowed(p, relaxed)).map(of).collect();
            if all.len() > CANDIDATES {
                all.select_nth_unstable_by(CANDIDATES, order);
                all.truncate(CANDIDATES);
            }
            all.sort_unstable_by(order);
            all
        };
        // On a small site nothing may be left to choose from.
        let best = (0..3).map(ranked).find(|all| !all.is_empty()).unwrap_or_default();
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

    /// Whether a patch from this place would continue a neighbour.
    fn continues(&self, place: &Place, wanted: &Wanted<'_>) -> bool {
        let at = place.block.map(|k| (k * self.factor) as i64);
        let near = |of: &[i64; 2]| (0..2).all(|axis| (at[axis] - of[axis]).unsigned_abs() < wanted.clearance as u64);
        wanted.continuations.iter().any(near)
    }

    /// Notes that a patch was taken from `at`.
    fn count(&mut self, at: [usize; 2]) {
        let (factor, patch) = (self.factor, self.patch);
        let is_near =
            |place: &Place| (0..2).all(|axis| 2 * at[axis].abs_diff(place.block[axis] * factor) < patch[axis]);
        self.places.iter_mut().filter(|place| is_near(place)).for_each(|place| place.uses += 1);
    }

    /// Errors of the blocks' means at all places, without their common term, by torus cell.
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
                *value = self.mask.1.values[k].conj() * self.squares.values[k]
                    - heights.values[k].conj() * self.heights.values[k] * 2.0;
            }
        })
    }
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
            let [row, col] = place.block;
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
