//! A planner on a map that is known only as far as it has been seen, without the whole map at hand.
//!
//! The explorer is told of areas that are safe or hold a hazard, cell by cell (a cell belongs to the area that holds its centre, on an edge to the one with the hazard). Cells that
//! it has not seen it takes for free. As in [`crate::replan`], [`DStarLite`] gives the cheapest steps to the goal over that and searches again
//! only what new sights change.
//!
//! * What a cell is known to be only ever rises: unseen, suspect (in an area with a hazard, which lies anywhere in it), safe, fixed
//!   hazard. A suspect cell is freed by a look that finds it safe; a safe one stays so, and is no longer where a hazard of an area may
//!   lie. An area with a hazard for which no cell near it is left becomes a fixed hazard as a whole: an earlier look has missed
//!   something. A hazard that is seen at a place, not in an area, fixes its cell at once. So there is an end to what can be learnt, and with it
//!   to changes of the plan.
//! * Suspect cells and fixed hazards block all cells nearer than a margin, so that the body is kept clear of them.
//! * Where no way is left, what is known may be wrong; it can be forgotten ([`Explorer::forget`]).
//! * Every free cell within the tolerance of the goal leads to it: the goal itself may be blocked.
//! * A start among blocked cells is left by the nearest free one.
//! * The map holds start and goal with room around. Where the plan touches its edge, or none is found though the edge can be reached
//!   from both ends, it grows; at [`CELLS_MAX`] cells it grows no more, and its edge bounds all plans.
//!
//! # Cost
//! 50 bytes a cell: 50 MB at most.

use crate::cost::{CostModel, SlopeCost};
use crate::line::Ground;
use crate::map::{Direction, Neighbourhood, Node, Point, SlopeLimits, TravelMap};
use crate::search::dstar_lite::DStarLite;
use crate::search::grid::GridNetwork;
use crate::search::{Network, Reversible};
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::ParameterError;
use std::collections::VecDeque;

#[cfg(test)]
mod tests;

/// Most cells of a map: a square of 102 m at cells of 0.1 m.
pub const CELLS_MAX: usize = 1 << 20;
/// Limit of slopes of a level map, deg: any.
const LEVEL_DEG: f64 = 45.0;
/// The goal counts as reached this much of a cell before its tolerance, so that a rover anywhere in the cell is within it.
const CELL_CORNER: f64 = 0.75;
/// Steps of a plan that are looked along for the next way point.
const STEPS_AHEAD: usize = 60;
/// Rounding of squared distances, as a share.
const ROUNDING: f64 = 1e-9;
/// A way point this near, in cells, has been reached.
const AT_CENTRE: f64 = 0.05;

/// How an explorer plans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExplorerSettings {
    /// Side of a cell, m.
    pub cell_m: f64,
    /// Least distance between a hazard and a place of the rover, each anywhere in its cell, m.
    pub margin_m: f64,
    /// Distance from the goal at which it is reached, m.
    pub arrive_m: f64,
    /// How far the map reaches beyond start and goal at first, m.
    pub beyond_m: f64,
}

/// What a look says of an area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// There is no hazard in it.
    Safe,
    /// Somewhere in it is one.
    Hazard,
}

/// Knowledge of a cell, rising.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Cell {
    Unseen,
    Suspect,
    Safe,
    Fixed,
}

impl Cell {
    fn is_hazard(self) -> bool {
        matches!(self, Self::Suspect | Self::Fixed)
    }
}

/// What an explorer knows, and its search.
#[derive(Clone, Debug)]
pub struct Explorer {
    settings: ExplorerSettings,
    start_m: [f64; 2],
    goal_m: [f64; 2],
    beyond_m: f64,
    map: TravelMap,
    costs: CostModel,
    cells: Vec<Cell>,
    /// Cells with hazards nearer to each than the margin.
    near: Vec<u16>,
    /// Offsets in rows and columns of the cells within the margin of one.
    margin: Vec<[i64; 2]>,
    goal: Node,
    search: DStarLite,
    /// Nodes whose steps have changed since the last search.
    changed: Vec<Node>,
}

