use super::*;

#[test]
fn val_an_obstacle_goes_along_its_line_and_stands() {
    let points_m = vec![[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]];
    let obstacle = MovingObstacle { points_m, speed_m_s: 2.0, radius_m: 1.0, start_s: 1.0 };
    obstacle.check().unwrap();
    for (time_s, expected_m) in
        [(0.0, [0.0, 0.0]), (1.5, [1.0, 0.0]), (3.0, [3.0, 1.0]), (4.5, [3.0, 4.0]), (9.0, [3.0, 4.0])]
    {
        assert_eq!(obstacle.position_m(time_s), expected_m, "{time_s} s");
    }
    assert_eq!(obstacle.end_s(), 4.5);
}

#[test]
fn val_wrong_obstacles_are_refused() {
    let right = MovingObstacle { points_m: vec![[0.0, 0.0]], speed_m_s: 1.0, radius_m: 0.5, start_s: 0.0 };
    assert!(right.check().is_ok());
    for (wrong, key) in [
        (MovingObstacle { points_m: Vec::new(), ..right.clone() }, "points_m"),
        (MovingObstacle { points_m: vec![[f64::NAN, 0.0]], ..right.clone() }, "points_m"),
        (MovingObstacle { speed_m_s: 0.0, ..right.clone() }, "speed_m_s"),
        (MovingObstacle { radius_m: -1.0, ..right.clone() }, "radius_m"),
        (MovingObstacle { start_s: -1.0, ..right }, "start_s"),
    ] {
        assert_eq!(wrong.check().unwrap_err().key, key);
    }
}
