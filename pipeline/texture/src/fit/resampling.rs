//! Intervals by parametric bootstrap and by spatial block bootstrap.
//!
//! Parametric: surfaces of the fitted model on the same mask go through the same detrending, trimming, correlation and
//! fit. The deviations of their estimates from the model they were drawn from show how far the fit may be from the truth, if the
//! model is right. Blocks: the DEM's blocks are drawn with replacement and their pairs pooled. This does not need the
//! model to be right, but it needs enough blocks.
//!
//! Both give basic intervals `[2 e - q_high, 2 e - q_low]` in search coordinates (logarithms of sigma, b and shapes), e the
//! estimate, q the quantiles of the replicates (Davison and Hinkley, 1997, section 5.2), which hold whatever the size of
//! the bias.
//!
//! A range whose profile likelihood (`profile.rs`) is open at an end, or whose replicates reach the bound of the
//! search, gets its interval from the profile: replicates of a surface whose range is not identified carry little information.
//!
//! Rasters of more than [`CELLS_MAX`] cells are simulated on a part of that size (or three windows each way), and the
//! deviations are scaled by the square root of the part's share of the residuals.

use super::FitError;
use super::block_places::{BLOCKS_ALONG, block_places};
use super::case::Case;
use super::estimator::{Estimate, Estimator};
use super::null_surfaces::NullSurfaces;
use super::profile;
use super::survey::Squares;
use crate::covariance::bins;
use crate::covariance::form::Role;
use crate::covariance::{Covariance, LagBins, masked_covariance};
use rayon::prelude::*;
use sastrugi_numeric::{Stream, Streams, sums};
use sastrugi_schemas::fit::Intervals;
use std::collections::BTreeMap;

/// Name of `sigma^2 / b` among intervals and diagnostics.
pub const SILL_OVER_RANGE: &str = "sigma2_over_range_m";
/// Confidence level of every interval.
pub const LEVEL: f64 = 0.95;
/// Most cells of a replicate.
pub const CELLS_MAX: usize = 1 << 20;
/// Fewest blocks for a block bootstrap.
const BLOCKS_MIN: usize = 9;
/// Block replicates per parametric replicate; they are cheap.
const BLOCK_REPLICATES: usize = 4;

/// Estimates from surfaces of the fitted model.
pub struct Replicates {
    /// Search coordinates of each.
    pub at: Vec<Vec<f64>>,
    /// Generalised sum of squares of each, per degree of freedom.
    pub misfit_ratio: Vec<f64>,
    /// Median absolute residual over the trimming threshold of each.
    pub median_over_threshold: Vec<f64>,
}

/// Simulates and refits `count` surfaces.
pub fn parametric(estimator: &Estimator, estimate: &Estimate, count: usize, streams: &Streams) -> Replicates {
    let case = estimator.case;
    let part = Part::of(case);
    let (cols, scale) = (part.cols, part.scale);
    let surfaces = part.null_surfaces(case, &estimate.covariance);
    let freedom = estimator.bins.len().saturating_sub(estimate.at.len()).max(1) as f64;
    let refits = estimator.refits(estimate);
    let results: Vec<(Vec<f64>, f64, f64)> = (0..count)
        .into_par_iter()
        .map(|k| {
            let surface = surfaces.one(&streams.child(&format!("bootstrap-{k}")));
            let trim = surface.trim;
            let data = estimator.bins.means(&masked_covariance(&surface.trimmed(), cols, case.max_lag));
            let end = refits.to(&data, trim.threshold_m);
            let at = end.at.iter().zip(&estimate.at).map(|(a, e)| e + scale * (a - e)).collect();
            // A smaller part scatters more, so its sum of squares must be scaled down by the square of `scale`.
            (at, end.value * scale * scale / freedom, trim.median_size_m / trim.threshold_m)
        })
        .collect();
    Replicates {
        misfit_ratio: results.iter().map(|r| r.1).collect(),
        median_over_threshold: results.iter().map(|r| r.2).collect(),
        at: results.into_iter().map(|r| r.0).collect(),
    }
}