impl Explorer {
    /// An explorer that has seen nothing.
    ///
    /// # Errors
    /// Settings out of range, or a map of too many cells.
    pub fn new(settings: ExplorerSettings, start_m: [f64; 2], goal_m: [f64; 2]) -> Result<Self, ParameterError> {
        settings.check()?;
        let geometry = settings.geometry(start_m, goal_m, settings.beyond_m)?;
        let (map, costs) = level(geometry)?;
        let goal = map.nearest(map.point_at(goal_m));
        let start = map.nearest(map.point_at(start_m));
        let search = DStarLite::new(&Arrival::new(&map, &costs, goal, settings.arrive()), start, goal);
        Ok(Self {
            start_m,
            goal_m,
            beyond_m: settings.beyond_m,
            cells: vec![Cell::Unseen; map.len()],
            near: vec![0; map.len()],
            margin: settings.margin(),
            changed: Vec::new(),
            settings,
            map,
            costs,
            goal,
            search,
        })
    }

    /// Cells of the map.
    pub fn len(&self) -> usize {
        self.map.len()
    }

    /// Never so.
    pub fn is_empty(&self) -> bool {
        self.map.is_empty()
    }

    /// Vertices expanded by all searches on the present map.
    pub fn expansions(&self) -> u64 {
        self.search.expansions()
    }

    /// Whether a point lies in a cell that plans keep clear of.
    pub fn is_blocked(&self, at_m: [f64; 2]) -> bool {
        self.node_at(at_m).is_some_and(|node| self.map.is_blocked(node))
    }

    /// Takes a look at the convex area with these corners, in order around it. What lies beyond the map is not remembered: the map grows
    /// before a plan leads there.
    pub fn see(&mut self, corners_m: &[[f64; 2]; 4], sight: Sight) {
        let end = |axis: usize, pick: fn(f64, f64) -> f64| {
            corners_m.iter().map(|corner| corner[axis]).reduce(pick).unwrap_or_default()
        };
        let low = self.map.point_at([end(0, f64::min), end(1, f64::max)]);
        let high = self.map.point_at([end(0, f64::max), end(1, f64::min)]);
        let [rows, cols] = self.map.shape();
        let within = |at: f64, count: usize| libm::floor(at).clamp(0.0, count as f64) as usize;
        let mut nodes = Vec::new();
        for row in within(low[0], rows)..within(high[0] + 2.0, rows) {
            for col in within(low[1], cols)..within(high[1] + 2.0, cols) {
                let node = self.map.node(row, col);
                if holds(corners_m, self.map.position_m(node), sight == Sight::Hazard) {
                    nodes.push(node);
                }
            }
        }
        let seen = if sight == Sight::Hazard { Cell::Suspect } else { Cell::Safe };
        nodes.iter().for_each(|node| self.learn(*node, seen));
        // What lies there was taken for safe.
        if sight == Sight::Hazard && !nodes.iter().any(|node| self.map.is_blocked(*node)) {
            nodes.iter().for_each(|node| self.learn(*node, Cell::Fixed));
        }
    }

    /// Takes a look that found a hazard at a place: its cell is one for good. What lies beyond the map is not remembered.
    pub fn see_hazard_at(&mut self, at_m: [f64; 2]) {
        if let Some(node) = self.node_at(at_m) {
            self.learn(node, Cell::Fixed);
        }
    }

    /// Forgets all that it has seen.
    pub fn forget(&mut self) {
        for node in 0..self.map.len() as Node {
            self.cells[node as usize] = Cell::Unseen;
            if std::mem::take(&mut self.near[node as usize]) > 0 {
                self.map.unblock(node);
                self.changed.extend(self.map.around(node));
            }
        }
    }

    /// Raises what is known of a cell.
    fn learn(&mut self, node: Node, seen: Cell) {
        let before = self.cells[node as usize];
        if seen <= before {
            return;
        }
        self.cells[node as usize] = seen;
        match (before.is_hazard(), seen.is_hazard()) {
            (false, true) => self.keep_clear(node, true),
            (true, false) => self.keep_clear(node, false),
            _ => {}
        }
    }

    /// Blocks, or frees, what lies within the margin of a cell.
    fn keep_clear(&mut self, node: Node, of_hazard: bool) {
        let ([row, col], [rows, cols]) = (self.map.place(node), self.map.shape());
        for k in 0..self.margin.len() {
            let [down, across] = self.margin[k];
            let (r, c) = (row as i64 + down, col as i64 + across);
            if r < 0 || c < 0 || r >= rows as i64 || c >= cols as i64 {
                continue;
            }
            let around = self.map.node(r as usize, c as usize);
            let count = &mut self.near[around as usize];
            *count = if of_hazard { *count + 1 } else { count.saturating_sub(1) };
            match (*count, of_hazard) {
                (1, true) => self.map.block(around),
                (0, false) => self.map.unblock(around),
                _ => continue,
            }
            self.changed.extend(self.map.around(around));
        }
    }

