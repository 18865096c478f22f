use super::*;
use crate::formation::shape::Pattern;

const LIMITS: SpeedLimits =
    SpeedLimits { mean_m_s: 1.0, min_m_s: 0.25, max_m_s: 1.5, accelerate_m_s2: 0.5, slow_m_s2: 0.5 };
const BANDS: Bands = Bands { tolerance: 0.2, spacing_m: 10.0, literal: false };

/// Distance of two members in column after a minute on a line, from their distance at the start, m.
fn distance_after_a_minute(bands: Bands, start_m: f64) -> f64 {
    let pair = Formation::new(&Pattern::Column.slots(2, 10.0), 0.5).unwrap();
    let (mut at_m, mut speeds) = ([0.0, -start_m], [1.0; 2]);
    for _ in 0..600 {
        let requests = bands.requests(&pair, |slot| [at_m[slot], 0.0], |_| [1.0, 0.0]);
        for k in 0..2 {
            speeds[k] = LIMITS.tuned(speeds[k], requests[k], 0.1);
            at_m[k] += speeds[k] * 0.1;
        }
    }
    at_m[0] - at_m[1]
}

#[test]
fn val_a_lagging_member_closes_up_only_as_corrected() {
    assert!(distance_after_a_minute(BANDS, 13.0) <= 12.0);
    // As printed, it falls behind until its predecessor is slowed down.
    assert!(distance_after_a_minute(Bands { literal: true, ..BANDS }, 13.0) >= 13.0);
    assert!(distance_after_a_minute(BANDS, 16.0) <= 12.0);
    assert!((8.0..=12.0).contains(&distance_after_a_minute(BANDS, 5.0)));
}

#[test]
fn val_bands_are_shares_of_the_depth_and_at_least_of_the_spacing() {
    use Request::{Faster, Mean, None, Slower};
    for (distance_m, depth_m, expected) in [
        (7.9, 10.0, [Slower, None]),
        (8.1, 10.0, [Mean, Mean]),
        (11.9, 10.0, [Mean, Mean]),
        (12.1, 10.0, [Faster, None]),
        (14.1, 10.0, [Faster, Slower]),
        // Side by side, the distance has a sign.
        (-2.1, 0.0, [Slower, None]),
        (1.9, 0.0, [Mean, Mean]),
        (2.1, 0.0, [Faster, None]),
        (4.1, 0.0, [Faster, Slower]),
    ] {
        assert_eq!(BANDS.of_follower(distance_m, depth_m), expected, "{distance_m} of {depth_m}");
    }
}

#[test]
fn val_the_slower_request_counts() {
    let [none, mean, faster, slower] = [Request::None, Request::Mean, Request::Faster, Request::Slower];
    assert!(slower > faster && faster > mean && mean > none);
    for (request, expected) in [(none, 0.9), (mean, 0.95), (faster, 0.95), (slower, 0.85)] {
        assert!((LIMITS.tuned(0.9, request, 0.1) - expected).abs() < 1e-12, "{request:?}");
    }
    assert_eq!(LIMITS.tuned(1.48, faster, 0.1), 1.5);
    assert_eq!(LIMITS.tuned(0.26, slower, 0.1), 0.25);
    assert_eq!(LIMITS.tuned(1.02, mean, 0.1), 1.0);
}

/// A wedge of three: one follower lags by four metres and more, the other is in its band or too close. The leader gets the request that counts.
#[test]
fn val_of_several_requests_the_slowest_counts() {
    use Request::{Faster, Mean, None, Slower};
    let wedge = Formation::new(&Pattern::Wedge.slots(3, 10.0), 0.5).unwrap();
    let requests = |behind_m: [f64; 2]| {
        let at_m = [[0.0, 0.0], [-behind_m[0], 10.0], [-behind_m[1], -10.0]];
        BANDS.requests(&wedge, |slot| at_m[slot], |_| [1.0, 0.0])
    };
    assert_eq!(requests([10.0, 10.0]), [Mean, Mean, Mean]);
    assert_eq!(requests([14.1, 10.0]), [Slower, Faster, Mean]);
    assert_eq!(requests([10.0, 14.1]), [Slower, Mean, Faster]);
    assert_eq!(requests([7.9, 10.0]), [Mean, Slower, Mean]);
    assert_eq!(requests([7.9, 12.1]), [None, Slower, Faster]);
}
