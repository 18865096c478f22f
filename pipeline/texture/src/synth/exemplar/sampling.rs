//! Direct sampling: each unknown cell takes its detail from the place of the site whose neighbourhood is most like its own.
//!
//! For a cell with known neighbours k(d) at offsets d (nearest first, weights 1 / |d|^2), and a place s of the site with neighbours z(s + d), with
//! weighted means, variances and `level = mean of (k - z)`:
//!
//! `mismatch = var(k - z) / (var(k) + var(z)) + LEVEL_WEIGHT level^2 / sigma^2`
//!
//! The cell becomes `z(s) + level`: the detail of the place on the level of its own surroundings. Where the neighbours are one piece of the site,
//! mismatch and level are 0 and the cell is a copy. Two unrelated neighbourhoods have a mismatch of 1, whatever their roughness; without the
//! division a flat place would fit a rough neighbourhood better than another rough one.
//!
//! Where no place has data for enough of a neighbourhood, the cell becomes the weighted mean of its neighbours: a height drawn from the site would
//! stand out by up to the site's relief.
//!
//! Unknown cells are visited on grids of spacing 2^k, 2^(k-1) ... 1, each in four passes: every second cell of both axes; the centres between them;
//! the rest of every second row; the rest of the columns. Cells of one pass do not see each other, so that they may be computed in any order. On a
//! torus whose side is not a multiple of a grid's spacing, the last line of a pass has no line of the pass before it beyond the border: it follows
//! the other lines, so that it sees both sides. Otherwise steps across the border would be twice those inside.

use crate::synth::measured::Holes;
use rayon::prelude::*;
use sastrugi_numeric::{Counter, Geometry, Grid, Streams, sums};

/// Weight of a difference of level in the mismatch: small, because the level is corrected; not 0, so that crests stay on high ground.
const LEVEL_WEIGHT: f64 = 0.1;
/// Added to the variances of two neighbourhoods, as a share of the site's: level ground fits level ground.
const LEAST_VARIANCE: f64 = 1e-6;
/// Share of a neighbourhood's weight for which a place must have data.
const DATA_SHARE: f64 = 0.7;
/// Neighbours are sought within this many spacings of the grid.
const REACH: usize = 4;
/// On grids of at least this spacing, cells, all the stated places are compared at random.
const FULL_SPACING: usize = 8;
/// Fewest places that are compared at random, if as many are stated.
const SCAN_MIN: usize = 8;

/// Neighbours, places at random, and widest grid for gaps.
const GAP_NEIGHBOURS: usize = 12;
const GAP_SCAN: usize = 512;
const GAP_SPACING: usize = 4;

/// A field in which some cells are known.
pub struct Field {
    /// Rows and columns.
    pub shape: [usize; 2],
    /// Heights, row-major, m; NaN where unknown.
    pub heights_m: Vec<f64>,
    /// Cells of the site from which known cells come.
    pub sources: Vec<u32>,
    /// Whether it continues at the other side beyond its border.
    pub is_torus: bool,
}

/// How to sample.
#[derive(Clone, Copy, Debug)]
pub struct Sampling {
    /// Most neighbours that are compared.
    pub neighbours: usize,
    /// Places compared at random for each cell of wide grids, besides those that continue a neighbour; see [`scan_at`].
    pub scan: usize,
    /// Widest spacing of the grids, a power of 2, cells.
    pub spacing: usize,
}

/// A known cell, seen from one that is not.
struct Neighbour {
    /// Distance south and east, cells.
    offset: [i64; 2],
    height_m: f64,
    weight: f64,
    source: usize,
}

/// A place of the site and what it would give the cell.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sample {
    source: usize,
    height_m: f64,
    mismatch: f64,
}

/// The site that is sampled.
struct Exemplar<'a> {
    grid: &'a Grid,
    /// Cells with data.
    places: Vec<u32>,
    /// Mean square height, m2.
    variance_m2: f64,
}

