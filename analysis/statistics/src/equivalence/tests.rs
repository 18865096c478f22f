use super::*;
use sastrugi_numeric::Streams;

const A: [f64; 6] = [62.0, 71.5, 55.0, 80.0, 66.5, 71.5];
const B: [f64; 5] = [58.0, 49.0, 71.5, 40.5, 55.0];
const D: [f64; 8] = [1.5, -0.5, 3.0, 0.0, 2.5, 0.5, -1.0, 4.0];

/// Against statsmodels 0.15.0 (`tests/statistical/nested_tests.py`): weightstats.ttost_ind with usevar="unequal", ttost_paired,
/// CompareMeans.tconfint_diff, and scipy.stats.t.interval. Relative tolerance 1e-11.
#[test]
fn val_of_statsmodels() {
    let close = |value: f64, expected: f64| assert!((value / expected - 1.0).abs() < 1e-11, "{value} {expected}");
    let apart = MeanDifference::between(&A, &B).unwrap();
    close(apart.freedom, 7.369_710_049_821_217);
    close(apart.equivalence_p(25.0), 0.046_238_325_523_798_314);
    close(apart.interval(0.9).low, -24.674_490_916_076_664);
    close(apart.interval(0.9).high, -1.225_509_083_923_341_8);
    let pairs = MeanDifference::of_pairs(&D).unwrap();
    close(pairs.equivalence_p(3.0), 0.014_031_050_250_940_128);
    close(pairs.interval(0.9).low, 0.049_091_623_242_922_156);
    close(pairs.smallest_margin(0.05), 2.450_908_376_757_077);
}

/// The two criteria agree: p <= 0.05 exactly if the 90 % interval lies within the margins.
#[test]
fn prop_interval_inclusion_equals_the_two_tests() {
    let difference = MeanDifference::between(&A, &B).unwrap();
    for k in 1..80 {
        let margin = 0.5 * f64::from(k);
        let i = difference.interval(0.9);
        let within = -margin < i.low && i.high < margin;
        assert_eq!(difference.equivalence_p(margin) < 0.05, within, "{margin}");
        assert_eq!(within, margin > difference.smallest_margin(0.05), "{margin}");
        let beyond = i.low > margin || i.high < -margin;
        assert_eq!(difference.beyond_p(margin) < 0.1, beyond, "{margin}");
    }
}

#[test]
fn val_degenerate_samples() {
    assert_eq!(MeanDifference::between(&[1.0], &[1.0, 2.0]), None);
    assert_eq!(MeanDifference::between(&[], &[]), None);
    assert_eq!(MeanDifference::of_pairs(&[1.0]), None);
    // Nothing varies: an estimate, no interval, and the p of a sign test; by hand 1/4 for two pairs, 1/8 for three terrains.
    for sure in [MeanDifference::between(&[2.0; 3], &[1.0; 3]), MeanDifference::of_pairs(&[-1.0, -1.0 - 1e-13])] {
        let sure = sure.unwrap();
        assert!((sure.estimate + 1.0).abs() < 1e-12 && !sure.scatters());
        assert!(sure.interval(0.9).low.is_nan() && sure.smallest_margin(0.05).is_nan());
    }
    assert_eq!(MeanDifference::of_pairs(&[1.0, f64::NAN]), None);
    let [three, two] =
        [MeanDifference::between(&[2.0; 3], &[1.0; 3]), MeanDifference::of_pairs(&[-1.0; 2])].map(Option::unwrap);
    assert_eq!((three.equivalence_p(5.0), two.equivalence_p(5.0)), (0.125, 0.25));
    assert_eq!((three.equivalence_p(0.5), three.beyond_p(0.5), three.beyond_p(5.0)), (1.0, 0.25, 1.0));
    assert!(MeanDifference::between(&[1.0, 2.0], &[3.0, 3.0]).is_some());
}

/// Null: the true difference is the margin itself, 1. Level 0.05: equivalence is claimed in 5 % of 4000 sets of 10 + 10
/// (and 10 pairs of) normal terrain means with standard deviations 0.3 and 0.6. More than 272 of 4000 has a false-alarm
/// probability of 3e-7 (binomial, p = 0.05), fewer than 134 one of 2e-7: levels of 8 % and 2.5 % would be detected.
#[test]
fn stat_level_at_the_margin() {
    let mut s = Streams::for_seed(1, "equivalence-test").stream("level");
    let mut claims = [0; 2];
    for _ in 0..4000 {
        let mut group = |mean: f64, deviation: f64| (0..10).map(|_| mean + deviation * s.normal()).collect::<Vec<_>>();
        let (a, b) = (group(0.0, 0.3), group(1.0, 0.6));
        let d: Vec<f64> = a.iter().zip(&b).map(|(a, b)| b - a).collect();
        let both = [MeanDifference::between(&a, &b), MeanDifference::of_pairs(&d)];
        claims.iter_mut().zip(both).for_each(|(n, m)| *n += usize::from(m.unwrap().equivalence_p(1.0) <= 0.05));
    }
    assert!(claims.iter().all(|n| (134..=272).contains(n)), "{claims:?} of 4000");
}
