use super::*;
use crate::testing::{drawn, limits, map_of, oblong_map_of, thesis_costs};

#[test]
fn val_a_step_costs_its_length_times_the_cost_of_its_slope() {
    let map = map_of(2, 2, limits(80.0, 80.0), |r, _| if r == 0 { 0.75 } else { 0.0 });
    let costs = CostModel::new(SlopeCost::Linear { up: 2.0, down: 0.5 }, None, &map).unwrap();
    let [north, south] = [Direction::ALL[1], Direction::ALL[3]];
    assert_eq!(costs.step(&map, 2, 0, north), 1.25 * (1.0 + 2.0 * 0.75));
    assert_eq!(costs.step(&map, 0, 2, south), 1.25 * (1.0 + 0.5 * 0.75));
}

#[test]
fn val_energy_stops_falling_at_its_floor() {
    let energy = SlopeCost::Energy { resistance: 0.1, floor: 0.2 };
    assert_eq!([energy.at(0.0), energy.at(0.1), energy.at(-0.05)], [1.0, 2.0, 0.5]);
    assert_eq!(energy.at(-0.5), 0.2, "below 0 without the floor");
    let map = drawn(&["..", ".."]);
    let costs = CostModel::new(energy, Some(vec![2.0, 3.0, 4.0, 5.0]), &map).unwrap();
    assert_eq!(costs.least(), 0.4);
}

#[test]
fn val_factors_of_blocked_cells_do_not_matter_and_others_are_checked() {
    let map = drawn(&[".#", ".."]);
    let model = |factors: Vec<f64>| CostModel::new(SlopeCost::THESIS, Some(factors), &map);
    assert_eq!(model(vec![2.0, f64::NAN, 3.0, 4.0]).unwrap().least(), 2.0);
    let error = model(vec![2.0, 1.0, 3.0, -4.0]).unwrap_err();
    assert_eq!(error.message, "is -4 at row 1, column 1; it must be a finite number above 0");
    assert_eq!(model(vec![1.0]).unwrap_err().message, "has 1 values for 4 cells");
}

#[test]
fn val_weights_out_of_range_are_refused() {
    let map = drawn(&["..", ".."]);
    let key = |slope| CostModel::new(slope, None, &map).unwrap_err().key;
    assert_eq!(key(SlopeCost::Linear { up: -1.0, down: 0.0 }), "up_weight");
    assert_eq!(key(SlopeCost::Linear { up: 0.0, down: f64::NAN }), "down_weight");
    assert_eq!(key(SlopeCost::Energy { resistance: 0.0, floor: 0.5 }), "resistance");
    assert_eq!(key(SlopeCost::Energy { resistance: 0.1, floor: 0.0 }), "floor");
    assert_eq!(key(SlopeCost::Energy { resistance: 0.1, floor: 1.5 }), "floor");
}

#[test]
fn val_the_bound_is_manhattan_or_octile_on_level_ground_and_the_slant_where_longer() {
    let map = map_of(4, 4, limits(80.0, 80.0), |r, c| if [r, c] == [0, 1] { 30.0 } else { 0.0 });
    let costs = thesis_costs(&map);
    assert_eq!(costs.bound(&map, 0, 7, Neighbourhood::Four), 4.0);
    assert!((costs.bound(&map, 0, 7, Neighbourhood::Eight) - (2.0 + 2f64.sqrt())).abs() < 1e-12);
    assert_eq!(costs.bound(&map, 0, 1, Neighbourhood::Eight), 901f64.sqrt());
}

#[test]
fn val_a_step_costs_the_mean_factor_of_its_ends() {
    let map = drawn(&["..", ".."]);
    let costs = CostModel::new(SlopeCost::THESIS, Some(vec![2.0, 3.0, 4.0, 6.0]), &map).unwrap();
    let [east, south, south_east] = [Direction::ALL[0], Direction::ALL[3], Direction::ALL[7]];
    assert_eq!(costs.step(&map, 0, 1, east), 2.5);
    assert_eq!(costs.step(&map, 0, 2, south), 3.0);
    assert_eq!(costs.step(&map, 0, 3, south_east), 4.0 * 2f64.sqrt());
    assert_eq!(costs.factor(3), 6.0);
    // Bounds are at the least factor.
    assert_eq!(costs.bound(&map, 0, 1, Neighbourhood::Four), 2.0);
    assert_eq!(costs.straight(&map, 0, 3), 2.0 * 2f64.sqrt());
}

/// Two rows and three columns apart: 9 m east-west, 8 m north-south, and 5 m along each diagonal.
#[test]
fn val_bounds_over_oblong_cells_keep_the_axes_apart() {
    let map = oblong_map_of(3, 4, limits(30.0, 30.0), |_, _| 0.0);
    let costs = thesis_costs(&map);
    let [from, to] = [map.node(0, 0), map.node(2, 3)];
    for [from, to] in [[from, to], [to, from]] {
        assert_eq!(costs.bound(&map, from, to, Neighbourhood::Four), 17.0);
        assert_eq!(costs.bound(&map, from, to, Neighbourhood::Eight), 13.0);
        assert_eq!(costs.level_bound(&map, from, to, Neighbourhood::Eight), 13.0);
        assert_eq!(costs.straight(&map, from, to), 145f64.sqrt());
    }
}

/// Bounds for unknown ground leave the heights out.
#[test]
fn val_the_level_bound_does_not_know_heights() {
    let map = map_of(2, 2, limits(80.0, 80.0), |_, c| 3.0 * c as f64);
    let costs = thesis_costs(&map);
    assert_eq!(costs.bound(&map, 0, 1, Neighbourhood::Four), 10f64.sqrt());
    assert_eq!(costs.level_bound(&map, 0, 1, Neighbourhood::Four), 1.0);
}
