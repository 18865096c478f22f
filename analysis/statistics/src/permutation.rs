//! Permutation tests of terrains: labels of groups are laid anew over the values, and what was found is compared with
//! what such labels give.
//!
//! The unit is what was drawn independently: a terrain, with one number for all its missions. Where groups share their
//! random draws (common pairing) labels move within a block of paired terrains only. Under the null hypothesis that
//! labels do not matter every arrangement is as likely as the observed one, whatever the distribution of the values (R.
//! Fisher, The Design of Experiments, 1935; E. Pitman, 1937). Let `t` be a statistic that is large when the groups
//! differ:
//!
//! ```text
//! p = #{arrangements with t >= t observed} / #{arrangements}      all arrangements, where they are not more than the draws
//! p = (b + 1) / (m + 1)                                           b of m random arrangements with t >= t observed
//! ```
//!
//! The second form (A. Davison and D. Hinkley, 1997, equation 4.11) counts the observed arrangement as one of them, so
//! that the test keeps its level with any number of draws. Cost: one evaluation of the statistic per arrangement.

use crate::correlation::ranks;
use sastrugi_numeric::{Stream, sums};

/// Relative difference below which a statistic counts as equal to the observed one: sums in another order round
/// otherwise.
const EQUAL: f64 = 1e-10;

/// Result of a permutation test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Permutation {
    /// The statistic of the data; large values speak against the null hypothesis.
    pub observed: f64,
    /// Probability of a statistic at least as large under the null hypothesis, in (0, 1].
    pub p: f64,
    /// Arrangements that were looked at, the observed one included.
    pub arrangements: usize,
    /// True when these are all there are.
    pub exact: bool,
}

/// The test of any statistic of labels that move within blocks. `blocks` are the lengths of consecutive runs of
/// `labels`. `None` when the statistic of the data is not finite, when there is a single arrangement, or when the
/// blocks are not as long as the labels.
pub fn within_blocks(
    labels: &[usize],
    blocks: &[usize],
    draws: usize,
    stream: &mut Stream,
    statistic: impl Fn(&[usize]) -> f64,
) -> Option<Permutation> {
    let observed = statistic(labels);
    if !observed.is_finite() || blocks.iter().sum::<usize>() != labels.len() {
        return None;
    }
    let all = number_of_arrangements(labels, blocks);
    let least = observed - EQUAL * observed.abs();
    let mut labels = labels.to_vec();
    if all <= draws as f64 {
        each_block(&mut labels, blocks).for_each(<[usize]>::sort_unstable);
        let (mut large, mut arrangements) = (0, 0);
        loop {
            arrangements += 1;
            large += usize::from(statistic(&labels) >= least);
            if !advance(&mut labels, blocks) {
                break;
            }
        }
        let p = large as f64 / arrangements as f64;
        return (arrangements > 1).then_some(Permutation { observed, p, arrangements, exact: true });
    }
    let mut large = 1;
    for _ in 0..draws {
        each_block(&mut labels, blocks).for_each(|block| shuffle(block, stream));
        large += usize::from(statistic(&labels) >= least);
    }
    let arrangements = draws + 1;
    let p = large as f64 / arrangements as f64;
    (draws > 0).then_some(Permutation { observed, p, arrangements, exact: false })
}

/// Two independent groups and any statistic of both, large when they differ.
pub fn two_groups(
    first: &[f64],
    second: &[f64],
    draws: usize,
    stream: &mut Stream,
    statistic: impl Fn(&[f64], &[f64]) -> f64,
) -> Option<Permutation> {
    let values = [first, second].concat();
    let labels = labels_of(&[first.len(), second.len()]);
    within_blocks(&labels, &[values.len()], draws, stream, |labels| {
        let of = |group| values.iter().zip(labels).filter(|v| *v.1 == group).map(|v| *v.0).collect::<Vec<_>>();
        statistic(&of(0), &of(1))
    })
}

/// Paired groups and any statistic of the differences within blocks, large when the groups differ: signs are flipped.
pub fn paired(
    differences: &[f64],
    draws: usize,
    stream: &mut Stream,
    statistic: impl Fn(&[f64]) -> f64,
) -> Option<Permutation> {
    let labels: Vec<usize> = differences.iter().flat_map(|_| [0, 1]).collect();
    within_blocks(&labels, &vec![2; differences.len()], draws, stream, |labels| {
        let flipped = differences.iter().zip(labels.chunks(2)).map(|(d, l)| if l[0] == 0 { *d } else { -d });
        statistic(&flipped.collect::<Vec<_>>())
    })
}

