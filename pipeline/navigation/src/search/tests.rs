use super::graph::Graph;
use super::grid::GridNetwork;
use super::*;
use crate::clearance::Clearance;
use crate::cost::{CostModel, SlopeCost};
use crate::line::Ground;
use crate::map::Neighbourhood;
use crate::roadmap::Roadmap;
use crate::testing::{NEIGHBOURHOODS, Random, drawn, ends, ground, hills, limits, map_of, plane, rough, thesis_costs};
use crate::vertices::{VertexSettings, Vertices};

mod any_angle;
mod components;
mod edits;
mod replanning;
mod scenarios;
mod weighted;

/// Costs by `petgraph`.
pub fn costs_by_petgraph(network: &impl Network, start: u32) -> Vec<f64> {
    let mut edges = Vec::new();
    (0..network.len() as u32).for_each(|v| network.edges(v, |target, cost| edges.push((v, target, cost))));
    let mut graph = petgraph::graph::DiGraph::<(), f64>::from_edges(edges);
    while graph.node_count() < network.len() {
        graph.add_node(());
    }
    let costs = petgraph::algo::dijkstra(&graph, start.into(), None, |edge| *edge.weight());
    (0..network.len())
        .map(|v| costs.get(&petgraph::graph::NodeIndex::new(v)).copied().unwrap_or(f64::INFINITY))
        .collect()
}

fn check(network: &impl Network, [start, goal]: [u32; 2]) -> bool {
    let expected = costs_by_petgraph(network, start);
    let ours = dijkstra::costs_from(network, start);
    assert!(ours.iter().zip(&expected).all(|(a, b)| a == b || (a / b - 1.0).abs() < 1e-12));
    let found = astar::search(network, start, goal);
    assert_eq!(found.is_some(), expected[goal as usize].is_finite());
    let Some(found) = found else { return false };
    assert!((found.cost / expected[goal as usize] - 1.0).abs() < 1e-9);
    assert!((found.cost / cost_along(network, &found.path) - 1.0).abs() < 1e-12);
    assert_eq!((found.path.first(), found.path.last()), (Some(&start), Some(&goal)));
    true
}

/// Whether no bound exceeds the true cost to the goal, and none decreases along an edge by more than the edge costs.
fn bounds_hold(network: &impl Reversible, goal: u32) -> bool {
    let costs = dijkstra::costs_to(network, goal);
    (0..network.len() as u32).all(|vertex| {
        let bound = network.bound(vertex, goal);
        let mut consistent = true;
        network.edges(vertex, |target, cost| {
            consistent &= bound <= (cost + network.bound(target, goal)) * (1.0 + 1e-12);
        });
        // Blocked nodes without height have neither a bound nor a cost.
        bound.is_nan() || consistent && bound <= costs[vertex as usize] * (1.0 + 1e-12)
    })
}

#[test]
fn val_astar_costs_equal_those_of_dijkstra_on_200_maps_and_their_roadmaps() {
    let mut random = Random(10);
    let mut found = 0;
    for k in 0..200 {
        let map = rough(12, 17, 0.15, [0.0, 0.4, 0.9][k % 3], &mut random);
        let Some(ends) = ends(&map, &mut random) else { continue };
        let factors = (k % 4 == 1).then(|| (0..map.len()).map(|_| 0.5 + random.unit()).collect());
        let slope = match k % 2 {
            0 => SlopeCost::Linear { up: 2.0, down: 0.5 },
            _ => SlopeCost::Energy { resistance: 0.15, floor: 0.1 },
        };
        let costs = CostModel::new(slope, factors, &map).unwrap();
        let clearance = Clearance::new(&map, 3.0, 1.0, 10.0).unwrap();
        let ground = Ground { map: &map, costs: &costs, clearance: (k % 5 == 0).then_some(&clearance) };
        for neighbourhood in NEIGHBOURHOODS {
            let grid = GridNetwork { ground, neighbourhood };
            assert!(bounds_hold(&grid, ends[1]), "map {k}");
            found += usize::from(check(&grid, ends));
            let vertices = Vertices::of(&map, neighbourhood, &VertexSettings::default(), &ends);
            let roadmap = Roadmap::new(ground, &vertices.marks, neighbourhood);
            check(&roadmap, ends.map(|node| roadmap.vertex(node).unwrap()));
        }
    }
    assert!(found > 100, "{found}");
}

