//! How many of the ordered differences of pairs lie below an interval of the shift, from the null distributions of the rank
//! statistics that count them.
//!
//! The number of pairs with `y_j - x_i` above the true shift has the distribution of H. Mann and D. Whitney's `U` (1947), the number
//! of Walsh averages above it that of F. Wilcoxon's signed-rank sum (1945); both are exact for values without ties, whatever their
//! distribution, and count too few where there are ties, so that intervals become wider. Where counting is long the statistics are
//! taken for normal, with a correction for continuity.

use crate::normal;

/// Pairs up to which `U` is counted out.
const PAIRS_MAX: usize = 2500;
/// Differences up to which the signed-rank sum is counted out.
const DIFFERENCES_MAX: usize = 100;

/// The largest `k` with `P(U < k) <= tail`.
pub(crate) fn rank_sum_below(n: usize, m: usize, tail: f64) -> usize {
    if n * m > PAIRS_MAX {
        let (n, m) = (n as f64, m as f64);
        return of_normal(0.5 * n * m, n * m * (n + m + 1.0) / 12.0, tail);
    }
    below(&rank_sum(n, m), tail)
}

/// The largest `k` with `P(W < k) <= tail`, W being the signed-rank sum of the positive ones of `n` differences.
pub(crate) fn signed_rank_below(n: usize, tail: f64) -> usize {
    if n > DIFFERENCES_MAX {
        let n = n as f64;
        return of_normal(0.25 * n * (n + 1.0), n * (n + 1.0) * (2.0 * n + 1.0) / 24.0, tail);
    }
    below(&signed_rank(n), tail)
}

/// Probability of each value of `U`: the largest of all values is of the first or of the second group, and has then `m` or no
/// pairs below it.
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

/// Probability of each signed-rank sum: every rank is counted or not.
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
    // Sums round: equal to the tail counts as within it.
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

    /// scipy 1.17.1: scipy.stats.mannwhitneyu and wilcoxon, method "exact", give these tails (`tests/statistical/nested_tests.py`); the
    /// counts at 2.5 % are those of printed tables (Hollander, Wolfe and Chicken, 2014): U of 4 + 4, 5 + 6, 10 + 10, 20 + 20
    /// terrains, W of 5, 6, 10, 20 pairs.
    #[test]
    fn val_of_tables() {
        let of = [(3, 3), (4, 4), (5, 6), (10, 10), (20, 20)].map(|(n, m)| rank_sum_below(n, m, 0.025));
        assert_eq!(of, [0, 1, 4, 24, 128]);
        assert_eq!([5, 6, 10, 20].map(|n| signed_rank_below(n, 0.025)), [0, 1, 9, 53]);
        assert!((rank_sum(5, 6).iter().sum::<f64>() - 1.0).abs() < 1e-14);
        assert!((signed_rank(9).iter().sum::<f64>() - 1.0).abs() < 1e-14);
    }

    /// Where counting ends the normal distribution is off by one in hundreds at most.
    #[test]
    fn conv_normal_where_counting_ends() {
        for tail in [0.05, 0.025, 0.005] {
            let (exact, near) = (below(&rank_sum(50, 50), tail), of_normal(1250.0, 2500.0 * 101.0 / 12.0, tail));
            assert!(exact.abs_diff(near) <= 3, "{exact} {near}");
            let (exact, near) = (below(&signed_rank(100), tail), of_normal(2525.0, 100.0 * 101.0 * 201.0 / 24.0, tail));
            assert!(exact.abs_diff(near) <= 8, "{exact} {near}");
        }
    }
}
