use super::*;
use crate::formation::footing::TeamGround;
use crate::formation::shape::{Pattern, SlotParameters};
use crate::map::TravelMap;
use crate::testing::{Random, drawn, ground, hills, limits, map_of, rough, thesis_costs};

fn formation(pattern: Pattern) -> Formation {
    Formation::new(&pattern.slots(4, 10.0), 0.5).unwrap()
}

fn placed(map: &TravelMap, formation: &Formation, route_m: &[Vector], discs: &[Disc]) -> Vec<Placement> {
    let costs = thesis_costs(map);
    let on = TeamGround::new(ground(map, &costs));
    let footing = Footing::new(&on, route_m);
    Placer { footing: &footing, formation, route_m, radius_m: 0.5, margin_m: 0.1, discs }.all()
}

fn level(rows: usize, cols: usize) -> TravelMap {
    map_of(rows, cols, limits(30.0, 30.0), |_, _| 0.0)
}

#[test]
fn val_open_ground_reproduces_the_offsets() {
    let map = level(121, 121);
    for pattern in Pattern::ALL {
        for k in 0..36 {
            let turn = f64::from(k) * std::f64::consts::PI / 18.0;
            let forward = [libm::cos(turn), libm::sin(turn)];
            let route_m = [[60.5, 60.5], add([60.5, 60.5], scale(forward, 20.0))];
            let formation = formation(pattern);
            let placements = placed(&map, &formation, &route_m, &[]);
            assert_eq!((placements[0].scale, placements[0].squeezed), ([1.0, 1.0], false));
            let right = to_the_right(forward);
            let leader_m = placements[0].targets_m[0];
            for (slot, target_m) in formation.slots().iter().zip(&placements[0].targets_m) {
                let [depth_m, width_m] = slot.from_leader_m;
                let expected_m = add(leader_m, sub(scale(right, width_m), scale(forward, depth_m)));
                assert!(distance(*target_m, expected_m) < 1e-9, "{pattern:?} {k}");
            }
            // The middle of the box's front is at the waypoint.
            let [a, b, ..] = placements[0].corners_m;
            assert!(distance(scale(add(a, b), 0.5), route_m[0]) < 1e-9);
        }
    }
}

#[test]
fn val_the_last_waypoint_keeps_the_heading() {
    let placements = placed(&level(81, 81), &formation(Pattern::Column), &[[20.5, 40.5], [60.5, 40.5]], &[]);
    assert_eq!(placements[1].targets_m[1], [50.5, 40.5]);
}

/// Level ground with free rows `free`, counted from the north.
fn corridor(free: std::ops::Range<usize>) -> TravelMap {
    let mut map = level(101, 101);
    let walls: Vec<u32> = (0..map.len() as u32).filter(|n| !free.contains(&map.place(*n)[0])).collect();
    walls.into_iter().for_each(|node| map.block(node));
    map
}

#[test]
fn val_a_corridor_compresses_the_width() {
    // Free rows 40 to 55, which leave 15 m between the outer ones for the 30 m of the line.
    let map = corridor(40..56);
    let middle_m = map.position_m(map.node(48, 60));
    let route_m = [middle_m, add(middle_m, [20.0, 0.0])];
    let placement = &placed(&map, &formation(Pattern::Line), &route_m, &[])[0];
    assert_eq!(placement.scale, [0.5, 1.0]);
    assert!(!placement.squeezed);
    let mut norths: Vec<f64> = placement.targets_m.iter().map(|target| target[1]).collect();
    norths.sort_by(f64::total_cmp);
    let rows = [55, 50, 45, 40].map(|row| map.position_m(map.node(row, 60))[1]);
    assert_eq!(norths, rows);
}

#[test]
fn val_a_wall_behind_compresses_the_depth() {
    let map = level(41, 41);
    // 10 m of the column's 30 m lie behind a start that is 10 cells from the edge.
    let start_m = map.position_m(map.node(20, 10));
    let placement = &placed(&map, &formation(Pattern::Column), &[start_m, add(start_m, [20.0, 0.0])], &[])[0];
    assert!((placement.scale[1] - 1.0 / 3.0).abs() < 1e-12);
    assert!(distance(placement.targets_m[3], sub(start_m, [10.0, 0.0])) < 1e-9);
}