#[test]
fn val_astar_costs_equal_those_of_the_pathfinding_crate() {
    let map = hills(60, 3000.0, 6, 11);
    let costs = thesis_costs(&map);
    let mut random = Random(12);
    let mut found = 0;
    for neighbourhood in NEIGHBOURHOODS {
        let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood };
        for _ in 0..20 {
            let [start, goal] = ends(&map, &mut random).unwrap();
            // Its costs must implement Ord, so use integers in billionths.
            let successors = |vertex: &u32| {
                let mut next = Vec::new();
                grid.edges(*vertex, |target, cost| next.push((target, (cost * 1e9).round() as u64)));
                next
            };
            let theirs = pathfinding::prelude::astar(&start, successors, |_| 0, |vertex| *vertex == goal);
            let ours = astar::search(&grid, start, goal);
            assert_eq!(ours.is_some(), theirs.is_some());
            if let (Some(ours), Some(theirs)) = (ours, theirs) {
                assert!((ours.cost / (theirs.1 as f64 * 1e-9) - 1.0).abs() < 1e-8);
                found += 1;
            }
        }
    }
    assert!(found > 10, "{found}");
}

/// The grid with the thesis' Manhattan bound.
struct Manhattan<'a>(GridNetwork<'a>);

impl Network for Manhattan<'_> {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn edges(&self, vertex: u32, visit: impl FnMut(u32, f64)) {
        self.0.edges(vertex, visit);
    }

    fn bound(&self, from: u32, to: u32) -> f64 {
        let Ground { map, costs, .. } = self.0.ground;
        costs.bound(map, from, to, Neighbourhood::Four)
    }
}

impl Reversible for Manhattan<'_> {
    fn edges_into(&self, vertex: u32, visit: impl FnMut(u32, f64)) {
        self.0.edges_into(vertex, visit);
    }
}

#[test]
fn val_the_manhattan_bound_fails_with_eight_neighbours() {
    let map = drawn(&["......"; 6]);
    let costs = thesis_costs(&map);
    let with = |neighbourhood| Manhattan(GridNetwork { ground: ground(&map, &costs), neighbourhood });
    assert!(bounds_hold(&with(Neighbourhood::Four), 35));
    assert!(!bounds_hold(&with(Neighbourhood::Eight), 35));
}

#[test]
fn val_ties_go_to_the_vertex_farther_along_and_then_to_the_smaller_number() {
    let map = drawn(&["...."; 4]);
    let costs = thesis_costs(&map);
    let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Four };
    let found = astar::search(&grid, 12, 3).unwrap();
    // Straight along two sides, never through the middle: 6 expansions for 6 steps.
    assert_eq!(found.expansions, 6);
    assert_eq!(found.path, [12, 8, 4, 0, 1, 2, 3]);
}

#[test]
fn val_the_way_back_costs_the_same_with_the_weights_exchanged() {
    let map = map_of(50, 50, limits(30.0, 30.0), |r, c| 0.25 * ((r + 2 * c) % 3) as f64);
    let model = |up, down| CostModel::new(SlopeCost::Linear { up, down }, None, &map).unwrap();
    let (there, back) = (model(2.0, 0.5), model(0.5, 2.0));
    for neighbourhood in NEIGHBOURHOODS {
        let cost = |costs: &CostModel, from, to| {
            astar::search(&GridNetwork { ground: ground(&map, costs), neighbourhood }, from, to).map(|found| found.cost)
        };
        let [a, b] = [map.node(3, 4), map.node(45, 40)];
        let (there, back) = (cost(&there, a, b).unwrap(), cost(&back, b, a).unwrap());
        assert!((there / back - 1.0).abs() < 1e-12);
    }
}

