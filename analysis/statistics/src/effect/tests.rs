use super::*;
use proptest::prelude::*;
use sastrugi_numeric::Streams;

const A: [f64; 6] = [62.0, 71.5, 55.0, 80.0, 66.5, 71.5];
const B: [f64; 5] = [58.0, 49.0, 71.5, 40.5, 55.0];
const D: [f64; 8] = [1.5, -0.5, 3.0, 0.0, 2.5, 0.5, -1.0, 4.0];

fn stream(purpose: &str) -> Stream {
    Streams::for_seed(1, "effect-test").stream(purpose)
}

/// numpy's median and mean over all pairs (`tests/statistical/nested_tests.py`).
#[test]
fn val_of_numpy() {
    assert_eq!(shift(&A, &B), -13.5);
    assert!((delta(&A, &B) + 0.633_333_333_333_333_3).abs() < 1e-15);
    assert_eq!((paired_shift(&D), paired_delta(&D)), (1.25, 0.375));
}

#[test]
fn val_degenerate_samples() {
    assert!(shift(&[], &[1.0]).is_nan() && delta(&[1.0], &[]).is_nan());
    assert!(paired_shift(&[]).is_nan() && paired_delta(&[]).is_nan());
    assert_eq!((shift(&[1.0], &[-2.0]), paired_shift(&[-2.0])), (-3.0, -2.0));
    let mut s = stream("degenerate");
    assert_eq!(Effect::between(&[1.0], &[1.0, 2.0], 9, 0.95, &mut s), None);
    assert_eq!(Effect::between(&[], &[], 9, 0.95, &mut s), None);
    assert_eq!(Effect::of_pairs(&[1.0], 9, 0.95, &mut s), None);
}

/// The slow way: all pairs, sorted.
fn all_pairs(first: &[f64], second: &[f64]) -> Vec<f64> {
    first.iter().flat_map(|x| second.iter().map(move |y| y - x)).collect()
}

/// Mean of the two values in the middle.
fn middle(values: &[f64]) -> f64 {
    let sorted = sorted(values);
    0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2])
}

proptest! {
    /// Bisection gives the median of all pairs to the bit, and delta is the count of their signs.
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

/// Null: intervals of 95 % hold the truth. 400 sets of 20 terrains a group, values normal, true shift 1; its delta is
/// P(y > x) - P(y < x) = erf(1/2) = 0.5205. 400 redraws. The percentile bootstrap over 20 terrains covers 93 to 95 %:
/// fewer than 347 hits of 400 (86.8 %) has a false-alarm probability of 3e-6 (binomial, p = 0.93). For pairs the truth
/// is 1 / sqrt 2 in units of the scatter of differences, so delta is erf(1/2) as well.
#[test]
fn stat_coverage() {
    let mut s = stream("coverage");
    let truth = libm::erf(0.5);
    let mut hits = [0; 4];
    for _ in 0..400 {
        let mut group = |shift: f64| (0..20).map(|_| shift + s.normal()).collect::<Vec<_>>();
        let (a, b) = (group(0.0), group(1.0));
        let d: Vec<f64> = a.iter().zip(&b).map(|(a, b)| b - a).collect();
        let apart = Effect::between(&a, &b, 400, 0.95, &mut s).unwrap();
        let pairs = Effect::of_pairs(&d, 400, 0.95, &mut s).unwrap();
        let held = [apart.shift.holds(1.0), apart.delta.holds(truth), pairs.shift.holds(1.0), pairs.delta.holds(truth)];
        hits.iter_mut().zip(held).for_each(|(n, h)| *n += usize::from(h));
    }
    assert!(hits.iter().all(|n| (347..=399).contains(n)), "{hits:?} of 400");
}
