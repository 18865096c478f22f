use super::*;
use crate::cost::SlopeCost;
use crate::testing::{Random, drawn, ends, ground, hills, limits, map_of, oblong_map_of, rough, thesis_costs};
use sastrugi_numeric::Grid;

#[test]
fn val_a_line_over_a_plane_costs_its_length_times_the_cost_of_its_slope() {
    let map = map_of(9, 9, limits(40.0, 40.0), |r, c| 0.3 * c as f64 - 0.2 * r as f64);
    let costs = CostModel::new(SlopeCost::Linear { up: 2.0, down: 0.5 }, None, &map).unwrap();
    for (end, rise_m) in [([1.0, 8.0], 2.2), ([8.0, 0.0], -1.6), ([8.0, 8.0], 0.8), ([0.0, 3.0], 0.9)] {
        let run_m = f64::sqrt(end[0] * end[0] + end[1] * end[1]);
        let line = ground(&map, &costs).segment([0.0, 0.0], end).unwrap();
        let slope: f64 = rise_m / run_m;
        let length_m = (run_m * run_m + rise_m * rise_m).sqrt();
        let cost = length_m * (1.0 + 2.0 * slope.max(0.0) + 0.5 * (-slope).max(0.0));
        assert!((line.cost / cost - 1.0).abs() < 1e-12);
        assert!((line.length_m / length_m - 1.0).abs() < 1e-12);
        assert!((line.horizontal_m / run_m - 1.0).abs() < 1e-12);
        assert!((line.steepest[0] - slope.max(0.0)).abs() < 1e-12);
        assert!((line.steepest[1] - (-slope).max(0.0)).abs() < 1e-12);
    }
}

#[test]
fn val_a_point_is_a_line_without_length() {
    let map = drawn(&["...", "..."]);
    assert_eq!(ground(&map, &thesis_costs(&map)).segment([0.5, 0.5], [0.5, 0.5]), Some(Travelled::NONE));
}

#[test]
fn prop_every_allowed_step_is_a_passable_line() {
    let mut random = Random(3);
    let mut steps = 0;
    for relief_m in [0.0, 0.5, 2.0] {
        for offset_m in [0.0, 8000.0] {
            let mut map = rough(12, 12, 0.1, relief_m, &mut random);
            (0..map.len() as Node).for_each(|n| map.set_height_m(n, map.height_m(n) + offset_m).unwrap());
            let costs = thesis_costs(&map);
            for node in 0..map.len() as Node {
                for (direction, next) in Direction::ALL.iter().filter_map(|d| Some((d, map.accessible(node, *d)?))) {
                    let line = ground(&map, &costs).line(node, next).unwrap();
                    steps += 1;
                    if !direction.is_diagonal() {
                        let step = costs.step(&map, node, next, *direction);
                        assert!((line.cost / step - 1.0).abs() < 1e-9, "{} {step}", line.cost);
                    }
                }
            }
        }
    }
    assert!(steps > 1000, "{steps}");
}

#[test]
fn val_a_cliff_between_level_ends_is_impassable() {
    let map = map_of(3, 9, limits(30.0, 30.0), |_, c| if c == 4 { 3.0 } else { 0.0 });
    assert_eq!(ground(&map, &thesis_costs(&map)).line(9, 17), None);
}

/// A transformed map: `kind` 0 to 3 are quarter turns, 4 to 7 mirrored as well.
fn turned(size: usize, kind: usize, [row, col]: [usize; 2]) -> [usize; 2] {
    let [row, col] = if kind >= 4 { [row, size - 1 - col] } else { [row, col] };
    (0..kind % 4).fold([row, col], |[r, c], _| [c, size - 1 - r])
}

#[test]
fn val_costs_do_not_change_when_the_map_is_rotated_or_mirrored() {
    const SIZE: usize = 11;
    let mut random = Random(4);
    let mut travelled = 0;
    for _ in 0..20 {
        let mut map = rough(SIZE, SIZE, 0.1, 0.4, &mut random);
        let limit = limits(30.0, 30.0);
        map = {
            let mut symmetric = TravelMap::new(map.heights().clone(), limit).unwrap();
            (0..map.len() as Node).filter(|n| map.is_blocked(*n)).for_each(|n| symmetric.block(n));
            symmetric
        };
        let factors: Vec<f64> = (0..map.len()).map(|_| 1.0 + random.unit()).collect();
        let costs = CostModel::new(SlopeCost::THESIS, Some(factors.clone()), &map).unwrap();
        let room = Clearance::new(&map, 4.0, 1.0, 10.0).unwrap();
        let here = Ground { map: &map, costs: &costs, clearance: Some(&room) };
        for kind in 1..8 {
            let node = |n: Node| {
                let [row, col] = turned(SIZE, kind, map.place(n));
                map.node(row, col)
            };
            let (mut heights, mut others) = (map.heights().values.clone(), factors.clone());
            for n in 0..map.len() as Node {
                heights[node(n) as usize] = map.height_m(n);
                others[node(n) as usize] = factors[n as usize];
            }
            let mut other = TravelMap::new(Grid::new(map.heights().geometry, heights), limit).unwrap();
            (0..map.len() as Node).filter(|n| map.is_blocked(*n)).for_each(|n| other.block(node(n)));
            let costs = CostModel::new(SlopeCost::THESIS, Some(others), &other).unwrap();
            let room = Clearance::new(&other, 4.0, 1.0, 10.0).unwrap();
            let there = Ground { map: &other, costs: &costs, clearance: Some(&room) };
            for _ in 0..100 {
                let Some([a, b]) = ends(&map, &mut random) else { continue };
                match (here.line(a, b), there.line(node(a), node(b))) {
                    (None, None) => {}
                    (Some(here), Some(there)) => {
                        travelled += 1;
                        assert!((here.cost / there.cost - 1.0).abs() < 1e-12);
                    }
                    other => panic!("{other:?}"),
                }
            }
        }
    }
    assert!(travelled > 1000, "{travelled}");
}

