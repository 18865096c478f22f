//! Permutation tests of terrains: group labels are permuted over the values, and the observed statistic is compared with
//! its distribution over the permutations.
//!
//! The unit is the terrain, which is drawn independently, with one number for all its missions. If groups share their
//! random draws (common pairing), labels are permuted only within blocks of paired terrains. Under the null hypothesis that
//! labels do not matter, every arrangement is as likely as the observed one, whatever the distribution of the values (R.
//! Fisher, The Design of Experiments, 1935; E. Pitman, 1937). Let `t` be a statistic that is large if the groups
//! differ:
//!
//! ```text
//! p = #{arrangements with t >= t observed} / #{arrangements}      all arrangements, if there are no more than the draws
//! p = (b + 1) / (m + 1)                                           b of m random arrangements with t >= t observed
//! ```
//!
//! The second form (A. Davison and D. Hinkley, 1997, equation 4.11) counts the observed arrangement as one of them, so
//! that the test keeps its level with any number of draws. Cost: one evaluation of the statistic per arrangement.
//!
//! For rank statistics of very many values the normal distribution with the exact variance over all arrangements is used
//! (A. Wald and J. Wolfowitz, 1944), unless a single term is large compared with their sum (G. Noether, 1949; this happens if few values
//! stand out from many ties, or a small group is compared with a large one). Random arrangements would be slow, and could not give a p
//! below one over their number.

use crate::correlation::ranks;
use crate::normal;
use sastrugi_numeric::{Stream, sums};

/// Relative difference below which numbers count as equal: sums in a different order round differently.
pub(crate) const EQUAL: f64 = 1e-10;
/// Number of values from which rank statistics are treated as normal.
const NORMAL_FROM: usize = 300;
/// Largest square of one term, as a share of the variance of the sum, for which the sum is treated as normal; 300 values without ties
/// in two equal groups have 0.04.
const TERM_MAX: f64 = 0.05;
/// Random arrangements of a test, unless several tests at once need more.
const DRAWS: usize = 9999;
/// Arrangements per test, times the level: with this many, p-values can still be significant after Holm's adjustment.
const DRAWS_PER_TEST: f64 = 4.0;

/// Most arrangements: beyond some hundred tests at small levels they would take hours.
const DRAWS_MAX: f64 = 1e5;

/// Number of random arrangements for each of several tests that are adjusted together at level `alpha`; if there are no more than these,
/// all are enumerated.
///
/// ```
/// use sastrugi_statistics::permutation::draws;
///
/// // More tests need more arrangements, for the least p that the first of them can have after adjustment.
/// assert!(draws(100_000, 0.05) > draws(1, 0.05));
/// ```
pub fn draws(tests: usize, alpha: f64) -> usize {
    DRAWS.max((DRAWS_PER_TEST * tests as f64 / alpha).min(DRAWS_MAX) as usize)
}

/// The arrangements behind a p-value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrangements {
    /// All arrangements, with their number.
    All(usize),
    /// Drawn at random; the number includes the observed one.
    Drawn(usize),
    /// The normal distribution of a rank statistic with the exact variance of all arrangements.
    Normal,
}

/// Result of a permutation test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Permutation {
    /// The statistic of the data; large values are evidence against the null hypothesis.
    pub observed: f64,
    /// Probability of a statistic at least as large under the null hypothesis, in (0, 1].
    pub p: f64,
    /// The arrangements that `p` is based on.
    pub arrangements: Arrangements,
    /// The smallest p that any data with these numbers of values could have.
    pub least_p: f64,
}

/// Permutation test of any statistic of labels that are permuted within blocks. `blocks` are the lengths of consecutive runs of
/// `labels`. `None` if the statistic of the data is not finite, if there is only one arrangement, or if the lengths of the
/// blocks do not add up to the number of labels.
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
        let share = |n: usize| n as f64 / arrangements as f64;
        let (p, least_p, arrangements) = (share(large), share(1), Arrangements::All(arrangements));
        return (all > 1.0).then_some(Permutation { observed, p, arrangements, least_p });
    }
    let mut large = 1;
    for _ in 0..draws {
        each_block(&mut labels, blocks).for_each(|block| shuffle(block, stream));
        large += usize::from(statistic(&labels) >= least);
    }
    let arrangements = draws + 1;
    let share = |n: usize| n as f64 / arrangements as f64;
    let (p, least_p, arrangements) = (share(large), share(1), Arrangements::Drawn(arrangements));
    (draws > 0).then_some(Permutation { observed, p, arrangements, least_p })
}