/// Places compared at random for each cell of a grid of `spacing` cells: `scan` from a spacing of 8 on; on finer grids, which have four times
/// the cells each, fewer by the cube of the spacing, but at least 8.
pub fn scan_at(scan: usize, spacing: usize) -> usize {
    let spacing = spacing.min(FULL_SPACING);
    (scan * spacing.pow(3) / FULL_SPACING.pow(3)).clamp(scan.min(SCAN_MIN), scan)
}

/// Fills the unknown cells that `wanted` marks.
pub fn fill(field: &mut Field, wanted: &[bool], site: &Grid, sampling: Sampling, counter: Counter) {
    let exemplar = Exemplar::new(site);
    let [rows, cols] = field.shape;
    let mut open: Vec<bool> = wanted.iter().zip(&field.heights_m).map(|(&w, z)| w && z.is_nan()).collect();
    let mut spacing = sampling.spacing;
    while spacing > 0 {
        let offsets = offsets(REACH * spacing, field.reach());
        let scan = scan_at(sampling.scan, spacing);
        for (shift, late) in
            [[0, 0], [1, 1], [0, 1], [1, 0]].into_iter().flat_map(|shift| [(shift, false), (shift, true)])
        {
            let cells: Vec<usize> = (shift[0] * spacing..rows)
                .step_by(2 * spacing)
                .flat_map(|r| (shift[1] * spacing..cols).step_by(2 * spacing).map(move |c| r * cols + c))
                .filter(|&cell| open[cell] && field.is_late(cell, shift, spacing) == late)
                .collect();
            let known = &*field;
            let sample = |&cell: &usize| {
                let neighbours = known.neighbours(cell, &offsets, sampling.neighbours);
                exemplar.best(&neighbours, scan, counter.at(cell as i64))
            };
            let samples: Vec<Sample> = cells.par_iter().map(sample).collect();
            for (cell, sample) in cells.into_iter().zip(samples) {
                open[cell] = false;
                field.put(cell, sample.source, sample.height_m);
            }
        }
        spacing /= 2;
    }
}

/// The site with its narrow gaps filled: those where at least half of the window of `width` cells around has data. Streams: `gaps`.
pub fn closed(site: &Grid, width: usize, streams: &Streams) -> Field {
    let (holes, half) = (Holes::of(site), width / 2);
    // The part of the window around line `k` of a side that lies within it.
    let window = |k: usize, side: usize| (k.saturating_sub(half), (k + half + 1).min(side));
    let is_narrow = |cell: usize| {
        let ((top, bottom), (left, right)) =
            (window(cell / site.cols(), site.rows()), window(cell % site.cols(), site.cols()));
        let [rows, cols] = [bottom - top, right - left];
        let known = rows * cols - holes.missing([top, left], [rows, cols]) as usize;
        2 * known >= rows * cols
    };
    let wanted: Vec<bool> = (0..site.values.len()).map(|k| site.values[k].is_nan() && is_narrow(k)).collect();
    let mut field = Field::of_site(site);
    let sampling = Sampling { neighbours: GAP_NEIGHBOURS, scan: GAP_SCAN, spacing: GAP_SPACING };
    fill(&mut field, &wanted, site, sampling, Counter::new(&mut streams.stream("gaps")));
    field
}

/// Offsets within a radius, at most `reach` rows and columns away, nearest first.
fn offsets(radius: usize, reach: [usize; 2]) -> Vec<[i32; 2]> {
    let [down, across] = reach.map(|most| most.min(radius) as i32);
    let square = |d: &[i32; 2]| d.iter().map(|&k| i64::from(k) * i64::from(k)).sum::<i64>();
    let farthest = (radius * radius) as i64;
    let all = (-down..=down).flat_map(|r| (-across..=across).map(move |c| [r, c]));
    let mut near: Vec<[i32; 2]> = all.filter(|d| (1..=farthest).contains(&square(d))).collect();
    near.sort_unstable_by_key(|d| (square(d), *d));
    near
}