/// Two-sided rank-sum test (F. Wilcoxon, 1945; H. Mann and D. Whitney, 1947), ties sharing their mean rank. The
/// statistic is the distance of the rank sum of the second group from its expectation.
pub fn rank_sum(first: &[f64], second: &[f64], draws: usize, stream: &mut Stream) -> Option<Permutation> {
    let scores = centred_ranks(&[first, second].concat());
    let labels = labels_of(&[first.len(), second.len()]);
    within_blocks(&labels, &[scores.len()], draws, stream, |labels| linear(labels, &scores).abs())
}

/// Second less first of every pair; 0 where they are equal but for rounding, as means of the same value over other numbers of
/// missions are: a sign counts in a test however small the difference.
pub fn differences(pairs: impl IntoIterator<Item = [f64; 2]>) -> Vec<f64> {
    let difference = |[first, second]: [f64; 2]| {
        let equal = (second - first).abs() <= EQUAL * first.abs().max(second.abs());
        if equal { 0.0 } else { second - first }
    };
    pairs.into_iter().map(difference).collect()
}

/// Two-sided signed-rank test (F. Wilcoxon, 1945), ties of the magnitudes sharing their mean rank, zeros ranked and
/// without a sign (J. Pratt, 1959). The statistic is the magnitude of the sum of signed ranks.
pub fn signed_rank(differences: &[f64], draws: usize, stream: &mut Stream) -> Option<Permutation> {
    paired(&signed_ranks(differences), draws, stream, |d| sums::sum(d).abs())
}

/// Rank of the magnitude of each value with the value's sign, 0 for zeros.
pub(crate) fn signed_ranks(differences: &[f64]) -> Vec<f64> {
    let magnitudes: Vec<f64> = differences.iter().map(|d| d.abs()).collect();
    let signed = |(d, rank): (&f64, f64)| if *d == 0.0 { 0.0 } else { rank.copysign(*d) };
    differences.iter().zip(ranks(&magnitudes)).map(signed).collect()
}

/// Ranks less their mean: their sums are multiples of one half and exact.
pub(crate) fn centred_ranks(values: &[f64]) -> Vec<f64> {
    let mean = 0.5 * (values.len() + 1) as f64;
    ranks(values).iter().map(|r| r - mean).collect()
}

/// Sum of label times score.
pub(crate) fn linear(labels: &[usize], scores: &[f64]) -> f64 {
    labels.iter().zip(scores).map(|(l, s)| *l as f64 * s).sum()
}

/// The number of each group, as often as the group has members.
pub(crate) fn labels_of(sizes: &[usize]) -> Vec<usize> {
    sizes.iter().enumerate().flat_map(|(label, n)| std::iter::repeat_n(label, *n)).collect()
}

/// Fisher and Yates (1938).
pub(crate) fn shuffle(labels: &mut [usize], stream: &mut Stream) {
    for last in (1..labels.len()).rev() {
        labels.swap(last, stream.below(last as u64 + 1) as usize);
    }
}

fn each_block<'a>(labels: &'a mut [usize], blocks: &'a [usize]) -> impl Iterator<Item = &'a mut [usize]> {
    let mut rest = labels;
    blocks.iter().map(move |n| {
        let (block, after) = std::mem::take(&mut rest).split_at_mut(*n);
        rest = after;
        block
    })
}

/// Product over blocks of n! / (n_1! n_2! ...); infinite where that is beyond all counting.
fn number_of_arrangements(labels: &[usize], blocks: &[usize]) -> f64 {
    let mut sorted = labels.to_vec();
    let of_block = |block: &mut [usize]| {
        block.sort_unstable();
        let mut placed = 0.0;
        let of_label = |same: &[usize]| {
            // Each factor is a binomial coefficient built up as a whole number.
            (1..=same.len()).fold(1.0, |product, k| {
                placed += 1.0;
                product * placed / k as f64
            })
        };
        block.chunk_by(|a, b| a == b).map(of_label).product::<f64>()
    };
    each_block(&mut sorted, blocks).map(of_block).product()
}

/// The next arrangement, blocks counting like the wheels of an odometer; false when the first one has come again.
fn advance(labels: &mut [usize], blocks: &[usize]) -> bool {
    each_block(labels, blocks).any(next_in_order)
}

/// The next arrangement in the order of words (E. Dijkstra, A Discipline of Programming, 1976); false, and the first
/// one, after the last.
fn next_in_order(labels: &mut [usize]) -> bool {
    let Some(pivot) = (1..labels.len()).rev().find(|&k| labels[k - 1] < labels[k]) else {
        labels.reverse();
        return false;
    };
    let larger = (pivot..labels.len()).rev().find(|&k| labels[k] > labels[pivot - 1]).unwrap_or(pivot);
    labels.swap(pivot - 1, larger);
    labels[pivot..].reverse();
    true
}

#[cfg(test)]
mod tests;