/// Two-sided test of the sum of label times score, for scores with mean 0 in every block: by arrangements as in
/// [`within_blocks`], or by the normal distribution if there are too many values for that.
pub(crate) fn linear_within_blocks(
    labels: &[usize],
    scores: &[f64],
    blocks: &[usize],
    draws: usize,
    stream: &mut Stream,
) -> Option<Permutation> {
    let normal = || normal_test(labels, scores, blocks).filter(|_| labels.len() >= NORMAL_FROM);
    if number_of_arrangements(labels, blocks) > draws as f64
        && let Some(test) = normal()
    {
        return Some(test);
    }
    let test = within_blocks(labels, blocks, draws, stream, |labels| linear(labels, scores).abs())?;
    // An arrangement and its mirror image are equally extreme.
    let mirrored = matches!(test.arrangements, Arrangements::All(_)) && have_mirror_images(labels, blocks);
    Some(if mirrored { Permutation { least_p: 2.0 * test.least_p, ..test } } else { test })
}

/// The same by the normal distribution; `None` if a single term is too large for it.
fn normal_test(labels: &[usize], scores: &[f64], blocks: &[usize]) -> Option<Permutation> {
    let observed = linear(labels, scores).abs();
    let (mut variance, mut term) = (0.0, 0.0f64);
    let mut at = 0;
    for n in blocks {
        let labels: Vec<f64> = labels.get(at..at + n)?.iter().map(|l| *l as f64).collect();
        let scores = scores.get(at..at + n)?;
        at += n;
        if *n > 1 {
            // Sums of squares about the means are n times the variances.
            let squares = [&labels, scores].map(|v| sums::variance(v) * *n as f64);
            variance += squares[0] * squares[1] / (*n as f64 - 1.0);
            let largest = |v: &[f64]| v.iter().fold(0.0f64, |largest, x| largest.max(x.abs()));
            let span = largest(&labels) - labels.iter().copied().fold(f64::INFINITY, f64::min);
            term = term.max(span * largest(scores));
        }
    }
    let p = (2.0 * normal::cdf(-observed / variance.sqrt())).min(1.0);
    let fits = observed.is_finite() && term * term <= TERM_MAX * variance && variance > 0.0;
    fits.then_some(Permutation { observed, p, arrangements: Arrangements::Normal, least_p: 0.0 })
}

/// The smallest p that the two-sided test of independent groups of these sizes could have, whatever the values.
pub fn least_p_apart(sizes: &[usize]) -> f64 {
    least_p(&labels_of(sizes), &[sizes.iter().sum()])
}

/// The same for `blocks` blocks with one value from each of `groups` groups.
pub fn least_p_in_blocks(groups: usize, blocks: usize) -> f64 {
    let labels: Vec<usize> = (0..blocks).flat_map(|_| 0..groups).collect();
    least_p(&labels, &vec![groups; blocks])
}

fn least_p(labels: &[usize], blocks: &[usize]) -> f64 {
    let extreme = if have_mirror_images(labels, blocks) { 2.0 } else { 1.0 };
    (extreme / number_of_arrangements(labels, blocks)).min(1.0)
}

/// True if the labels of each block are symmetric: swapping the largest with the smallest, and so on, gives the same labels.
fn have_mirror_images(labels: &[usize], blocks: &[usize]) -> bool {
    let mut sorted = labels.to_vec();
    each_block(&mut sorted, blocks).all(|block| {
        block.sort_unstable();
        block.iter().zip(block.iter().rev()).all(|(a, b)| a + b == block[0] + block[block.len() - 1])
    })
}

/// Two-sided rank-sum test (F. Wilcoxon, 1945; H. Mann and D. Whitney, 1947), with mean ranks for ties. The
/// statistic is the absolute difference between the rank sum of the second group and its expectation.
///
/// ```
/// use sastrugi_numeric::Streams;
/// use sastrugi_statistics::{Arrangements, permutation::rank_sum};
///
/// let mut stream = Streams::for_seed(1, "example").stream("arrangements");
/// let test = rank_sum(&[1.0, 2.0, 3.0], &[7.0, 8.0, 9.0], 999, &mut stream).unwrap();
/// // Rank sum 4 + 5 + 6, expectation 10.5. Two of the 20 arrangements are as extreme, and none is more so.
/// assert_eq!((test.observed, test.p), (4.5, 0.1));
/// assert_eq!((test.arrangements, test.least_p), (Arrangements::All(20), 0.1));
/// ```
pub fn rank_sum(first: &[f64], second: &[f64], draws: usize, stream: &mut Stream) -> Option<Permutation> {
    let scores = centred_ranks(&[first, second].concat());
    let labels = labels_of(&[first.len(), second.len()]);
    linear_within_blocks(&labels, &scores, &[scores.len()], draws, stream)
}