    /// Way points from a place to the goal over what is known: the first is the place itself, the next ones are as far along the plan as
    /// straight lines lead. `None` where there is no way.
    pub fn plan(&mut self, at_m: [f64; 2]) -> Option<Vec<[f64; 2]>> {
        loop {
            let Some(at) = self.node_at(at_m).filter(|node| !self.is_edge(*node)) else {
                // Beyond the map, or at its edge.
                self.grow(at_m).then_some(())?;
                continue;
            };
            let start = self.nearest_free(at)?;
            let path = self.search(start);
            let grows = match &path {
                Some(path) => path.iter().any(|node| self.is_edge(*node)),
                None => self.leads_out([start].into()) && self.leads_out(self.arrival().cells_at_goal().collect()),
            };
            if !(grows && self.grow(at_m)) {
                return path.map(|path| self.way_points(at_m, at, &path));
            }
        }
    }

    fn arrival(&self) -> Arrival<'_> {
        Arrival::new(&self.map, &self.costs, self.goal, self.settings.arrive())
    }

    fn search(&mut self, start: Node) -> Option<Vec<Node>> {
        let Self { map, costs, goal, settings, search, changed, .. } = self;
        let network = Arrival::new(map, costs, *goal, settings.arrive());
        search.move_to(&network, start);
        changed.sort_unstable();
        changed.dedup();
        search.changed(&network, changed.drain(..));
        search.search(&network).map(|found| found.path)
    }

    /// Way points along a path of nodes from the cell of a place, or from the free one that is nearest to it.
    fn way_points(&self, at_m: [f64; 2], at: Node, path: &[Node]) -> Vec<[f64; 2]> {
        let Some((first, rest)) = path.split_first() else { return vec![at_m] };
        let mut points_m = vec![at_m];
        let mut from = self.map.point_at(at_m);
        let mut rest = rest;
        // The map is level: what is free may be passed.
        let passable = |from: Point, node: Node| self.map.is_free_along(from, self.map.point(node));
        let centred = |from: Point| {
            let to = self.map.point(*first);
            (from[0] - to[0]).abs().max((from[1] - to[1]).abs()) <= AT_CENTRE
        };
        // Out of blocked cells, and from off the centre of a cell where a step from there would touch a blocked one.
        if *first != at || !(centred(from) || rest.first().is_none_or(|next| passable(from, *next))) {
            points_m.push(self.map.position_m(*first));
            from = self.map.point(*first);
        }
        while let Some(next) = rest.first() {
            let ahead = &rest[..rest.len().min(STEPS_AHEAD)];
            let seen = ahead.iter().take_while(|node| passable(from, **node)).count().max(1);
            let last = ahead.get(seen - 1).unwrap_or(next);
            points_m.push(self.map.position_m(*last));
            from = self.map.point(*last);
            rest = &rest[seen..];
        }
        // The goal itself rather than the centre of its cell.
        if points_m.len() > 1 {
            points_m.pop();
        }
        points_m.push(self.goal_m);
        points_m
    }

    /// The free node that is nearest to one, by steps over cells that hold no hazard themselves, then over any; `None` where all are blocked.
    fn nearest_free(&self, at: Node) -> Option<Node> {
        let free = |node: &Node| !self.map.is_blocked(*node);
        let over = |all: bool| {
            let open = |node: Node| all || !self.cells[node as usize].is_hazard();
            self.flood(vec![at], open, &mut |node| free(&node))
        };
        if free(&at) { Some(at) } else { over(false).or_else(|| over(true)) }
    }

    /// Whether free cells lead from one of these to the edge of the map.
    fn leads_out(&self, from: Vec<Node>) -> bool {
        let free = |node: Node| !self.map.is_blocked(node);
        let from = from.into_iter().filter(|node| free(*node)).collect();
        self.flood(from, free, &mut |node| self.is_edge(node)).is_some()
    }

    /// The first node, in order of steps along the axes over open cells, that is looked for.
    fn flood(&self, from: Vec<Node>, open: impl Fn(Node) -> bool, found: &mut dyn FnMut(Node) -> bool) -> Option<Node> {
        let mut met = vec![false; self.map.len()];
        from.iter().for_each(|node| met[*node as usize] = true);
        let mut queue = VecDeque::from(from);
        while let Some(node) = queue.pop_front() {
            if found(node) {
                return Some(node);
            }
            for &direction in Neighbourhood::Four.directions() {
                let Some(next) = self.map.neighbour(node, direction).filter(|next| open(*next)) else { continue };
                if !std::mem::replace(&mut met[next as usize], true) {
                    queue.push_back(next);
                }
            }
        }
        None
    }

    fn node_at(&self, [x, y]: [f64; 2]) -> Option<Node> {
        self.map.heights().geometry.cell_at(x, y).map(|(row, col)| self.map.node(row, col))
    }

    fn is_edge(&self, node: Node) -> bool {
        let ([row, col], [rows, cols]) = (self.map.place(node), self.map.shape());
        row == 0 || col == 0 || row + 1 == rows || col + 1 == cols
    }

    /// Doubles the room around start, goal and a place; `false`, and no change, where that would make too many cells.
    fn grow(&mut self, at_m: [f64; 2]) -> bool {
        let beyond_m = 2.0 * self.beyond_m;
        let low = [0, 1].map(|axis| self.start_m[axis].min(at_m[axis]));
        let high = [0, 1].map(|axis| self.start_m[axis].max(at_m[axis]));
        let ends = [0, 1].map(|axis| [low[axis].min(self.goal_m[axis]), high[axis].max(self.goal_m[axis])]);
        let larger = self.settings.geometry(ends.map(|end| end[0]), ends.map(|end| end[1]), beyond_m);
        let Some((map, costs)) = larger.and_then(level).ok() else { return false };
        let before = std::mem::replace(&mut self.map, map);
        let cells = std::mem::replace(&mut self.cells, vec![Cell::Unseen; self.map.len()]);
        (self.costs, self.beyond_m, self.near) = (costs, beyond_m, vec![0; self.map.len()]);
        for (node, cell) in (0..before.len() as Node).zip(cells) {
            if cell != Cell::Unseen
                && let Some(same) = self.node_at(before.position_m(node))
            {
                self.learn(same, cell);
            }
        }
        self.goal = self.map.nearest(self.map.point_at(self.goal_m));
        let start = self.map.nearest(self.map.point_at(at_m));
        self.search = DStarLite::new(&self.arrival(), start, self.goal);
        self.changed.clear();
        true
    }
}

