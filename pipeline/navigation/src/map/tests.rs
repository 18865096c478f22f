use super::*;
use crate::testing::{Random, drawn, limits, map_of, may_step_by_definition, oblong_map_of, rough};
use sastrugi_numeric::Geometry;

fn refused(rows: usize, cols: usize, cell: f64, heights: Vec<f64>) -> String {
    let geometry = Geometry::square(rows, cols, cell);
    TravelMap::new(Grid { geometry, values: heights }, limits(30.0, 30.0)).unwrap_err().to_string()
}

#[test]
fn val_invalid_maps_are_refused() {
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
fn val_directions_have_their_indices() {
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
    let mut counts = [0, 0];
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
                counts[usize::from(expected)] += 1;
            }
        }
    }
    assert!(counts.iter().all(|count| *count > 1000), "refused and allowed: {counts:?}");
}

#[test]
fn val_only_nodes_with_heights_can_be_unblocked() {
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
fn val_lines_do_not_pass_between_diagonal_blocked_cells() {
    let map = drawn(&["..#", ".#.", "..."]);
    assert!(!map.is_free_along([2.0, 0.0], [0.0, 1.0]), "touches the corner of the centre");
    assert!(!map.is_free_along([1.0, 2.0], [0.0, 1.0]), "between two blocked cells");
    assert!(map.is_free_along([2.0, 2.0], [1.0, 2.0]));
    assert!(!map.is_free_along([0.0, 0.0], [0.0, 3.0]), "beyond the map");
    assert!(!map.is_free_along([f64::NAN, 0.0], [0.0, 0.0]));
}

/// Whether a line between two nodes comes within `slack` of a cell; a slow and obvious reference by clipping.
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

/// The same between points anywhere, such as positions of a team's members.
#[test]
fn prop_free_lines_between_any_points_touch_no_blocked_cell() {
    let mut random = Random(3);
    let mut free = 0;
    for _ in 0..2000 {
        let map = rough(9, 9, 0.12, 0.0, &mut random);
        let mut point = || [8.0 * random.unit(), 8.0 * random.unit()];
        let [start, end] = [point(), point()];
        let mut blocked = (0..map.len() as Node).filter(|node| map.is_blocked(*node)).map(|node| map.place(node));
        let expected = !blocked.any(|cell| touches(start, end, cell, 1e-9));
        assert_eq!(map.is_free_along(start, end), expected, "{start:?} {end:?}");
        free += usize::from(expected);
    }
    assert!((500..1500).contains(&free), "{free}");
}

#[test]
fn val_oblong_cells_keep_their_axes_apart() {
    let [east, north, north_east] = [Direction::ALL[0], Direction::ALL[1], Direction::ALL[4]];
    let level = oblong_map_of(3, 4, limits(30.0, 30.0), |_, _| 0.0);
    assert_eq!([east, north, north_east].map(|direction| level.step_m(direction)), [3.0, 4.0, 5.0]);
    assert_eq!(level.position_m(level.node(0, 0)), [101.5, 210.0]);
    assert_eq!(level.position_m(level.node(2, 3)), [110.5, 202.0]);
    assert_eq!(level.point_at([110.5, 202.0]), [2.0, 3.0]);
    assert_eq!(level.point_at([103.0, 209.0]), [0.25, 0.5]);
    // A rise of 2 m is 33.7 degrees over 3 m, and 26.6 degrees over 4 m.
    let eastward = oblong_map_of(3, 3, limits(30.0, 30.0), |_, c| 2.0 * c as f64);
    let southward = oblong_map_of(3, 3, limits(30.0, 30.0), |r, _| 2.0 * r as f64);
    assert_eq!([east, east.back(), north].map(|d| eastward.accessible(4, d)), [None, None, Some(1)]);
    assert_eq!([east, north, north.back()].map(|d| southward.accessible(4, d)), [Some(5), Some(1), Some(7)]);
}

#[test]
fn val_the_nearest_node_of_a_point_lies_on_the_map() {
    let map = drawn(&["....", "....", "...."]);
    for (point, place) in [([0.49, 0.5], [0, 1]), ([1.5, 2.4], [2, 2]), ([-7.0, 99.0], [0, 3]), ([99.0, -7.0], [2, 0])]
    {
        assert_eq!(map.place(map.nearest(point)), place, "{point:?}");
    }
}

/// The limits are tangents of the angles, and allowed themselves.
#[test]
fn val_slopes_up_to_the_limits_are_allowed() {
    let limits = limits(30.0, 20.0);
    assert!((limits.up - 1.0 / 3f64.sqrt()).abs() < 1e-15 && (limits.down - 0.363_970_234_266_202).abs() < 1e-14);
    assert!(limits.allow(limits.up) && limits.allow(-limits.down) && limits.allow(0.0));
    assert!(!limits.allow(limits.up * (1.0 + 1e-12)) && !limits.allow(-limits.down * (1.0 + 1e-12)));
    assert!(!limits.allow(f64::NAN));
}