impl Field {
    /// A field of unknown cells.
    pub fn new(shape: [usize; 2], is_torus: bool) -> Self {
        let cells = shape[0] * shape[1];
        Self { shape, heights_m: vec![f64::NAN; cells], sources: vec![0; cells], is_torus }
    }

    /// A site, whose cells come from themselves.
    pub fn of_site(site: &Grid) -> Self {
        let sources = (0..site.values.len() as u32).collect();
        Self { shape: [site.rows(), site.cols()], heights_m: site.values.clone(), sources, is_torus: false }
    }

    /// The field with the cells of `geometry`.
    pub fn grid(&self, geometry: Geometry) -> Grid {
        Grid::new(geometry, self.heights_m.clone())
    }

    /// Sets a cell that comes from cell `source` of the site.
    pub fn put(&mut self, cell: usize, source: usize, height_m: f64) {
        self.heights_m[cell] = height_m;
        self.sources[cell] = source as u32;
    }

    /// The known cells nearest to `cell`.
    fn neighbours(&self, cell: usize, offsets: &[[i32; 2]], most: usize) -> Vec<Neighbour> {
        let at = [cell / self.shape[1], cell % self.shape[1]];
        let known = offsets.iter().filter_map(|offset| {
            let offset = offset.map(i64::from);
            let [row, col] = [self.reached(0, at[0], offset[0])?, self.reached(1, at[1], offset[1])?];
            let k = row * self.shape[1] + col;
            let height_m = Some(self.heights_m[k]).filter(|z| !z.is_nan())?;
            let weight = 1.0 / (offset[0] * offset[0] + offset[1] * offset[1]) as f64;
            Some(Neighbour { offset, height_m, weight, source: self.sources[k] as usize })
        });
        known.take(most).collect()
    }

    /// The line `step` lines from line `k`.
    fn reached(&self, axis: usize, k: usize, step: i64) -> Option<usize> {
        let (side, target) = (self.shape[axis] as i64, k as i64 + step);
        match self.is_torus {
            true => Some(target.rem_euclid(side) as usize),
            false => (0..side).contains(&target).then_some(target as usize),
        }
    }

    /// Rows and columns from a cell to the farthest ones; on a torus, around either side.
    fn reach(&self) -> [usize; 2] {
        self.shape.map(|side| if self.is_torus { side / 2 } else { side - 1 })
    }

    /// Whether the next line of the pass before lies beyond the border of a torus. In a pass, lines are `shift` spacings from every second line of
    /// the grid.
    fn is_late(&self, cell: usize, shift: [usize; 2], spacing: usize) -> bool {
        let at = [cell / self.shape[1], cell % self.shape[1]];
        let beyond = |axis: usize| {
            let next = at[axis] + (2 - shift[axis]) * spacing;
            at[axis] >= 2 * spacing && next > self.shape[axis]
        };
        self.is_torus && (beyond(0) || beyond(1))
    }
}

impl<'a> Exemplar<'a> {
    fn new(grid: &'a Grid) -> Self {
        let is_data = |k: &u32| grid.values[*k as usize].is_finite();
        let places: Vec<u32> = (0..grid.values.len() as u32).filter(is_data).collect();
        let squares: Vec<f64> = grid.values.iter().map(|z| z * z).filter(|square| square.is_finite()).collect();
        Self { grid, places, variance_m2: sums::mean(&squares) }
    }

    /// The best sample among the places that continue a neighbour, and `scan` places at random. A cell without neighbours takes a place at random;
    /// one whose neighbourhood the site lacks, the mean of its neighbours.
    fn best(&self, neighbours: &[Neighbour], scan: usize, counter: Counter) -> Sample {
        let cols = self.grid.cols();
        let place = |k: usize| [(k / cols) as i64, (k % cols) as i64];
        // The top bits of a product of 64 and 32 bits: uniform below the number of places.
        let draw = |k: usize| {
            let product = u128::from(counter.at(k as i64).bits()) * self.places.len() as u128;
            self.places[(product >> 64) as usize] as usize
        };
        let continued = neighbours.iter().map(|n| {
            let [row, col] = place(n.source);
            [row - n.offset[0], col - n.offset[1]]
        });
        let drawn = (0..scan).map(|k| place(draw(k)));
        let any = draw(scan);
        let mut known = Sums::default();
        neighbours.iter().for_each(|n| known.add(n.weight, n.height_m));
        let height_m = if neighbours.is_empty() { self.grid.values[any] } else { known.mean() };
        let start = Sample { source: any, height_m, mismatch: f64::INFINITY };
        let samples = continued.chain(drawn).filter_map(|at| self.compare(at, neighbours));
        samples.fold(start, |best, sample| if sample.mismatch < best.mismatch { sample } else { best })
    }

