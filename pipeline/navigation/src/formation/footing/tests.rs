use super::*;
use crate::testing::{drawn, ground, limits, map_of, thesis_costs};

#[test]
fn val_members_stand_only_on_the_ground_of_the_route() {
    let map = drawn(&["...#...", "...#...", "...#..."]);
    let costs = thesis_costs(&map);
    let on = TeamGround::new(ground(&map, &costs));
    let [west_m, wall_m, east_m] = [1, 3, 5].map(|col| map.position_m(map.node(1, col)));
    let footing = Footing::new(&on, &[west_m]);
    assert_eq!([west_m, wall_m, east_m].map(|point_m| footing.holds(point_m)), [true, false, false]);
    // With waypoints on both sides, or without any, both are home; the wall never is.
    for points_m in [&[west_m, east_m][..], &[]] {
        let footing = Footing::new(&on, points_m);
        assert_eq!([west_m, wall_m, east_m].map(|point_m| footing.holds(point_m)), [true, false, true]);
    }
    assert_eq!(footing.node_near(east_m, 1, |_| true), None);
}

/// From 0.1 m east and 0.2 m north of a node, that node is the nearest, then the one north of it.
#[test]
fn val_the_nearest_open_node_is_found() {
    let map = map_of(5, 5, limits(30.0, 30.0), |_, _| 0.0);
    let costs = thesis_costs(&map);
    let on = TeamGround::new(ground(&map, &costs));
    let [x_m, y_m] = map.position_m(map.node(2, 2));
    let footing = Footing::new(&on, &[[x_m, y_m]]);
    let point_m = [x_m + 0.1, y_m + 0.2];
    assert_eq!(footing.node_near(point_m, 1, |_| true), Some(map.node(2, 2)));
    assert_eq!(footing.node_near(point_m, 1, |node_m| node_m != [x_m, y_m]), Some(map.node(1, 2)));
    assert_eq!(footing.node_near(point_m, 1, |_| false), None);
}

#[test]
fn val_a_plateau_that_no_path_leaves_is_not_home() {
    // Two levels, 2 m apart: no step leads from one to the other.
    let map = map_of(4, 8, limits(30.0, 30.0), |_, c| if c < 4 { 0.0 } else { 2.0 });
    let costs = thesis_costs(&map);
    let on = TeamGround::new(ground(&map, &costs));
    let [low_m, high_m] = [1, 6].map(|col| map.position_m(map.node(1, col)));
    let footing = Footing::new(&on, &[low_m]);
    assert!(footing.holds(low_m) && !footing.holds(high_m) && !footing.is_passable(low_m, high_m));
}
