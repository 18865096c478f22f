//! Judges a texture of any origin against its site; the reference is how far blocks of the site differ from each other.
//!
//! # What
//! Both rasters go through the same moving average, the texture with the site's holes, and without the objects of either (unless `find_objects` is
//! false). They are cut into blocks of one shape, at least two windows wide. Each block has the statistics of
//! [`sastrugi_roughness::surface_statistics`], and the logarithms of its root mean square height, slope and curvature. A statistic of a set of
//! blocks is the mean over them; `spread_of_blocks` is the logarithm of the standard deviation of those three over them, which reveals a texture
//! that repeats itself, or is uniform where the site is not. Blocks far apart in one large texture count as its realisations. Also reported,
//! without a verdict, are verbatim copies ([`sastrugi_roughness::copies()`]).
//!
//! # Null hypothesis and error rates
//! No generator is known, so nothing can be simulated. The null hypothesis is that the texture is more ground of the same kind: its blocks and the
//! site's are exchangeable. Under it, the share of divisions of all blocks into two such sets that lie at least as far apart is an exact
//! p-value (permutation test), and Holm's adjustment bounds the probability of any wrong `different` by alpha.
//!
//! Blocks of a site that changes from one end to the other are not exchangeable. Where its halves (west and east, north and south) lie farther
//! apart than blocks of the site drawn at random into halves of that size (root mean square over both), the null is widened by that ratio. Two
//! splits say little about it, so the error rate is then approximate, and for ground beyond the site it holds only as far as the halves are
//! typical: compare the distance with `site` of the quantity, and judge another part of the site in the texture's place.
//!
//! Intervals, bounds and answers are those of all comparisons ([`super`]). `cannot tell` comes from few blocks, a site whose parts differ as much as the
//! texture does, or a bound that is narrower than its blocks can resolve.
//!
//! # Cost
//! The statistics of each block; 2000 permutations take less time than the statistics of a million cells. Some 150 bytes per cell.

use super::halves::cut;
use super::surfaces::case;
use super::verdict::{Finding, Null, decide, overall};
use super::{CompareError, CompareParameters, CompareSettings, Comparison, Measure, SiteDistances};
use crate::fit::case::Case;
use rayon::prelude::*;
use sastrugi_numeric::{Grid, Stream, Streams, sums};
use sastrugi_roughness::{Copies, Scale, Statistic, copies, repeats, surface_statistics};
use sastrugi_schemas::counted;
use serde::Serialize;

/// Least width of a block, windows.
const BLOCK_WINDOWS: usize = 2;
/// Most blocks along one side of the site.
const BLOCKS_ALONG: usize = 8;
/// Fewest blocks of either side: two sets of six have 924 arrangements.
const BLOCKS_MIN: usize = 6;
/// Least share of the cells of a block that must have data.
const DATA_SHARE: f64 = 0.5;
/// Arrangements of the blocks of both sides.
const ARRANGEMENTS: usize = 1999;
/// Arrangements of the blocks of the site into two halves.
const HALVINGS: usize = 199;
/// Fewest blocks of a part of the site.
const PART_MIN: usize = 2;
/// Relative difference below which cell sizes are equal.
const EQUAL_CELLS: f64 = 1e-6;
/// Least standard deviation of logarithms, for textures whose blocks are all the same.
const SPREAD_MIN: f64 = 1e-6;
/// Widening that is noted.
const WIDENING_NOTED: f64 = 1.5;

/// Name of the statistic of how blocks differ from each other.
const SPREAD: &str = "spread_of_blocks";

/// What a comparison by blocks rests on, and copies found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BlockEvidence {
    /// Rows and columns of a block.
    pub shape_cells: [usize; 2],
    /// Blocks of the site.
    pub site: usize,
    /// Blocks of the texture.
    pub texture: usize,
    /// Verbatim copies.
    pub copies: FoundCopies,
}

/// Neighbourhoods that occur twice, cell by cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundCopies {
    /// In the texture, from the heights or the residual of the site, whichever has more.
    pub of_site: Copies,
    /// In the texture, from elsewhere in the texture.
    pub of_itself: Copies,
    /// In one half of the site, from the other: what is found by chance, or by rounding of the heights.
    pub between_halves: Copies,
}