/// The part of a raster that is simulated.
pub struct Part {
    pub rows: usize,
    pub cols: usize,
    /// Cells with trusted data.
    pub mask: Vec<bool>,
    /// Scatter of the complete raster over scatter of the part.
    pub scale: f64,
}

impl Part {
    /// Null surfaces of a covariance on this part.
    pub fn null_surfaces<'a>(self, case: &'a Case<'a>, covariance: &Covariance) -> NullSurfaces<'a> {
        NullSurfaces::new(case, covariance, [self.rows, self.cols], self.mask)
    }

    /// The complete raster, or the one of up to 3 x 3 places of a smaller part that has most residuals.
    pub fn of(case: &Case) -> Self {
        let (rows, cols) = (case.geometry.rows, case.geometry.cols);
        let part = shrunk([rows, cols], case.window.cells().map(|w| 3 * w));
        let places = places([rows, cols], part)
            .into_iter()
            .map(|at| (at, case.survey.used_count(at[0]..at[0] + part[0], at[1]..at[1] + part[1])));
        let (at, used) = places.fold(([0, 0], 0), |best, tile| if tile.1 > best.1 { tile } else { best });
        let mask = case.survey.trusted(at[0]..at[0] + part[0], at[1]..at[1] + part[1]);
        let scale = (used.max(1) as f64 / case.survey.detrended.max(1) as f64).sqrt().min(1.0);
        Self { rows: part[0], cols: part[1], mask, scale }
    }
}

/// Sides of a part of at most about [`CELLS_MAX`] cells, with the raster's proportions unless a side would fall below its
/// floor; the complete raster if it is smaller.
pub fn shrunk(shape: [usize; 2], floor: [usize; 2]) -> [usize; 2] {
    let share = (CELLS_MAX as f64 / (shape[0] as f64 * shape[1] as f64)).sqrt().min(1.0);
    let side = |k: usize, wanted: usize| wanted.max(floor[k]).clamp(1, shape[k]);
    let [rows, cols] = [0, 1].map(|k| side(k, (shape[k] as f64 * share) as usize));
    // A side that is held at its floor leaves fewer cells for the other.
    [side(0, rows.min(CELLS_MAX / cols)), side(1, cols.min(CELLS_MAX / rows))]
}

/// Up to 3 x 3 places of a part, the middle first.
fn places(shape: [usize; 2], part: [usize; 2]) -> Vec<[usize; 2]> {
    let [down, across] = [0, 1].map(|k| {
        let mut all: Vec<usize> = [1, 0, 2].map(|place| (shape[k] - part[k]) * place / 2).to_vec();
        all.dedup();
        if shape[k] == part[k] { vec![0] } else { all }
    });
    down.into_iter().flat_map(|r| across.iter().map(move |&c| [r, c])).collect()
}

/// One block of a DEM.
pub struct Block {
    /// Its residuals.
    squares: Squares,
    /// Sum of products and number of pairs of each bin, both cells within the block; empty if not requested.
    sums: Vec<(f64, u64)>,
}

impl Block {
    /// Number of its residuals.
    pub fn cells(&self) -> u64 {
        self.squares.count
    }

    /// Mean square of its residuals, m2.
    pub fn variance_m2(&self) -> f64 {
        self.squares.sum_m2 / self.squares.count as f64
    }
}

/// The blocks of a DEM; empty if too few have data. Pairs are counted only if the blocks will be resampled.
pub fn blocks(case: &Case, bins: &LagBins, with_pairs: bool) -> Result<Vec<Block>, FitError> {
    let places = block_places(&case.geometry, case.window, case.heights.are_profiles());
    // A block needs at least a window's worth of cells.
    let least = case.window.area() as u64;
    let mut all: Vec<Block> = Vec::new();
    for places in places.iter().zip(&case.survey.blocks).collect::<Vec<_>>().chunks(BLOCKS_ALONG) {
        // Heights must be read from one thread.
        let parts = places.iter().map(|([rows, cols], squares)| {
            let part = if with_pairs { case.trimmed(rows.clone(), cols.clone())? } else { Vec::new() };
            Ok((part, cols.len(), **squares))
        });
        let parts = parts.collect::<Result<Vec<_>, FitError>>()?;
        all.par_extend(parts.par_iter().map(|(part, cols, squares)| {
            let sums = match with_pairs {
                true => bins.bin_sums(&masked_covariance(part, *cols, case.max_lag)),
                false => Vec::new(),
            };
            Block { squares: *squares, sums }
        }));
    }
    all.retain(|b| b.cells() >= least && b.sums.iter().all(|(_, pairs)| *pairs > 0));
    Ok(if all.len() < BLOCKS_MIN { Vec::new() } else { all })
}

