use super::*;
use proptest::prelude::*;
use sastrugi_numeric::Streams;
use std::collections::BTreeSet;

/// Data of `tests/statistical/nested_tests.py`.
const A: [f64; 6] = [62.0, 71.5, 55.0, 80.0, 66.5, 71.5];
const B: [f64; 5] = [58.0, 49.0, 71.5, 40.5, 55.0];
const D: [f64; 8] = [1.5, -0.5, 3.0, 0.0, 2.5, 0.5, -1.0, 4.0];

fn stream(purpose: &str) -> Stream {
    Streams::for_seed(1, "permutation-test").stream(purpose)
}

/// Test of two independent groups with any statistic of both that is large if they differ.
fn two_groups(
    first: &[f64],
    second: &[f64],
    draws: usize,
    stream: &mut Stream,
    statistic: impl Fn(&[f64], &[f64]) -> f64,
) -> Option<Permutation> {
    let values = [first, second].concat();
    let labels = labels_of(&[first.len(), second.len()]);
    within_blocks(&labels, &[values.len()], draws, stream, |labels| {
        let of = |group| values.iter().zip(labels).filter(|v| *v.1 == group).map(|v| *v.0).collect::<Vec<_>>();
        statistic(&of(0), &of(1))
    })
}

/// Test of paired groups with any statistic of the differences within blocks that is large if the groups differ: signs are flipped.
fn paired(
    differences: &[f64],
    draws: usize,
    stream: &mut Stream,
    statistic: impl Fn(&[f64]) -> f64,
) -> Option<Permutation> {
    let labels: Vec<usize> = differences.iter().flat_map(|_| [0, 1]).collect();
    within_blocks(&labels, &vec![2; differences.len()], draws, stream, |labels| {
        let flipped = differences.iter().zip(labels.chunks(2)).map(|(d, l)| if l[0] == 0 { *d } else { -d });
        statistic(&flipped.collect::<Vec<_>>())
    })
}

fn difference_of_means(a: &[f64], b: &[f64]) -> f64 {
    (sums::mean(a) - sums::mean(b)).abs()
}

/// Against scipy.stats.permutation_test of scipy 1.17.1, all arrangements; ties within and between groups. Tolerance 1e-12.
#[test]
fn val_exact_tests_of_scipy() {
    let mut s = stream("scipy");
    let found = [
        two_groups(&A, &B, 1000, &mut s, difference_of_means),
        rank_sum(&A, &B, 1000, &mut s),
        paired(&D, 1000, &mut s, |d| sums::mean(d).abs()),
        signed_rank(&D, 1000, &mut s),
    ];
    let expected = [
        (12.95, 0.064_935_064_935_064_93, 462),
        (9.5, 0.093_073_593_073_593_07, 462),
        (1.25, 0.125, 256),
        (22.0, 0.140_625, 256),
    ];
    for (test, (observed, p, arrangements)) in found.into_iter().zip(expected) {
        let test = test.unwrap();
        assert!((test.observed - observed).abs() < 1e-12 && (test.p - p).abs() < 1e-12, "{test:?}");
        assert_eq!(test.arrangements, Arrangements::All(arrangements));
    }
}

/// Random arrangements against the full enumeration. 20 000 draws: 5 standard errors of the share, false alarm 6e-7 each.
#[test]
fn stat_random_arrangements_estimate_the_exact_p() {
    let mut s = stream("random");
    let (a, b) = ([A.as_slice(), &[60.0, 70.0, 64.0]].concat(), [B.as_slice(), &[59.0, 66.0, 50.0]].concat());
    let all = rank_sum(&a, &b, 24_310, &mut s).unwrap();
    let some = rank_sum(&a, &b, 20_000, &mut s).unwrap();
    assert_eq!((all.arrangements, some.arrangements), (Arrangements::All(24_310), Arrangements::Drawn(20_001)));
    let error = (all.p * (1.0 - all.p) / 20_000.0).sqrt();
    assert!((all.p - some.p).abs() < 5.0 * error, "{} {}", all.p, some.p);
}

/// Every arrangement within blocks occurs exactly once: the set of all enumerated arrangements against the product of
/// multinomials.
#[test]
fn val_every_arrangement_occurs_once() {
    for (labels, blocks, n) in
        [(&[0, 0, 1, 1, 2][..], &[5][..], 30), (&[0, 1, 0, 1, 2], &[2, 3], 12), (&[0, 0, 1], &[2, 1], 1)]
    {
        assert_eq!(number_of_arrangements(labels, blocks), f64::from(n));
        let mut at = labels.to_vec();
        each_block(&mut at, blocks).for_each(<[usize]>::sort_unstable);
        let mut seen = BTreeSet::new();
        while seen.insert(at.clone()) {
            advance(&mut at, blocks);
        }
        assert_eq!(seen.len(), n as usize);
    }
}