impl ExplorerSettings {
    /// # Errors
    /// A value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::positive("cell_m", self.cell_m)?;
        ParameterError::not_negative("margin_m", self.margin_m)?;
        ParameterError::positive("arrive_m", self.arrive_m)?;
        ParameterError::positive("beyond_m", self.beyond_m).map(|_| ())
    }

    /// Shape and place of a map that holds two places and room around them: cells lie at whole multiples of their side.
    ///
    /// # Errors
    /// Too many cells.
    pub fn geometry(&self, a_m: [f64; 2], b_m: [f64; 2], beyond_m: f64) -> Result<Geometry, ParameterError> {
        let cell = self.cell_m;
        let first = [0, 1].map(|axis| libm::floor((a_m[axis].min(b_m[axis]) - beyond_m) / cell));
        let count = [0, 1].map(|axis| libm::ceil((a_m[axis].max(b_m[axis]) + beyond_m) / cell) - first[axis]);
        let cells = count[0] * count[1];
        if cells.is_nan() || cells > CELLS_MAX as f64 {
            let message =
                format!("is {cell} m: the map would have {} x {} cells, more than {CELLS_MAX}", count[1], count[0]);
            return Err(ParameterError::new("cell_m", message));
        }
        Ok(Geometry {
            rows: count[1] as usize,
            cols: count[0] as usize,
            cell: [cell; 2],
            origin: first.map(|k| k * cell),
        })
    }

    /// Distance of cell centres from the goal at which it is reached, m.
    fn arrive(&self) -> f64 {
        (self.arrive_m - CELL_CORNER * self.cell_m).max(0.0)
    }

    /// Offsets of the cells whose sides are nearer than the margin.
    fn margin(&self) -> Vec<[i64; 2]> {
        let reach = libm::floor(self.margin_m / self.cell_m) as i64 + 1;
        let gap_m = |cells: i64| (cells.abs() - 1).max(0) as f64 * self.cell_m;
        let within = |down: i64, across: i64| {
            let [y, x] = [gap_m(down), gap_m(across)];
            (down, across) == (0, 0) || x * x + y * y < self.margin_m * self.margin_m * (1.0 - ROUNDING)
        };
        let offsets = (-reach..=reach).flat_map(|down| (-reach..=reach).map(move |across| [down, across]));
        offsets.filter(|[down, across]| within(*down, *across)).collect()
    }
}