    /// The sample at a place, which may lie beyond the borders of the site; `None` if the site has no data there or for most of the
    /// neighbourhood.
    fn compare(&self, [row, col]: [i64; 2], neighbours: &[Neighbour]) -> Option<Sample> {
        let site = self.grid;
        let source = cell(site, [row, col]).filter(|&k| !site.values[k].is_nan())?;
        let (mut total, mut known, mut found, mut off) = (0.0, Sums::default(), Sums::default(), Sums::default());
        for n in neighbours {
            total += n.weight;
            let Some(k) = cell(site, [row + n.offset[0], col + n.offset[1]]) else { continue };
            let z = site.values[k];
            if !z.is_nan() {
                known.add(n.weight, n.height_m);
                found.add(n.weight, z);
                off.add(n.weight, n.height_m - z);
            }
        }
        if off.weight == 0.0 || off.weight < DATA_SHARE * total {
            return None;
        }
        let level_m = off.mean();
        let variances_m2 = known.variance() + found.variance() + LEAST_VARIANCE * self.variance_m2;
        let mismatch = off.variance() / variances_m2 + LEVEL_WEIGHT * level_m * level_m / self.variance_m2;
        Some(Sample { source, height_m: site.values[source] + level_m, mismatch })
    }
}

/// Weighted sums of values and their squares.
#[derive(Clone, Copy, Default)]
struct Sums {
    weight: f64,
    values: f64,
    squares: f64,
}

impl Sums {
    fn add(&mut self, weight: f64, value: f64) {
        self.weight += weight;
        self.values += weight * value;
        self.squares += weight * value * value;
    }

    fn mean(&self) -> f64 {
        self.values / self.weight
    }

    fn variance(&self) -> f64 {
        (self.squares / self.weight - self.mean() * self.mean()).max(0.0)
    }
}