/// Search coordinates of the fits to resampled blocks.
pub fn block_replicates(
    estimator: &Estimator,
    estimate: &Estimate,
    blocks: &[Block],
    count: usize,
    streams: &Streams,
) -> Vec<Vec<f64>> {
    if blocks.is_empty() || count == 0 {
        return Vec::new();
    }
    let threshold_m = estimator.case.survey.trim.threshold_m;
    // Blocks that are used only in part scatter more than complete ones.
    let used: u64 = blocks.iter().map(Block::cells).sum();
    let scale = (used as f64 / estimator.case.survey.kept as f64).sqrt().min(1.0);
    let pooled = |chosen: &[usize]| -> Vec<f64> {
        let mut total = vec![(0.0, 0); estimator.bins.len()];
        for &k in chosen {
            total.iter_mut().zip(&blocks[k].sums).for_each(|(t, s)| *t = (t.0 + s.0, t.1 + s.1));
        }
        bins::means(&total)
    };
    // Pairs across blocks are missing, so deviations are taken from the fit to all blocks once.
    let once: Vec<usize> = (0..blocks.len()).collect();
    let refits = estimator.refits(estimate);
    let centre = refits.to(&pooled(&once), threshold_m).at;
    (0..BLOCK_REPLICATES * count)
        .into_par_iter()
        .map(|k| {
            let mut stream: Stream = streams.stream(&format!("blocks-{k}"));
            let chosen: Vec<usize> = once.iter().map(|_| stream.below(blocks.len() as u64) as usize).collect();
            let at = refits.to(&pooled(&chosen), threshold_m).at;
            at.iter().zip(&centre).zip(&estimate.at).map(|((a, c), e)| e + scale * (a - c)).collect()
        })
        .collect()
}

/// Intervals of the form's parameters from replicates; `None` without any. A parameter has no interval if its estimate or more than
/// 2.5 % of its replicates end at a bound of the search, since the quantiles would then be those of the bound.
pub fn intervals(estimator: &Estimator, estimate: &Estimate, replicates: &[Vec<f64>]) -> Option<Intervals> {
    if replicates.is_empty() {
        return None;
    }
    let coordinates = estimator.case.coordinates(&estimate.form);
    let covariances: Vec<_> = replicates.iter().map(|at| coordinates.decode(at)).collect();
    let mut values = BTreeMap::new();
    for (k, parameter) in estimate.form.parameters().into_iter().enumerate() {
        let own = parameter.of(&estimate.covariance);
        let all: Vec<f64> = covariances.iter().map(|c| parameter.of(c)).collect();
        let ends =
            if at_bound(estimator, estimate, replicates, k) { [None; 2] } else { interval(parameter.role, own, &all) };
        values.insert(parameter.name.clone(), ends);
    }
    // If the range is unknown, so is sigma.
    if let (Some([None, None]), true) = (values.get("range_m"), values.contains_key("sigma_m")) {
        values.insert("sigma_m".to_owned(), [None; 2]);
    }
    if let Some(own) = sill_over_range(&estimate.covariance) {
        let all: Vec<f64> = covariances.iter().filter_map(sill_over_range).collect();
        values.insert(SILL_OVER_RANGE.to_owned(), interval(Role::Sigma(0), own, &all));
    }
    Some(Intervals { level: LEVEL, replicates: replicates.len() as u32, from_profile: false, values })
}

