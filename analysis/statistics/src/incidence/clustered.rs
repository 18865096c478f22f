//! Cumulative incidence of one cause among clustered subjects (rovers of one world arriving), with an interval at each step, and the
//! distance by which a given share has ended.
//!
//! The variance of the share `F` at a distance is that of the jackknife over clusters, `(k - 1) / k sum (F_c - F.)^2` with `F_c` the estimate
//! without cluster `c` and `F.` their mean (S. Lipsitz, K. Dear and L. Zhao, Biometrics 50, 1994, for clustered survival data). The interval is that of
//! [`proportion::of_clusters`]. Once every subject has ended by this cause, the lower end of the previous step is kept.
//!
//! The distance of a share has the interval of R. Brookmeyer and J. Crowley (Biometrics 38, 1982): the distances at which the interval of
//! the curve includes that share. Cost: one pass over the subjects for each cluster.

use super::{Ending, Incidence};
use crate::bootstrap::Interval;
use crate::proportion;
use sastrugi_numeric::sums;

/// The curve at and after one of its steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Distance.
    pub at: f64,
    /// Share that has ended by this cause, in 0..1.
    pub share: f64,
    /// Its interval; `None` for fewer than two clusters.
    pub interval: Option<Interval>,
    /// Subjects at risk just before.
    pub at_risk: usize,
}

/// A step function, 0 before its first step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clustered {
    /// Steps in ascending order of distance.
    pub steps: Vec<Step>,
}

/// The distance by which a given share has ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distance {
    /// Where the curve reaches the share; `None` if it does not.
    pub estimate: Option<f64>,
    /// Where the upper end of the curve's interval reaches it.
    pub low: Option<f64>,
    /// Where the lower end of the curve's interval reaches it.
    pub high: Option<f64>,
}

impl Clustered {
    /// For cause 0 of `causes`, from the endings in each cluster. Endings at an unknown distance are left out.
    pub fn of(clusters: &[Vec<Ending>], causes: usize, level: f64) -> Self {
        let numbered = clusters.iter().enumerate().flat_map(|(c, endings)| endings.iter().map(move |e| (c, *e)));
        let mut sorted: Vec<(usize, Ending)> = numbered.filter(|(_, e)| e.at.is_finite()).collect();
        sorted.sort_by(|a, b| a.1.at.total_cmp(&b.1.at));
        let mut known: Vec<usize> = sorted.iter().map(|(c, _)| *c).collect();
        known.sort_unstable();
        known.dedup();
        let without = |left_out: Option<usize>| {
            let counted = sorted.iter().map(|(c, e)| (*e, usize::from(Some(*c) != left_out)));
            Incidence::of_counted(counted, causes)
        };
        let (all, jackknifed) = (without(None), known.iter().map(|c| without(Some(*c))).collect::<Vec<_>>());
        let mut steps: Vec<Step> = Vec::new();
        for (&at, &share) in all.at.iter().zip(&all.shares[0]) {
            let before = steps.last().map_or(0.0, |s| s.share);
            if share > before {
                let at_risk = sorted.len() - sorted.partition_point(|(_, e)| e.at < at);
                let interval = interval(share, at, &jackknifed, sorted.len(), level);
                steps.push(Step { at, share, interval, at_risk });
            }
        }
        keep_low_ends(&mut steps);
        Self { steps }
    }

    /// The last step up to a distance; `None` before the first.
    pub fn at(&self, at: f64) -> Option<&Step> {
        self.steps.partition_point(|s| s.at <= at).checked_sub(1).map(|last| &self.steps[last])
    }

    /// The distance by which `share`, in 0..1, has ended by this cause.
    pub fn distance(&self, share: f64) -> Distance {
        let first = |of: &dyn Fn(&Step) -> Option<f64>| {
            self.steps.iter().find(|s| of(s).is_some_and(|v| v >= share - 1e-12)).map(|s| s.at)
        };
        Distance {
            estimate: first(&|s| Some(s.share)),
            low: first(&|s| s.interval.map(|i| i.high)),
            high: first(&|s| s.interval.map(|i| i.low)),
        }
    }
}

fn interval(share: f64, at: f64, jackknifed: &[Incidence], subjects: usize, level: f64) -> Option<Interval> {
    let shares: Vec<f64> = jackknifed.iter().map(|i| i.share(0, at)).collect();
    let k = shares.len() as f64;
    let variance = (k - 1.0) * sums::variance(&shares);
    // A sum of rounded shares may slightly exceed 1.
    let share = if share > 1.0 - 1e-12 { 1.0 } else { share };
    proportion::of_clusters(share, variance, subjects, shares.len(), level)
}