/// Compares a texture with a site, both in metres with NaN where there is no data; their cells must be of one size, their extents may differ.
///
/// # Errors
/// Cells of different size, a side that cannot be detrended, fewer than six blocks of either, and too few for an answer at the stated alpha.
pub fn blocks(
    site: &Grid,
    texture: &Grid,
    settings: &CompareSettings,
    streams: &Streams,
) -> Result<Comparison, CompareError> {
    check_cells(site, texture)?;
    let real = case("the site", site, settings)?;
    let punched = with_holes(texture, &real);
    let synthetic = case("the texture", &punched, settings)?;
    let residuals = [residual("the site", &real)?, residual("the texture", &synthetic)?];
    let shape = block_shape(&real);
    let lag_max = real.max_lag[0].min(real.max_lag[1]);
    let sides = residuals.each_ref().map(|r| Blocks::of(r, shape, lag_max));
    let [site_blocks, texture_blocks] = sides.each_ref().map(|side| side.kept.iter().collect::<Vec<&Block>>());
    if site_blocks.len().min(texture_blocks.len()) < BLOCKS_MIN {
        let (site, texture) = (site_blocks.len(), texture_blocks.len());
        return Err(CompareError::TooFewBlocks { shape, site, texture, needed: BLOCKS_MIN });
    }
    let parameters = settings.parameters();
    check_alpha([site_blocks.len(), texture_blocks.len()], site_blocks[0].statistics.len(), parameters.alpha)?;
    let judge = Judge::new(site_blocks, texture_blocks, streams);
    let (findings, distances): (Vec<Finding>, Vec<SiteDistances>) =
        (0..judge.site[0].statistics.len()).map(|k| judge.finding(k, parameters)).unzip();
    let mut quantities = decide(findings, parameters.alpha);
    quantities.iter_mut().zip(distances).for_each(|(quantity, distances)| quantity.site = Some(distances));
    let (answer, sentence) = overall(&quantities);
    let widened = quantities.iter().filter_map(|q| Some(q.null.as_ref()?.widened)).fold(1.0, f64::max);
    let evidence = BlockEvidence {
        shape_cells: shape,
        site: judge.site.len(),
        texture: judge.texture.len(),
        copies: FoundCopies::of(site, texture, &residuals[0]),
    };
    let notes = notes(&evidence, &sides, widened);
    Ok(Comparison {
        what: "statistics",
        quantities,
        interleaved: None,
        blocks: Some(evidence),
        answer,
        sentence,
        alpha: parameters.alpha,
        model: String::new(),
        simulations: 0,
        streams: streams.label(),
        notes,
    })
}

fn check_cells(site: &Grid, texture: &Grid) -> Result<(), CompareError> {
    let (site_m, texture_m) = (site.geometry.cell, texture.geometry.cell);
    match (0..2).all(|k| (site_m[k] - texture_m[k]).abs() <= EQUAL_CELLS * site_m[k]) {
        true => Ok(()),
        false => Err(CompareError::Cells { site_m, texture_m }),
    }
}

/// Refuses blocks of site and texture whose rarest arrangement could not pass the first step of Holm's adjustment.
fn check_alpha([site, texture]: [usize; 2], quantities: usize, alpha: f64) -> Result<(), CompareError> {
    let least = least_p(site, texture);
    match quantities as f64 * least > alpha {
        true => Err(CompareError::TooFewArrangements { site, texture, least, quantities, alpha }),
        false => Ok(()),
    }
}

/// The smallest p-value that blocks of site and texture can have: one arrangement of all (two if site and texture have equal numbers of blocks,
/// because exchanging the sides gives the same distance), and no less than one of those drawn.
fn least_p(site: usize, texture: usize) -> f64 {
    let arrangements = (1..=texture).fold(1.0, |all, k| all * (site + k) as f64 / k as f64);
    let alike = if site == texture { 2.0 } else { 1.0 };
    f64::max(alike / arrangements, 1.0 / (ARRANGEMENTS + 1) as f64)
}

/// The texture without the cells that the site lacks or leaves out as objects; where it is larger, the site's holes are repeated.
fn with_holes(texture: &Grid, site: &Case) -> Grid {
    let (rows, cols) = (site.geometry.rows, site.geometry.cols);
    let trusted = site.survey.trusted(0..rows, 0..cols);
    let width = texture.cols();
    let values = texture.values.iter().enumerate().map(|(k, &z)| {
        let is_hole = !trusted[(k / width % rows) * cols + k % width % cols];
        if is_hole { f64::NAN } else { z }
    });
    Grid::new(texture.geometry, values.collect())
}