#[test]
fn val_degenerate_samples() {
    let mut s = stream("degenerate");
    assert_eq!(rank_sum(&[], &[1.0], 99, &mut s), None);
    assert_eq!(rank_sum(&[], &[], 99, &mut s), None);
    assert_eq!(signed_rank(&[], 99, &mut s), None);
    assert_eq!(two_groups(&[1.0], &[f64::NAN], 99, &mut s, difference_of_means), None);
    assert_eq!(within_blocks(&[0, 1], &[3], 99, &mut s, |_| 1.0), None);
    assert_eq!(within_blocks(&[0, 1], &[2], 0, &mut s, |_| 1.0), None);
    let equal = rank_sum(&[2.0; 4], &[2.0; 3], 99, &mut s).unwrap();
    assert_eq!((equal.observed, equal.p), (0.0, 1.0));
    assert_eq!(signed_rank(&[0.0; 3], 99, &mut s).unwrap().p, 1.0);
}

proptest! {
    /// The order within groups, and which group comes first, change nothing.
    #[test]
    fn prop_symmetry(a in proptest::collection::vec(0u8..9, 1..6), b in proptest::collection::vec(0u8..9, 1..6)) {
        let [a, b] = [a, b].map(|v| v.into_iter().map(f64::from).collect::<Vec<_>>());
        let reversed: Vec<f64> = a.iter().rev().copied().collect();
        let mut s = stream("symmetry");
        let p = |x: &[f64], y: &[f64], s: &mut Stream| rank_sum(x, y, 1000, s).unwrap().p;
        prop_assert_eq!(p(&a, &b, &mut s), p(&b, &reversed, &mut s));
    }
}

/// Means of terrains over 20 missions: standard deviation 1 between terrains, 1 between missions.
fn terrain_means(terrains: usize, s: &mut Stream) -> Vec<f64> {
    (0..terrains).map(|_| s.normal() + s.normal() / 20f64.sqrt()).collect()
}

/// Null: both groups have the same distribution, so a test at level 0.05 finds a difference in at most 5 % of data sets.
/// 2000 sets of 10 + 10 terrains (10 pairs), 99 random arrangements. More than 151 of 2000 has a false-alarm
/// probability of 4e-7 (binomial, p = 0.05), fewer than 57 one of 7e-7: a level of 8.5 % or 2.5 % would be detected. A
/// test that treated the missions as independent would find one in 55 % of the sets.
#[test]
fn stat_level_of_the_two_group_tests() {
    let mut s = stream("level");
    let mut found = [0; 3];
    for _ in 0..2000 {
        let (a, b) = (terrain_means(10, &mut s), terrain_means(10, &mut s));
        let d: Vec<f64> = a.iter().zip(&b).map(|(a, b)| b - a).collect();
        let tests = [
            rank_sum(&a, &b, 99, &mut s),
            two_groups(&a, &b, 99, &mut s, difference_of_means),
            signed_rank(&d, 99, &mut s),
        ];
        found.iter_mut().zip(tests).for_each(|(n, t)| *n += usize::from(t.unwrap().p <= 0.05));
    }
    assert!(found.iter().all(|n| (57..=151).contains(n)), "{found:?} of 2000");
}

/// Means of equal values differ by rounding if their numbers differ; that does not count as a sign.
#[test]
fn val_rounding_is_not_a_difference() {
    let mean = |n: usize| (0..n).map(|_| 0.1).sum::<f64>() / n as f64;
    let pairs = [3, 6, 7, 10].map(|n| [mean(1), mean(n)]);
    assert!(pairs.iter().any(|[a, b]| a != b));
    assert_eq!(differences(pairs), [0.0; 4]);
    assert_eq!(differences([[1.0, 1.5], [2.0, 1.0], [0.0, 0.0], [0.0, 1e-12]]), [0.5, -1.0, 0.0, 1e-12]);
}

/// Normal approximation for many values against random arrangements: 160 + 160 terrains with ties, and 160 pairs. 20 000 draws: 5
/// standard errors of the share, false alarm 6e-7 each.
#[test]
fn stat_normal_p_is_that_of_arrangements() {
    let mut s = stream("normal");
    let mut values = |shift: f64| (0..160).map(|_| libm::round(4.0 * (s.normal() + shift))).collect::<Vec<_>>();
    let (a, b, d) = (values(0.0), values(0.2), values(0.1));
    let normal = [rank_sum(&a, &b, 20_000, &mut s).unwrap(), signed_rank(&d, 20_000, &mut s).unwrap()];
    let scores = centred_ranks(&[&a[..], &b].concat());
    let ranks = signed_ranks(&d);
    let drawn = [
        within_blocks(&labels_of(&[160, 160]), &[320], 20_000, &mut s, |l| linear(l, &scores).abs()).unwrap(),
        paired(&ranks, 20_000, &mut s, |d| sums::sum(d).abs()).unwrap(),
    ];
    for (n, d) in normal.iter().zip(&drawn) {
        let error = (d.p * (1.0 - d.p) / 20_000.0).sqrt();
        assert!(n.arrangements == Arrangements::Normal && (n.observed - d.observed).abs() < 1e-9, "{n:?} {d:?}");
        assert!(d.p > 1e-3 && (n.p - d.p).abs() < 5.0 * error, "{n:?} {d:?}");
    }
}

