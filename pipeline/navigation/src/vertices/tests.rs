use super::*;
use crate::map::SlopeLimits;
use crate::roadmap::Roadmap;
use crate::search::{astar, dijkstra, grid::GridNetwork};
use crate::testing::{NEIGHBOURHOODS, Random, drawn, ends, hills, limits, map_of, rough};
use crate::testing::{ground, thesis_costs};
use sastrugi_numeric::{Geometry, Grid};

fn marked(marks: &[bool]) -> Vec<usize> {
    marks.iter().enumerate().filter(|(_, mark)| **mark).map(|(node, _)| node).collect()
}

#[test]
fn val_flat_ground_has_neither_critical_nor_singular_points() {
    let map = drawn(&["......"; 6]);
    let vertices = Vertices::of(&map, Neighbourhood::Eight, &VertexSettings::default(), &[]);
    assert_eq!(vertices.count(), 0);
}

#[test]
fn val_a_cone_has_one_maximum() {
    let map = map_of(21, 21, limits(60.0, 60.0), |r, c| {
        let [y, x] = [r as f64 - 10.0, c as f64 - 10.0];
        10.0 - 0.5 * (x * x + y * y).sqrt()
    });
    assert_eq!(marked(&critical::marks(&map)), [10 * 21 + 10]);
}

#[test]
fn val_a_pit_is_critical_and_a_shoulder_is_not() {
    let marks = |centre: f64, east: f64| {
        let map = map_of(3, 3, limits(80.0, 80.0), move |r, c| match [r, c] {
            [1, 1] => centre,
            [1, 2] => east,
            _ => 0.0,
        });
        marked(&critical::marks(&map))
    };
    assert_eq!(marks(-1.0, 0.0), [4]);
    assert_eq!(marks(1.0, 0.0), [4]);
    assert!(marks(1.0, 2.0).is_empty());
    // As high as one neighbour, or next to a missing height.
    assert!(marks(1.0, 1.0).is_empty());
    assert!(marks(1.0, f64::NAN).is_empty());
}

#[test]
fn val_a_saddle_is_marked_either_way_round() {
    let saddle = |high: [usize; 2]| {
        map_of(3, 3, limits(80.0, 80.0), move |r, c| match [r, c] {
            [1, 1] => 3.0,
            place if place == high || place == [2 - high[0], 2 - high[1]] => 5.0,
            [1, _] | [_, 1] => 1.0,
            _ => 0.0,
        })
    };
    assert_eq!(marked(&critical::marks(&saddle([0, 1]))), [4]);
    assert_eq!(marked(&critical::marks(&saddle([1, 0]))), [4]);
}

#[test]
fn val_bumps_up_to_the_step_vanish_and_higher_ones_stay() {
    // Three peaks in a row.
    let map = |middle: f64| {
        map_of(3, 9, limits(85.0, 85.0), move |r, c| match [r, c] {
            [1, 2] | [1, 6] => 5.0,
            [1, 4] => 5.0 + middle,
            _ => 0.0,
        })
    };
    let kept = |middle: f64, literal: bool| {
        let map = map(middle);
        let mut marks = critical::marks(&map);
        assert!(marks[13]);
        filter::filter(&map, &mut marks, 1.0, literal);
        marks[13]
    };
    assert_eq!(
        [kept(1.0, false), kept(1.001, false), kept(-1.0, false), kept(-1.5, false)],
        [false, true, false, true]
    );
    // The formula as printed drops the high peak and keeps the low one.
    assert_eq!([kept(1.0, true), kept(1.001, true)], [true, false]);
}

#[test]
fn val_an_isolated_critical_point_stays() {
    let map = map_of(3, 3, limits(85.0, 85.0), |r, c| if [r, c] == [1, 1] { 0.2 } else { 0.0 });
    let mut marks = critical::marks(&map);
    filter::filter(&map, &mut marks, 1.0, false);
    assert_eq!(marked(&marks), [4]);
}