/// Second minus first of every pair; 0 if they are equal except for rounding, like means of the same value over different numbers of
/// missions: in a test a sign counts however small the difference.
pub fn differences(pairs: impl IntoIterator<Item = [f64; 2]>) -> Vec<f64> {
    let difference = |[first, second]: [f64; 2]| {
        let equal = (second - first).abs() <= EQUAL * first.abs().max(second.abs());
        if equal { 0.0 } else { second - first }
    };
    pairs.into_iter().map(difference).collect()
}

/// Two-sided signed-rank test (F. Wilcoxon, 1945), with mean ranks for tied magnitudes; zeros are ranked but have
/// no sign (J. Pratt, 1959). The statistic is the magnitude of the sum of signed ranks.
pub fn signed_rank(differences: &[f64], draws: usize, stream: &mut Stream) -> Option<Permutation> {
    let scores: Vec<f64> = signed_ranks(differences).into_iter().flat_map(|rank| [-rank, rank]).collect();
    let labels: Vec<usize> = differences.iter().flat_map(|_| [0, 1]).collect();
    linear_within_blocks(&labels, &scores, &vec![2; differences.len()], draws, stream)
}

/// Rank of the magnitude of each value, with the value's sign; 0 for zeros.
pub(crate) fn signed_ranks(differences: &[f64]) -> Vec<f64> {
    let magnitudes = tied(&differences.iter().map(|d| d.abs()).collect::<Vec<_>>());
    let signed = |(d, rank): (&f64, f64)| if *d == 0.0 { 0.0 } else { rank.copysign(*d) };
    differences.iter().zip(ranks(&magnitudes)).map(signed).collect()
}

/// Ranks minus their mean; sums of these are multiples of one half and therefore exact.
pub(crate) fn centred_ranks(values: &[f64]) -> Vec<f64> {
    let mean = 0.5 * (values.len() + 1) as f64;
    ranks(&tied(values)).iter().map(|r| r - mean).collect()
}

/// The values, with those that are equal except for rounding made equal: each of a run of neighbours becomes the smallest of them.
pub(crate) fn tied(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut tied = values.to_vec();
    for pair in order.windows(2) {
        let [low, high] = [values[pair[0]], values[pair[1]]];
        if high - low <= EQUAL * low.abs().max(high.abs()) {
            tied[pair[1]] = tied[pair[0]];
        }
    }
    tied
}

/// Sum of label times score.
pub(crate) fn linear(labels: &[usize], scores: &[f64]) -> f64 {
    labels.iter().zip(scores).map(|(l, s)| *l as f64 * s).sum()
}

/// The number of each group, repeated for each of its members.
pub(crate) fn labels_of(sizes: &[usize]) -> Vec<usize> {
    sizes.iter().enumerate().flat_map(|(label, n)| std::iter::repeat_n(label, *n)).collect()
}

/// Shuffles by the method of Fisher and Yates (1938).
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

/// Product over blocks of n! / (n_1! n_2! ...); infinite on overflow.
fn number_of_arrangements(labels: &[usize], blocks: &[usize]) -> f64 {
    let mut sorted = labels.to_vec();
    let of_block = |block: &mut [usize]| {
        block.sort_unstable();
        let mut placed = 0.0;
        let of_label = |same: &[usize]| {
            // Each factor is a binomial coefficient whose intermediate values are integers.
            (1..=same.len()).fold(1.0, |product, k| {
                placed += 1.0;
                product * placed / k as f64
            })
        };
        block.chunk_by(|a, b| a == b).map(of_label).product::<f64>()
    };
    each_block(&mut sorted, blocks).map(of_block).product()
}

/// The next arrangement, with blocks counting like the wheels of an odometer; false after wrapping around to the first one.
fn advance(labels: &mut [usize], blocks: &[usize]) -> bool {
    each_block(labels, blocks).any(next_in_order)
}

/// The next arrangement in lexicographic order (E. Dijkstra, A Discipline of Programming, 1976); after the last, the first
/// one and false.
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
