use super::*;
use crate::clearance::Clearance;
use crate::cost::{CostModel, SlopeCost};
use crate::map::Direction;
use crate::testing::{NEIGHBOURHOODS, Random, drawn, ends, ground, hills, limits, map_of, plane, rough, thesis_costs};

const GRID: RouteSettings = RouteSettings {
    method: Method::GridAstar,
    neighbourhood: Neighbourhood::Four,
    landmarks: 0,
    smoothing_tolerance: 0.0,
};

fn roadmap(threshold_m: Option<f64>) -> RouteSettings {
    let vertices = VertexSettings { threshold_m, ..VertexSettings::default() };
    RouteSettings { method: Method::Roadmap(vertices), ..GRID }
}

fn methods() -> Vec<RouteSettings> {
    let anytime = Method::Anytime { weight: 2.0, budget: 1_000_000 };
    vec![
        GRID,
        roadmap(None),
        roadmap(Some(0.5)),
        RouteSettings { method: Method::ThetaStar, neighbourhood: Neighbourhood::Eight, ..GRID },
        RouteSettings { method: anytime, ..GRID },
    ]
}

#[test]
fn prop_every_method_finds_a_path_with_the_stated_properties() {
    let mut random = Random(60);
    let mut found = 0;
    for k in 0..30 {
        let map = rough(18, 20, 0.15, 0.5, &mut random);
        let Some(nodes) = ends(&map, &mut random) else { continue };
        let [start, goal] = nodes.map(|node| map.place(node));
        let costs = thesis_costs(&map);
        let clearance = Clearance::new(&map, 3.0, 1.0, 10.0).unwrap();
        let ground = Ground { clearance: (k % 3 == 0).then_some(&clearance), ..ground(&map, &costs) };
        for settings in methods() {
            let Ok(route) = plan(&ground, &settings, start, goal) else { continue };
            found += 1;
            assert_eq!((route.path.first(), route.path.last()), (Some(&nodes[0]), Some(&nodes[1])));
            assert_eq!(ground.path(&route.path), Some(route.path_score));
            assert_eq!(ground.path(&route.smoothed), Some(route.smoothed_score));
            assert!(route.smoothed_score.cost <= route.path_score.cost * (1.0 + 1e-12));
            for score in [route.path_score, route.smoothed_score] {
                assert!(score.horizontal_m <= score.length_m && score.length_m <= score.cost * (1.0 + 1e-12));
                let [up, down] = score.steepest;
                assert!(up <= libm::tan(30f64.to_radians()) + 1e-9 && down <= libm::tan(25f64.to_radians()) + 1e-9);
            }
            if settings.method == Method::GridAstar && k % 3 != 0 {
                assert!((route.search_cost / route.path_score.cost - 1.0).abs() < 1e-9);
            }
        }
    }
    assert!(found > 60, "{found}");
}

#[test]
fn val_the_search_charges_a_gap_only_at_the_ends_of_edges_and_the_score_all_along() {
    // A gap in the middle of a long edge.
    let mut map = drawn(&[".".repeat(21).as_str(); 11]);
    (0..11).filter(|row| *row != 5).for_each(|row| map.block(map.node(row, 10)));
    let costs = thesis_costs(&map);
    let clearance = Clearance::new(&map, 4.0, 1.0, 10.0).unwrap();
    let ground = Ground { clearance: Some(&clearance), ..ground(&map, &costs) };
    let vertices = VertexSettings { literal_border: true, ..VertexSettings::default() };
    let blind = RouteSettings { method: Method::Roadmap(vertices), ..GRID };
    let route = plan(&ground, &blind, [5, 2], [5, 18]).unwrap();
    assert_eq!(route.search_cost, 16.0, "both ends have room");
    assert!(route.path_score.cost > 18.0, "{}", route.path_score.cost);
    let by_cells = plan(&ground, &GRID, [5, 2], [5, 18]).unwrap();
    assert_eq!(by_cells.smoothed_score, route.smoothed_score, "the same line has the same score");
}

