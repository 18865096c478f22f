//! How alike the members of a cluster are: the intraclass correlation, and what it costs.
//!
//! Of values `y_ij` in clusters `i` (rovers of one world), with a variance `A` between clusters and `E` within them,
//!
//! ```text
//! rho = A / (A + E)
//! ```
//!
//! `A` and `E` are the estimates of the analysis of variance for clusters of unequal size ([`components`](crate::components)), so that `rho` can be
//! negative where clusters differ less than chance would have them. The interval is that of S. Searle (Linear Models, 1971; P. Shrout and
//! J. Fleiss, Psychological Bulletin 86, 1979, formula for ICC(1,1)):
//!
//! ```text
//! F = 1 + m A / E,   m = (N - sum n_i^2 / N) / (k - 1)
//! low = (F / F_high - 1) / (F / F_high + m - 1),   high = (F F'_high - 1) / (F F'_high + m - 1)
//! ```
//!
//! with `F_high` and `F'_high` the upper quantiles of Fisher's distribution with `(k - 1, N - k)` and `(N - k, k - 1)` degrees of freedom. It is
//! exact for normal effects and clusters of one size; for outcomes that are 0 or 1 it is a guide.
//!
//! The design effect `1 + (m' - 1) rho` with `m' = sum n_i^2 / N` (L. Kish, Survey Sampling, 1965) is the factor on the variance of a mean: `N` values
//! tell as much as `N` over it independent ones.

use crate::bootstrap::Interval;
use crate::components::{Components, Group};
use crate::proportion::beta_quantile;

/// Intraclass correlation and design effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intraclass {
    /// Correlation of two values of one cluster, with its interval.
    pub correlation: Interval,
    /// Factor on the variance of the mean of all values; at least 1.
    pub design_effect: f64,
    /// Values.
    pub values: usize,
    /// Clusters with values.
    pub clusters: usize,
}

impl Intraclass {
    /// From the values of each cluster; `None` unless there are two clusters, one with two values, and something varies.
    pub fn of(clusters: &[Vec<f64>], level: f64) -> Option<Self> {
        let (member, repeat) = Components::within_groups(&[Group::of(clusters)])?;
        let sizes: Vec<f64> = clusters.iter().filter(|c| !c.is_empty()).map(|c| c.len() as f64).collect();
        let (n, k) = (sizes.iter().sum::<f64>(), sizes.len() as f64);
        let mean_square: f64 = sizes.iter().map(|s| s * s).sum::<f64>() / n;
        let size = (n - mean_square) / (k - 1.0);
        let estimate = member / (member + repeat);
        if k < 2.0 || !estimate.is_finite() {
            return None;
        }
        let ratio = 1.0 + size * member / repeat;
        let tail = 0.5 + 0.5 * level;
        let bound = |f: f64| if f.is_finite() { (f - 1.0) / (f + size - 1.0) } else { 1.0 };
        let low = bound(ratio / fisher_quantile(tail, k - 1.0, n - k));
        let high = bound(ratio * fisher_quantile(tail, n - k, k - 1.0));
        let correlation = Interval { estimate, low: low.min(estimate), high: high.max(estimate), level };
        let design_effect = 1.0 + (mean_square - 1.0) * estimate.max(0.0);
        Some(Self { correlation, design_effect, values: n as usize, clusters: sizes.len() })
    }
}

