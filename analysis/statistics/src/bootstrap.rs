//! Bootstrap intervals for clustered samples (missions on one terrain resemble each other, so terrains are resampled).

use sastrugi_numeric::{Stream, sums};

/// An estimate with its interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Estimate from the sample itself.
    pub estimate: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Nominal coverage, such as 0.95.
    pub level: f64,
}

impl Interval {
    /// Percentile interval (Davison and Hinkley, 1997, section 5.3.1) from bootstrap values of a statistic. Non-finite values
    /// (replicates for which the statistic is undefined) are left out; `None` if they are more than half.
    pub fn percentile(estimate: f64, replicates: &[f64], level: f64) -> Option<Self> {
        let mut sorted = sums::finite(replicates);
        if sorted.is_empty() || 2 * sorted.len() < replicates.len() {
            return None;
        }
        sorted.sort_by(f64::total_cmp);
        let tail = 0.5 * (1.0 - level);
        let [low, high] = [tail, 1.0 - tail].map(|q| sums::quantile_sorted(&sorted, q));
        Some(Self { estimate, low, high, level })
    }

    /// True if the value lies in the interval, ends included.
    pub fn holds(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

/// Evaluates a statistic of clustered samples on `replicates` bootstrap replicates. `samples` are the numbers of clusters of each
/// independent sample; for each, that many cluster indices are drawn with replacement (none for a sample without clusters).
pub fn redraw<T>(
    samples: &[usize],
    replicates: usize,
    stream: &mut Stream,
    mut statistic: impl FnMut(&[Vec<usize>]) -> T,
) -> Vec<T> {
    let mut draw = |n: &usize| (0..*n).map(|_| stream.below(*n as u64) as usize).collect();
    let mut once = || {
        let drawn: Vec<Vec<usize>> = samples.iter().map(&mut draw).collect();
        statistic(&drawn)
    };
    (0..replicates).map(|_| once()).collect()
}

/// Percentile cluster-bootstrap interval (Davison and Hinkley, 1997, section 3.8) of a statistic of the cluster indices of each
/// sample; the estimate uses each index once. With fewer than about ten clusters the intervals are too short. `None` if any sample has
/// fewer than two clusters, or as for [`Interval::percentile`].
///
/// ```
/// use sastrugi_numeric::{Streams, sums};
/// use sastrugi_statistics::cluster_interval;
///
/// // Mean distance over the missions of five terrains: terrains are resampled, with all their missions.
/// let terrains = [[10.0, 12.0], [30.0, 28.0], [21.0, 19.0], [15.0, 15.0], [24.0, 26.0]];
/// let mut stream = Streams::for_seed(1, "example").stream("bootstrap");
/// let mean = |drawn: &[Vec<usize>]| sums::mean(&drawn[0].iter().flat_map(|&k| terrains[k]).collect::<Vec<_>>());
/// let found = cluster_interval(&[terrains.len()], 500, 0.95, &mut stream, mean).unwrap();
/// assert!((found.estimate - 20.0).abs() < 1e-12 && found.holds(found.estimate));
/// // No replicate can leave the range of the terrains' means.
/// assert!(found.low >= 11.0 && found.high <= 29.0);
/// ```
pub fn cluster_interval(
    samples: &[usize],
    replicates: usize,
    level: f64,
    stream: &mut Stream,
    statistic: impl Fn(&[Vec<usize>]) -> f64,
) -> Option<Interval> {
    if samples.iter().any(|n| *n < 2) {
        return None;
    }
    let once: Vec<Vec<usize>> = samples.iter().map(|n| (0..*n).collect()).collect();
    Interval::percentile(statistic(&once), &redraw(samples, replicates, stream, &statistic), level)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    fn stream(purpose: &str) -> Stream {
        Streams::for_seed(1, "bootstrap-test").stream(purpose)
    }

    /// Median of all values of the clusters.
    fn cluster_median(clusters: &[Vec<f64>], replicates: usize, level: f64, stream: &mut Stream) -> Option<Interval> {
        let clusters: Vec<Vec<f64>> = clusters.iter().map(|c| sums::finite(c)).filter(|c| !c.is_empty()).collect();
        cluster_interval(&[clusters.len()], replicates, level, stream, |drawn| {
            sums::median(&drawn[0].iter().flat_map(|&c| clusters[c].iter().copied()).collect::<Vec<_>>())
        })
    }

    #[test]
    fn val_equal_clusters_have_no_spread() {
        let clusters = vec![vec![1.0, 2.0, 3.0]; 5];
        let i = cluster_median(&clusters, 100, 0.95, &mut stream("equal")).unwrap();
        assert_eq!((i.low, i.estimate, i.high), (2.0, 2.0, 2.0));
    }

    #[test]
    fn val_no_interval_without_clusters() {
        assert_eq!(cluster_median(&[vec![1.0, 2.0]], 100, 0.95, &mut stream("one")), None);
        assert_eq!(cluster_median(&[vec![], vec![f64::NAN], vec![1.0]], 100, 0.95, &mut stream("empty")), None);
    }

    /// By hand: for 0..=100, 2.5 % lie beyond each of 2.5 and 97.5. Of NaN and 1, half is finite, which is enough; of NaN, NaN and 1 it
    /// is not.
    #[test]
    fn val_percentiles_and_missing_values() {
        let values: Vec<f64> = (0..=100).map(f64::from).collect();
        let i = Interval::percentile(50.0, &values, 0.95).unwrap();
        assert!((i.low - 2.5).abs() < 1e-12 && (i.high - 97.5).abs() < 1e-12, "{i:?}");
        assert!(i.holds(i.low) && !i.holds(97.6) && !i.holds(f64::NAN));
        assert!(Interval::percentile(1.0, &[f64::NAN, 1.0], 0.9).is_some());
        assert_eq!(Interval::percentile(1.0, &[f64::NAN, f64::NAN, 1.0], 0.9), None);
        assert_eq!(Interval::percentile(1.0, &[], 0.9), None);
    }

    /// Samples are resampled independently, each with its own number of clusters.
    #[test]
    fn prop_samples_keep_their_sizes() {
        let sizes = |drawn: &[Vec<usize>]| {
            assert!(drawn[0].iter().all(|c| *c < 3) && drawn[1].iter().all(|c| *c < 5));
            (drawn[0].len(), drawn[1].len(), drawn[2].len())
        };
        assert_eq!(redraw(&[3, 5, 0], 50, &mut stream("sizes"), sizes), [(3, 5, 0); 50]);
        assert_eq!(cluster_interval(&[3, 1], 9, 0.9, &mut stream("few"), |_| 1.0), None);
    }

    /// Every index of a sample is drawn equally often, with replacement. Null: probability 1/4 each, 4 x 5000 draws; bound 5 standard deviations
    /// of a count, sqrt(20 000 x 3/16) = 61 (false alarm 4 x 6e-7). All four are drawn in 4!/4^4 = 9.4 % of the replicates: 469, standard
    /// deviation 21, bound 5 of these.
    #[test]
    fn stat_draws_are_uniform_and_with_replacement() {
        let drawn = redraw(&[4], 5000, &mut stream("uniform"), |drawn| drawn[0].clone());
        let count = |k: usize| drawn.iter().flatten().filter(|c| **c == k).count();
        assert!((0..4).all(|k| count(k).abs_diff(5000) <= 305), "{:?}", [0, 1, 2, 3].map(count));
        let complete = drawn.iter().filter(|d| (0..4).all(|k| d.contains(&k))).count();
        assert!(complete.abs_diff(469) <= 105, "{complete}");
    }

    /// Null: 20 clusters of 10, cluster means N(0, 1), values N(mean, 1); true median 0. 300 samples, 200 replicates.
    /// Nominal 95 %; the percentile bootstrap of a median over 20 clusters covers 94 %, so fewer than 262 hits of 300
    /// (87.3 %) has a false-alarm probability of 7e-6 (binomial, p = 0.94). An interval that ignored the clusters
    /// would cover about 50 %.
    #[test]
    fn stat_coverage_over_clusters() {
        let mut s = stream("coverage");
        let hits = (0..300)
            .filter(|_| {
                let clusters: Vec<Vec<f64>> = (0..20)
                    .map(|_| {
                        let centre = s.normal();
                        (0..10).map(|_| centre + s.normal()).collect()
                    })
                    .collect();
                let i = cluster_median(&clusters, 200, 0.95, &mut s).unwrap();
                i.low <= 0.0 && 0.0 <= i.high
            })
            .count();
        assert!((262..=299).contains(&hits), "{hits} of 300");
    }
}