/// At a share of 1 the scatter is no longer observable, so the lower end of the previous step is kept.
fn keep_low_ends(steps: &mut [Step]) {
    let before = steps.iter().rev().nth(1).and_then(|s| s.interval).map(|i| i.low);
    let whole = steps.last_mut().and_then(|s| s.interval.as_mut()).filter(|i| i.estimate == 1.0);
    if let (Some(interval), Some(low)) = (whole, before) {
        interval.low = interval.low.max(low);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Stream, Streams};

    fn ending(at: f64, arrived: bool) -> Ending {
        Ending { at, cause: arrived.then_some(0) }
    }

    /// Gehan (1965), remission of 21 patients on 6-MP in weeks (Cox and Oakes, Analysis of Survival Data, 1984; R's `survfit` prints the same): one minus
    /// the curve 0.857, 0.807, 0.753, 0.690, 0.627, 0.538, 0.448.
    const WEEKS: [(f64, bool); 21] = [
        (6., true),
        (6., true),
        (6., true),
        (6., false),
        (7., true),
        (9., false),
        (10., true),
        (10., false),
        (11., false),
        (13., true),
        (16., true),
        (17., false),
        (19., false),
        (20., false),
        (22., true),
        (23., true),
        (25., false),
        (32., false),
        (32., false),
        (34., false),
        (35., false),
    ];

    /// Each patient is a cluster of one: the curve, and standard errors up to 12 % above Greenwood's as printed by R (0.0764, 0.0869, 0.0963,
    /// 0.1068, 0.1141, 0.1282, 0.1346). Median 23 weeks, with an interval from 13 weeks.
    #[test]
    fn val_gehan() {
        let clusters: Vec<Vec<Ending>> = WEEKS.iter().map(|w| vec![ending(w.0, w.1)]).collect();
        let curve = Clustered::of(&clusters, 1, 0.95);
        let printed = [
            (6., 0.857, 0.0764, 21),
            (7., 0.807, 0.0869, 17),
            (10., 0.753, 0.0963, 15),
            (13., 0.690, 0.1068, 12),
            (16., 0.627, 0.1141, 11),
            (22., 0.538, 0.1282, 7),
            (23., 0.448, 0.1346, 6),
        ];
        assert_eq!(curve.steps.len(), printed.len());
        for (step, (at, left, error, at_risk)) in curve.steps.iter().zip(printed) {
            assert!(step.at == at && step.at_risk == at_risk && (1.0 - step.share - left).abs() < 5e-4, "{step:?}");
            // The factor t(20) / t(20) = 1 leaves the effective number of values unchanged.
            let of = |error: f64| proportion::of_clusters(step.share, error * error, 21, 21, 0.95).unwrap();
            let (i, narrow, wide) = (step.interval.unwrap(), of(0.999 * error), of(1.12 * error));
            assert!(
                wide.low <= i.low && i.low <= narrow.low && narrow.high <= i.high && i.high <= wide.high,
                "{step:?}"
            );
        }
        assert_eq!((curve.distance(0.5).estimate, curve.distance(0.9).estimate), (Some(23.0), None));
        // By the same formulas in Python (mpmath) the upper end of the curve is 0.495 at 10 weeks and 0.571 at 13.
        assert_eq!((curve.distance(0.5).low, curve.distance(0.5).high), (Some(13.0), None));
        let high = |weeks: f64| curve.at(weeks).unwrap().interval.unwrap().high;
        assert!((high(10.0) - 0.495_366_12).abs() < 1e-6 && (high(13.0) - 0.570_683_17).abs() < 1e-6, "{curve:?}");
    }

    /// Six worlds against `tests/statistical/clustered_tests.py`: curves by lifelines 0.30.3 with one world left out, quantiles by scipy
    /// 1.17.1. Share, low, high at four distances. Tolerance 1e-9.
    #[test]
    fn val_of_an_independent_program() {
        let curve = Clustered::of(&worlds(), 2, 0.95);
        for (at, expected) in WORLDS {
            let step = curve.at(at).unwrap();
            let i = step.interval.unwrap();
            for (ours, theirs) in [step.share, i.low, i.high].into_iter().zip(expected) {
                assert!((ours - theirs).abs() < 1e-9, "{at}: {step:?}");
            }
        }
    }
    const WORLDS: [(f64, [f64; 3]); 4] = [
        (30.0, [0.25, 0.035_579_909_548_463_635, 0.636_157_095_019_529_5]),
        (40.0, [0.458_333_333_333_333_2, 0.097_789_739_014_316, 0.856_819_087_584_233_2]),
        (57.0, [0.583_333_333_333_333_1, 0.233_371_238_020_226_7, 0.879_317_964_384_732_2]),
        (80.0, [0.666_666_666_666_666_4, 0.389_066_636_853_417_25, 0.878_766_960_847_150_1]),
    ];

    /// Arrived (1), will never arrive (2), stopped at 90 m (0).
    fn worlds() -> Vec<Vec<Ending>> {
        let world = |distances: &[f64], ends: &[usize]| {
            distances.iter().zip(ends).map(|(&at, &e)| Ending { at, cause: e.checked_sub(1) }).collect()
        };
        vec![
            world(&[26.5, 31.0, 40.0, 90.0], &[1, 1, 1, 0]),
            world(&[27.0, 28.0, 29.5, 33.0], &[1, 1, 1, 1]),
            world(&[45.0, 52.5, 71.0, 90.0, 90.0], &[1, 2, 1, 0, 0]),
            world(&[30.0, 34.0, 61.0], &[1, 2, 1]),
            world(&[26.0, 36.0, 44.0, 90.0], &[1, 1, 1, 0]),
            world(&[38.0, 57.0, 80.0, 90.0], &[1, 1, 2, 0]),
        ]
    }

    /// For clusters of equal size without censoring, the jackknife is the variance of the clusters' shares over their number.
    #[test]
    fn val_shares_of_equal_clusters() {
        let clusters: Vec<Vec<Ending>> = [1, 3, 4, 2, 4]
            .iter()
            .map(|n| (0..4).map(|k| ending(if k < *n { 1.0 } else { 9.0 }, true)).collect())
            .collect();
        let step = Clustered::of(&clusters, 1, 0.95).steps[0];
        let shares = [0.25, 0.75, 1.0, 0.5, 1.0];
        let expected = proportion::of_clusters(0.7, sums::variance(&shares) / 4.0, 20, 5, 0.95).unwrap();
        let i = step.interval.unwrap();
        assert!(
            (step.share - 0.7).abs() < 1e-15
                && (i.low - expected.low).abs() < 1e-12
                && (i.high - expected.high).abs() < 1e-12
        );
    }

    #[test]
    fn val_degenerate_clusters() {
        assert_eq!(Clustered::of(&[], 1, 0.95).steps, []);
        assert_eq!(Clustered::of(&[vec![ending(5.0, false)], vec![]], 1, 0.95).steps, []);
        let one = Clustered::of(&[vec![ending(2.0, true), ending(3.0, true)]], 1, 0.95);
        assert!(one.steps.len() == 2 && one.steps.iter().all(|s| s.interval.is_none()));
        assert_eq!(one.distance(1.0), Distance { estimate: Some(3.0), low: None, high: None });
        assert!(one.at(1.9).is_none() && one.at(2.5).is_some_and(|s| s.share == 0.5));
        // All arrive: the last lower end is better than that of five single trials.
        let all: Vec<Vec<Ending>> = (0..5).map(|c| (0..40).map(|k| ending(f64::from(k + c), true)).collect()).collect();
        let curve = Clustered::of(&all, 1, 0.95);
        let last = curve.steps.last().unwrap();
        assert!(last.share > 1.0 - 1e-12 && last.interval.unwrap().low > 0.9, "{last:?}");
    }

    /// A world of rovers: log distances with standard deviation 0.6 about the world's mean, which has a standard deviation of 0.5; rounded up
    /// to tenths, stopped at 3.3.
    fn world(rovers: usize, s: &mut Stream) -> Vec<Ending> {
        let centre = 0.5 * s.normal();
        let mut rover = || {
            let at = (10.0 * libm::exp(centre + 0.6 * s.normal())).ceil() / 10.0;
            if at <= 3.3 { ending(at, true) } else { ending(3.3, false) }
        };
        (0..rovers).map(|_| rover()).collect()
    }

    /// Null: the 95 % interval at distances 1 and 2.5 covers the true share (normal, standard deviation sqrt(0.61)), and the interval of the
    /// median distance covers 1. 20 worlds of 10 and of 30 rovers, 1000 sets each. Fewer than 911 of 1000 has a false-alarm probability of 1e-7
    /// at p = 0.95 (binomial), more than 981 one of 3e-7. With rovers treated as independent, coverage would be about 60 %.
    #[test]
    fn stat_coverage_over_worlds() {
        let mut s = Streams::for_seed(1, "clustered-incidence-test").stream("coverage");
        let truth = |at: f64| crate::normal::cdf(libm::log(at) / 0.61_f64.sqrt());
        for rovers in [10, 30] {
            let mut hits = [0; 3];
            for _ in 0..1000 {
                let worlds: Vec<Vec<Ending>> = (0..20).map(|_| world(rovers, &mut s)).collect();
                let curve = Clustered::of(&worlds, 1, 0.95);
                let holds = |at: f64| curve.at(at).unwrap().interval.unwrap().holds(truth(at));
                let median = curve.distance(0.5);
                let held = median.low.is_none_or(|low| low <= 1.0) && median.high.is_none_or(|high| high >= 1.0);
                hits.iter_mut().zip([holds(1.0), holds(2.5), held]).for_each(|(n, h)| *n += usize::from(h));
            }
            assert!(hits.iter().all(|h| (911..=981).contains(h)), "{hits:?} of 1000 with {rovers}");
        }
    }
}