#[test]
fn val_an_isolated_rock_moves_one_member() {
    // The rock is where slot 3 of the wedge would be; the other slots stay where they are in open ground.
    let mut map = level(121, 121);
    let waypoint_m = map.position_m(map.node(60, 60));
    let route_m = [sub(waypoint_m, [30.0, 0.0]), waypoint_m, add(waypoint_m, [20.0, 0.0])];
    let open = placed(&map, &formation(Pattern::Wedge), &route_m, &[]).remove(1);
    map.block(map.node(70, 50));
    let placement = placed(&map, &formation(Pattern::Wedge), &route_m, &[]).remove(1);
    assert_eq!(placement.targets_m[2], sub(waypoint_m, [10.0, 0.0]));
    for k in [0, 1, 3] {
        assert_eq!(placement.targets_m[k], open.targets_m[k]);
    }
}

#[test]
fn val_targets_that_collapse_are_pushed_back_along_the_route() {
    // A passage of one cell: the four members of a line stand one behind another.
    let map = corridor(50..51);
    let at = |col: usize| map.position_m(map.node(50, col));
    let placements = placed(&map, &formation(Pattern::Line), &[at(40), at(60), at(80)], &[]);
    let eastings: Vec<f64> = placements[1].targets_m.iter().map(|target| at(60)[0] - target[0]).collect();
    assert!(!placements[1].squeezed);
    assert_eq!(eastings.len(), 4);
    for pair in eastings.windows(2) {
        let gap_m = pair[1] - pair[0];
        assert!((1.1 - 1e-9..1.4).contains(&gap_m), "{gap_m}");
    }
}

#[test]
fn val_targets_keep_clear_of_lost_members() {
    let map = level(81, 81);
    let waypoint_m = map.position_m(map.node(40, 40));
    let route_m = [sub(waypoint_m, [30.0, 0.0]), waypoint_m];
    let disc = Disc { position_m: sub(waypoint_m, [10.2, 0.0]), radius_m: 0.5 };
    let placement = placed(&map, &formation(Pattern::Column), &route_m, &[disc]).remove(1);
    assert!(placement.targets_m.iter().all(|target| distance(*target, disc.position_m) >= 1.1 - 1e-9));
    assert_eq!(placement.targets_m[0], waypoint_m);
}

#[test]
fn val_a_waypoint_without_room_is_squeezed() {
    // A closed pocket of two cells.
    let map = drawn(&["######", "#..###", "######"]);
    let [a, b] = [1, 2].map(|col| map.position_m(map.node(1, col)));
    let placements = placed(&map, &formation(Pattern::Column), &[a, b], &[]);
    assert!(placements[1].squeezed);
    let alone = Formation::new(
        &[SlotParameters { id: 1, predecessor: None, depth_m: 0.0, width_m: 0.0, team: Vec::new() }],
        0.5,
    );
    assert!(!placed(&map, &alone.unwrap(), &[a, b], &[])[1].squeezed);
}

/// On any ground, members can stand on every target, and the targets of a waypoint that is not squeezed keep their separation.
#[test]
fn prop_targets_are_on_the_ground_and_apart() {
    let mut random = Random(7);
    let maps = (0..10).map(|seed| match seed % 2 {
        0 => hills(120, 300.0, 8, seed),
        _ => rough(120, 120, 0.15, 0.5, &mut random),
    });
    let mut unsqueezed = 0;
    for map in maps.collect::<Vec<_>>() {
        let costs = thesis_costs(&map);
        let on = TeamGround::new(ground(&map, &costs));
        let settings = crate::RouteSettings { method: crate::Method::GridAstar, ..Default::default() };
        for _ in 0..4 {
            let Some([start, goal]) = crate::testing::ends(&map, &mut random) else { continue };
            let Ok(route) = crate::plan(&on.ground(), &settings, map.place(start), map.place(goal)) else { continue };
            let route_m: Vec<Vector> = route.smoothed.iter().map(|node| map.position_m(*node)).collect();
            for pattern in Pattern::ALL {
                let footing = Footing::new(&on, &route_m);
                let formation = formation(pattern);
                let placer = Placer {
                    footing: &footing,
                    formation: &formation,
                    route_m: &route_m,
                    radius_m: 0.5,
                    margin_m: 0.1,
                    discs: &[],
                };
                for placement in placer.all().into_iter().filter(|placement| !placement.squeezed) {
                    unsqueezed += 1;
                    for (k, target_m) in placement.targets_m.iter().enumerate() {
                        assert!(map.height_at_m(map.point_at(*target_m)).is_some());
                        let others = &placement.targets_m[..k];
                        assert!(others.iter().all(|other| distance(*other, *target_m) >= 1.1 - 1e-9));
                    }
                }
            }
        }
    }
    assert!(unsqueezed > 300, "{unsqueezed}");
}