/// A level map without hazards.
fn level(geometry: Geometry) -> Result<(TravelMap, CostModel), ParameterError> {
    let limits = SlopeLimits::new(LEVEL_DEG, LEVEL_DEG)?;
    let refused = |error| ParameterError::new("cell_m", format!("gives no map: failed to {error}"));
    let map = TravelMap::new(Grid::filled(geometry, 0.0), limits).map_err(refused)?;
    let costs = CostModel::new(SlopeCost::Linear { up: 0.0, down: 0.0 }, None, &map)?;
    Ok((map, costs))
}

/// Whether a convex area holds a point: it lies on one side of all edges, or on one of them.
fn holds(corners: &[[f64; 2]; 4], [x, y]: [f64; 2], edges_too: bool) -> bool {
    let turn = |k: usize| {
        let ([ax, ay], [bx, by]) = (corners[k], corners[(k + 1) % 4]);
        (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    };
    let turns = [0, 1, 2, 3].map(turn);
    let inside = |sign: f64| turns.iter().all(|turn| sign * turn > 0.0 || edges_too && *turn == 0.0);
    inside(1.0) || inside(-1.0)
}

/// Steps over free cells, and from every free cell within reach of the goal to it.
struct Arrival<'a> {
    grid: GridNetwork<'a>,
    goal: Node,
    arrive_m: f64,
}

impl<'a> Arrival<'a> {
    fn new(map: &'a TravelMap, costs: &'a CostModel, goal: Node, arrive_m: f64) -> Self {
        let ground = Ground { map, costs, clearance: None };
        Self { grid: GridNetwork { ground, neighbourhood: Neighbourhood::Eight }, goal, arrive_m }
    }

    fn arrives(&self, node: Node) -> bool {
        let map = self.grid.ground.map;
        let ([x, y], [gx, gy]) = (map.position_m(node), map.position_m(self.goal));
        let away = (x - gx) * (x - gx) + (y - gy) * (y - gy);
        node != self.goal && away <= self.arrive_m * self.arrive_m && !map.is_blocked(node)
    }

    /// Free cells within reach of the goal.
    fn cells_at_goal(&self) -> impl Iterator<Item = Node> {
        let map = self.grid.ground.map;
        let ([row, col], [rows, cols]) = (map.place(self.goal), map.shape());
        let reach = libm::floor(self.arrive_m / map.step_m(Direction { rows: 0, cols: 1 })) as usize;
        let near = move |at: usize, count: usize| at.saturating_sub(reach)..(at + reach + 1).min(count);
        let nodes = near(row, rows).flat_map(move |r| near(col, cols).map(move |c| map.node(r, c)));
        nodes.filter(move |node| self.arrives(*node) || *node == self.goal && !map.is_blocked(*node))
    }
}

impl Network for Arrival<'_> {
    fn len(&self) -> usize {
        self.grid.len()
    }

    fn edges(&self, node: Node, mut visit: impl FnMut(Node, f64)) {
        self.grid.edges(node, &mut visit);
        if self.arrives(node) {
            visit(self.goal, self.bound(node, self.goal));
        }
    }

    fn bound(&self, from: Node, to: Node) -> f64 {
        self.grid.bound(from, to)
    }
}

impl Reversible for Arrival<'_> {
    fn edges_into(&self, node: Node, mut visit: impl FnMut(Node, f64)) {
        self.grid.edges_into(node, &mut visit);
        if node == self.goal {
            let others = self.cells_at_goal().filter(|cell| *cell != self.goal);
            others.for_each(|cell| visit(cell, self.bound(cell, self.goal)));
        }
    }
}
