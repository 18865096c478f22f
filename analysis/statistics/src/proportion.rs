//! Means of bounded values from few terrains: shares, signs and correlations within blocks.
//!
//! The interval is that of C. Clopper and E. Pearson (Biometrika 26, 1934) for a share, with the sum of the values instead of the
//! number of successes:
//!
//! ```text
//! low: I_low(x, n - x + 1) = tail,   high: I_high(x + 1, n - x) = 1 - tail,   x = sum of n values in 0..1
//! ```
//!
//! `I` is the regularised incomplete beta function, for which `x` need not be an integer. Of all distributions on 0..1 with a given mean,
//! the one concentrated at the ends has the largest variance (W. Hoeffding, Journal of the American Statistical Association 58, 1963), so
//! that for other values the interval is too wide rather than too short. Unlike bootstrap intervals, it does not shrink to a point if all
//! values are 0 or all are 1.
//!
//! For many 0/1 values in clusters (rovers of one world), whose share `p` has a variance `v` that includes the scatter between clusters,
//! E. Korn and B. Graubard (Survey Methodology 24, 1998) use the same interval with the effective number of values
//!
//! ```text
//! n_df = p (1 - p) / v * (t(n - 1) / t(k - 1))^2,   x = p n_df
//! ```
//!
//! with `n` values in `k` clusters and `t` the two-sided quantiles of Student's distribution.

use crate::bootstrap::Interval;
use crate::student::{self, incomplete_beta};
use sastrugi_numeric::sums;

/// Mean of values in 0..1 with its interval; `None` without values.
///
/// ```
/// use sastrugi_statistics::proportion;
///
/// // Three goals in three missions: the interval ends at 1 and does not shrink to a point. At its lower end p, three of three have a
/// // probability of 2.5 %: p^3 = 0.025.
/// let goals = proportion::of_shares(&[1.0, 1.0, 1.0], 0.95).unwrap();
/// assert_eq!((goals.estimate, goals.high), (1.0, 1.0));
/// assert!((goals.low * goals.low * goals.low - 0.025).abs() < 1e-12);
/// ```
pub fn of_shares(values: &[f64], level: f64) -> Option<Interval> {
    let (n, x) = (values.len() as f64, sums::sum(values).clamp(0.0, values.len() as f64));
    let estimate = x / n;
    estimate.is_finite().then(|| exact(estimate, n, level))
}

/// Share of ones among `values` 0/1 values in `clusters` clusters, with its interval from the share's variance, which includes the scatter
/// between clusters. If all values are equal that scatter is unknown, and each cluster counts as one value. `None` for fewer than two
/// clusters.
pub fn of_clusters(share: f64, variance: f64, values: usize, clusters: usize, level: f64) -> Option<Interval> {
    let (n, k) = (values as f64, clusters as f64);
    if clusters < 2 || values < clusters || !((0.0..=1.0).contains(&share) && variance >= 0.0) {
        return None;
    }
    if share == 0.0 || share == 1.0 {
        return Some(exact(share, k, level));
    }
    let t = |freedom: f64| student::quantile(0.5 + 0.5 * level, freedom);
    let narrower = t(n - 1.0) / t(k - 1.0);
    let effective = (share * (1.0 - share) / variance).min(n) * narrower * narrower;
    Some(exact(share, effective.max(1.0), level))
}

/// Clopper and Pearson's interval of a share of `n` values, `n` not necessarily an integer.
fn exact(estimate: f64, n: f64, level: f64) -> Interval {
    let (x, tail) = (estimate * n, 0.5 * (1.0 - level));
    let low = if x > 0.0 { beta_quantile(tail, x, n - x + 1.0) } else { 0.0 };
    let high = if x < n { beta_quantile(1.0 - tail, x + 1.0, n - x) } else { 1.0 };
    Interval { estimate, low: low.min(estimate), high: high.max(estimate), level }
}

/// Mean of values in -1..1 with its interval; `None` without values.
pub fn between_ends(values: &[f64], level: f64) -> Option<Interval> {
    let shares: Vec<f64> = values.iter().map(|v| 0.5 * (1.0 + v)).collect();
    let of = of_shares(&shares, level)?;
    let back = |share: f64| 2.0 * share - 1.0;
    Some(Interval { estimate: back(of.estimate), low: back(of.low), high: back(of.high), level })
}