#[test]
fn prop_the_filter_commutes_with_transposing_and_mirroring() {
    let mut random = Random(7);
    for _ in 0..50 {
        let heights: Vec<f64> = (0..13 * 13).map(|_| 4.0 * random.unit()).collect();
        let marks_of = |place: fn(usize, usize) -> usize| {
            let map = map_of(13, 13, limits(85.0, 85.0), |r, c| heights[place(r, c)]);
            let mut marks = critical::marks(&map);
            filter::filter(&map, &mut marks, 1.0, false);
            marks
        };
        let plain = marks_of(|r, c| 13 * r + c);
        for place in
            [|r, c| 13 * c + r, |r, c| 13 * (12 - r) + c, |r, c| 13 * r + 12 - c] as [fn(usize, usize) -> usize; 3]
        {
            let other = marks_of(place);
            (0..169).for_each(|k| assert_eq!(other[k], plain[place(k / 13, k % 13)]));
        }
    }
}

#[test]
fn val_both_sides_of_a_cliff_are_singular_whichever_way_it_blocks() {
    for (up, down) in [(30.0, 80.0), (80.0, 30.0), (30.0, 30.0)] {
        let map = map_of(4, 6, limits(up, down), |_, c| if c < 3 { 0.0 } else { 2.0 });
        let mut marks = vec![false; map.len()];
        singular::mark(&map, &mut marks, Neighbourhood::Four);
        let expected: Vec<usize> = (0..4).flat_map(|r| [6 * r + 2, 6 * r + 3]).collect();
        assert_eq!(marked(&marks), expected);
    }
}

#[test]
fn val_the_rim_of_an_obstacle_is_free_and_the_literal_one_is_not() {
    let map = drawn(&[".....", ".....", "..##.", ".....", "....."]);
    let of = |literal_border: bool| {
        let settings =
            VertexSettings { literal_border, literal_alone: true, repair: false, ..VertexSettings::default() };
        marked(&Vertices::of(&map, Neighbourhood::Four, &settings, &[]).marks)
    };
    assert_eq!(of(false), [6, 7, 8, 9, 11, 14, 16, 17, 18, 19]);
    assert_eq!(of(true), [12, 13]);
}

#[test]
fn val_isolated_points_of_rows_and_columns_are_joined_and_the_listing_joins_none() {
    let map = drawn(&["......"; 6]);
    let mut marks = vec![false; 36];
    // Rows 0, 2 and 5 have one mark each: (0, 1), (2, 4), (5, 3).
    [1, 16, 33].into_iter().for_each(|node| marks[node] = true);
    alone::mark(&map, &mut marks);
    // Rows: (0, 4) above (2, 4), then (2, 3) above (5, 3). Columns with one mark: only 1; 3 and 4 have two.
    assert_eq!(marked(&marks), [1, 4, 15, 16, 33]);
    let settings = VertexSettings { literal_alone: true, repair: false, ..VertexSettings::default() };
    assert_eq!(marked(&Vertices::of(&map, Neighbourhood::Four, &settings, &[1, 16, 33]).marks), [1, 16, 33]);
}

#[test]
fn val_a_blocked_node_is_not_marked_to_join_isolated_points() {
    let mut map = drawn(&["....", "....", "...."]);
    map.block(3);
    let mut marks = vec![false; 12];
    [0, 11].into_iter().for_each(|node| marks[node] = true);
    alone::mark(&map, &mut marks);
    assert!(!marks[3]);
}

#[test]
fn val_the_threshold_marks_every_change_since_the_last_mark() {
    // A ramp of 0.25 m per cell eastward between two marks.
    let map = map_of(2, 17, limits(30.0, 30.0), |_, c| 0.25 * c as f64);
    let mut marks = vec![false; 34];
    [0, 16].into_iter().for_each(|node| marks[node] = true);
    threshold::mark(&map, &mut marks, 1.0);
    assert_eq!(marked(&marks), [0, 4, 8, 12, 16]);
    let mut marks = vec![false; 34];
    [2, 9].into_iter().for_each(|node| marks[node] = true);
    threshold::mark(&map, &mut marks, 1.0);
    assert_eq!(marked(&marks), [2, 6, 9], "nothing beyond the outer marks");
}

