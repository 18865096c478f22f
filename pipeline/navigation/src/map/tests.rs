use super::*;
use crate::testing::{Random, drawn, limits, map_of, may_step_by_definition, rough};
use sastrugi_numeric::Geometry;

fn refused(rows: usize, cols: usize, cell: f64, heights: Vec<f64>) -> String {
    let geometry = Geometry::square(rows, cols, cell);
    TravelMap::new(Grid { geometry, values: heights }, limits(30.0, 30.0)).unwrap_err().to_string()
}

#[test]
fn val_maps_that_cannot_be_planned_on_are_refused() {
    assert_eq!(
        refused(1, 3, 1.0, vec![0.0; 3]),
        "plan on 1 x 3 cells: a map needs at least 2 x 2 and at most 1073741824 in all"
    );
    assert_eq!(
        refused(2, 2, 1.0, vec![0.0, 0.0, f64::INFINITY, 0.0]),
        "plan on a height of inf m (row 1, column 0): heights must be finite; cells without data are NaN"
    );
    assert!(refused(2, 2, 0.0, vec![0.0; 4]).contains("cells of 0 m by 0 m"));
    assert!(refused(2, 2, 1.0, vec![0.0; 3]).contains("3 heights for 2 x 2 cells"));
}

#[test]
fn val_slope_limits_lie_between_0_and_90_degrees() {
    for deg in [0.0, 90.0, -1.0, f64::NAN] {
        let error = SlopeLimits::new(30.0, deg).unwrap_err();
        assert_eq!(error.key, "max_down_deg");
        assert!(error.message.contains(&deg.to_string()), "{}", error.message);
    }
}

#[test]
fn val_the_directions_know_their_places() {
    for (k, direction) in Direction::ALL.into_iter().enumerate() {
        assert_eq!(direction.index(), k);
        assert_eq!(direction.back().back(), direction);
    }
    assert_eq!(Direction { rows: 0, cols: 0 }.index(), 8);
    assert_eq!(Direction { rows: 2, cols: 0 }.index(), 8);
    assert_eq!(Direction { rows: i8::MIN, cols: 1 }.index(), 8);
}

#[test]
fn prop_the_table_of_steps_agrees_with_their_definition_after_any_edits() {
    let mut random = Random(1);
    for _ in 0..40 {
        let mut map = rough(7, 9, 0.15, 1.1, &mut random);
        for _ in 0..30 {
            let node = random.below(map.len() as u64) as Node;
            match random.below(4) {
                0 => map.block(node),
                1 => map.unblock(node),
                2 => map.set_height_m(node, random.unit()).unwrap(),
                _ => map.set_height_m(node, if random.below(3) == 0 { f64::NAN } else { 0.5 }).unwrap(),
            }
        }
        for node in 0..map.len() as Node {
            for direction in Direction::ALL {
                let expected = may_step_by_definition(&map, node, direction);
                assert_eq!(map.accessible(node, direction).is_some(), expected, "{node} {direction:?}");
            }
        }
    }
}

#[test]
fn val_heights_decide_what_may_be_freed() {
    let mut map = map_of(3, 3, limits(30.0, 30.0), |r, c| if [r, c] == [1, 1] { f64::NAN } else { 0.0 });
    assert!(map.is_blocked(4));
    map.unblock(4);
    assert!(map.is_blocked(4), "a cell without height stays blocked");
    map.set_height_m(4, 0.1).unwrap();
    map.unblock(4);
    assert!(!map.is_blocked(4) && map.accessible(4, Direction::ALL[0]) == Some(5));
    assert!(map.set_height_m(4, f64::NEG_INFINITY).unwrap_err().to_string().contains("row 1, column 1"));
}

#[test]
fn val_a_diagonal_does_not_cut_the_corner_of_a_blocked_cell() {
    let map = drawn(&[".#", ".."]);
    let north_east = Direction { rows: -1, cols: 1 };
    assert_eq!(map.accessible(2, north_east), None);
    assert_eq!(map.accessible(0, Direction { rows: 1, cols: 1 }), None);
    assert_eq!(map.accessible(0, Direction { rows: 1, cols: 0 }), Some(2));
}

#[test]
fn val_a_diagonal_over_a_ridge_is_refused_though_its_ends_are_level() {
    let map = map_of(2, 2, limits(30.0, 30.0), |r, c| if r == c { 0.0 } else { 2.0 });
    assert_eq!(map.accessible(0, Direction { rows: 1, cols: 1 }), None);
    assert_eq!(map.accessible(1, Direction { rows: 1, cols: -1 }), None);
}

#[test]
fn val_lines_slip_between_no_two_diagonal_blocked_cells() {
    let map = drawn(&["..#", ".#.", "..."]);
    assert!(!map.is_free_along([2.0, 0.0], [0.0, 1.0]), "touches the corner of the centre");
    assert!(!map.is_free_along([1.0, 2.0], [0.0, 1.0]), "between two blocked cells");
    assert!(map.is_free_along([2.0, 2.0], [1.0, 2.0]));
    assert!(!map.is_free_along([0.0, 0.0], [0.0, 3.0]), "beyond the map");
    assert!(!map.is_free_along([f64::NAN, 0.0], [0.0, 0.0]));
}

/// Whether a line between two nodes comes within `slack` of a cell: the slow and obvious way, by clipping.
fn touches(start: Point, end: Point, cell: [usize; 2], slack: f64) -> bool {
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        let (low, high) = (cell[axis] as f64 - 0.5 - slack, cell[axis] as f64 + 0.5 + slack);
        let span = end[axis] - start[axis];
        if span == 0.0 {
            if start[axis] < low || start[axis] > high {
                return false;
            }
            continue;
        }
        let ends = [(low - start[axis]) / span, (high - start[axis]) / span];
        (from, to) = (from.max(ends[0].min(ends[1])), to.min(ends[0].max(ends[1])));
    }
    from <= to
}

#[test]
fn prop_free_lines_touch_no_blocked_cell() {
    let mut random = Random(2);
    for _ in 0..2000 {
        let map = rough(9, 9, 0.12, 0.0, &mut random);
        let mut node = || [random.below(9) as f64, random.below(9) as f64];
        let [start, end] = [node(), node()];
        let mut blocked = (0..map.len() as Node).filter(|node| map.is_blocked(*node)).map(|node| map.place(node));
        let expected = !blocked.any(|cell| touches(start, end, cell, 1e-9));
        assert_eq!(map.is_free_along(start, end), expected, "{start:?} {end:?}");
        assert_eq!(map.is_free_along(end, start), expected);
    }
}

#[test]
fn val_heights_between_nodes_are_bilinear() {
    let map = map_of(2, 2, limits(30.0, 30.0), |r, c| (1 + r + 2 * c) as f64);
    assert_eq!(map.height_at_m([0.5, 0.5]), Some(2.5));
    assert_eq!(map.height_at_m([1.0, 1.0]), Some(4.0));
    assert_eq!(map.height_at_m([1.0, 1.01]), None);
    let gap = map_of(2, 2, limits(30.0, 30.0), |r, c| if [r, c] == [1, 1] { f64::NAN } else { 3.0 });
    assert_eq!(gap.height_at_m([0.0, 0.5]), Some(3.0), "a missing height without weight does not count");
    assert_eq!(gap.height_at_m([0.5, 0.5]), None);
}
