//! Number of ordered pairwise differences below an interval of the shift, from the null distributions of the rank
//! statistics that count them.
//!
//! The number of pairs with `y_j - x_i` above the true shift has the distribution of H. Mann and D. Whitney's `U` (1947), the number
//! of Walsh averages above it that of F. Wilcoxon's signed-rank sum (1945). Both are exact for values without ties, whatever their
//! distribution; with ties the counts are too small, so that intervals become wider. If exact counting would take too long, the
//! statistics are treated as normal, with a continuity correction.

use crate::normal;

/// Most pairs for which `U` is counted exactly.
const PAIRS_MAX: usize = 2500;
/// Most differences for which the signed-rank sum is counted exactly.
const DIFFERENCES_MAX: usize = 100;

/// The largest `k` with `P(U < k) <= tail`.
pub(crate) fn rank_sum_below(n: usize, m: usize, tail: f64) -> usize {
    if n * m > PAIRS_MAX {
        let (n, m) = (n as f64, m as f64);
        return of_normal(0.5 * n * m, n * m * (n + m + 1.0) / 12.0, tail);
    }
    below(&rank_sum(n, m), tail)
}

/// The largest `k` with `P(W < k) <= tail`, W being the rank sum of the positive ones among `n` differences.
pub(crate) fn signed_rank_below(n: usize, tail: f64) -> usize {
    if n > DIFFERENCES_MAX {
        let n = n as f64;
        return of_normal(0.25 * n * (n + 1.0), n * (n + 1.0) * (2.0 * n + 1.0) / 24.0, tail);
    }
    below(&signed_rank(n), tail)
}

/// Probability of each value of `U`. Recursion: the largest of all values is in the first or in the second group, and then adds `m`
/// pairs or none.
fn rank_sum(n: usize, m: usize) -> Vec<f64> {
    // Row by row over the size of the first group; one distribution for each size of the second.
    let mut row: Vec<Vec<f64>> = (0..=m).map(|_| vec![1.0]).collect();
    for i in 1..=n {
        let mut next = vec![vec![1.0]];
        for j in 1..=m {
            let mut of = vec![0.0; i * j + 1];
            let share = i as f64 / (i + j) as f64;
            row[j].iter().enumerate().for_each(|(u, p)| of[u + j] += share * p);
            next[j - 1].iter().enumerate().for_each(|(u, p): (usize, &f64)| of[u] += (1.0 - share) * p);
            next.push(of);
        }
        row = next;
    }
    row.pop().unwrap_or_default()
}

/// Probability of each signed-rank sum: every rank is included or not.
fn signed_rank(n: usize) -> Vec<f64> {
    let mut of = vec![1.0];
    for rank in 1..=n {
        let mut next = vec![0.0; of.len() + rank];
        for (w, p) in of.iter().enumerate() {
            next[w] += 0.5 * p;
            next[w + rank] += 0.5 * p;
        }
        of = next;
    }
    of
}

fn below(probabilities: &[f64], tail: f64) -> usize {
    // Sums are rounded: a sum equal to the tail counts as within it.
    let bound = tail * (1.0 + 1e-12);
    let sums = probabilities.iter().scan(0.0, |sum, p| {
        *sum += p;
        Some(*sum)
    });
    sums.take_while(|sum| *sum <= bound).count()
}

fn of_normal(mean: f64, variance: f64, tail: f64) -> usize {
    (mean + normal::quantile(tail) * variance.sqrt() + 0.5).max(0.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scipy 1.17.1: scipy.stats.mannwhitneyu and wilcoxon, method "exact", give these tails (`tests/statistical/nested_tests.py`). The
    /// counts at 2.5 % are those of printed tables (Hollander, Wolfe and Chicken, 2014): U for 4 + 4, 5 + 6, 10 + 10, 20 + 20
    /// terrains, W for 5, 6, 10, 20 pairs.
    #[test]
    fn val_of_tables() {
        let of = [(3, 3), (4, 4), (5, 6), (10, 10), (20, 20)].map(|(n, m)| rank_sum_below(n, m, 0.025));
        assert_eq!(of, [0, 1, 4, 24, 128]);
        assert_eq!([5, 6, 10, 20].map(|n| signed_rank_below(n, 0.025)), [0, 1, 9, 53]);
        assert!((rank_sum(5, 6).iter().sum::<f64>() - 1.0).abs() < 1e-14);
        assert!((signed_rank(9).iter().sum::<f64>() - 1.0).abs() < 1e-14);
    }

    /// Both distributions against the enumeration of all arrangements: every choice of the first group's ranks, and every choice of
    /// signs, is equally likely. Tolerance 1e-14.
    #[test]
    fn val_distributions_equal_enumeration() {
        let shares = |values: Vec<usize>, len: usize| {
            let count = |value: usize| values.iter().filter(|v| **v == value).count() as f64;
            (0..len).map(|value| count(value) / values.len() as f64).collect::<Vec<f64>>()
        };
        let close = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-14);
        for (n, m) in [(1usize, 1usize), (2, 3), (4, 2), (3, 5)] {
            let chosen = (0..1usize << (n + m)).filter(|bits| bits.count_ones() as usize == n);
            // Pairs in which the member of the second group has the higher rank.
            let pairs = |bits: usize| {
                let is_first = |k: usize| bits >> k & 1 == 1;
                let above = |k: usize| (k + 1..n + m).filter(|&l| !is_first(l)).count();
                (0..n + m).filter(|&k| is_first(k)).map(above).sum::<usize>()
            };
            assert!(close(&rank_sum(n, m), &shares(chosen.map(pairs).collect(), n * m + 1)), "{n} {m}");
        }
        for n in [1usize, 2, 5, 8] {
            let sum = |bits: usize| (0..n).filter(|k| bits >> k & 1 == 1).map(|k| k + 1).sum::<usize>();
            let all = shares((0..1usize << n).map(sum).collect(), n * (n + 1) / 2 + 1);
            assert!(close(&signed_rank(n), &all), "{n}");
        }
    }

    /// Where exact counting ends, it is off from the normal approximation by as much as whole-number arithmetic in Python finds: 0, 0
    /// and 2 pairs of 2500, 1, 1 and 4 of the signed-rank sum. Beyond that limit the approximation is used.
    #[test]
    fn conv_normal_where_counting_ends() {
        for (tail, u, w) in
            [(0.05, [1011, 1011], [2046, 2047]), (0.025, [966, 966], [1956, 1955]), (0.005, [878, 876], [1780, 1776])]
        {
            assert_eq!([below(&rank_sum(50, 50), tail), of_normal(1250.0, 2500.0 * 101.0 / 12.0, tail)], u);
            let near = of_normal(2525.0, 100.0 * 101.0 * 201.0 / 24.0, tail);
            assert_eq!([below(&signed_rank(100), tail), near], w);
            assert_eq!((rank_sum_below(50, 50, tail), signed_rank_below(100, tail)), (u[0], w[0]));
        }
        // Whole-number arithmetic gives 987 and 1998.
        assert_eq!((rank_sum_below(51, 50, 0.025), signed_rank_below(101, 0.025)), (986, 1997));
    }
}