#[test]
fn val_the_way_back_costs_the_same_with_the_weights_exchanged() {
    let map = hills(60, 3000.0, 6, 5);
    let mut random = Random(6);
    let exchanged = TravelMap::new(map.heights().clone(), limits(25.0, 32.0)).unwrap();
    let map = TravelMap::new(map.heights().clone(), limits(32.0, 25.0)).unwrap();
    let model = |up, down| CostModel::new(SlopeCost::Linear { up, down }, None, &map).unwrap();
    let (there, back) = (model(2.0, 0.3), model(0.3, 2.0));
    let mut travelled = 0;
    for _ in 0..2000 {
        let Some([a, b]) = ends(&map, &mut random) else { continue };
        let (there, back) = (ground(&map, &there).line(a, b), ground(&exchanged, &back).line(b, a));
        assert_eq!(there.is_some(), back.is_some());
        if let (Some(there), Some(back)) = (there, back) {
            travelled += 1;
            assert!((there.cost / back.cost - 1.0).abs() < 1e-12);
            assert!((there.steepest[0] - back.steepest[1]).abs() < 1e-9);
        }
    }
    assert!(travelled > 200, "{travelled}");
}

#[test]
fn conv_lines_over_a_smooth_hill_converge_at_second_order() {
    let z = |y: f64, x: f64| 1.5 / (1.0 + 0.2 * ((y - 4.0) * (y - 4.0) + (x - 4.0) * (x - 4.0)));
    let cost = |n: usize| {
        let cell = 8.0 / n as f64;
        let values = (0..(n + 1) * (n + 1)).map(|k| z((k / (n + 1)) as f64 * cell, (k % (n + 1)) as f64 * cell));
        let geometry = sastrugi_numeric::Geometry::square(n + 1, n + 1, cell);
        let map = TravelMap::new(Grid::new(geometry, values.collect()), limits(60.0, 60.0)).unwrap();
        ground(&map, &thesis_costs(&map)).segment([0.0, 0.0], [0.5 * n as f64, 0.375 * n as f64]).unwrap().cost
    };
    // Up one side of the analytic hill, in pieces so short that their chords do not matter.
    const PIECES: usize = 100_000;
    let at = |k: usize| z(4.0 * k as f64 / PIECES as f64, 3.0 * k as f64 / PIECES as f64);
    let piece = |k: usize| {
        let (run, rise) = (5.0 / PIECES as f64, at(k + 1) - at(k));
        (run * run + rise * rise).sqrt() * (1.0 + (rise / run).abs())
    };
    let exact: f64 = (0..PIECES).map(piece).sum();
    let errors = [16, 32, 64, 128, 256].map(|n| (cost(n) - exact).abs());
    let order = 0.25 * libm::log2(errors[0] / errors[4]);
    assert!((1.75..2.5).contains(&order), "order {order}, errors {errors:?}");
}

/// From the centre of one cell to that of the second next: half a cell of the first, one of the second, half of the third.
#[test]
fn val_a_line_is_charged_the_factor_of_each_cell_that_it_crosses() {
    let map = drawn(&["...", "..."]);
    let costs = CostModel::new(SlopeCost::THESIS, Some(vec![1.0, 2.0, 3.0, 9.0, 9.0, 9.0]), &map).unwrap();
    let cost = |start, end| ground(&map, &costs).segment(start, end).unwrap().cost;
    assert!((cost([0.0, 0.0], [0.0, 2.0]) - 4.0).abs() < 1e-12);
    assert!((cost([0.0, 2.0], [0.0, 0.0]) - 4.0).abs() < 1e-12);
    // Between two rows, the mean of both: 5, 5.5 and 6.
    assert!((cost([0.5, 0.0], [0.5, 2.0]) - 11.0).abs() < 1e-12);
}

#[test]
fn val_lines_over_oblong_cells_keep_the_axes_apart() {
    // 2 rows of 4 m and 5 columns of 3 m: 8, 15 and 17 m. The ground rises by 0.1 per metre eastward.
    let map = oblong_map_of(3, 6, limits(30.0, 30.0), |_, c| 0.3 * c as f64);
    let costs = thesis_costs(&map);
    let line = ground(&map, &costs).segment([0.0, 0.0], [2.0, 5.0]).unwrap();
    assert!((line.horizontal_m - 17.0).abs() < 1e-12, "{line:?}");
    assert!((line.steepest[0] - 1.5 / 17.0).abs() < 1e-12 && line.steepest[1] == 0.0, "{line:?}");
    let west = ground(&map, &costs).segment([1.0, 5.0], [1.0, 0.0]).unwrap();
    assert!((west.horizontal_m - 15.0).abs() < 1e-12 && (west.steepest[1] - 0.1).abs() < 1e-12, "{west:?}");
}

/// The direction of a line is the nearest multiple of 45 degrees, counted from east to north.
#[test]
fn val_a_line_has_the_nearest_of_eight_directions() {
    const TURNS: [[i8; 2]; 8] = [[0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0], [1, 1]];
    for deg in 0..360 {
        let turn = f64::from(deg).to_radians();
        let [rows, cols] = TURNS[(deg as usize + 22) / 45 % 8];
        let found = direction_of([-7.0 * libm::sin(turn), 7.0 * libm::cos(turn)]);
        assert_eq!(found, Direction { rows, cols }, "{deg} degrees");
    }
}