fn residual(side: &'static str, case: &Case) -> Result<Grid, CompareError> {
    let values = case.residual().map_err(|error| CompareError::Side { side, error })?;
    Ok(Grid::new(case.geometry, values))
}

/// Rows and columns of a block: an eighth of the site, and at least two windows.
fn block_shape(site: &Case) -> [usize; 2] {
    let (shape, window) = ([site.geometry.rows, site.geometry.cols], site.window.cells());
    [0, 1].map(|k| (shape[k] / BLOCKS_ALONG).max(BLOCK_WINDOWS * window[k]))
}

/// One block.
struct Block {
    /// Row and column among the blocks.
    place: [usize; 2],
    /// Its statistics; the last holds the logarithms of its sizes.
    statistics: Vec<Statistic>,
}

/// The blocks of one side.
struct Blocks {
    kept: Vec<Block>,
    /// Blocks without enough data, or without relief.
    left_out: usize,
}

impl Blocks {
    fn of(residual: &Grid, [rows, cols]: [usize; 2], lag_max: usize) -> Self {
        let along = [residual.rows() / rows, residual.cols() / cols];
        let places: Vec<[usize; 2]> = (0..along[0]).flat_map(|r| (0..along[1]).map(move |c| [r, c])).collect();
        let block = |&[r, c]: &[usize; 2]| Block::of([r, c], &residual.window(r * rows, c * cols, rows, cols), lag_max);
        let kept: Vec<Block> = places.par_iter().filter_map(block).collect();
        Self { left_out: places.len() - kept.len(), kept }
    }
}

impl Block {
    /// `None` if the block lacks data, or any statistic (on a plane most have no value).
    fn of(place: [usize; 2], residual: &Grid, lag_max: usize) -> Option<Self> {
        if (residual.finite_count() as f64) < DATA_SHARE * residual.values.len() as f64 {
            return None;
        }
        let mut statistics = surface_statistics(residual, lag_max);
        statistics.push(Statistic { name: SPREAD, values: log_sizes(&statistics), scale: Scale::Absolute });
        let complete = statistics.iter().all(|s| s.values.iter().all(|v| v.is_finite()));
        complete.then_some(Self { place, statistics })
    }
}

/// Logarithms of the root mean square slope, curvature and height.
fn log_sizes(statistics: &[Statistic]) -> Vec<f64> {
    let mean_square = |s: &Statistic| match s.name {
        "slope_distribution" | "curvature_distribution" => {
            Some(sums::mean(&s.values.iter().map(|v| v * v).collect::<Vec<_>>()))
        }
        "covariance" => s.values.first().copied(),
        _ => None,
    };
    statistics.iter().filter_map(mean_square).map(|square| 0.5 * libm::log(square)).collect()
}

/// A statistic of a set of blocks: means over them; for the spread, logarithms of standard deviations.
fn values(blocks: &[&Block], k: usize) -> Vec<f64> {
    let Statistic { name, values, .. } = &blocks[0].statistics[k];
    let over_blocks = |i: usize| {
        let all: Vec<f64> = blocks.iter().map(|b| b.statistics[k].values[i]).collect();
        if *name != SPREAD {
            return sums::mean(&all);
        }
        let count = all.len() as f64;
        libm::log((sums::variance(&all) * count / (count - 1.0)).sqrt().max(SPREAD_MIN))
    };
    (0..values.len()).map(over_blocks).collect()
}

/// Distance between two sets of blocks, on the scale of the reference values.
fn distance([one, other]: [&[&Block]; 2], k: usize, reference: &[f64]) -> f64 {
    one[0].statistics[k].scale.distance(&values(one, k), &values(other, k), reference)
}

/// The blocks of both sides, and the arrangements that give the null distributions.
struct Judge<'a> {
    site: Vec<&'a Block>,
    texture: Vec<&'a Block>,
    /// Orders of all blocks.
    arrangements: Vec<Vec<usize>>,
    /// Orders of the site's blocks.
    halvings: Vec<Vec<usize>>,
}

impl<'a> Judge<'a> {
    fn new(site: Vec<&'a Block>, texture: Vec<&'a Block>, streams: &Streams) -> Self {
        let arrangements =
            orders(site.len() + texture.len(), ARRANGEMENTS, &mut streams.stream("arrangements of blocks"));
        let halvings = orders(site.len(), HALVINGS, &mut streams.stream("halves of the site"));
        Self { site, texture, arrangements, halvings }
    }

