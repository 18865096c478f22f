//! Anytime search, landmarks, and lines at any angle.

use crate::cost::{CostModel, SlopeCost};
use crate::line::Ground;
use crate::map::{Neighbourhood, Node, TravelMap};
use crate::search::anytime::{Outcome, search};
use crate::search::cost_along;
use crate::search::graph::Graph;
use crate::search::grid::GridNetwork;
use crate::search::landmarks::Landmarks;
use crate::search::{Network, astar, dijkstra, theta_star};
use crate::testing::{NEIGHBOURHOODS, Random, ends, ground, hills, limits, map_of, plane, rough, thesis_costs};

#[test]
fn prop_the_proven_bound_holds_and_falls_with_the_budget() {
    let mut random = Random(90);
    let mut loose = 0;
    for k in 0..60 {
        let map = rough(25, 25, 0.15, 0.5, &mut random);
        let Some([start, goal]) = ends(&map, &mut random) else { continue };
        let costs = thesis_costs(&map);
        let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: NEIGHBOURHOODS[k % 2] };
        let optimum = astar::search(&grid, start, goal).map(|found| found.cost);
        let mut before = f64::INFINITY;
        for budget in [1, 10, 20, 40, 80, 160, 320, 100_000] {
            match (search(&grid, start, goal, 3.0, budget), optimum) {
                (Outcome::Found(found, ratio), Some(optimum)) => {
                    assert!(found.expansions <= budget && ratio >= 1.0);
                    assert!(found.cost <= ratio * optimum * (1.0 + 1e-12), "{} {ratio} {optimum}", found.cost);
                    assert!(ratio <= before * (1.0 + 1e-12));
                    assert!((cost_along(&grid, &found.path) / found.cost - 1.0).abs() < 1e-12);
                    loose += usize::from(ratio > 1.01);
                    before = ratio;
                }
                (Outcome::Found(..), None) => panic!("a path where there is none"),
                (Outcome::NoPath, optimum) => assert_eq!(optimum, None),
                (Outcome::Spent, _) => assert!(budget < 100_000),
            }
        }
        assert!(optimum.is_none() || before == 1.0, "with a sufficient budget the path is optimal");
    }
    assert!(loose > 20, "{loose}");
}

/// With a single weight, a vertex would be expanded again whenever it becomes cheaper, for minutes on such a map of 500 x 500 cells.
#[test]
fn val_an_anytime_search_without_a_budget_takes_a_few_times_the_work_of_astar() {
    let map = hills(200, 145.0, 6, 95);
    let costs = thesis_costs(&map);
    let mut random = Random(96);
    let mut compared = 0;
    for neighbourhood in NEIGHBOURHOODS {
        let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood };
        for weight in [1.5, 2.0, 10.0] {
            let Some([start, goal]) = ends(&map, &mut random) else { continue };
            let Some(optimum) = astar::search(&grid, start, goal) else { continue };
            let Outcome::Found(found, ratio) = search(&grid, start, goal, weight, u64::MAX) else { panic!() };
            assert_eq!(ratio, 1.0);
            assert!((found.cost / optimum.cost - 1.0).abs() < 1e-12);
            assert!(found.expansions <= 12 * optimum.expansions + 1000, "{} {}", found.expansions, optimum.expansions);
            compared += 1;
        }
    }
    assert!(compared > 0, "no pair has a path");
}

#[test]
fn val_a_weight_of_one_is_astar() {
    let map = hills(60, 2000.0, 4, 91);
    let costs = thesis_costs(&map);
    let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Eight };
    let [start, goal] = [map.node(5, 5), map.node(50, 52)];
    let Outcome::Found(found, ratio) = search(&grid, start, goal, 1.0, u64::MAX) else { panic!() };
    assert_eq!(ratio, 1.0);
    assert!((found.cost / astar::search(&grid, start, goal).unwrap().cost - 1.0).abs() < 1e-12);
}