#[test]
fn val_prepared_routes_reach_what_single_ones_reach_and_cost_no_less_than_the_grid() {
    let mut random = Random(61);
    let mut found = 0;
    for k in 0..40 {
        let map = if k % 4 == 0 { hills(70, 2000.0, 6, k) } else { rough(16, 16, 0.2, 0.5, &mut random) };
        let costs = thesis_costs(&map);
        let ground = ground(&map, &costs);
        for neighbourhood in NEIGHBOURHOODS {
            let with = |landmarks| RouteSettings { neighbourhood, landmarks, ..roadmap(None) };
            let (plain, guided) = (Planner::new(ground, with(0)).unwrap(), Planner::new(ground, with(4)).unwrap());
            for _ in 0..8 {
                let Some(nodes) = ends(&map, &mut random) else { continue };
                let [start, goal] = nodes.map(|node| map.place(node));
                let by_cells = plan(&ground, &RouteSettings { neighbourhood, ..GRID }, start, goal);
                let (a, b) = (plain.route(start, goal), guided.route(start, goal));
                assert_eq!((a.is_ok(), b.is_ok()), (by_cells.is_ok(), by_cells.is_ok()));
                if let (Ok(a), Ok(b), Ok(by_cells)) = (a, b, by_cells) {
                    found += 1;
                    assert!((a.search_cost / b.search_cost - 1.0).abs() < 1e-9);
                    assert!(b.expansions <= a.expansions);
                    assert!(a.search_cost >= by_cells.search_cost * (1.0 - 1e-9));
                }
            }
        }
    }
    assert!(found > 150, "{found}");
}

#[test]
fn val_without_a_path_the_neighbourhood_and_the_limits_are_named() {
    let map = plane(12, 12, libm::tan(35f64.to_radians()), 30.0);
    let costs = thesis_costs(&map);
    let error = plan(&ground(&map, &costs), &GRID, [11, 3], [0, 3]).unwrap_err();
    assert!(matches!(error, RouteError::NoPath { .. }));
    assert_eq!(
        error.to_string(),
        "find a path from row 11, column 3 to row 0, column 3: none exists with four neighbours and slopes of at most 30 \
         degrees uphill and 30 degrees downhill"
    );
    let eight = RouteSettings { neighbourhood: Neighbourhood::Eight, ..GRID };
    assert!(plan(&ground(&map, &costs), &eight, [11, 3], [0, 3]).is_ok());
    for settings in [roadmap(None), RouteSettings { method: Method::ThetaStar, ..GRID }] {
        assert!(matches!(plan(&ground(&map, &costs), &settings, [11, 3], [0, 3]), Err(RouteError::NoPath { .. })));
    }
    let planner = Planner::new(ground(&map, &costs), roadmap(None)).unwrap();
    assert!(matches!(planner.route([11, 3], [0, 3]), Err(RouteError::NoPath { .. })));
}

#[test]
fn val_ends_that_cannot_be_used_are_refused_with_their_cell() {
    let mut map = map_of(3, 4, limits(30.0, 30.0), |r, c| if [r, c] == [0, 3] { f64::NAN } else { 1.5 });
    map.block(map.node(1, 1));
    let costs = thesis_costs(&map);
    let message = |start, goal| plan(&ground(&map, &costs), &GRID, start, goal).unwrap_err().to_string();
    assert_eq!(
        message([3, 0], [0, 0]),
        "plan a route: the start (row 3, column 0) is outside the map; rows are 0 to 2, columns 0 to 3"
    );
    assert!(message([0, 0], [0, 4]).contains("the goal (row 0, column 4) is outside"));
    assert!(message([0, 0], [usize::MAX, usize::MAX]).contains("outside"));
    assert!(message([1, 1], [0, 0]).contains("the start (row 1, column 1, height 1.5 m) is blocked"));
    assert!(message([0, 0], [0, 3]).contains("the goal (row 0, column 3, height NaN m) is blocked"));
    assert!(message([2, 2], [2, 2]).contains("start and goal are both row 2, column 2"));
}

#[test]
fn val_settings_out_of_range_are_refused_with_their_value() {
    let map = drawn(&["...", "..."]);
    let costs = thesis_costs(&map);
    let message = |settings| Planner::new(ground(&map, &costs), settings).unwrap_err().to_string();
    let anytime = |weight, budget| RouteSettings { method: Method::Anytime { weight, budget }, ..GRID };
    assert!(message(anytime(0.9, 1)).contains("`method.weight` is 0.9"), "{}", message(anytime(0.9, 1)));
    assert!(message(anytime(f64::NAN, 1)).contains("NaN"));
    assert!(message(anytime(1.0, 0)).contains("`method.budget` is 0"));
    assert!(message(roadmap(Some(0.0))).contains("`method.threshold_m` is 0"));
    assert!(message(RouteSettings { smoothing_tolerance: -1.0, ..GRID }).contains("`smoothing_tolerance` is -1"));
    assert!(message(RouteSettings { landmarks: 65, ..GRID }).contains("`landmarks` is 65"));
}

