use super::*;

#[test]
fn val_errors_have_their_signs() {
    // The predecessor heads north; the slot is 10 m behind it and 5 m to the right.
    let errors = |follower_m| errors_m([0.0, 0.0], [0.0, 1.0], follower_m, [10.0, 5.0]);
    assert_eq!(errors([5.0, -10.0]), [0.0, 0.0]);
    assert_eq!(errors([5.0, -12.0]), [2.0, 0.0]);
    assert_eq!(errors([8.0, -10.0]), [0.0, 3.0]);
    assert_eq!(errors([5.0, -9.0]), [-1.0, 0.0]);
    // The same heading east: the slot is to the west and to the south.
    let errors = |follower_m| errors_m([0.0, 0.0], [1.0, 0.0], follower_m, [10.0, 5.0]);
    assert_eq!(errors([-10.0, -5.0]), [0.0, 0.0]);
    assert_eq!(errors([-12.0, -5.0]), [2.0, 0.0]);
    assert_eq!(errors([-10.0, -8.0]), [0.0, 3.0]);
}

#[test]
fn val_shares_and_means_are_over_steps_and_followers() {
    let mut metrics = Metrics::of(3);
    for errors_m in [[1.0, -2.0], [-3.0, 0.0], [5.0, 0.0]] {
        metrics.followers[1].add(errors_m, 10.0);
    }
    metrics.followers[2].add([0.0, 6.0], 10.0);
    assert_eq!(metrics.mean_errors_m(), [9.0 / 4.0, 8.0 / 4.0]);
    assert_eq!(metrics.worst_errors_m(), [3.0, 6.0]);
    assert_eq!(metrics.shares(), [0.25, 0.5]);
    assert_eq!(metrics.followers[1].largest_m, [5.0, 2.0]);
    assert!(Metrics::of(1).mean_errors_m()[0].is_nan() && Metrics::of(1).worst_errors_m()[0].is_nan());
}