/// Index of a cell, if it lies within the site.
fn cell(site: &Grid, [row, col]: [i64; 2]) -> Option<usize> {
    let inside = row >= 0 && col >= 0 && row < site.rows() as i64 && col < site.cols() as i64;
    inside.then(|| row as usize * site.cols() + col as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(rows: usize, cols: usize) -> Grid {
        let mut stream = Streams::for_seed(3, "sampling-test").stream("heights");
        Grid::new(Geometry::square(rows, cols, 1.0), (0..rows * cols).map(|_| stream.normal()).collect())
    }

    fn counter() -> Counter {
        Counter::new(&mut Streams::for_seed(1, "sampling-test").stream("places"))
    }

    const SAMPLING: Sampling = Sampling { neighbours: 12, scan: 20, spacing: 4 };

    #[test]
    fn val_offsets_are_nearest_first() {
        let near = offsets(2, [9, 9]);
        assert_eq!(near[..4], [[-1, 0], [0, -1], [0, 1], [1, 0]]);
        assert_eq!((near.len(), near[11]), (12, [2, 0]));
        // A strip of two rows.
        assert_eq!(offsets(2, [1, 9]).len(), 10);
        let field = |is_torus: bool| Field::new([5, 8], is_torus).reach();
        assert_eq!((field(true), field(false)), ([2, 4], [4, 7]));
    }

    /// By hand: all places from a spacing of 8 on, then an eighth for each halving, at least 8 or all of them; for a spacing of 64 at most 55 places for
    /// each cell of the finest grid.
    #[test]
    fn val_places_by_spacing() {
        assert_eq!([64, 8, 4, 2, 1].map(|spacing| scan_at(2000, spacing)), [2000, 2000, 250, 31, 8]);
        assert_eq!([1 << 40, 8, 4, 1].map(|spacing| scan_at(20, spacing)), [20, 20, 8, 8]);
        assert_eq!([16, 4, 1].map(|spacing| scan_at(1, spacing)), [1, 1, 1]);
        let grids = [32, 16, 8, 4, 2, 1];
        let total: f64 = grids.iter().map(|&s| 0.75 / (s * s) as f64 * scan_at(2000, s) as f64).sum();
        assert!((50.0..55.0).contains(&total), "{total}");
    }

    /// By hand, on a torus of 23 lines and a grid of 4: even lines are 0, 8, 16 and the next would be 24; odd ones are 4, 12, 20, of which the last
    /// has no even line after it. On 24 lines, 20 has line 0.
    #[test]
    fn val_late_lines_by_hand() {
        let late = |side: usize, shift: usize, is_torus: bool| {
            let field = Field::new([side, 1], is_torus);
            let lines = (shift * 4..side).step_by(8);
            lines.filter(|&line| field.is_late(line, [shift, 0], 4)).collect::<Vec<usize>>()
        };
        assert_eq!((late(23, 0, true), late(23, 1, true)), (vec![16], vec![20]));
        assert_eq!((late(24, 0, true), late(24, 1, true)), (Vec::new(), Vec::new()));
        assert_eq!((late(23, 0, false), late(23, 1, false)), (Vec::new(), Vec::new()));
    }

    /// A neighbourhood that no place of the site has: its only neighbours lie farther apart than the site is wide.
    #[test]
    fn val_a_cell_without_a_place_is_the_mean_of_its_neighbours() {
        let exemplar_site = noise(5, 5);
        let exemplar = Exemplar::new(&exemplar_site);
        let of = |offset: [i64; 2], height_m: f64, weight: f64| Neighbour { offset, height_m, weight, source: 12 };
        let sample = exemplar.best(&[of([0, -9], 100.0, 3.0), of([0, 9], 104.0, 1.0)], 50, counter());
        assert_eq!((sample.height_m, sample.mismatch), (101.0, f64::INFINITY));
        // Without neighbours, any height of the site will do.
        let alone = exemplar.best(&[], 50, counter());
        assert_eq!(alone.height_m, exemplar_site.values[alone.source]);
    }

    /// A hole cut into a site is filled with the very heights that were there, although other places were compared: those that
    /// continue the neighbours fit exactly.
    #[test]
    fn prop_a_hole_in_one_piece_is_restored() {
        let site = noise(40, 45);
        for is_torus in [false, true] {
            let mut field = Field { is_torus, ..Field::of_site(&site) };
            let is_hole = |k: &usize| (10..21).contains(&(k / 45)) && (15..30).contains(&(k % 45));
            (0..40 * 45).filter(is_hole).for_each(|k| field.heights_m[k] = f64::NAN);
            fill(&mut field, &[true; 40 * 45], &site, SAMPLING, counter());
            assert_eq!(field.heights_m, site.values);
            assert_eq!(field.sources, Field::of_site(&site).sources);
        }
    }

    /// Every unknown cell that is wanted is filled, also from nothing, and no other cell changes.
    #[test]
    fn prop_all_wanted_cells_are_filled() {
        let site = noise(30, 30);
        for (shape, spacing) in [([17, 23], 4), ([1, 40], 8), ([33, 2], 1), ([16, 16], 16)] {
            let cells = shape[0] * shape[1];
            let mut field = Field::new(shape, true);
            (0..cells).step_by(7).for_each(|k| field.put(k, k, 100.0));
            let wanted: Vec<bool> = (0..cells).map(|k| k % 5 != 3).collect();
            fill(&mut field, &wanted, &site, Sampling { spacing, ..SAMPLING }, counter());
            for (k, z) in field.heights_m.iter().enumerate() {
                match (k % 7 == 0, wanted[k]) {
                    (true, _) => assert_eq!(*z, 100.0),
                    (false, true) => assert!(z.is_finite(), "{shape:?} {k}"),
                    (false, false) => assert!(z.is_nan(), "{shape:?} {k}"),
                }
            }
        }
    }

    /// The best of all places by the definition is found when every place is drawn.
    #[test]
    fn val_the_best_place_is_found() {
        let mut site = noise(9, 10);
        site.values[33..37].fill(f64::NAN);
        let known = noise(12, 12);
        let neighbours: Vec<Neighbour> = offsets(2, [2, 2])
            .into_iter()
            .map(|offset| offset.map(i64::from))
            .enumerate()
            .map(|(k, offset)| Neighbour { offset, height_m: known.values[k], weight: 1.0 / (1 + k) as f64, source: 0 })
            .collect();
        let exemplar = Exemplar::new(&site);
        let found = exemplar.best(&neighbours, 5000, counter());
        let all = (0..90).filter_map(|k| exemplar.compare([k / 10, k % 10], &neighbours));
        let least = all.map(|sample| sample.mismatch).fold(f64::INFINITY, f64::min);
        assert_eq!(found.mismatch, least);
    }

    /// By hand: neighbours of 1, 3 and 8 with weights of 1, 2 and 1, at a place with 0, 4 and no data. The differences 1 and -1 have the mean -1/3
    /// and the variance 8/9; the known heights the mean 7/3 and the variance 8/9, the site's 8/3 and 32/9.
    #[test]
    fn val_a_sample_by_hand() {
        let site = Grid::new(Geometry::square(2, 3, 1.0), vec![0.0, 5.0, 4.0, 6.0, f64::NAN, 6.0]);
        let of = |offset: [i64; 2], height_m: f64, weight: f64| Neighbour { offset, height_m, weight, source: 0 };
        let exemplar = Exemplar::new(&site);
        // (0 + 25 + 16 + 36 + 36) / 5.
        assert!((exemplar.variance_m2 - 22.6).abs() < 1e-12);
        let three = [of([0, -1], 1.0, 1.0), of([0, 1], 3.0, 2.0), of([1, 0], 8.0, 1.0)];
        let sample = exemplar.compare([0, 1], &three).unwrap();
        assert!((sample.height_m - (5.0 - 1.0 / 3.0)).abs() < 1e-12 && sample.source == 1);
        let expected = (8.0 / 9.0) / (40.0 / 9.0) + LEVEL_WEIGHT / 9.0 / 22.6;
        assert!((sample.mismatch - expected).abs() < 1e-5, "{sample:?}");
        // Without data at the place, beyond the border, and without data around it.
        assert_eq!(exemplar.compare([1, 1], &three), None);
        assert_eq!(exemplar.compare([0, 3], &three), None);
        assert_eq!(exemplar.compare([1, 0], &three), None);
    }

    /// One wide gap stays, narrow ones are closed, and heights with data stay as they are.
    #[test]
    fn val_narrow_gaps_are_closed() {
        let whole = noise(60, 60);
        let mut site = whole.clone();
        (0..3600).filter(|k| k / 60 < 25 && k % 60 < 25).for_each(|k| site.values[k] = f64::NAN);
        (0..3600).filter(|k| (k / 60) % 10 == 5 && k % 3 == 0).for_each(|k| site.values[k] = f64::NAN);
        let field = closed(&site, 13, &Streams::for_seed(1, "sampling-test"));
        for (k, z) in field.heights_m.iter().enumerate() {
            let (row, col) = (k / 60, k % 60);
            assert!(site.values[k].is_nan() || *z == site.values[k]);
            assert_eq!(z.is_nan(), row < 25 && col < 25 && z.is_nan(), "{row} {col}");
            assert!(!(row < 18 && col < 18) || z.is_nan(), "{row} {col}");
        }
    }
}
