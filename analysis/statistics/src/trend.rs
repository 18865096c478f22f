//! Trend over ordered groups: do the values rise or fall from group to group?
//!
//! Groups are numbered 0, 1, ... in their order. The statistic is linear in the ranks,
//!
//! ```text
//! T = sum over terrains of (number of the group) (rank - mean rank)
//! ```
//!
//! with ranks among all terrains (then `T` is Spearman's correlation of group and value up to a factor; P.
//! Armitage, 1955, for ordered groups), or, if groups share their random draws, among the terrains of a block (then
//! `T` is the statistic `L` of E. Page, Journal of the American Statistical Association 58, 1963, minus its
//! expectation). Both tests are two-sided permutation tests, see [`crate::permutation`]. With two groups the first is
//! the rank-sum test. Cost: one pass per arrangement.
//!
//! The size of a trend is a rank correlation. For independent groups its interval is that of D. Bonett and T. Wright
//! (Psychometrika 65, 2000): on the scale of Fisher's `z = artanh r`, with variance `(1 + r^2 / 2) / (n - 3)`. For blocks
//! it is that of a mean of bounded values, [`crate::proportion`], which is too wide rather than too short.

use crate::bootstrap::Interval;
use crate::correlation::spearman;
use crate::permutation::{Permutation, centred_ranks, labels_of, linear_within_blocks, tied};
use crate::{normal, proportion};
use sastrugi_numeric::Stream;

/// Trend over independent groups, each with the values of its terrains.
///
/// ```
/// use sastrugi_numeric::Streams;
/// use sastrugi_statistics::trend;
///
/// let mut stream = Streams::for_seed(1, "example").stream("arrangements");
/// // Of the 90 arrangements of six values only this one and its mirror image are in order.
/// let test = trend::of_groups(&[vec![1.0, 2.0], vec![3.0, 4.0], vec![5.0, 6.0]], 999, &mut stream).unwrap();
/// assert_eq!(test.p, 2.0 / 90.0);
/// ```
pub fn of_groups(groups: &[Vec<f64>], draws: usize, stream: &mut Stream) -> Option<Permutation> {
    let scores = centred_ranks(&groups.concat());
    let labels = labels_of(&sizes(groups));
    linear_within_blocks(&labels, &scores, &[scores.len()], draws, stream)
}

/// Trend over paired groups: each block has one value from every group, in the order of the groups.
pub fn of_blocks(blocks: &[Vec<f64>], draws: usize, stream: &mut Stream) -> Option<Permutation> {
    let scores: Vec<f64> = blocks.iter().flat_map(|b| centred_ranks(b)).collect();
    let labels: Vec<usize> = blocks.iter().flat_map(|b| 0..b.len()).collect();
    linear_within_blocks(&labels, &scores, &sizes(blocks), draws, stream)
}

/// Size of the trend over independent groups: Spearman's correlation of the group's number and the value, in -1..1, with its
/// interval; the interval is -1..1 for fewer than four values. `None` if all labels or all values are equal.
pub fn correlation_of_groups(groups: &[Vec<f64>], level: f64) -> Option<Interval> {
    let values = tied(&groups.concat());
    let labels: Vec<f64> = labels_of(&sizes(groups)).iter().map(|l| *l as f64).collect();
    let estimate = spearman(&labels, &values);
    let mut interval = Interval { estimate, low: -1.0, high: 1.0, level };
    // At |r| = 1 Fisher's z is infinite; use a value just inside, of the order of the next one that n ranks can give.
    let n = values.len() as f64;
    let r = estimate.clamp(1.0 / (n * n) - 1.0, 1.0 - 1.0 / (n * n));
    if values.len() > 3 {
        let reach = normal::quantile(0.5 * (1.0 + level)) * ((1.0 + 0.5 * r * r) / (n - 3.0)).sqrt();
        let z = libm::atanh(r);
        interval.low = libm::tanh(z - reach).min(estimate);
        interval.high = libm::tanh(z + reach).max(estimate);
    }
    estimate.is_finite().then_some(interval)
}

/// Size of the trend over paired groups: the mean over blocks of Spearman's correlation of the group's number and the value, in
/// -1..1, with its interval; blocks of equal values count as 0. `None` without blocks of two or more groups.
pub fn correlation_of_blocks(blocks: &[Vec<f64>], level: f64) -> Option<Interval> {
    let of_block = |block: &Vec<f64>| {
        let r = spearman(&(0..block.len()).map(|k| k as f64).collect::<Vec<_>>(), &tied(block));
        if r.is_finite() { r } else { 0.0 }
    };
    let correlations: Vec<f64> = blocks.iter().map(of_block).collect();
    blocks.iter().any(|b| b.len() > 1).then(|| proportion::between_ends(&correlations, level))?
}

fn sizes(groups: &[Vec<f64>]) -> Vec<usize> {
    groups.iter().map(Vec::len).collect()
}

#[cfg(test)]
mod tests;