#[test]
fn prop_landmarks_bound_costs_from_below_both_ways() {
    let mut random = Random(92);
    let mut reached = 0;
    for k in 0..30 {
        let map = rough(14, 14, 0.25, 0.6, &mut random);
        let costs = CostModel::new(SlopeCost::Linear { up: 4.0, down: 0.0 }, None, &map).unwrap();
        let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: NEIGHBOURHOODS[k % 2] };
        let graph = Graph::new(grid.len() as u32, |vertex, visit| grid.edges(vertex, visit));
        let landmarks = Landmarks::new(&graph, 5);
        let goal = random.below(map.len() as u64) as u32;
        // The goal is beyond two last edges.
        let last_edges = [(goal, 2.0), ((goal + 30) % map.len() as u32, 1.0)];
        let target = landmarks.target(&last_edges);
        let truths =
            last_edges.map(|(vertex, cost)| dijkstra::costs_to(&grid, vertex).into_iter().map(move |c| c + cost));
        let [first, second] = truths;
        for (vertex, truth) in (0..).zip(first.zip(second).map(|(a, b)| a.min(b))) {
            let bound = landmarks.bound(vertex, &target);
            assert!(bound >= 0.0 && bound <= truth * (1.0 + 1e-12), "{bound} {truth}");
            // Where no path leads, any bound holds.
            reached += usize::from(truth.is_finite() && bound > 0.0);
        }
    }
    assert!(reached > 500, "{reached}");
}

#[test]
fn val_landmarks_save_expansions() {
    let map = rough(80, 80, 0.2, 0.5, &mut Random(93));
    let costs = thesis_costs(&map);
    let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Four };
    let graph = Graph::new(grid.len() as u32, |vertex, visit| grid.edges(vertex, visit));
    let landmarks = Landmarks::new(&graph, 8);
    struct Guided<'a>(&'a GridNetwork<'a>, &'a Landmarks);
    impl Network for Guided<'_> {
        fn len(&self) -> usize {
            self.0.len()
        }
        fn edges(&self, vertex: u32, visit: impl FnMut(u32, f64)) {
            self.0.edges(vertex, visit);
        }
        fn bound(&self, from: u32, to: u32) -> f64 {
            self.1.bound(from, &self.1.target(&[(to, 0.0)])).max(self.0.bound(from, to))
        }
    }
    let mut random = Random(94);
    let (mut plain, mut guided) = (0, 0);
    for _ in 0..10 {
        let [start, goal] = ends(&map, &mut random).unwrap();
        let (a, b) = (astar::search(&grid, start, goal), astar::search(&Guided(&grid, &landmarks), start, goal));
        assert_eq!(a.is_some(), b.is_some());
        if let (Some(a), Some(b)) = (a, b) {
            assert!((a.cost / b.cost - 1.0).abs() < 1e-9);
            (plain, guided) = (plain + a.expansions, guided + b.expansions);
        }
    }
    assert!(2 * guided < plain, "{guided} of {plain}");
}

/// Costs of the cheapest paths of straight lines from a node, from all lines between all nodes.
fn any_angle_optima(ground: &Ground<'_>, start: Node) -> Vec<f64> {
    let count = ground.map.len() as u32;
    let lines = Graph::new(count, |from, visit| {
        for to in (0..count).filter(|to| *to != from && !ground.map.is_blocked(*to)) {
            ground.line(from, to).into_iter().for_each(|line| visit(to, line.cost));
        }
    });
    dijkstra::costs_from(&lines, start)
}

/// Relative excess of lazy Theta* over the any-angle optimum.
fn excesses(maps: impl Iterator<Item = TravelMap>, random: &mut Random) -> Vec<f64> {
    let mut excesses = Vec::new();
    for map in maps {
        let costs = thesis_costs(&map);
        let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Eight };
        let Some([start, _]) = ends(&map, random) else { continue };
        let optima = any_angle_optima(&grid.ground, start);
        for goal in (0..map.len() as Node).filter(|node| *node != start && !map.is_blocked(*node)) {
            let Some(found) = theta_star::search(&grid, start, goal) else { continue };
            let line = grid.ground.path(&found.path).unwrap();
            assert!((line.cost / found.cost - 1.0).abs() < 1e-12);
            assert!(found.cost >= optima[goal as usize] * (1.0 - 1e-6));
            excesses.push(found.cost / optima[goal as usize] - 1.0);
        }
    }
    excesses.sort_by(f64::total_cmp);
    excesses
}

#[test]
fn val_theta_star_stays_near_the_any_angle_optimum() {
    let mut random = Random(95);
    let level: Vec<TravelMap> = (0..6).map(|_| rough(18, 18, 0.15, 0.0, &mut random)).collect();
    let level = excesses(level.into_iter(), &mut random);
    let steep: Vec<TravelMap> = (0..6).map(|_| rough(14, 14, 0.1, 0.35, &mut random)).collect();
    let steep = excesses(steep.into_iter(), &mut random);
    let quantile = |sorted: &[f64], share: f64| sorted[(share * (sorted.len() - 1) as f64) as usize];
    let [level, steep] = [level, steep].map(|sorted| [0.5, 0.99].map(|share| quantile(&sorted, share)));
    println!("excess over the any-angle optimum, median and 99 %: level {level:?}, rough {steep:?}");
    for [median, most] in [level, steep] {
        assert!(median < 1e-6 && most < 0.06, "{median} {most}");
    }
}

