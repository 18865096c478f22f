use super::*;
use sastrugi_numeric::Streams;

fn stream(purpose: &str) -> Stream {
    Streams::for_seed(1, "power-test").stream(purpose)
}

/// Against statsmodels 0.15.0 (`tests/statistical/nested_tests.py`): TTestIndPower and TTestPower for the standardised
/// difference of terrain means. The rank tests are 95.5 % as efficient for normal values (J. Hodges and E. Lehmann,
/// 1956), which costs at most 3 points of power, and having only 199 arrangements costs another; 5 standard errors of the simulation
/// are 8 points (false alarm 6e-7 each).
#[test]
fn stat_power_is_that_of_the_t_test() {
    let mut s = stream("t-test");
    for (difference, between, within, n, m, apart, pairs) in [
        (10.0, 150.0, 1600.0, 20, 20, 0.528_866, 0.798_741),
        (10.0, 150.0, 1600.0, 40, 5, 0.530_897, 0.811_873),
        (15.0, 60.0, 1900.0, 10, 40, 0.863_968, 0.981_604),
    ] {
        let target = Target { difference, between, within };
        let found = [target.of_groups(n, m, 0.05, &mut s), target.of_pairs(n, m, 0.05, &mut s)];
        for (power, expected) in found.into_iter().zip([apart, pairs]) {
            let error = (expected * (1.0 - expected) / SIMULATIONS as f64).sqrt();
            assert!(power < expected + 5.0 * error && power > expected - 0.04 - 5.0 * error, "{power} {expected}");
        }
    }
}

/// Null: no difference, so the power is the level. 4 cells of 1000 simulations: 22 to 89 of 1000 at 0.05, false alarm
/// 2e-6 and 1e-7 (binomial) each.
#[test]
fn stat_power_without_a_difference_is_the_level() {
    let mut s = stream("level");
    let target = Target { difference: 0.0, between: 1.0, within: 4.0 };
    for n in [10, 25] {
        for power in [target.of_groups(n, 10, 0.05, &mut s), target.of_pairs(n, 10, 0.05, &mut s)] {
            assert!((0.022..=0.089).contains(&power), "{n}: {power}");
        }
    }
}

#[test]
fn val_limits() {
    let mut s = stream("limits");
    let sure = Target { difference: 1.0, between: -1.0, within: 0.0 };
    assert_eq!((sure.of_groups(10, 1, 0.05, &mut s), sure.of_pairs(10, 1, 0.05, &mut s)), (1.0, 1.0));
    // Four terrains cannot give p <= 0.05: the smallest is 2 / 6.
    assert_eq!(sure.of_groups(2, 5, 0.05, &mut s), 0.0);
    assert_eq!((sure.of_groups(0, 0, 0.05, &mut s), sure.of_pairs(0, 0, 0.05, &mut s)), (0.0, 0.0));
}
