use super::*;

const ROUTE_M: [Vector; 3] = [[0.0, 0.0], [60.0, 0.0], [60.0, 40.0]];

fn drawn(losses: u32, obstacles: u32) -> TeamParameters {
    let parameters = TeamParameters { drawn_losses: losses, drawn_obstacles: obstacles, ..TeamParameters::default() };
    draw(&parameters, &ROUTE_M, 4, &Streams::for_item(1, "navigate", "test"))
}

#[test]
fn prop_requesting_more_does_not_change_earlier_draws() {
    let (few, many) = (drawn(1, 2), drawn(3, 5));
    assert_eq!(few.losses, many.losses[..1]);
    assert_eq!(few.obstacles, many.obstacles[..2]);
    assert_eq!(many.losses.len(), 3);
    let mut members: Vec<u32> = many.losses.iter().map(|loss| loss.member).collect();
    members.sort_unstable();
    members.dedup();
    assert_eq!(members.len(), 3);
    many.check().unwrap();
}

#[test]
fn prop_draws_lie_along_the_route() {
    let many = drawn(3, 200);
    assert_eq!([many.losses.len(), many.obstacles.len()], [3, 200]);
    assert!(many.losses.iter().all(|loss| (10.0..=90.0).contains(&loss.time_s)));
    for obstacle in &many.obstacles {
        obstacle.check().unwrap();
        let [a, b] = [obstacle.points_m[0], obstacle.points_m[1]];
        let middle = scale(add(a, b), 0.5);
        let on_leg = middle[1].abs() < 1e-9 && (0.0..=60.0).contains(&middle[0]);
        let on_other = (middle[0] - 60.0).abs() < 1e-9 && (0.0..=40.0).contains(&middle[1]);
        assert!(on_leg || on_other, "{middle:?}");
        assert!((distance(a, b) - 30.0).abs() < 1e-9);
    }
}

/// An obstacle crosses the route at a right angle, from either side, within 10 s of the leader's passage at 1 m/s, at a quarter to the whole of that
/// speed.
#[test]
fn prop_obstacles_meet_the_leader() {
    let many = drawn(0, 200);
    let mut from_right = 0;
    for obstacle in &many.obstacles {
        let [a, b] = [obstacle.points_m[0], obstacle.points_m[1]];
        let middle = scale(add(a, b), 0.5);
        let (along_m, forward) =
            if middle[0] < 60.0 - 1e-9 { (middle[0], [1.0, 0.0]) } else { (60.0 + middle[1], [0.0, 1.0]) };
        assert!(crate::formation::plane::dot(sub(b, a), forward).abs() < 1e-9, "{obstacle:?}");
        from_right += usize::from(crate::formation::plane::dot(sub(a, middle), to_the_right(forward)) > 0.0);
        assert!((0.25..=1.0).contains(&obstacle.speed_m_s) && (10.0 - 1e-9..=90.0 + 1e-9).contains(&along_m));
        let meets_s = obstacle.start_s + 15.0 / obstacle.speed_m_s;
        // Not before the start of the run.
        assert!(meets_s <= along_m + 10.0 + 1e-9 || obstacle.start_s == 0.0, "{obstacle:?}");
        assert!(meets_s >= along_m - 10.0 - 1e-9, "{obstacle:?}");
        assert!(distance(obstacle.position_m(meets_s), middle) < 1e-9);
    }
    // 200 tosses of a coin: outside 60 to 140 with a probability of 1e-8.
    assert!((60..=140).contains(&from_right), "{from_right}");
}
