use super::*;
use crate::testing::{drawn, limits, map_of, oblong_map_of};
use sastrugi_numeric::{Geometry, Grid};

const EAST: Direction = Direction { rows: 0, cols: 1 };

/// An eastward corridor, `free` rows wide, with cells of `cell_m`.
fn corridor(free: usize, cell_m: f64) -> TravelMap {
    let heights = Grid::filled(Geometry::square(free + 2, 8, cell_m), 0.0);
    let mut map = TravelMap::new(heights, limits(30.0, 30.0)).unwrap();
    (0..8).for_each(|col| [0, free + 1].into_iter().for_each(|row| map.block(map.node(row, col))));
    map
}

#[test]
fn val_a_corridor_of_exactly_the_width_fits_and_one_cell_less_does_not() {
    for cell_m in [0.1, 0.3, 1.0, 2.5] {
        // A width of one cell adds no cost in any gap, because gaps narrower than a cell count as one.
        for width_cells in 2..=9usize {
            let width_m = width_cells as f64 * cell_m;
            let middle = |free: usize| {
                let map = corridor(free, cell_m);
                Clearance::new(&map, width_m, 1.0, 10.0).unwrap().multiplier(map.node(1 + free / 2, 4), EAST)
            };
            assert_eq!(middle(width_cells + 1), 1.0, "{width_cells} cells of {cell_m} m");
            assert!(middle(width_cells) > 1.0, "{width_cells} cells of {cell_m} m");
        }
    }
}

#[test]
fn val_the_factor_falls_with_the_gap_and_is_bounded() {
    let factor = |free: usize| {
        let map = corridor(free, 1.0);
        Clearance::new(&map, 20.0, 1.0, 10.0).unwrap().multiplier(map.node(1, 4), EAST)
    };
    let factors: Vec<f64> = (2..=21).map(factor).collect();
    assert!(factors.windows(2).all(|pair| pair[1] <= pair[0]));
    // Gaps of 1 to 20 m: min(10, 20 / gap).
    assert_eq!([factors[0], factors[1], factors[3], factors[9], factors[19]], [10.0, 10.0, 5.0, 2.0, 1.0]);
}

#[test]
fn val_the_gap_ends_at_the_last_point_that_can_be_reached() {
    // A step of 2 m on one side, an obstacle on the other.
    let mut map = map_of(9, 3, limits(30.0, 30.0), |row, _| if row < 2 { 2.0 } else { 0.0 });
    map.block(map.node(7, 1));
    let clearance = Clearance::new(&map, 8.0, 1.0, 10.0).unwrap();
    assert_eq!(clearance.gap_m(map.node(4, 1), EAST), 4.0);
    assert_eq!(clearance.gap_m(map.node(4, 1), EAST.back()), 4.0);
    assert_eq!(clearance.gap_m(map.node(4, 1), Direction { rows: 1, cols: 0 }), 2.0);
}

#[test]
fn val_across_a_diagonal_the_gap_is_measured_along_the_other_one() {
    let map = drawn(&["...", "...", "..."]);
    let clearance = Clearance::new(&map, 5.0, 1.0, 10.0).unwrap();
    let gap_m = clearance.gap_m(4, Direction { rows: -1, cols: 1 });
    assert!((gap_m - 8f64.sqrt()).abs() < 1e-12);
}

#[test]
fn val_settings_out_of_range_are_refused() {
    let map = drawn(&["..", ".."]);
    let key = |width_m, weight, most| Clearance::new(&map, width_m, weight, most).unwrap_err().key;
    assert_eq!(key(0.0, 1.0, 10.0), "width_m");
    assert_eq!(key(f64::NAN, 1.0, 10.0), "width_m");
    assert_eq!(key(1e9, 1.0, 10.0), "width_m");
    assert_eq!(key(1.0, -1.0, 10.0), "clearance_weight");
    assert_eq!(key(1.0, 1.0, 0.5), "clearance_max");
}

/// From the middle of 5 x 5 oblong cells, two steps to each side: of 4 m across a path eastward, 3 m northward, 5 m along a diagonal.
#[test]
fn val_gaps_over_oblong_cells_are_measured_across_the_path() {
    let map = oblong_map_of(5, 5, limits(30.0, 30.0), |_, _| 0.0);
    let clearance = Clearance::new(&map, 100.0, 1.0, 10.0).unwrap();
    let gap_m = |rows, cols| clearance.gap_m(map.node(2, 2), Direction { rows, cols });
    assert_eq!([gap_m(0, 1), gap_m(-1, 0), gap_m(-1, 1), gap_m(-1, -1)], [16.0, 12.0, 20.0, 20.0]);
}