#[test]
fn val_a_tilted_plane_costs_as_much_as_its_zigzags() {
    // Cost per metre up-slope of zigzags along the diagonals: l (1 + s), s = tan(a) / sqrt(2), l = sqrt(2 + tan(a)^2).
    const ROWS: usize = 61;
    for (deg, expected) in [(31.0f64, 2.1894), (35.0, 2.3594), (39.0, 2.5628)] {
        let map = plane(ROWS, 9, libm::tan(deg.to_radians()), 30.0);
        let costs = thesis_costs(&map);
        let grid = |neighbourhood| GridNetwork { ground: ground(&map, &costs), neighbourhood };
        let [start, goal] = [map.node(ROWS - 1, 4), map.node(0, 4)];
        assert_eq!(astar::search(&grid(Neighbourhood::Four), start, goal), None);
        let found = astar::search(&grid(Neighbourhood::Eight), start, goal).unwrap();
        let up_slope = found.cost / (ROWS - 1) as f64;
        assert!((up_slope - expected).abs() < 5e-5, "{deg} degrees: {up_slope}");
    }
}

#[test]
fn val_on_a_tilted_plane_the_neighbourhood_decides_what_can_be_reached() {
    // Four neighbours climb to the limit of 30 degrees, eight to atan(sqrt(2) tan(30 degrees)) = 39.23 degrees.
    for (deg, expected) in [(29.9f64, [true, true]), (30.1, [false, true]), (39.2, [false, true]), (39.3, [false; 2])] {
        let map = plane(20, 20, libm::tan(deg.to_radians()), 30.0);
        let costs = thesis_costs(&map);
        let reached = NEIGHBOURHOODS.map(|neighbourhood| {
            let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood };
            astar::search(&grid, map.node(19, 4), map.node(0, 4)).is_some()
        });
        assert_eq!(reached, expected, "{deg} degrees");
    }
}

#[test]
fn val_a_reversed_graph_has_the_same_edges_reversed() {
    let map = rough(9, 9, 0.1, 0.5, &mut Random(14));
    let costs = thesis_costs(&map);
    let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Eight };
    let graph = Graph::new(grid.len() as u32, |vertex, visit| grid.edges(vertex, visit));
    assert_eq!(graph.edge_count(), grid.edge_count());
    assert_eq!(
        graph.reversed().reversed(),
        Graph::new(grid.len() as u32, |v, visit| {
            let mut edges = Vec::new();
            grid.edges(v, |target, cost| edges.push((target, cost)));
            edges.sort_by_key(|edge| edge.0);
            edges.into_iter().for_each(|(target, cost)| visit(target, cost));
        })
    );
    let reversed = graph.reversed();
    for vertex in 0..grid.len() as u32 {
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        grid.edges_into(vertex, |source, cost| ours.push((source, cost.to_bits())));
        reversed.edges(vertex, |source, cost| theirs.push((source, cost.to_bits())));
        ours.sort_unstable();
        assert_eq!(ours, theirs);
    }
}

#[test]
fn prop_the_queue_agrees_with_a_sorted_list() {
    let mut random = Random(15);
    for _ in 0..200 {
        let mut draw = || Open::new(random.below(5) as f64, random.below(4) as f64, random.below(6) as u32);
        let entries: Vec<Open> = (0..60).map(|_| draw()).collect();
        let key = |open: &Open| (open.sum, std::cmp::Reverse(open.so_far), open.vertex);
        let (mut queue, mut sorted) = (Queue::default(), Vec::new());
        for (k, &open) in entries.iter().enumerate() {
            queue.push(open);
            sorted.push(open);
            if k % 3 == 0 {
                sorted.sort_by_key(key);
                assert_eq!(queue.pop(), Some(sorted.remove(0)));
            }
        }
        sorted.sort_by_key(key);
        sorted.into_iter().for_each(|open| assert_eq!(queue.pop(), Some(open)));
        assert_eq!(queue.pop(), None);
    }
}
