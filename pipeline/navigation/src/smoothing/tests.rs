use super::*;
use crate::map::{Neighbourhood, TravelMap};
use crate::search::astar;
use crate::search::grid::GridNetwork;
use crate::testing::{NEIGHBOURHOODS, Random, drawn, ends, ground, hills, rough, thesis_costs};

fn path_of(map: &TravelMap, neighbourhood: Neighbourhood, [start, goal]: [Node; 2]) -> Option<Vec<Node>> {
    let costs = thesis_costs(map);
    astar::search(&GridNetwork { ground: ground(map, &costs), neighbourhood }, start, goal).map(|found| found.path)
}

#[test]
fn val_on_level_free_ground_the_smoothed_path_is_the_straight_line() {
    let map = drawn(&[".".repeat(40).as_str(); 30]);
    let costs = thesis_costs(&map);
    let mut random = Random(40);
    for _ in 0..50 {
        let ends = ends(&map, &mut random).unwrap();
        let path = path_of(&map, Neighbourhood::Four, ends).unwrap();
        let (kept, total) = smoothed(&ground(&map, &costs), &path, 0.0).unwrap();
        assert_eq!(kept, ends);
        let [a, b] = ends.map(|node| map.point(node));
        let straight_m = ((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1])).sqrt();
        assert!((total.cost - straight_m).abs() < 1e-9);
        let ratio = (path.len() - 1) as f64 / total.cost;
        assert!((1.0..=2f64.sqrt() + 1e-9).contains(&ratio), "{ratio}");
    }
}

#[test]
fn prop_smoothing_raises_no_cost_and_every_leg_is_passable() {
    let mut random = Random(41);
    let mut smoothed_some = 0;
    for k in 0..60 {
        let map = if k % 2 == 0 { rough(20, 20, 0.1, 0.4, &mut random) } else { hills(60, 2000.0, 4, k) };
        let Some(ends) = ends(&map, &mut random) else { continue };
        let costs = thesis_costs(&map);
        let ground = ground(&map, &costs);
        for neighbourhood in NEIGHBOURHOODS {
            let Some(path) = path_of(&map, neighbourhood, ends) else { continue };
            let before = ground.path(&path).unwrap();
            let (kept, total) = smoothed(&ground, &path, 0.0).unwrap();
            assert!(total.cost <= before.cost * (1.0 + 1e-12));
            assert_eq!(ground.path(&kept).unwrap(), total);
            assert_eq!((kept.first(), kept.last()), (path.first(), path.last()));
            smoothed_some += usize::from(kept.len() < path.len());
            let tolerance = 0.5;
            let (fewer, total) = smoothed(&ground, &path, tolerance).unwrap();
            let removed = (path.len() - fewer.len()) as f64;
            assert!(total.cost <= before.cost * (1.0 + 1e-12) + tolerance * removed);
        }
    }
    assert!(smoothed_some > 40, "{smoothed_some}");
}

#[test]
fn val_collinear_waypoints_are_removed_despite_rounding() {
    // 0.1 m per cell: sums of steps differ from the line by a few units in the last place.
    let heights = sastrugi_numeric::Grid::filled(sastrugi_numeric::Geometry::square(2, 200, 0.1), 7.3);
    let map = TravelMap::new(heights, crate::testing::limits(30.0, 30.0)).unwrap();
    let costs = thesis_costs(&map);
    let path: Vec<Node> = (0..200).collect();
    assert_eq!(smoothed(&ground(&map, &costs), &path, 0.0).unwrap().0, [0, 199]);
}

#[test]
fn val_an_impassable_path_is_not_smoothed() {
    let map = drawn(&[".#.", "..."]);
    let costs = thesis_costs(&map);
    assert_eq!(smoothed(&ground(&map, &costs), &[0, 2], 0.0), None);
    assert_eq!(smoothed(&ground(&map, &costs), &[0], 0.0).unwrap().0, [0]);
}