#[test]
fn val_on_a_tilted_plane_theta_star_lies_between_the_continuous_optimum_and_the_zigzags_of_steps() {
    const ROWS: usize = 41;
    for (deg, optimum) in [(31.0f64, 1.8955), (35.0, 2.2089), (39.0, 2.5546)] {
        let map = plane(ROWS, 41, libm::tan(deg.to_radians()), 30.0);
        let costs = thesis_costs(&map);
        let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Eight };
        let [start, goal] = [map.node(ROWS - 1, 20), map.node(0, 20)];
        let steps = astar::search(&grid, start, goal).unwrap().cost;
        let lines = theta_star::search(&grid, start, goal).unwrap().cost;
        let up_slope = lines / (ROWS - 1) as f64;
        assert!(up_slope >= optimum * (1.0 - 1e-4), "{deg} degrees: {up_slope}");
        assert!(lines <= steps * (1.0 + 1e-12), "{deg} degrees: {lines} {steps}");
        println!("{deg} degrees: {up_slope:.4} a metre up-slope, optimum {optimum}");
    }
}

#[test]
fn val_theta_star_keeps_the_longer_path_if_the_line_from_the_grandparent_costs_more() {
    let map = map_of(31, 31, limits(40.0, 40.0), |r, c| {
        let [y, x] = [r as f64 - 15.0, c as f64 - 15.0];
        3.0 / (1.0 + 0.03 * (x * x + y * y))
    });
    let costs = CostModel::new(SlopeCost::Linear { up: 8.0, down: 0.0 }, None, &map).unwrap();
    let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Eight };
    let [start, goal] = [map.node(15, 2), map.node(15, 28)];
    let straight = grid.ground.line(start, goal).unwrap().cost;
    let round = theta_star::search(&grid, start, goal).unwrap();
    assert!(round.cost < 0.9 * straight, "{} {straight}", round.cost);
    let steps = astar::search(&grid, start, goal).unwrap();
    assert!(round.cost <= grid.ground.path(&steps.path).unwrap().cost * (1.0 + 1e-12));
}

#[test]
fn val_one_table_or_an_edit_that_lowers_a_cost_would_break_the_bound() {
    // Going up a ramp costs more than going down.
    let map = map_of(3, 20, limits(30.0, 30.0), |_, c| 0.3 * c as f64);
    let costs = CostModel::new(SlopeCost::Linear { up: 4.0, down: 0.0 }, None, &map).unwrap();
    let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Four };
    let [bottom, top] = [map.node(1, 0), map.node(1, 19)];
    let [up, down] = [[bottom, top], [top, bottom]].map(|[a, b]| dijkstra::costs_from(&grid, a)[b as usize]);
    assert!(up > 2.0 * down, "the cost there is not a bound for the way back");
    let graph_of = |grid: &GridNetwork<'_>| Graph::new(grid.len() as u32, |vertex, visit| grid.edges(vertex, visit));
    let landmarks = Landmarks::new(&graph_of(&grid), 3);
    let cheaper = CostModel::new(SlopeCost::Linear { up: 0.0, down: 0.0 }, None, &map).unwrap();
    let edited = GridNetwork { ground: ground(&map, &cheaper), neighbourhood: Neighbourhood::Four };
    let truth = dijkstra::costs_from(&edited, bottom)[top as usize];
    let bound = |landmarks: &Landmarks| landmarks.bound(bottom, &landmarks.target(&[(top, 0.0)]));
    assert!(bound(&landmarks) > truth);
    assert!(bound(&Landmarks::new(&graph_of(&edited), 3)) <= truth * (1.0 + 1e-12));
}

/// On a line of ten vertices, one forward 1 and one back 2, the landmark is the far end, and its bounds are the costs.
#[test]
fn val_a_landmark_at_the_end_of_a_line_bounds_costs_exactly() {
    let line = Graph::new(10, |vertex, visit| {
        if vertex > 0 {
            visit(vertex - 1, 2.0);
        }
        if vertex < 9 {
            visit(vertex + 1, 1.0);
        }
    });
    let landmarks = Landmarks::new(&line, 1);
    for (from, to) in (0..10u32).flat_map(|from| (0..10u32).map(move |to| (from, to))) {
        let expected = if to >= from { f64::from(to - from) } else { 2.0 * f64::from(from - to) };
        assert_eq!(landmarks.bound(from, &landmarks.target(&[(to, 0.0)])), expected, "{from} to {to}");
    }
}
