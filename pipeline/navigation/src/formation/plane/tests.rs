use super::*;

#[test]
fn val_turns_are_to_the_left() {
    assert_eq!(turned([3.0, 4.0], 2), [-4.0, 3.0]);
    assert_eq!(turned([3.0, 4.0], -2), [4.0, -3.0]);
    assert_eq!(turned([3.0, 4.0], 4), [-3.0, -4.0]);
    assert_eq!(to_the_right([3.0, 4.0]), [4.0, -3.0]);
    for eighths in -9..=9 {
        let turn = f64::from(eighths) * std::f64::consts::FRAC_PI_4;
        let expected = [libm::cos(turn), libm::sin(turn)];
        assert!(distance(turned([1.0, 0.0], eighths), expected) < 1e-12, "{eighths}");
    }
}

#[test]
fn val_only_displacements_have_a_direction() {
    assert!(direction([3.0, 4.0]).is_some_and(|unit| distance(unit, [0.6, 0.8]) < 1e-15));
    for none in [[0.0, 0.0], [f64::INFINITY, 0.0], [f64::NAN, 1.0]] {
        assert_eq!(direction(none), None, "{none:?}");
    }
}

#[test]
fn val_the_closest_approach_lies_on_the_way() {
    for (offset, motion, least) in [
        ([3.0, 4.0], [0.0, 0.0], 5.0),
        // Past the origin, up to 4 short of it, and away from it.
        ([-10.0, 2.0], [20.0, 0.0], 2.0),
        ([-10.0, 0.0], [6.0, 0.0], 4.0),
        ([5.0, 0.0], [3.0, 0.0], 5.0),
    ] {
        assert_eq!(closest_approach(offset, motion), least, "{offset:?} by {motion:?}");
    }
}
