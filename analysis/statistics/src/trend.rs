//! Trend over ordered groups: do the values rise, or fall, from group to group?
//!
//! Groups are numbered 0, 1, ... in their order. The statistic is linear in the ranks,
//!
//! ```text
//! T = sum over terrains of (number of the group) (rank - mean rank)
//! ```
//!
//! with ranks among all terrains (then `T` is, but for a factor, Spearman's correlation of group and value; P.
//! Armitage, 1955, for ordered groups), or among the terrains of a block where groups share their random draws (then
//! `T` is the statistic `L` of E. Page, Journal of the American Statistical Association 58, 1963, less its
//! expectation). Both tests are two-sided, and by permutation: see [`crate::permutation`]. With two groups the first is
//! the rank-sum test. Cost: one pass per arrangement.

use crate::correlation::{pearson, spearman};
use crate::permutation::{Permutation, centred_ranks, labels_of, linear, within_blocks};
use sastrugi_numeric::Stream;

/// Trend over independent groups, each with the values of its terrains.
pub fn of_groups(groups: &[Vec<f64>], draws: usize, stream: &mut Stream) -> Option<Permutation> {
    let scores = centred_ranks(&groups.concat());
    let labels = labels_of(&sizes(groups));
    within_blocks(&labels, &[scores.len()], draws, stream, |labels| linear(labels, &scores).abs())
}

/// Trend over paired groups: each block holds one value of every group, in the order of the groups.
pub fn of_blocks(blocks: &[Vec<f64>], draws: usize, stream: &mut Stream) -> Option<Permutation> {
    let scores: Vec<f64> = blocks.iter().flat_map(|b| centred_ranks(b)).collect();
    let labels: Vec<usize> = blocks.iter().flat_map(|b| 0..b.len()).collect();
    within_blocks(&labels, &sizes(blocks), draws, stream, |labels| linear(labels, &scores).abs())
}

/// Size of the trend over independent groups: Spearman's correlation of the group's number and the value, in -1..1.
pub fn correlation_of_groups(groups: &[Vec<f64>]) -> f64 {
    let labels: Vec<f64> = labels_of(&sizes(groups)).iter().map(|l| *l as f64).collect();
    spearman(&labels, &groups.concat())
}

/// Size of the trend over paired groups: correlation of the group's number and the rank within the block, in -1..1.
pub fn correlation_of_blocks(blocks: &[Vec<f64>]) -> f64 {
    let labels: Vec<f64> = blocks.iter().flat_map(|b| (0..b.len()).map(|k| k as f64)).collect();
    pearson(&labels, &blocks.iter().flat_map(|b| centred_ranks(b)).collect::<Vec<_>>())
}

fn sizes(groups: &[Vec<f64>]) -> Vec<usize> {
    groups.iter().map(Vec::len).collect()
}

#[cfg(test)]
mod tests;
