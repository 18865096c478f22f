use super::*;
use crate::formation::footing::TeamGround;
use crate::map::TravelMap;
use crate::testing::{drawn, ground, limits, map_of, thesis_costs};

/// The detour between two cells, from its start on; `None` if there is none.
fn found(map: &TravelMap, from: [usize; 2], to: [usize; 2], discs: &[Disc]) -> Option<Vec<Vector>> {
    let costs = thesis_costs(map);
    let on = TeamGround::new(ground(map, &costs));
    let [from_m, to_m] = [from, to].map(|[row, col]| map.position_m(map.node(row, col)));
    let footing = Footing::new(&on, &[from_m]);
    let points_m = detour(&footing, from_m, to_m, discs)?;
    assert_eq!(points_m.last(), Some(&to_m));
    let all = [&[from_m], points_m.as_slice()].concat();
    assert!(all.windows(2).all(|leg| footing.is_passable(leg[0], leg[1])), "{all:?}");
    Some(all)
}

fn length_m(points_m: &[Vector]) -> f64 {
    points_m.windows(2).map(|leg| distance(leg[0], leg[1])).sum()
}

#[test]
fn val_an_open_line_needs_no_detour() {
    let map = map_of(9, 9, limits(30.0, 30.0), |_, _| 0.0);
    assert_eq!(found(&map, [2, 1], [6, 7], &[]).unwrap().len(), 2);
}

/// Around the end of a wall, no shorter than past the corners of its last cell and no longer than by steps.
#[test]
fn val_a_detour_leads_around_a_wall() {
    let map = drawn(&[
        "....#....",
        "....#....",
        "....#....",
        "....#....",
        "....#....",
        "....#....",
        "....#....",
        ".........",
        ".........",
    ]);
    let length_m = length_m(&found(&map, [2, 1], [2, 7], &[]).unwrap());
    let (past_corners_m, by_steps_m) = (2.0 * libm::hypot(2.5, 4.5) + 1.0, 2.0 * (2.0 * 2f64.sqrt() + 3.0) + 2.0);
    assert!((past_corners_m..=by_steps_m + 1e-9).contains(&length_m), "{past_corners_m} {length_m} {by_steps_m}");
}

#[test]
fn val_a_detour_keeps_clear_of_discs() {
    let map = map_of(11, 11, limits(30.0, 30.0), |_, _| 0.0);
    let disc = Disc { position_m: map.position_m(map.node(5, 5)), radius_m: 2.0 };
    let points_m = found(&map, [5, 1], [5, 9], &[disc]).unwrap();
    assert!(points_m.len() > 2);
    for leg in points_m.windows(2) {
        let least_m = closest_approach(sub(leg[0], disc.position_m), sub(leg[1], leg[0]));
        assert!(least_m >= 2.0, "{least_m}: {points_m:?}");
    }
    // No longer than by steps: two diagonals aside, four cells along, two diagonals back.
    assert!(length_m(&points_m) <= 4.0 + 4.0 * 2f64.sqrt() + 1e-9, "{points_m:?}");
}

#[test]
fn val_no_detour_leads_into_a_closed_room() {
    let map = drawn(&[".......", ".#####.", ".#...#.", ".#...#.", ".#####.", "......."]);
    assert_eq!(found(&map, [0, 0], [2, 3], &[]), None);
}