    /// The finding on statistic `k`, and the distances between parts of the site.
    fn finding(&self, k: usize, parameters: &CompareParameters) -> (Finding, SiteDistances) {
        let reference = values(&self.site, k);
        let all: Vec<&Block> = self.site.iter().chain(&self.texture).copied().collect();
        let split = |blocks: &[&'a Block], order: &[usize], first: usize| {
            let picked = |order: &[usize]| {
                let mut order = order.to_vec();
                // Sums must not depend on the order within a set, so that a draw of the observed sets ties with them.
                order.sort_unstable();
                order.into_iter().map(|i| blocks[i]).collect::<Vec<&Block>>()
            };
            let (one, other) = order.split_at(first);
            distance([&picked(one), &picked(other)], k, &reference)
        };
        let drawn: Vec<f64> = self.arrangements.par_iter().map(|order| split(&all, order, self.site.len())).collect();
        // Distance of each two halves, and its square over that of blocks drawn at random into halves of that size.
        let halves: Vec<[f64; 2]> = contiguous_halves(&self.site)
            .iter()
            .map(|[one, other]| {
                let found = distance([one, other], k, &reference);
                let random = self.halvings.par_iter().map(|order| split(&self.site, order, one.len()));
                let squares: Vec<f64> = random.map(|d| d * d).collect();
                [found, found * found / sums::mean(&squares)]
            })
            .collect();
        let ratios: Vec<f64> = halves.iter().map(|[_, ratio]| *ratio).collect();
        // Without halves the ratio is NaN, and the null is as drawn.
        let widened = sums::mean(&ratios).sqrt().max(1.0);
        let name = self.site[0].statistics[k].name;
        let interleaved = parts(&self.site, |[r, c]| (r + c) % 2 == 0);
        let distances = SiteDistances {
            halves: halves.iter().map(|[found, _]| *found).reduce(f64::max),
            interleaved: interleaved.map(|[one, other]| distance([&one, &other], k, &reference)),
        };
        let apart = distance([&self.site, &self.texture], k, &reference);
        let finding = Finding {
            name: name.to_owned(),
            values: [None, None],
            measure: Measure::Distance,
            bound: match name {
                "covariance" => parameters.equivalence_covariance,
                "height_distribution" => parameters.equivalence_heights,
                _ => parameters.equivalence_agreement,
            },
            known: Ok((apart, Null::arrangements(drawn, widened))),
            words: format!("the distance of {name} between site and texture"),
        };
        (finding, distances)
    }
}

/// Random orders of `count` blocks (Fisher and Yates).
fn orders(count: usize, draws: usize, stream: &mut Stream) -> Vec<Vec<usize>> {
    let mut order = || {
        let mut order: Vec<usize> = (0..count).collect();
        (1..count).rev().for_each(|k| order.swap(k, stream.below(k as u64 + 1) as usize));
        order
    };
    (0..draws).map(|_| order()).collect()
}

/// The blocks in two parts; `None` if either has too few.
fn parts<'a>(blocks: &[&'a Block], belongs: impl Fn([usize; 2]) -> bool) -> Option<[Vec<&'a Block>; 2]> {
    let (one, other): (Vec<&Block>, Vec<&Block>) = blocks.iter().copied().partition(|b| belongs(b.place));
    (one.len().min(other.len()) >= PART_MIN).then_some([one, other])
}

/// North and south, west and east: as far as both have blocks.
fn contiguous_halves<'a>(blocks: &[&'a Block]) -> Vec<[Vec<&'a Block>; 2]> {
    let halves = |axis: usize| {
        let places = || blocks.iter().map(|b| b.place[axis]);
        let (first, last) = (places().min()?, places().max()?);
        parts(blocks, |place| 2 * place[axis] <= first + last)
    };
    [0, 1].into_iter().filter_map(halves).collect()
}

impl FoundCopies {
    fn of(site: &Grid, texture: &Grid, site_residual: &Grid) -> Self {
        let [heights, residual] = [site, site_residual].map(|source| copies(texture, source));
        let (one, other) = cut(site);
        Self {
            of_site: if residual.share > heights.share { residual } else { heights },
            of_itself: repeats(texture),
            between_halves: copies(&other, &one),
        }
    }
}

