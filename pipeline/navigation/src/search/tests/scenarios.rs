//! Scenarios of the Moving AI benchmark (Sturtevant, 2012): lengths of shortest octile paths that do not cut corners.

use crate::map::{Neighbourhood, Node, TravelMap};
use crate::search::dstar_lite::DStarLite;
use crate::search::grid::GridNetwork;
use crate::search::{astar, dijkstra};
use crate::testing::{Random, ground, limits, map_of, thesis_costs};
use movingai::Map2D;
use movingai::parser::{parse_map, parse_scen};
use std::io::Read;

pub fn text(name: &str) -> String {
    let bytes = std::fs::read(sastrugi_fixtures::routes(name)).unwrap();
    let mut text = String::new();
    match name.ends_with(".gz") {
        true => flate2::read::GzDecoder::new(bytes.as_slice()).read_to_string(&mut text).unwrap(),
        false => bytes.as_slice().read_to_string(&mut text).unwrap(),
    };
    text
}

fn map(name: &str) -> TravelMap {
    let theirs = parse_map(&text(name)).unwrap();
    let mut map = map_of(theirs.height(), theirs.width(), limits(30.0, 30.0), |_, _| 0.0);
    let blocked = |(row, col): &(usize, usize)| !theirs.is_traversable((*col, *row));
    let cells = (0..theirs.height()).flat_map(|row| (0..theirs.width()).map(move |col| (row, col)));
    cells.filter(blocked).for_each(|(row, col)| map.block(map.node(row, col)));
    map
}

/// Length of a diagonal in the files: the square root of 2 to nine decimals.
const DIAGONAL: f64 = 1_414_213_562.0 / 1e9;

/// Length of a path with the files' diagonals.
fn length(map: &TravelMap, path: &[Node]) -> f64 {
    let is_diagonal = |pair: &&[Node]| {
        let ([r0, c0], [r1, c1]) = (map.place(pair[0]), map.place(pair[1]));
        r0 != r1 && c0 != c1
    };
    let diagonals = path.windows(2).filter(is_diagonal).count();
    (path.len() - 1 - diagonals) as f64 + DIAGONAL * diagonals as f64
}

/// Every `stride`-th scenario; lengths agree within `tolerance`. Shortest paths all have the same number of diagonals.
fn check(map_name: &str, scenarios: &str, stride: usize, count: usize, tolerance: f64) {
    let map = map(map_name);
    let costs = thesis_costs(&map);
    let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Eight };
    let scenarios = parse_scen(&text(scenarios)).unwrap();
    assert_eq!(scenarios.len(), count);
    for scenario in scenarios.iter().step_by(stride) {
        let [start, goal] = [scenario.start_pos, scenario.goal_pos].map(|(col, row)| map.node(row, col));
        let path = if start == goal { vec![start] } else { astar::search(&grid, start, goal).unwrap().path };
        let length = length(&map, &path);
        assert!((length - scenario.optimal_length).abs() < tolerance, "{length} {}", scenario.optimal_length);
    }
}

#[test]
fn val_all_scenarios_of_the_arena_have_their_length() {
    check("arena.map", "arena.map.scen", 1, 160, 5e-5);
}

#[test]
fn val_every_two_hundredth_scenario_of_the_maze_has_its_length() {
    check("maze512-32-9.map.gz", "maze512-32-9.map.scen.gz", 200, 8010, 1e-8);
}

#[test]
#[ignore = "slow: ./test --full"]
fn val_every_tenth_scenario_of_the_maze_has_its_length() {
    check("maze512-32-9.map.gz", "maze512-32-9.map.scen.gz", 10, 8010, 1e-8);
}

/// 2000 queries between 439 edits of the arena; both numbers are those of the dynamic track of the grid-based path planning competition.
#[test]
fn val_queries_between_edits_of_the_arena_have_the_bits_of_dijkstra() {
    const QUERIES: usize = 2000;
    const EDITS: usize = 439;
    let mut map = map("arena.map");
    let costs = thesis_costs(&map);
    let mut random = Random(80);
    let free: Vec<Node> = (0..map.len() as Node).filter(|node| !map.is_blocked(*node)).collect();
    let goal = free[free.len() / 2];
    let mut search =
        DStarLite::new(&GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Eight }, goal, goal);
    let (mut edits, mut reached) = (0, 0);
    for query in 0..QUERIES {
        let mut changed = Vec::new();
        if query * EDITS / QUERIES >= edits {
            edits += 1;
            // A patch of up to 4 x 4 cells is blocked, or freed where it was free initially.
            let [row, col] = map.place(free[random.below(free.len() as u64) as usize]);
            let [rows, cols] = [0; 2].map(|_| 1 + random.below(4) as usize);
            let block = random.below(2) == 0;
            for (r, c) in (row..(row + rows).min(49)).flat_map(|r| (col..(col + cols).min(49)).map(move |c| (r, c))) {
                let node = map.node(r, c);
                if node == goal || free.binary_search(&node).is_err() {
                    continue;
                }
                if block {
                    map.block(node)
                } else {
                    map.unblock(node)
                }
                changed.extend(map.around(node));
            }
        }
        let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Eight };
        let start = free[random.below(free.len() as u64) as usize];
        search.changed(&grid, changed);
        search.move_to(&grid, start);
        let found = search.search(&grid);
        let truth = dijkstra::costs_to(&grid, goal)[start as usize];
        assert_eq!(search.value(start).to_bits(), truth.to_bits(), "query {query}");
        let fresh = DStarLite::new(&grid, start, goal).search(&grid);
        assert_eq!(found.as_ref().map(|f| &f.path), fresh.as_ref().map(|f| &f.path));
        reached += usize::from(found.is_some());
    }
    assert_eq!(edits, EDITS);
    assert!(reached > QUERIES / 2 && reached < QUERIES, "{reached}");
}