#[test]
fn prop_lower_thresholds_have_more_vertices() {
    for (per_million, minor) in [(34.0, 3), (42.0, 6), (145.0, 6)] {
        for seed in 0..3 {
            let map = hills(300, 20.0 * per_million, minor, seed);
            let count = |threshold_m| {
                let settings = VertexSettings { threshold_m, repair: false, ..VertexSettings::default() };
                Vertices::of(&map, Neighbourhood::Four, &settings, &[0, 89_999]).count()
            };
            let counts = [count(None), count(Some(5.0)), count(Some(2.0)), map.len()];
            assert!(counts.is_sorted(), "{counts:?}");
        }
    }
}

/// A maze on every other cell of a square, with some walls removed again.
fn maze(size: usize, openings: usize, random: &mut Random) -> TravelMap {
    let mut map = drawn(&vec![".".repeat(size).as_str(); size]);
    let walls: Vec<u32> = (0..map.len() as u32).filter(|n| map.place(*n).iter().any(|k| k % 2 == 1)).collect();
    walls.into_iter().for_each(|n| map.block(n));
    for _ in 0..openings {
        map.unblock(random.below(map.len() as u64) as u32);
    }
    map
}

#[test]
fn prop_repaired_roadmaps_reach_what_the_ground_reaches() {
    let mut random = Random(8);
    let (mut reached, mut apart) = (0, 0);
    for k in 0..500 {
        let map = match k % 3 {
            0 => maze(15, 60 + k / 3, &mut random),
            1 => rough(14, 14, 0.25, 0.0, &mut random),
            // Steep ground, many of whose steps are allowed in one direction only.
            _ => rough(14, 14, 0.05, 1.4, &mut random),
        };
        let Some([start, goal]) = ends(&map, &mut random) else { continue };
        let costs = thesis_costs(&map);
        let ground = ground(&map, &costs);
        for neighbourhood in NEIGHBOURHOODS {
            let vertices = Vertices::of(&map, neighbourhood, &VertexSettings::default(), &[start, goal]);
            let roadmap = Roadmap::new(ground, &vertices.marks, neighbourhood);
            let found = astar::search(&roadmap, roadmap.vertex(start).unwrap(), roadmap.vertex(goal).unwrap());
            let by_cells = dijkstra::costs_from(&GridNetwork { ground, neighbourhood }, start)[goal as usize];
            assert_eq!(found.is_some(), by_cells.is_finite(), "map {k}, {neighbourhood:?}");
            match found {
                Some(found) => {
                    reached += 1;
                    assert!(found.cost >= by_cells * (1.0 - 1e-12));
                }
                None => apart += 1,
            }
        }
    }
    assert!(reached > 100 && apart > 100, "{reached} {apart}");
}

#[test]
fn val_repair_joins_marks_that_share_no_line() {
    let map = drawn(&["......"; 6]);
    let of = |repair: bool| {
        let settings = VertexSettings { repair, literal_alone: true, ..VertexSettings::default() };
        Vertices::of(&map, Neighbourhood::Four, &settings, &[0, 35])
    };
    assert_eq!((of(false).count(), of(false).repaired), (2, 0));
    assert_eq!((of(true).count(), of(true).repaired), (3, 1), "one corner");
}

#[test]
fn val_settings_out_of_range_are_refused() {
    let key = |settings: VertexSettings| settings.check().unwrap_err().key;
    let plain = VertexSettings::default();
    assert_eq!(key(VertexSettings { step_over_m: -1.0, ..plain }), "step_over_m");
    assert_eq!(key(VertexSettings { threshold_m: Some(0.0), ..plain }), "threshold_m");
    assert_eq!(key(VertexSettings { threshold_m: Some(f64::NAN), ..plain }), "threshold_m");
}

#[test]
fn val_nodes_without_height_are_never_vertices() {
    let values = (0..25).map(|k| if k == 12 { f64::NAN } else { 0.1 * (k % 3) as f64 }).collect();
    let map =
        TravelMap::new(Grid::new(Geometry::square(5, 5, 1.0), values), SlopeLimits::new(30.0, 30.0).unwrap()).unwrap();
    let settings = VertexSettings { threshold_m: Some(0.05), ..VertexSettings::default() };
    assert!(!Vertices::of(&map, Neighbourhood::Eight, &settings, &[0, 24]).marks[12]);
}