/// If a few values stand out from many ties, or a small group is compared with a large one, the normal distribution is anticonservative, and
/// arrangements are drawn. Four of 200 pairs differ, all in one direction: 2 / 2^4 (5 standard errors of 20 000 draws, false alarm 6e-7).
#[test]
fn stat_large_terms_are_drawn() {
    let mut s = stream("terms");
    let pairs: Vec<f64> = (0..200).map(|k| if k < 4 { 1.0 + f64::from(k) } else { 0.0 }).collect();
    let test = signed_rank(&pairs, 20_000, &mut s).unwrap();
    assert_eq!(test.arrangements, Arrangements::Drawn(20_001));
    assert!((test.p - 0.125).abs() < 5.0 * (0.125f64 * 0.875 / 20_000.0).sqrt(), "{test:?}");
    let rare = |n: usize| (0..n).map(|k| if k % 100 == 0 { 95.0 } else { 100.0 }).collect::<Vec<_>>();
    let apart = |n: usize, m: usize, s: &mut Stream| rank_sum(&rare(n), &rare(m), 999, s).unwrap().arrangements;
    assert_eq!(
        (apart(280, 20, &mut s), apart(150, 150, &mut s)),
        (Arrangements::Drawn(1000), Arrangements::Drawn(1000))
    );
    let mut even = |n: usize| (0..n).map(|_| s.normal()).collect::<Vec<_>>();
    let (large, small) = (even(1000), even(20));
    assert_eq!(rank_sum(&large, &small, 999, &mut s).unwrap().arrangements, Arrangements::Drawn(1000));
}

/// The smallest p of groups of equal size is that of an arrangement and its mirror image. With unequal groups there may be no mirror image:
/// five terrains at 0, three at 100 give 1 / 56.
#[test]
fn val_least_p() {
    let mut s = stream("least");
    let equal = rank_sum(&[1.0; 4], &[2.0; 4], 999, &mut s).unwrap();
    assert_eq!((equal.p, equal.least_p), (2.0 / 70.0, 2.0 / 70.0));
    let unequal = rank_sum(&[0.0; 5], &[100.0; 3], 999, &mut s).unwrap();
    assert_eq!((unequal.p, unequal.least_p), (1.0 / 56.0, 1.0 / 56.0));
    assert_eq!(signed_rank(&[1.0, 2.0, 3.0], 999, &mut s).unwrap().least_p, 0.25);
    // The same in advance, without values: 8! / 4!^2 = 70, 8! / (5! 3!) = 56, 6! / 2!^3 = 90, and 2^3 and 6^5 within blocks.
    assert_eq!([&[4, 4][..], &[5, 3], &[2, 2, 2]].map(least_p_apart), [2.0 / 70.0, 1.0 / 56.0, 2.0 / 90.0]);
    assert_eq!((least_p_in_blocks(2, 3), least_p_in_blocks(3, 5)), (0.25, 2.0 / 7776.0));
    // One group has one arrangement.
    assert_eq!((least_p_apart(&[3]), least_p_in_blocks(1, 4)), (1.0, 1.0));
}

/// By hand: two groups of 150 without ties, 0, 1, ... and 20.5, 21.5, ... The k-th of the second group is above k + 21 of the first, and at
/// most all: U is the sum of these, T = U - 150 x 150 / 2, and its variance is 150 x 150 x 301 / 12 (H. Mann and D. Whitney, 1947).
#[test]
fn val_normal_p_by_hand() {
    let first: Vec<f64> = (0..150).map(f64::from).collect();
    let second: Vec<f64> = (0..150).map(|k| f64::from(k) + 20.5).collect();
    let test = rank_sum(&first, &second, 999, &mut stream("by hand")).unwrap();
    let u: f64 = (0..150).map(|k| f64::min(150.0, f64::from(k) + 21.0)).sum();
    let observed = u - 0.5 * 150.0 * 150.0;
    let deviation = (150.0 * 150.0 * 301.0f64 / 12.0).sqrt();
    assert_eq!((test.arrangements, test.observed), (Arrangements::Normal, observed));
    assert!((test.p / (2.0 * normal::cdf(-observed / deviation)) - 1.0).abs() < 1e-12, "{test:?}");
    assert_eq!(test.least_p, 0.0);
}

/// Values that are equal except for rounding share their rank.
#[test]
fn val_rounding_does_not_change_ranks() {
    assert_eq!(tied(&[0.1 + 0.2, 1.0, 0.3, 0.3000001]), [0.3, 1.0, 0.3, 0.3000001]);
    assert_eq!(signed_ranks(&[0.1 + 0.2, -0.3, 1.0]), [1.5, -1.5, 3.0]);
}

/// Four tests at 5 % need no more draws than usual, 1000 tests do: their smallest adjusted p is then below the level.
#[test]
fn val_draws_suffice_after_adjustment() {
    assert_eq!(draws(4, 0.05), 9999);
    // Four per test and level.
    assert_eq!(draws(1000, 0.0625), 64_000);
    assert!(1000.0 / (draws(1000, 0.05) + 1) as f64 <= 0.05);
    assert_eq!(draws(1_000_000, 0.01), 100_000);
}
