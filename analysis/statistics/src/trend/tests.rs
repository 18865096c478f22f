use super::*;
use crate::Arrangements;
use sastrugi_numeric::Streams;

fn stream(purpose: &str) -> Stream {
    Streams::for_seed(1, "trend-test").stream(purpose)
}

/// Data of `tests/statistical/nested_tests.py`.
fn groups() -> Vec<Vec<f64>> {
    vec![vec![62.0, 71.5, 55.0, 80.0], vec![58.0, 49.0, 71.5], vec![44.0, 52.5, 40.5]]
}

fn blocks() -> Vec<Vec<f64>> {
    vec![
        vec![71.0, 64.0, 60.0],
        vec![55.0, 57.0, 41.0],
        vec![80.0, 62.0, 61.5],
        vec![66.0, 70.0, 49.0],
        vec![48.0, 40.0, 44.0],
    ]
}

/// Against scipy 1.17.1: scipy.stats.spearmanr, and the share of all arrangements of its labels. Tolerance 1e-12.
#[test]
fn val_groups_of_scipy() {
    let test = of_groups(&groups(), 5000, &mut stream("groups")).unwrap();
    assert_eq!(test.arrangements, Arrangements::All(4200));
    assert!((test.p - 0.017_142_857_142_857_144).abs() < 1e-12, "{test:?}");
    assert!((correlation_of_groups(&groups(), 0.95).unwrap().estimate + 0.750_317_945_991_113_3).abs() < 1e-12);
}

/// Against scipy.stats.page_trend_test of scipy 1.17.1, method "exact", of the values with reversed sign: L = 67, one-sided
/// p = 0.018132716049382717. L's expectation is 5 x 3 x 4^2 / 4 = 60; by symmetry the two-sided p is twice the
/// one-sided. Tolerance 1e-12.
#[test]
fn val_blocks_of_scipy() {
    let test = of_blocks(&blocks(), 10_000, &mut stream("blocks")).unwrap();
    assert_eq!(test.arrangements, Arrangements::All(7776));
    assert_eq!(test.observed, 7.0);
    assert!((test.p - 2.0 * 0.018_132_716_049_382_717).abs() < 1e-12, "{test:?}");
    // The squares of each block's centred ranks add up to 2, and so do those of its labels.
    assert!((correlation_of_blocks(&blocks(), 0.95).unwrap().estimate + (7.0) / 10.0).abs() < 1e-12);
}

/// With two groups the trend is the rank-sum test.
#[test]
fn val_two_groups_are_the_rank_sum_test() {
    let groups = &groups()[..2];
    let trend = of_groups(groups, 100, &mut stream("two")).unwrap();
    assert_eq!(Some(trend), crate::permutation::rank_sum(&groups[0], &groups[1], 100, &mut stream("two")));
}

#[test]
fn val_degenerate_samples() {
    let mut s = stream("degenerate");
    assert_eq!(of_groups(&[], 9, &mut s), None);
    assert_eq!(of_groups(&[vec![1.0, 2.0]], 9, &mut s), None);
    assert_eq!(of_blocks(&[vec![1.0]], 9, &mut s), None);
    assert_eq!(correlation_of_groups(&[vec![1.0], vec![1.0]], 0.95), None);
    assert_eq!(correlation_of_blocks(&[vec![1.0]], 0.95), None);
    let few = correlation_of_groups(&[vec![1.0], vec![2.0], vec![3.0]], 0.95).unwrap();
    assert_eq!((few.estimate, few.low, few.high), (1.0, -1.0, 1.0));
    // All in order: the interval ends at 1 and does not collapse to a point. z = artanh(15/16) = ln(31) / 2, with variance
    // 1 + (15/16)^2 / 2 (mpmath: -0.561 154 357 880 08). Tolerance 1e-12.
    let rising = correlation_of_groups(&[vec![1.0], vec![2.0], vec![3.0], vec![4.0]], 0.95).unwrap();
    assert!(rising.high == 1.0 && (rising.low + 0.561_154_357_880_080_1).abs() < 1e-12, "{rising:?}");
}

/// Bonett and Wright's interval of ten values with r = -0.7503: z = artanh r -+ 1.959 964 sqrt((1 + r^2 / 2) / 7), by mpmath. Tolerance 1e-12.
#[test]
fn val_interval_of_the_correlation() {
    let i = correlation_of_groups(&groups(), 0.95).unwrap();
    assert!((i.low + 0.948_063_561_447_341_2).abs() < 1e-12, "{i:?}");
    assert!((i.high + 0.134_263_554_237_684_4).abs() < 1e-12, "{i:?}");
}

/// Null: three groups with the same distribution, blocks with a common component. Level 0.05: 2000 sets of 6 terrains per group, 99
/// random arrangements. Bounds as in the tests of two groups: false alarm below 7e-7 on either side (binomial, p =
/// 0.05).
#[test]
fn stat_level_of_the_trend_tests() {
    let mut s = stream("level");
    let mut found = [0; 2];
    for _ in 0..2000 {
        let groups: Vec<Vec<f64>> = (0..3).map(|_| (0..6).map(|_| s.normal()).collect()).collect();
        let mut block = |_| {
            let common = 3.0 * s.normal();
            (0..3).map(|_| common + s.normal()).collect()
        };
        let blocks: Vec<Vec<f64>> = (0..6).map(&mut block).collect();
        let tests = [of_groups(&groups, 99, &mut s), of_blocks(&blocks, 99, &mut s)];
        found.iter_mut().zip(tests).for_each(|(n, t)| *n += usize::from(t.unwrap().p <= 0.05));
    }
    assert!(found.iter().all(|n| (57..=151).contains(n)), "{found:?} of 2000");
}

/// Null: 95 % intervals cover the true correlation, for 3 groups of 4 and of 20 terrains, and for blocks of 3. Values are normal, with means
/// 1 higher from group to group. The true value for groups (whose labels are tied) is that of a sample of 3 x 100 000, accurate to 0.003; for
/// blocks it is (P(y1 < y2) - P(y1 > y2)) (1 + 1 + 2 a) / 4 with a = erf(1) / erf(1/2). 1000 sets each: fewer than 905 hits has a
/// false-alarm probability of 1e-8 (binomial, p = 0.95).
#[test]
fn stat_coverage() {
    let mut s = stream("coverage");
    let mut sets =
        |n: usize| (0..3).map(|g| (0..n).map(|_| f64::from(g) + s.normal()).collect()).collect::<Vec<Vec<f64>>>();
    let truth = correlation_of_groups(&sets(100_000), 0.95).unwrap().estimate;
    // Spearman's correlation of three values without ties is the sum of the concordances weighted by the distance of labels, over 4.
    let of_blocks = (2.0 * libm::erf(0.5) + 2.0 * libm::erf(1.0)) / 4.0;
    for n in [4, 20] {
        let mut hits = [0; 2];
        for _ in 0..1000 {
            let groups = sets(n);
            let blocks: Vec<Vec<f64>> = (0..n).map(|k| groups.iter().map(|g| g[k]).collect()).collect();
            let held = [
                correlation_of_groups(&groups, 0.95).unwrap().holds(truth),
                correlation_of_blocks(&blocks, 0.95).unwrap().holds(of_blocks),
            ];
            hits.iter_mut().zip(held).for_each(|(n, h)| *n += usize::from(h));
        }
        assert!(hits.iter().all(|h| *h >= 905), "{hits:?} of 1000 with {n}");
    }
}