/// The value with probability `p` below it of Fisher's distribution, by that of the beta distribution (M. Abramowitz and I. Stegun, 1964, 26.6.2).
fn fisher_quantile(p: f64, numerator: f64, denominator: f64) -> f64 {
    let share = beta_quantile(p, 0.5 * numerator, 0.5 * denominator);
    denominator * share / (numerator * (1.0 - share))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Stream, Streams};

    /// Shrout and Fleiss (1979), Table 2: six targets, four judges. Table 4 and the documentation of R's psych::ICC give ICC(1,1) = 0.17 with the
    /// 95 % interval -0.13 to 0.72. Digits beyond theirs: `tests/statistical/clustered_tests.py` (scipy 1.17.1). Tolerance 1e-10.
    #[test]
    fn val_shrout_and_fleiss() {
        let targets = [
            [9., 2., 5., 8.],
            [6., 1., 3., 2.],
            [8., 4., 6., 8.],
            [7., 1., 2., 6.],
            [10., 5., 6., 9.],
            [6., 2., 4., 7.],
        ];
        let i = Intraclass::of(&targets.map(|t| t.to_vec()), 0.95).unwrap();
        let ours = [i.correlation.estimate, i.correlation.low, i.correlation.high, i.design_effect];
        for (ours, printed) in ours.into_iter().zip([0.17, -0.13, 0.72]) {
            assert!((ours - printed).abs() < 0.005, "{i:?}");
        }
        for (ours, expected) in ours.into_iter().zip(SHROUT) {
            assert!((ours - expected).abs() < 1e-10, "{i:?}");
        }
        assert_eq!((i.values, i.clusters), (24, 6));
    }
    const SHROUT: [f64; 4] =
        [0.165_741_768_405_475_44, -0.132_932_324_874_750_98, 0.722_560_062_328_121, 1.497_225_305_216_426_4];

    /// Clusters of 1 to 5 values by `tests/statistical/clustered_tests.py` (scipy 1.17.1): sums of squares and quantiles the obvious way.
    /// Tolerance 1e-10.
    #[test]
    fn val_unequal_clusters_of_scipy() {
        let clusters = [
            vec![0.9, 0.85, 0.95],
            vec![0.4],
            vec![0.7, 0.65, 0.8, 0.72, 0.61],
            vec![],
            vec![0.3, 0.55],
            vec![0.88, 0.91, 0.79, 0.86],
        ];
        let i = Intraclass::of(&clusters, 0.95).unwrap();
        let ours = [i.correlation.estimate, i.correlation.low, i.correlation.high, i.design_effect];
        for (ours, expected) in ours.into_iter().zip(UNEQUAL) {
            assert!((ours - expected).abs() < 1e-10, "{i:?}");
        }
        assert_eq!((i.values, i.clusters), (15, 5));
    }
    const UNEQUAL: [f64; 4] =
        [0.853_393_808_105_425_4, 0.507_089_305_945_411_9, 0.981_899_996_912_566_9, 3.275_716_821_614_465_4];

    #[test]
    fn val_degenerate_clusters() {
        assert_eq!(Intraclass::of(&[], 0.95), None);
        assert_eq!(Intraclass::of(&[vec![1.0, 2.0]], 0.95), None);
        assert_eq!(Intraclass::of(&[vec![1.0], vec![2.0]], 0.95), None);
        assert_eq!(Intraclass::of(&[vec![1.0; 3], vec![1.0; 3]], 0.95), None);
        // Clusters that differ and values that do not: all is between.
        let i = Intraclass::of(&[vec![1.0; 3], vec![2.0; 3], vec![5.0; 3]], 0.95).unwrap();
        assert_eq!((i.correlation.estimate, i.correlation.high, i.design_effect), (1.0, 1.0, 3.0));
    }

    /// Clusters of `sizes` values with the variance `rho` between and 1 - `rho` within.
    fn normal(sizes: &[usize], rho: f64, s: &mut Stream) -> Vec<Vec<f64>> {
        let cluster = |n: &usize| {
            let centre = rho.sqrt() * s.normal();
            (0..*n).map(|_| centre + (1.0 - rho).sqrt() * s.normal()).collect()
        };
        sizes.iter().map(cluster).collect()
    }

    /// Null: the 95 % interval holds rho = 0, 0.1 and 0.5 of normal values. 2000 sets each of 20 clusters of 10 (exact), and of 5 to 15
    /// (nearly). Fewer than 1848 or more than 1947 hits of 2000 have a false-alarm probability of 4e-7 on either side at p = 0.95
    /// (binomial); an interval that took all values as independent would hold 0.5 in fewer than half.
    #[test]
    fn stat_interval_coverage() {
        let mut s = Streams::for_seed(1, "intraclass-test").stream("coverage");
        let unequal: Vec<usize> = (0..20).map(|k| 5 + (k * 7) % 11).collect();
        for sizes in [vec![10; 20], unequal] {
            for rho in [0.0, 0.1, 0.5] {
                let holds =
                    |_: &usize| Intraclass::of(&normal(&sizes, rho, &mut s), 0.95).unwrap().correlation.holds(rho);
                let hits = (0..2000).filter(holds).count();
                assert!((1848..=1947).contains(&hits), "{hits} of 2000, rho {rho}, {sizes:?}");
            }
        }
    }
}
