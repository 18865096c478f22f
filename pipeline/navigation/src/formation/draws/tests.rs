use super::*;

const ROUTE_M: [Vector; 3] = [[0.0, 0.0], [60.0, 0.0], [60.0, 40.0]];

fn drawn(losses: u32, obstacles: u32) -> TeamParameters {
    let parameters = TeamParameters { drawn_losses: losses, drawn_obstacles: obstacles, ..TeamParameters::default() };
    draw(&parameters, &ROUTE_M, 4, &Streams::for_item(1, "navigate", "test"))
}

#[test]
fn prop_asking_for_more_changes_none_before() {
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