/// Replaces the intervals of sigma and b by those of the profile likelihood if it is open at an end, or if the replicates give
/// none.
pub fn with_profile(mut intervals: Intervals, estimator: &Estimator, estimate: &Estimate) -> Intervals {
    if estimate.covariance.structures.len() > 1 {
        return intervals;
    }
    let Some(ends) = profile::ends(estimator, estimate) else { return intervals };
    let unknown = intervals.values.get("range_m") == Some(&[None, None]);
    if !unknown && ends.iter().all(Option::is_some) {
        return intervals;
    }
    let covariances = ends.map(|end| Some(estimator.case.coordinates(&estimate.form).decode(&end?.at)));
    for (name, of) in [("sigma_m", Covariance::sigma_m as fn(&Covariance) -> f64), ("range_m", Covariance::range_m)] {
        intervals.values.insert(name.to_owned(), covariances.each_ref().map(|c| c.as_ref().map(of)));
    }
    intervals.from_profile = true;
    intervals
}

/// True if the estimate or too many replicates lie at a bound of the search, in a coordinate whose bounds are arbitrary.
fn at_bound(estimator: &Estimator, estimate: &Estimate, replicates: &[Vec<f64>], coordinate: usize) -> bool {
    /// Distance within which a value counts as at the bound.
    const NEAR: f64 = 1e-3;
    let role = estimate.form.parameters()[coordinate].role;
    // A nugget of zero and an isotropic surface are valid results.
    if matches!(role, Role::Nugget | Role::Ratio | Role::Azimuth) {
        return false;
    }
    let (low, high) = estimator.case.coordinates(&estimate.form).bounds()[coordinate];
    let near = |at: &Vec<f64>| at[coordinate] < low + NEAR || at[coordinate] > high - NEAR;
    let share = replicates.iter().filter(|at| near(at)).count() as f64 / replicates.len() as f64;
    near(&estimate.at) || share > 0.5 * (1.0 - LEVEL)
}

/// `sigma^2 / b`, m, of a single-term covariance that falls linearly from lag zero; for others it is not the slope there, so `None`.
pub fn sill_over_range(covariance: &Covariance) -> Option<f64> {
    let [term] = covariance.structures.as_slice() else { return None };
    term.model.is_linear_at_origin().then(|| term.sigma_m * term.sigma_m / term.range_m)
}

/// The interval of one parameter.
fn interval(role: Role, own: f64, all: &[f64]) -> [Option<f64>; 2] {
    let ends = match role {
        // Logarithms keep both ends positive.
        Role::Sigma(_) | Role::Range(_) | Role::Shape(_) => {
            let logs: Vec<f64> = all.iter().map(|&v| libm::log(v)).collect();
            basic(libm::log(own), &logs).map(libm::exp)
        }
        // A ratio of 1 bounds its range, and random surfaces never reach it: plain quantiles.
        Role::Ratio => quantiles(all).map(|q| q.min(1.0)),
        // A nugget is bounded by zero.
        Role::Nugget => quantiles(all),
        Role::Azimuth => {
            let turned: Vec<f64> = all.iter().map(|v| own + nearest_turn(v - own)).collect();
            basic(own, &turned)
        }
    };
    ends.map(Some)
}

/// The difference of two azimuths of axes, in [-90, 90).
fn nearest_turn(difference_deg: f64) -> f64 {
    difference_deg - 180.0 * ((difference_deg + 90.0) / 180.0).floor()
}

fn basic(own: f64, all: &[f64]) -> [f64; 2] {
    let [low, high] = quantiles(all);
    [2.0 * own - high, 2.0 * own - low]
}

fn quantiles(all: &[f64]) -> [f64; 2] {
    let mut sorted = sums::finite(all);
    sorted.sort_by(f64::total_cmp);
    [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL].map(|q| sums::quantile_sorted(&sorted, q))
}

/// Share of replicates at least as large as `own`, as a p-value that is never 0 (Davison and Hinkley, 1997, Eq. 4.11).
pub fn upper_p(own: f64, replicates: &[f64]) -> f64 {
    let larger = replicates.iter().filter(|r| **r >= own).count();
    (larger + 1) as f64 / (replicates.len() + 1) as f64
}

