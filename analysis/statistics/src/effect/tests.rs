use super::*;
use crate::permutation;
use proptest::prelude::*;
use sastrugi_numeric::{Stream, Streams};

const A: [f64; 6] = [62.0, 71.5, 55.0, 80.0, 66.5, 71.5];
const B: [f64; 5] = [58.0, 49.0, 71.5, 40.5, 55.0];
const D: [f64; 8] = [1.5, -0.5, 3.0, 0.0, 2.5, 0.5, -1.0, 4.0];

fn stream(purpose: &str) -> Stream {
    Streams::for_seed(1, "effect-test").stream(purpose)
}

/// Against numpy's median and mean over all pairs (`tests/statistical/nested_tests.py`).
#[test]
fn val_of_numpy() {
    assert_eq!(shift(&A, &B), -13.5);
    assert!((delta(&A, &B) + 0.633_333_333_333_333_3).abs() < 1e-15);
    assert_eq!((paired_shift(&D), paired_delta(&D)), (1.25, 0.375));
}

/// Newcombe's interval of delta, the roots of the formula in the module header found by mpmath: -19/30 from 6 and 5 values, and 1 from 4 and
/// 4. Tolerance 1e-12.
#[test]
fn val_interval_of_delta() {
    let i = Effect::between(&A, &B, 0.95).unwrap().delta;
    let close = |value: f64, expected: f64| (value - expected).abs() < 1e-12;
    assert!(close(i.low, -0.908_631_360_600_633_7) && close(i.high, 0.079_690_324_612_264_3), "{i:?}");
    let apart = Effect::between(&[1.0, 2.0, 3.0, 4.0], &[5.0, 6.0, 7.0, 8.0], 0.95).unwrap().delta;
    assert!(close(apart.low, 0.164_568_091_166_915_5) && apart.high == 1.0, "{apart:?}");
    // Swapping the groups mirrors the interval.
    let swapped = Effect::between(&B, &A, 0.95).unwrap().delta;
    assert!(close(swapped.low, -i.high) && close(swapped.high, -i.low), "{swapped:?}");
}

#[test]
fn val_degenerate_samples() {
    assert!(shift(&[], &[1.0]).is_nan() && delta(&[1.0], &[]).is_nan());
    assert!(paired_shift(&[]).is_nan() && paired_delta(&[]).is_nan());
    assert_eq!((shift(&[1.0], &[-2.0]), paired_shift(&[-2.0])), (-3.0, -2.0));
    assert_eq!(Effect::between(&[], &[1.0], 0.95), None);
    assert_eq!(Effect::of_pairs(&[], 0.95), None);
    // These values are too few to reject any shift.
    for few in [Effect::between(&[1.0], &[1.0, 2.0], 0.95).unwrap(), Effect::of_pairs(&[1.0; 5], 0.95).unwrap()] {
        assert_eq!((few.shift.low, few.shift.high), (f64::NEG_INFINITY, f64::INFINITY));
        assert!(few.delta.low < few.delta.high);
    }
}

/// The slow way: all pairs, sorted.
fn all_pairs(first: &[f64], second: &[f64]) -> Vec<f64> {
    first.iter().flat_map(|x| second.iter().map(move |y| y - x)).collect()
}

/// Median: mean of the two middle values.
fn middle(values: &[f64]) -> f64 {
    let sorted = sorted(values);
    0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2])
}

proptest! {
    /// Bisection gives the exact median of all pairs, and delta is the mean of their signs.
    #[test]
    fn prop_medians_of_pairs_are_exact(
        a in proptest::collection::vec(-1e3..1e3f64, 1..12),
        b in proptest::collection::vec(-1e3..1e3f64, 1..12),
        step in prop::sample::select(vec![0.0, 1.0, 100.0]),
    ) {
        // Rounded values have ties.
        let round = |v: &Vec<f64>| v.iter().map(|x| if step > 0.0 { (x / step).round() * step } else { *x }).collect::<Vec<_>>();
        let (a, b) = (round(&a), round(&b));
        let pairs = all_pairs(&a, &b);
        prop_assert_eq!(shift(&a, &b), middle(&pairs));
        prop_assert!((delta(&a, &b) - paired_delta(&pairs)).abs() < 1e-15);
        let walsh: Vec<f64> = (0..a.len()).flat_map(|i| a[i..].iter().map(move |y| (i, y))).map(|(i, y)| a[i] + y).collect();
        prop_assert_eq!(paired_shift(&a), 0.5 * middle(&walsh));
        prop_assert_eq!(shift(&a, &b), -shift(&b, &a));
    }
}

/// Intervals contain exactly the shifts that the rank tests over all arrangements do not reject at 5 %, checked on either side of each end.
#[test]
fn val_intervals_invert_the_tests() {
    let mut s = stream("invert");
    let (a, b) = ([0.1, 2.3, 1.7, 5.2, 3.9], [4.4, 1.1, 6.5, 7.2, 2.8, 9.3]);
    let by = |shift: f64| b.map(|y| y - shift);
    let d = [0.4, -0.7, 1.9, 2.6, 3.3, 0.9, 1.2, 4.8];
    let apart = Effect::between(&a, &b, 0.95).unwrap().shift;
    let pairs = Effect::of_pairs(&d, 0.95).unwrap().shift;
    for (end, inwards) in [(apart.low, 1e-9), (apart.high, -1e-9)] {
        let p = |shift: f64, s: &mut Stream| permutation::rank_sum(&a, &by(shift), 9999, s).unwrap().p;
        assert!(p(end + inwards, &mut s) > 0.05 && p(end - inwards, &mut s) <= 0.05, "{apart:?}");
    }
    for (end, inwards) in [(pairs.low, 1e-9), (pairs.high, -1e-9)] {
        let p = |shift: f64, s: &mut Stream| permutation::signed_rank(&d.map(|d| d - shift), 9999, s).unwrap().p;
        assert!(p(end + inwards, &mut s) > 0.05 && p(end - inwards, &mut s) <= 0.05, "{pairs:?}");
    }
}

/// Null: 95 % intervals cover the true values, for 4, 6 and 20 terrains per group (6 is the fewest pairs with a finite interval of the shift).
/// Values normal, true shift 1; its delta is P(y > x) - P(y < x) = erf(1/2) = 0.5205. For pairs the truth is 1 / sqrt 2 in units
/// of the scatter of differences, so delta is erf(1/2) as well. 1000 sets each: fewer than 905 hits has a false-alarm probability of
/// 1e-8 (binomial, p = 0.95).
#[test]
fn stat_coverage() {
    let mut s = stream("coverage");
    let truth = libm::erf(0.5);
    for n in [4, 6, 20] {
        let mut hits = [0; 4];
        for _ in 0..1000 {
            let mut group = |shift: f64| (0..n).map(|_| shift + s.normal()).collect::<Vec<_>>();
            let (a, b) = (group(0.0), group(1.0));
            let d: Vec<f64> = a.iter().zip(&b).map(|(a, b)| b - a).collect();
            let (apart, pairs) = (Effect::between(&a, &b, 0.95).unwrap(), Effect::of_pairs(&d, 0.95).unwrap());
            let held =
                [apart.shift.holds(1.0), apart.delta.holds(truth), pairs.shift.holds(1.0), pairs.delta.holds(truth)];
            hits.iter_mut().zip(held).for_each(|(n, h)| *n += usize::from(h));
        }
        assert!(hits.iter().all(|h| *h >= 905), "{hits:?} of 1000 with {n}");
    }
}