fn notes(evidence: &BlockEvidence, [site, texture]: &[Blocks; 2], widened: f64) -> Vec<String> {
    let [rows, cols] = evidence.shape_cells;
    let mut notes = vec![format!(
        "A is the site ({} blocks of {rows} x {cols} cells), B the texture ({} blocks); the null distribution is that of random permutations of \
         these blocks, so error rates hold if the site is homogeneous",
        evidence.site, evidence.texture
    )];
    for (name, side) in [("site", site), ("texture", texture)] {
        if side.left_out > 0 {
            let blocks = counted(side.left_out, "block");
            notes.push(format!("left out {blocks} of the {name}, with too little data or no relief"));
        }
    }
    if widened > WIDENING_NOTED {
        notes.push(format!(
            "halves of the site differ by up to {widened:.1} times as much as random halves of its blocks: the null distributions were widened \
             by that ratio, and error rates are approximate"
        ));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    /// A block with one statistic that is a mean, and one that is a spread.
    fn block(place: [usize; 2], value: f64) -> Block {
        let with = |name, scale, values| Statistic { name, values, scale };
        let statistics = vec![
            with("slope_distribution", Scale::Relative, vec![value, 2.0 * value]),
            with(SPREAD, Scale::Absolute, vec![value]),
        ];
        Block { place, statistics }
    }

    fn lattice(value: impl Fn(usize, usize) -> f64) -> Vec<Block> {
        (0..4).flat_map(|r| (0..4).map(move |c| [r, c])).map(|[r, c]| block([r, c], value(r, c))).collect()
    }

    fn judged(site: &[Block], texture: &[Block], k: usize) -> (f64, Null, SiteDistances) {
        let judge = Judge::new(site.iter().collect(), texture.iter().collect(), &Streams::for_seed(1, "blocks-test"));
        let (finding, distances) = judge.finding(k, &CompareParameters::default());
        let (apart, null) = finding.known.unwrap();
        (apart, null, distances)
    }

    /// By hand: 12 blocks have 924 arrangements into two sixes, each with its mirror image; 13 have 1716 into six and seven; more than 2000 are not drawn.
    #[test]
    fn val_least_p_values() {
        assert!((least_p(6, 6) - 2.0 / 924.0).abs() < 1e-15 && (least_p(6, 7) - 1.0 / 1716.0).abs() < 1e-15);
        assert!((least_p(7, 6) - least_p(6, 7)).abs() < 1e-15 && least_p(30, 200) == 1.0 / 2000.0);
        assert!(check_alpha([6, 6], 11, 0.05).is_ok());
        assert_eq!(
            check_alpha([6, 6], 11, 0.02).unwrap_err().to_string(),
            "with 6 blocks of the site and 6 of the texture, no p-value can be below 0.0022: a difference in one of 11 quantities cannot be \
             significant at alpha = 0.02; use a smaller outer scale, larger rasters or a larger alpha"
        );
    }

    /// A block without a maximum or minimum, smooth as it is, counts like any other; a level one has no statistics.
    #[test]
    fn val_smooth_blocks_are_kept() {
        let of = |f: &dyn Fn(f64, f64) -> f64| {
            let values = (0..34 * 34).map(|k| f((k % 34) as f64, (k / 34) as f64)).collect();
            Block::of([0, 0], &Grid::new(Geometry::square(34, 34, 0.1), values), 8)
        };
        let saddle = of(&|x, y| 0.01 * (x * x - 0.5 * y * y) + 0.02 * x * y + 0.1 * x);
        let density =
            |block: &Block| block.statistics.iter().find(|s| s.name == "extrema_density").unwrap().values.clone();
        let expected = libm::log(0.5 / (32.0 * 32.0 + 1.0));
        assert!(saddle.is_some_and(|block| density(&block).iter().all(|d| (d - expected).abs() < 1e-12)));
        assert!(of(&|_, _| 1.0).is_none());
    }

    /// By hand: blocks of 1 and 3 have the mean 2 and the standard deviation sqrt 2; against blocks of 2 and 2.5 the means are 0.25 apart,
    /// relative to 2, and the spreads ln 4.
    #[test]
    fn val_distances_by_hand() {
        let all = [1.0, 3.0, 2.0, 2.5].map(|v| block([0, 0], v));
        let [a, b, c, d] = all.each_ref();
        assert_eq!(values(&[a, b], 0), [2.0, 4.0]);
        assert!((distance([&[a, b], &[c, d]], 0, &values(&[a, b], 0)) - 0.125).abs() < 1e-15);
        assert!((values(&[a, b], 1)[0] - 0.5 * libm::log(2.0)).abs() < 1e-15);
        assert!((distance([&[a, b], &[c, d]], 1, &[]) - libm::log(4.0)).abs() < 1e-12);
        // Blocks that are all the same have the least spread, which has a logarithm.
        assert_eq!(values(&[a, a], 1), [libm::log(SPREAD_MIN)]);
    }

    /// A site that rises from west to east: its halves are 2 apart (of a mean of 2.5), its interleaved blocks are not, and the null is widened. One
    /// whose blocks alternate like a chessboard has equal halves, and is not.
    #[test]
    fn val_a_site_that_changes_widens_the_null() {
        let texture = lattice(|_, c| 1.0 + c as f64);
        let (apart, null, distances) = judged(&lattice(|_, c| 1.0 + c as f64), &texture, 0);
        assert!(apart == 0.0 && (distances.halves.unwrap() - 2.0 / 2.5).abs() < 1e-12, "{distances:?}");
        assert!(distances.interleaved.unwrap() < 1e-12 && null.widened > 1.5, "{} {distances:?}", null.widened);
        let (_, null, distances) = judged(&lattice(|r, c| 1.0 + ((r + c) % 2) as f64), &texture, 0);
        assert_eq!((distances.halves, null.widened), (Some(0.0), 1.0));
        assert!((distances.interleaved.unwrap() - 1.0 / 1.5).abs() < 1e-12);
    }

    /// Halves of seven columns of blocks: the middle one belongs to the west. One block alone is not a part.
    #[test]
    fn val_halves_of_blocks() {
        let row: Vec<Block> = (0..7).map(|c| block([3, c], 1.0)).collect();
        let halves = contiguous_halves(&row.iter().collect::<Vec<_>>());
        assert_eq!(halves.iter().map(|[a, b]| [a.len(), b.len()]).collect::<Vec<_>>(), [[4, 3]]);
        assert!(parts(&row.iter().collect::<Vec<_>>(), |[_, c]| c == 0).is_none());
    }

    /// The observed sets drawn in another order, also with the sides exchanged, lie exactly as far apart, so that they count as ties. The sums of these
    /// values, 1/3 to 1/14, depend on their order.
    #[test]
    fn prop_equal_arrangements_tie() {
        let side = |first: u32| -> Vec<Block> {
            (0..6).map(|k| block([k / 3, k % 3], 1.0 / f64::from(first + k as u32))).collect()
        };
        let (site, texture) = (side(3), side(9));
        let order = [0, 1, 2, 3, 5, 4];
        let shuffled =
            |sides: [usize; 2]| -> Vec<usize> { sides.into_iter().flat_map(|from| order.map(|k| from + k)).collect() };
        let mut judge =
            Judge::new(site.iter().collect(), texture.iter().collect(), &Streams::for_seed(1, "blocks-test"));
        judge.arrangements = vec![shuffled([0, 6]), shuffled([6, 0])];
        for k in 0..2 {
            let (apart, null) = judge.finding(k, &CompareParameters::default()).0.known.unwrap();
            assert!(null.draws.iter().all(|d| *d == apart * null.widened), "{k}: {apart} {:?}", null.draws);
        }
    }

    /// Null: blocks of both sides are independent draws of one distribution. 400 pairs of 16 and 12 blocks, p <= 0.1 in at most 66 of 400: beyond
    /// that with probability 5e-5 (binomial), as the test is exact without widening. A texture that repeats itself, with blocks of a tenth of the
    /// scatter, is detected by its spread in all of them.
    #[test]
    fn stat_permutations_are_exact_and_tell_repetition() {
        let mut stream = Streams::for_seed(2, "blocks-test").stream("values");
        let mut rejected = 0;
        for _ in 0..400 {
            let mut drawn = |rows: usize, scatter: f64| -> Vec<Block> {
                let places = (0..rows).flat_map(|r| (0..4).map(move |c| [r, c]));
                places.map(|place| block(place, 5.0 + scatter * stream.normal())).collect()
            };
            let (site, texture, repeated) = (drawn(4, 1.0), drawn(3, 1.0), drawn(3, 0.1));
            let p = |texture: &[Block], k: usize| {
                let (apart, null, _) = judged(&site, texture, k);
                (null.draws.iter().filter(|d| **d >= apart * null.widened).count() + 1) as f64
                    / (ARRANGEMENTS + 1) as f64
            };
            rejected += usize::from(p(&texture, 0) <= 0.1);
            assert!(p(&repeated, 1) <= 0.05);
        }
        assert!(rejected <= 66, "{rejected}");
    }
}
