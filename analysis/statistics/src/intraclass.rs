//! Intraclass correlation: how alike the members of a cluster are, and the resulting design effect.
//!
//! For values `y_ij` in clusters `i` (rovers of one world), with a variance `A` between clusters and `E` within them,
//!
//! ```text
//! rho = A / (A + E)
//! ```
//!
//! `A` and `E` are the analysis-of-variance estimates for clusters of unequal size ([`components`](crate::components)), so that `rho` can be
//! negative if clusters differ less than expected by chance. The interval is that of S. Searle (Linear Models, 1971; P. Shrout and
//! J. Fleiss, Psychological Bulletin 86, 1979, formula for ICC(1,1)):
//!
//! ```text
//! F = 1 + m A / E,   m = (N - sum n_i^2 / N) / (k - 1)
//! low = (F / F_high - 1) / (F / F_high + m - 1),   high = (F F'_high - 1) / (F F'_high + m - 1)
//! ```
//!
//! with `F_high` and `F'_high` the upper quantiles of Fisher's distribution with `(k - 1, N - k)` and `(N - k, k - 1)` degrees of freedom. It is
//! exact for normal effects and clusters of equal size; for outcomes that are 0 or 1 it is only a guide.
//!
//! The design effect `1 + (m' - 1) rho` with `m' = sum n_i^2 / N` (L. Kish, Survey Sampling, 1965) is the factor by which clustering raises the
//! variance of a mean: `N` values carry as much information as `N` divided by it independent ones.

use crate::bootstrap::Interval;
use crate::components::{Components, Group};
use crate::proportion::beta_quantile;

/// Intraclass correlation and design effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intraclass {
    /// Correlation of two values of the same cluster, with its interval.
    pub correlation: Interval,
    /// Factor on the variance of the mean of all values; at least 1.
    pub design_effect: f64,
    /// Number of values.
    pub values: usize,
    /// Number of clusters with values.
    pub clusters: usize,
}

impl Intraclass {
    /// From the values of each cluster; `None` unless there are at least two clusters, one of them with two values, and something varies.
    ///
    /// ```
    /// use sastrugi_statistics::Intraclass;
    ///
    /// // Three worlds of three rovers that all do the same: nine values carry as much information as three.
    /// let found = Intraclass::of(&[vec![1.0; 3], vec![2.0; 3], vec![5.0; 3]], 0.95).unwrap();
    /// assert_eq!((found.correlation.estimate, found.values, found.clusters), (1.0, 9, 3));
    /// assert_eq!(found.values as f64 / found.design_effect, 3.0);
    /// ```
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

/// Quantile of Fisher's distribution, from that of the beta distribution (M. Abramowitz and I. Stegun, 1964, 26.6.2).
fn fisher_quantile(p: f64, numerator: f64, denominator: f64) -> f64 {
    let share = beta_quantile(p, 0.5 * numerator, 0.5 * denominator);
    denominator * share / (numerator * (1.0 - share))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Stream, Streams};

    /// Shrout and Fleiss (1979), Table 2: six targets, four judges. Table 4 and the documentation of R's psych::ICC give ICC(1,1) = 0.17 with the
    /// 95 % interval -0.13 to 0.72. More digits from `tests/statistical/clustered_tests.py` (scipy 1.17.1). Tolerance 1e-10.
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

    /// Clusters of 1 to 5 values against a direct implementation in `tests/statistical/clustered_tests.py` (scipy 1.17.1).
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

    /// Fisher's distribution with (1, n) degrees of freedom is that of the square of Student's t with n, with (2, n) it has a closed form, with
    /// (n, n) its median is 1 (M. Abramowitz and I. Stegun, 1964, 26.6). Relative tolerance 1e-10.
    #[test]
    fn val_fisher_quantiles() {
        let close = |value: f64, expected: f64| assert!((value / expected - 1.0).abs() < 1e-10, "{value} {expected}");
        for n in [2.0, 5.0, 17.0, 80.0] {
            for p in [0.05, 0.5, 0.9, 0.975] {
                let t = crate::student::quantile(0.5 + 0.5 * p, n);
                close(fisher_quantile(p, 1.0, n), t * t);
                close(fisher_quantile(p, 2.0, n), 0.5 * n * (libm::pow(1.0 - p, -2.0 / n) - 1.0));
                close(fisher_quantile(p, n, 7.0) * fisher_quantile(1.0 - p, 7.0, n), 1.0);
            }
            close(fisher_quantile(0.5, n, n), 1.0);
        }
    }

    #[test]
    fn val_degenerate_clusters() {
        assert_eq!(Intraclass::of(&[], 0.95), None);
        assert_eq!(Intraclass::of(&[vec![1.0, 2.0]], 0.95), None);
        assert_eq!(Intraclass::of(&[vec![1.0], vec![2.0]], 0.95), None);
        assert_eq!(Intraclass::of(&[vec![1.0; 3], vec![1.0; 3]], 0.95), None);
        // Clusters differ and their values do not: all variance is between clusters.
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

    /// Null: the 95 % interval covers rho = 0, 0.1 and 0.5 of normal values. 2000 sets each of 20 clusters of 10 (exact), and of 5 to 15
    /// (nearly exact). Fewer than 1848 or more than 1947 hits of 2000 have a false-alarm probability of 4e-7 on either side at p = 0.95
    /// (binomial); an interval that treated all values as independent would cover 0.5 in fewer than half.
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
