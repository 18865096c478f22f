//! Intervals: parametric bootstrap, with a spatial block bootstrap beside it.
//!
//! Parametric: surfaces of the fitted model on the same mask go through the same detrending, trimming, correlation and
//! fit; how far their estimates fall from the model they come from is how far ours may be from the truth. It holds if the
//! model is right. Blocks: the DEM's blocks are drawn with replacement and their pairs put together; it does not need the
//! model, but blocks, and enough of them.
//!
//! Both give basic intervals `[2 e - q_high, 2 e - q_low]` in search coordinates (logarithms of sigma, b and shapes), e the
//! estimate, q the quantiles of the replicates (Davison and Hinkley, 1997, section 5.2), which hold whatever the size of
//! the bias.
//!
//! A range whose profile likelihood (`profile.rs`) is open at an end, or that replicates cannot tell from the end of the
//! search, has its interval from the profile: replicates of a surface whose range nobody can tell say little.
//!
//! Rasters of more than [`CELLS_MAX`] cells are examined on a part of that size (or three windows each way), and the
//! deviations scaled by the square root of the share of residuals in it.

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
/// Level of every interval.
pub const LEVEL: f64 = 0.95;
/// Most cells of a replicate.
pub const CELLS_MAX: usize = 1 << 20;
/// Fewest blocks worth drawing from.
const BLOCKS_MIN: usize = 9;
/// Replicates of the block bootstrap for each one asked for: they cost little.
const BLOCK_REPLICATES: usize = 4;

/// What the fitted model's own surfaces look like to the estimator.
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
            // A smaller part scatters more: its sum of squares is larger by the square of the scale.
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
    /// Scatter of the whole over scatter of the part.
    pub scale: f64,
}

impl Part {
    /// Surfaces of a covariance on it.
    pub fn null_surfaces<'a>(self, case: &'a Case<'a>, covariance: &Covariance) -> NullSurfaces<'a> {
        NullSurfaces::new(case, covariance, [self.rows, self.cols], self.mask)
    }

    /// The whole, or a window about the middle with as much of it as may be.
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

/// Sides of a part of about [`CELLS_MAX`] cells at most, of the raster's proportions unless a side would fall below its
/// floor; the whole where that is less.
pub fn shrunk(shape: [usize; 2], floor: [usize; 2]) -> [usize; 2] {
    let share = (CELLS_MAX as f64 / (shape[0] as f64 * shape[1] as f64)).sqrt().min(1.0);
    let side = |k: usize, wanted: usize| wanted.max(floor[k]).clamp(1, shape[k]);
    let [rows, cols] = [0, 1].map(|k| side(k, (shape[k] as f64 * share) as usize));
    // A side that was kept at its floor leaves less to the other.
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
    /// Sum of products and number of pairs of each bin, both cells within the block; empty when not asked for.
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

/// The blocks of a DEM; none when too few have data. Pairs are counted only where blocks will be resampled.
pub fn blocks(case: &Case, bins: &LagBins, with_pairs: bool) -> Result<Vec<Block>, FitError> {
    let places = block_places(&case.geometry, case.window, case.heights.are_profiles());
    // A block of less than a window's cells tells nothing.
    let least = case.window.area() as u64;
    let mut all: Vec<Block> = Vec::new();
    for places in places.iter().zip(&case.survey.blocks).collect::<Vec<_>>().chunks(BLOCKS_ALONG) {
        // Heights are read by one thread.
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

/// Search coordinates of resampled blocks.
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
    // Blocks that are looked at in part scatter more than whole ones.
    let looked_at: u64 = blocks.iter().map(Block::cells).sum();
    let scale = (looked_at as f64 / estimator.case.survey.kept as f64).sqrt().min(1.0);
    let together = |chosen: &[usize]| -> Vec<f64> {
        let mut total = vec![(0.0, 0); estimator.bins.len()];
        for &k in chosen {
            total.iter_mut().zip(&blocks[k].sums).for_each(|(t, s)| *t = (t.0 + s.0, t.1 + s.1));
        }
        bins::means(&total)
    };
    // Pairs across blocks are missing: deviations are taken from what all blocks once give.
    let once: Vec<usize> = (0..blocks.len()).collect();
    let refits = estimator.refits(estimate);
    let centre = refits.to(&together(&once), threshold_m).at;
    (0..BLOCK_REPLICATES * count)
        .into_par_iter()
        .map(|k| {
            let mut stream: Stream = streams.stream(&format!("blocks-{k}"));
            let chosen: Vec<usize> = once.iter().map(|_| stream.below(blocks.len() as u64) as usize).collect();
            let at = refits.to(&together(&chosen), threshold_m).at;
            at.iter().zip(&centre).zip(&estimate.at).map(|((a, c), e)| e + scale * (a - c)).collect()
        })
        .collect()
}

/// Intervals of the form's parameters from replicates; `None` without any. Where more than 2.5 % of the replicates end at a
/// bound of the search, or the estimate does, their quantiles are those of the bound: such a parameter has no interval.
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
    // Where the range is unknown, so is the sigma that goes with it.
    if let (Some([None, None]), true) = (values.get("range_m"), values.contains_key("sigma_m")) {
        values.insert("sigma_m".to_owned(), [None; 2]);
    }
    if let Some(own) = sill_over_range(&estimate.covariance) {
        let all: Vec<f64> = covariances.iter().filter_map(sill_over_range).collect();
        values.insert(SILL_OVER_RANGE.to_owned(), interval(Role::Sigma(0), own, &all));
    }
    Some(Intervals { level: LEVEL, replicates: replicates.len() as u32, from_profile: false, values })
}

/// Intervals with what the profile likelihood says of sigma and b where it is open at an end, or where replicates say
/// nothing.
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

/// True when the estimate or too many replicates lie at an end of what was searched in a coordinate that has ends of its own.
fn at_bound(estimator: &Estimator, estimate: &Estimate, replicates: &[Vec<f64>], coordinate: usize) -> bool {
    /// Distance from a bound that is none.
    const NEAR: f64 = 1e-3;
    let role = estimate.form.parameters()[coordinate].role;
    // A nugget of nothing and a round surface are results.
    if matches!(role, Role::Nugget | Role::Ratio | Role::Azimuth) {
        return false;
    }
    let (low, high) = estimator.case.coordinates(&estimate.form).bounds()[coordinate];
    let near = |at: &Vec<f64>| at[coordinate] < low + NEAR || at[coordinate] > high - NEAR;
    let share = replicates.iter().filter(|at| near(at)).count() as f64 / replicates.len() as f64;
    near(&estimate.at) || share > 0.5 * (1.0 - LEVEL)
}

/// `sigma^2 / b` of a covariance of one term that falls in a straight line from lag zero, m: of others it is the slope of nothing.
pub fn sill_over_range(covariance: &Covariance) -> Option<f64> {
    let [term] = covariance.structures.as_slice() else { return None };
    term.model.is_linear_at_origin().then(|| term.sigma_m * term.sigma_m / term.range_m)
}

/// The interval of one parameter.
fn interval(role: Role, own: f64, all: &[f64]) -> [Option<f64>; 2] {
    let ends = match role {
        // A logarithm reaches neither zero nor below.
        Role::Sigma(_) | Role::Range(_) | Role::Shape(_) => {
            let logs: Vec<f64> = all.iter().map(|&v| libm::log(v)).collect();
            basic(libm::log(own), &logs).map(libm::exp)
        }
        // A ratio of 1 is an end of its range, and random surfaces never reach it: no more than quantiles.
        Role::Ratio => quantiles(all).map(|q| q.min(1.0)),
        // Nor is a nugget below nothing.
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