#[test]
fn val_an_anytime_search_reports_a_budget_that_is_too_small() {
    let map = drawn(&[".........."; 10]);
    let costs = thesis_costs(&map);
    let anytime = |budget| RouteSettings { method: Method::Anytime { weight: 3.0, budget }, ..GRID };
    let error = plan(&ground(&map, &costs), &anytime(5), [0, 0], [9, 9]).unwrap_err();
    assert_eq!(error, RouteError::Budget { budget: 5 });
    let spent = |budget| RouteError::Budget { budget }.to_string();
    assert_eq!(spent(1), "find a path within 1 expansion; raise the budget or the weight");
    assert_eq!(spent(5), "find a path within 5 expansions; raise the budget or the weight");
    assert!(plan(&ground(&map, &costs), &anytime(50), [0, 0], [9, 9]).is_ok());
}

#[test]
fn val_settings_keep_their_names_in_files() {
    let text =
        r#"{"method":{"kind":"roadmap","threshold_m":2.0,"repair":false},"neighbourhood":"eight","landmarks":8}"#;
    let settings: RouteSettings = serde_json::from_str(text).unwrap();
    let vertices = VertexSettings { threshold_m: Some(2.0), repair: false, ..VertexSettings::default() };
    assert_eq!(settings.method, Method::Roadmap(vertices));
    assert_eq!((settings.neighbourhood, settings.landmarks), (Neighbourhood::Eight, 8));
    let back: RouteSettings = serde_json::from_str(&serde_json::to_string(&settings).unwrap()).unwrap();
    assert_eq!(back, settings);
    assert!(serde_json::from_str::<RouteSettings>(r#"{"metod":{"kind":"grid_astar"}}"#).is_err());
    assert!(serde_json::from_str::<RouteSettings>(r#"{"method":{"kind":"roadmap","treshold_m":2.0}}"#).is_err());
}

#[test]
fn val_the_vehicle_avoids_a_hill_when_climbing_is_expensive() {
    let map = map_of(41, 41, limits(40.0, 40.0), |r, c| {
        let [y, x] = [r as f64 - 20.0, c as f64 - 20.0];
        6.0 / (1.0 + 0.02 * (x * x + y * y))
    });
    let length_m = |resistance| {
        let costs = CostModel::new(SlopeCost::Energy { resistance, floor: 0.05 }, None, &map).unwrap();
        plan(&ground(&map, &costs), &GRID, [20, 2], [20, 38]).unwrap().smoothed_score.horizontal_m
    };
    assert!(length_m(1e6) < length_m(0.02) - 1.0);
}

#[test]
fn gold_the_same_call_finds_the_same_bits() {
    let map = hills(120, 1000.0, 6, 62);
    let costs = thesis_costs(&map);
    let digest = |route: &Route| {
        let words = [route.search_cost, route.path_score.cost, route.smoothed_score.cost].map(f64::to_bits);
        let nodes = route.path.iter().chain(&route.smoothed).map(|node| u64::from(*node));
        words
            .into_iter()
            .chain(nodes)
            .fold(0xcbf2_9ce4_8422_2325u64, |hash, word| (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3))
    };
    let digests: Vec<u64> = methods()
        .into_iter()
        .map(|settings| digest(&plan(&ground(&map, &costs), &settings, [5, 6], [113, 111]).unwrap()))
        .collect();
    assert_eq!(
        digests,
        [
            12_541_534_118_010_155_021,
            15_704_307_360_576_239_676,
            9_321_559_706_385_613_550,
            13_316_966_653_695_991_254,
            12_541_534_118_010_155_021
        ]
    );
}

#[test]
fn val_directions_of_travel_matter_where_limits_differ() {
    // A ledge that can be descended but not climbed.
    let map = map_of(3, 6, limits(30.0, 60.0), |_, c| if c < 3 { 1.0 } else { 0.0 });
    let costs = thesis_costs(&map);
    assert!(map.accessible(2, Direction::ALL[0]).is_some());
    for settings in methods() {
        assert!(plan(&ground(&map, &costs), &settings, [1, 0], [1, 5]).is_ok(), "{settings:?}");
        assert!(plan(&ground(&map, &costs), &settings, [1, 5], [1, 0]).is_err(), "{settings:?}");
    }
}