/// Two-sided p-value.
pub fn two_sided_p(own: f64, replicates: &[f64]) -> f64 {
    let upper = upper_p(own, replicates);
    let negative: Vec<f64> = replicates.iter().map(|r| -r).collect();
    (2.0 * upper.min(upper_p(-own, &negative))).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::{Form, model};

    /// By hand, with 9 replicates 1 to 9: 7.5 is exceeded by two, so p is 3/10 above and 8/10 below; nothing exceeds 99, and p is not 0.
    #[test]
    fn val_p_values_by_hand() {
        let replicates: Vec<f64> = (1..=9).map(f64::from).collect();
        assert_eq!((upper_p(7.5, &replicates), upper_p(99.0, &replicates), upper_p(0.0, &replicates)), (0.3, 0.1, 1.0));
        assert_eq!((upper_p(7.0, &replicates), two_sided_p(7.5, &replicates)), (0.4, 0.6));
        assert_eq!((two_sided_p(0.5, &replicates), two_sided_p(5.0, &replicates)), (0.2, 1.0));
    }

    /// Axes repeat after half a turn.
    #[test]
    fn val_nearest_turns() {
        let turned = [0.0, 89.0, 90.0, 100.0, 180.0, 270.0, -90.0, -91.0, 365.0].map(nearest_turn);
        assert_eq!(turned, [0.0, 89.0, -90.0, -80.0, 0.0, -90.0, -90.0, 89.0, 5.0]);
    }

    /// Basic intervals mirror the quantiles at the estimate, on logarithms for sigma and b; ratio and nugget keep theirs; azimuths are compared
    /// the shorter way around. Replicates at u = 0, 0.001, ... 1 have their quantiles at u = 0.025 and 0.975.
    #[test]
    fn val_intervals_by_role() {
        let of = |f: &dyn Fn(f64) -> f64| (0..=1000).map(|k| f(f64::from(k) / 1000.0)).collect::<Vec<f64>>();
        let close = |found: [Option<f64>; 2], expected: [f64; 2]| {
            let same = (0..2).all(|k| (found[k].unwrap() - expected[k]).abs() < 1e-9);
            assert!(same, "{found:?} {expected:?}");
        };
        // Logarithms from 0 to 1, estimate exp(0.2): 2 x 0.2 - 0.975 and 2 x 0.2 - 0.025.
        let powers = of(&libm::exp);
        let logs = [-0.575, 0.375].map(libm::exp);
        close(interval(Role::Sigma(0), libm::exp(0.2), &powers), logs);
        close(interval(Role::Range(0), libm::exp(0.2), &powers), logs);
        close(interval(Role::Nugget, 0.2, &of(&|u| u)), [0.025, 0.975]);
        close(interval(Role::Ratio, 0.9, &of(&|u| 0.5 + u)), [0.525, 1.0]);
        // Around 179 degrees, replicates from 174 to 184 (as 4): 2 x 179 - 183.75 and 2 x 179 - 174.25.
        let azimuths = of(&|u| crate::covariance::form::half_turn(174.0 + 10.0 * u));
        close(interval(Role::Azimuth, 179.0, &azimuths), [174.25, 183.75]);
    }

    /// A raster of up to a million cells is simulated as it is; of a larger one a part of its proportions, unless a side would be below its
    /// floor.
    #[test]
    fn val_parts_of_large_rasters() {
        assert_eq!(shrunk([1000, 1000], [10, 10]), [1000, 1000]);
        assert_eq!(shrunk([4096, 1024], [10, 10]), [2048, 512]);
        assert_eq!(shrunk([1 << 16, 64], [10, 100]), [1 << 14, 64]);
        let [rows, cols] = shrunk([1 << 20, 100], [10, 90]);
        assert!(cols >= 90 && rows * cols <= CELLS_MAX && rows > 10_000, "{rows} {cols}");
        assert_eq!(places([10, 10], [10, 10]), [[0, 0]]);
        assert_eq!(places([10, 21], [10, 11]), [[0, 5], [0, 0], [0, 10]]);
    }

    /// sigma^2 / b exists for a single term that falls linearly from lag zero.
    #[test]
    fn val_sill_over_range() {
        let of = |name: &str| sill_over_range(&Covariance::new(model(name).unwrap(), 0.5, 2.0).unwrap());
        let found = ["exponential", "spherical", "gaussian", "matern"].map(of);
        assert_eq!(found, [Some(0.125), Some(0.125), None, None]);
        assert_eq!(sill_over_range(&Form::parse("exponential+spherical").unwrap().unit()), None);
    }
}