/// Quantile of the beta distribution: Newton's method between shrinking bounds, with bisection where it would leave them.
pub(crate) fn beta_quantile(p: f64, a: f64, b: f64) -> f64 {
    let log_factor = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b);
    let (mut low, mut high, mut x) = (0.0, 1.0, a / (a + b));
    for _ in 0..60 {
        let excess = incomplete_beta(a, b, x) - p;
        if excess < 0.0 {
            low = x
        } else {
            high = x
        }
        let density = libm::exp(log_factor + (a - 1.0) * libm::log(x) + (b - 1.0) * libm::log1p(-x));
        let newton = x - excess / density;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - x).abs() <= 1e-15 * x {
            return next;
        }
        x = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    /// Against scipy 1.17.1, stats.beta.ppf (`tests/statistical/nested_tests.py`): 0, 3 and 10 of 10, and half counts. Tolerance 1e-12.
    #[test]
    fn val_of_scipy() {
        let of = |ones: usize, halves: usize| {
            let values: Vec<f64> = (0..10)
                .map(|k| {
                    if k < ones {
                        1.0
                    } else if k < ones + halves {
                        0.5
                    } else {
                        0.0
                    }
                })
                .collect();
            of_shares(&values, 0.95).unwrap()
        };
        for (i, low, high) in [
            (of(0, 0), 0.0, 0.308_497_107_818_760_7),
            (of(3, 0), 0.066_739_511_177_734_47, 0.652_452_850_059_997_3),
            (of(10, 0), 0.691_502_892_181_239_2, 1.0),
            (of(3, 1), 0.092_694_593_938_153_16, 0.696_320_514_399_511_7),
        ] {
            assert!((i.low - low).abs() < 1e-12 && (i.high - high).abs() < 1e-12, "{i:?}");
        }
        assert_eq!(of_shares(&[], 0.95), None);
        // Three of four: 2 q - 1 with the quantiles q of mpmath, 0.194 and 0.994.
        let signs = between_ends(&[1.0, 1.0, 1.0, -1.0], 0.95).unwrap();
        assert_eq!(signs.estimate, 0.5);
        assert!((signs.low + 0.611_759_100_633_513_4).abs() < 1e-12, "{signs:?}");
        assert!((signs.high - 0.987_381_073_580_580_2).abs() < 1e-12, "{signs:?}");
        assert_eq!(between_ends(&[], 0.95), None);
    }

    /// The definition of Clopper and Pearson's interval: at its low end the observed count or more has a probability of 5 %, at its high
    /// end the observed count or less. Binomial probabilities are summed term by term. Tolerance 1e-12.
    #[test]
    fn val_ends_are_binomial_tails() {
        let at_least = |k: i32, n: i32, p: f64| -> f64 {
            let chosen = |j: i32| (0..j).fold(1.0, |c, i| c * f64::from(n - i) / f64::from(i + 1));
            let power = |x: f64, j: i32| (0..j).fold(1.0, |product, _| product * x);
            (k..=n).map(|j| chosen(j) * power(p, j) * power(1.0 - p, n - j)).sum()
        };
        for (ones, n) in [(1, 2), (3, 4), (1, 12), (7, 12), (11, 12), (20, 25)] {
            let values: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k < ones))).collect();
            let i = of_shares(&values, 0.9).unwrap();
            assert!((at_least(ones, n, i.low) - 0.05).abs() < 1e-12, "{ones} of {n}: {i:?}");
            assert!((1.0 - at_least(ones + 1, n, i.high) - 0.05).abs() < 1e-12, "{ones} of {n}: {i:?}");
        }
    }

    /// Beta distributions with one parameter 1 have closed quantiles, and the distribution at a quantile is p. Tolerance 1e-12.
    #[test]
    fn val_beta_quantiles() {
        for p in [1e-4, 0.025, 0.5, 0.9, 0.999] {
            for a in [0.3, 1.0, 2.5, 40.0] {
                assert!((beta_quantile(p, a, 1.0) - libm::pow(p, 1.0 / a)).abs() < 1e-12, "{p} {a}");
                assert!((beta_quantile(p, 1.0, a) - (1.0 - libm::pow(1.0 - p, 1.0 / a))).abs() < 1e-12, "{p} {a}");
                let (x, y) = (beta_quantile(p, a, 3.5), beta_quantile(1.0 - p, 3.5, a));
                assert!((incomplete_beta(a, 3.5, x) - p).abs() < 1e-12, "{p} {a}: {x}");
                assert!((x + y - 1.0).abs() < 1e-11, "{p} {a}: {x} {y}");
            }
        }
    }

    /// Korn and Graubard's interval against `tests/statistical/clustered_tests.py` (scipy 1.17.1): 0.7 and 0.985 of 200 in 20 clusters.
    /// Tolerance 1e-10. A variance below that of independent values is raised to it; without scatter the clusters are counted; with one cluster
    /// there is no interval.
    #[test]
    fn val_shares_of_clusters() {
        for (share, variance, low, high) in KORN {
            let i = of_clusters(share, variance, 200, 20, 0.95).unwrap();
            assert!((i.low - low).abs() < 1e-10 && (i.high - high).abs() < 1e-10, "{i:?}");
        }
        let of = |share, variance| of_clusters(share, variance, 200, 20, 0.95).unwrap();
        assert_eq!(of(0.7, 0.0), of(0.7, 0.7 * 0.3 / 200.0));
        assert_eq!(of(1.0, 0.0), of_shares(&[1.0; 20], 0.95).unwrap());
        assert_eq!(of_clusters(0.5, 0.1, 10, 1, 0.95), None);
        assert_eq!(of_clusters(0.5, f64::NAN, 10, 2, 0.95), None);
        assert_eq!(of_clusters(f64::NAN, 0.1, 10, 2, 0.95), None);
    }
    const KORN: [(f64, f64, f64, f64); 2] = [
        (0.7, 0.004, 0.548_112_378_459_565, 0.825_365_448_245_054_1),
        (0.985, 0.0001, 0.946_384_676_472_260_7, 0.998_225_300_753_013_7),
    ];

    /// Null: the interval over clusters covers the share. 20 clusters of 10 or 100 values that are 1 with a probability per cluster,
    /// beta-distributed with mean 0.6 and 0.9 and an intraclass correlation of 0.2; 2000 sets each. Fewer than 1848 hits of 2000 (92.4 %) has a
    /// false-alarm probability of 4e-7 at p = 0.95 (binomial). With values treated as independent, coverage would be about 70 and 30 %.
    #[test]
    fn stat_coverage_over_clusters() {
        let mut s = Streams::for_seed(1, "proportion-test").stream("clusters");
        for (mean, values) in [(0.6, 10), (0.6, 100), (0.9, 10), (0.9, 100)] {
            let mut hits = 0;
            for _ in 0..2000 {
                let shares: Vec<f64> = (0..20)
                    .map(|_| {
                        let p = beta_quantile(s.uniform(), 4.0 * mean, 4.0 * (1.0 - mean));
                        (0..values).filter(|_| s.uniform() < p).count() as f64 / f64::from(values)
                    })
                    .collect();
                let variance = sums::variance(&shares) / 19.0;
                let i = of_clusters(sums::mean(&shares), variance, 20 * values as usize, 20, 0.95).unwrap();
                hits += usize::from(i.holds(mean));
            }
            assert!((1848..=1990).contains(&hits), "{hits} of 2000 about {mean} with {values}");
        }
    }

    /// Null: the interval covers the mean in at least 95 % of sets. Values at the ends, at three points, and uniform in 0..1; 4 and 15 of
    /// them; 2000 sets each. Fewer than 1840 hits (92 %) of 2000 has a false-alarm probability below 1e-8 (binomial, p = 0.95).
    #[test]
    fn stat_coverage() {
        let mut s = Streams::for_seed(1, "proportion-test").stream("coverage");
        for n in [4, 15] {
            let mut hits = [0; 3];
            for _ in 0..2000 {
                let mut values = |of: &dyn Fn(f64) -> f64| (0..n).map(|_| of(s.uniform())).collect::<Vec<f64>>();
                let ends = values(&|u| f64::from(u8::from(u < 0.9)));
                let places = values(&|u| {
                    if u < 0.2 {
                        0.0
                    } else if u < 0.6 {
                        0.5
                    } else {
                        1.0
                    }
                });
                let even = values(&|u| u);
                let held =
                    [(ends, 0.9), (places, 0.6), (even, 0.5)].map(|(v, mean)| of_shares(&v, 0.95).unwrap().holds(mean));
                hits.iter_mut().zip(held).for_each(|(n, h)| *n += usize::from(h));
            }
            assert!(hits.iter().all(|h| *h >= 1840), "{hits:?} of 2000 with {n}");
        }
    }
}
