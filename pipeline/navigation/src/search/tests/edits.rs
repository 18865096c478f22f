//! Queries between edits of a map, with published optima: `dao_arena2` of the dynamic track of the Grid-based Path Planning Competition (2023). Moves
//! are octile and do not cut corners.

use super::scenarios::text;
use crate::cost::CostModel;
use crate::map::{Neighbourhood, Node, TravelMap};
use crate::search::dstar_lite::DStarLite;
use crate::search::grid::GridNetwork;
use crate::search::{astar, dijkstra};
use crate::testing::{ground, limits, map_of, thesis_costs};
use std::str::SplitWhitespace;

const QUERIES: usize = 2000;
const EDITS: usize = 439;
/// The file prints 11 decimals of sums of up to a few hundred steps.
const TOLERANCE: f64 = 1e-9;

/// Rows of cells, `.` free.
type Patch = Vec<String>;

enum Command {
    /// Index of a patch, and the row and column of its first cell.
    Edit { patch: usize, place: [usize; 2] },
    /// Start and goal (row, column) with the length of the shortest path.
    Query { ends: [[usize; 2]; 2], optimum: f64 },
}

fn number(words: &mut SplitWhitespace<'_>) -> usize {
    words.next().unwrap().parse().unwrap()
}

/// The files list columns first.
fn place(words: &mut SplitWhitespace<'_>) -> [usize; 2] {
    let col = number(words);
    [number(words), col]
}

fn patches() -> Vec<Patch> {
    let text = text("dao_arena2.patch.gz");
    let rows_of = |patch: &str| patch.lines().skip_while(|line| *line != "map").skip(1).map(str::to_owned).collect();
    text.split("\npatch ").skip(1).map(rows_of).collect()
}

/// Shape of the map, and the commands on it.
fn commands() -> ([usize; 2], Vec<Command>) {
    let text = text("dao_arena2.scen.gz");
    let header = |key: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(key)).unwrap();
        line.trim().parse::<usize>().unwrap()
    };
    let command = |line: &str| {
        let mut words = line.split_whitespace();
        let kind = words.next()?;
        let _bucket = (kind == "P" || kind == "Q").then(|| number(&mut words))?;
        Some(match kind {
            "P" => Command::Edit { patch: number(&mut words), place: place(&mut words) },
            _ => Command::Query {
                ends: [place(&mut words), place(&mut words)],
                optimum: words.next().unwrap().parse().unwrap(),
            },
        })
    };
    ([header("height "), header("width ")], text.lines().filter_map(command).collect())
}

/// Applies a patch to the map; returns the nodes whose steps may have changed.
fn apply(map: &mut TravelMap, patch: &Patch, [row, col]: [usize; 2]) -> Vec<Node> {
    let mut changed = Vec::new();
    for (r, line) in patch.iter().enumerate() {
        for (c, cell) in line.bytes().enumerate() {
            let (node, free) = (map.node(row + r, col + c), cell == b'.');
            if free != map.is_blocked(node) {
                continue;
            }
            if free {
                map.unblock(node)
            } else {
                map.block(node)
            }
            changed.extend(map.around(node));
        }
    }
    changed
}

fn grid_of<'a>(map: &'a TravelMap, costs: &'a CostModel) -> GridNetwork<'a> {
    GridNetwork { ground: ground(map, costs), neighbourhood: Neighbourhood::Eight }
}

/// The present map, and searches that follow its edits.
struct Replay {
    map: TravelMap,
    /// The map before the last edits, and the nodes changed by these.
    before: TravelMap,
    changed: Vec<Node>,
    /// A search that lasts through all edits, its goal, and the nodes changed since its last query.
    lasting: DStarLite,
    lasting_goal: Node,
    lasting_changed: Vec<Node>,
}

impl Replay {
    fn new(map: TravelMap, costs: &CostModel, [start, goal]: [Node; 2]) -> Self {
        let lasting = DStarLite::new(&grid_of(&map, costs), start, goal);
        let before = map.clone();
        Self { map, before, changed: Vec::new(), lasting, lasting_goal: goal, lasting_changed: Vec::new() }
    }

    /// Starts a group of edits.
    fn begin_edits(&mut self) {
        self.before.clone_from(&self.map);
        self.changed.clear();
    }

    fn edit(&mut self, patch: &Patch, place: [usize; 2]) {
        let nodes = apply(&mut self.map, patch, place);
        self.changed.extend(&nodes);
        self.lasting_changed.extend(nodes);
    }

    /// Checks A*, and a search from before the last edits that D* Lite repairs: both have the published length, and the repaired search has the
    /// values of Dijkstra bit for bit and the path of a fresh search.
    fn check(&self, costs: &CostModel, [start, goal]: [Node; 2], optimum: f64) {
        let (before, now) = (grid_of(&self.before, costs), grid_of(&self.map, costs));
        let direct = astar::search(&now, start, goal).unwrap().cost;
        assert!((direct - optimum).abs() < TOLERANCE, "{start} to {goal}: {direct} {optimum}");
        let mut repaired = DStarLite::new(&before, start, goal);
        repaired.search(&before);
        repaired.changed(&now, self.changed.iter().copied());
        let found = repaired.search(&now).unwrap();
        assert!((found.cost - optimum).abs() < TOLERANCE, "{start} to {goal}: {} {optimum}", found.cost);
        let truth = dijkstra::costs_to(&now, goal);
        for node in &found.path {
            assert_eq!(repaired.value(*node).to_bits(), truth[*node as usize].to_bits(), "{start} to {goal}");
        }
        assert_eq!(found.path, DStarLite::new(&now, start, goal).search(&now).unwrap().path);
    }

    /// The lasting search, moved to a start, has the values of Dijkstra bit for bit.
    fn check_lasting(&mut self, costs: &CostModel, start: Node) {
        let now = grid_of(&self.map, costs);
        self.lasting.move_to(&now, start);
        self.lasting.changed(&now, self.lasting_changed.drain(..));
        self.lasting.search(&now);
        let truth = dijkstra::costs_to(&now, self.lasting_goal)[start as usize];
        assert_eq!(self.lasting.value(start).to_bits(), truth.to_bits(), "from {start}");
    }
}

/// Replays the file and checks every `stride`-th query.
fn replay(stride: usize) {
    let (patches, ([rows, cols], commands)) = (patches(), commands());
    let map = map_of(rows, cols, limits(30.0, 30.0), |_, _| 0.0);
    let nodes = |ends: [[usize; 2]; 2]| ends.map(|[row, col]| (row * cols + col) as Node);
    let costs = thesis_costs(&map);
    let Command::Query { ends, .. } = commands[0] else { panic!("the file begins with a query") };
    let mut replay = Replay::new(map, &costs, nodes(ends));
    let (mut edits, mut queries, mut after_query) = (0, 0, true);
    for command in commands {
        match command {
            Command::Edit { patch, place } => {
                if std::mem::take(&mut after_query) {
                    replay.begin_edits();
                }
                replay.edit(&patches[patch], place);
                edits += 1;
            }
            Command::Query { ends, optimum } => {
                after_query = true;
                if queries % stride == 0 {
                    replay.check(&costs, nodes(ends), optimum);
                    replay.check_lasting(&costs, nodes(ends)[0]);
                }
                queries += 1;
            }
        }
    }
    assert_eq!([queries, edits], [QUERIES, EDITS]);
}

#[test]
fn val_every_fortieth_query_between_the_edits_has_its_published_length() {
    replay(40);
}

#[test]
#[ignore = "slow: ./test --full"]
fn val_all_queries_between_the_edits_have_their_published_length() {
    replay(1);
}
