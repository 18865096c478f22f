//! Planner for a rover on a map that it discovers as it goes, without access to the complete map.
//!
//! The explorer is given areas that are safe or contain a hazard, and applies them cell by cell (a cell belongs to the area that contains its centre;
//! on an edge, to the area with the hazard). Unseen cells count as free. As in [`crate::replan`], [`DStarLite`] finds the cheapest steps to the goal
//! and searches again only what new observations change.
//!
//! * Knowledge of a cell only rises: unseen, suspect (in an area with a hazard, which may lie anywhere in it), safe, fixed hazard. A look that finds
//!   a suspect cell safe frees it; a safe cell stays safe, and no longer counts as a possible position of an area's hazard. If no cell near an area
//!   with a hazard can still hold it, an earlier look must have missed something, and all cells of the area become fixed hazards. A hazard seen at a
//!   position, rather than in an area, fixes its cell at once. Knowledge is therefore bounded, and with it the number of changes of the plan.
//! * Suspect cells and fixed hazards block all cells nearer than a margin, which keeps the body clear of them.
//! * If no path is left, the knowledge may be wrong; it can be discarded ([`Explorer::forget`]).
//! * Every free cell within the tolerance of the goal leads to it, because the goal itself may be blocked.
//! * A start among blocked cells is left via the nearest free one.
//! * The map contains start and goal and a border around them. It grows if the plan touches its edge, or if there is no plan although the edge can be
//!   reached from both ends. At [`CELLS_MAX`] cells it stops growing, and its edge bounds all plans.
//!
//! # Cost
//! 50 bytes per cell, at most 50 MB.

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

/// Largest number of cells of a map: a square of 102 m with cells of 0.1 m.
pub const CELLS_MAX: usize = 1 << 20;
/// Slope limit on the level map, degrees; any value will do.
const LEVEL_DEG: f64 = 45.0;
/// A cell counts as at the goal if its centre is within the tolerance less this share of a cell, so that a rover anywhere in the cell is within the
/// tolerance.
const CELL_CORNER: f64 = 0.75;
/// Number of steps of a plan that are checked for the next waypoint.
const STEPS_AHEAD: usize = 60;
/// Relative rounding of squared distances.
const ROUNDING: f64 = 1e-9;
/// A waypoint within this distance, in cells, has been reached.
const AT_CENTRE: f64 = 0.05;

/// Settings of an explorer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExplorerSettings {
    /// Side of a cell, m.
    pub cell_m: f64,
    /// Least distance between a hazard and the rover's position, each anywhere in its cell, m.
    pub margin_m: f64,
    /// Distance at which the goal counts as reached, m.
    pub arrive_m: f64,
    /// Initial border of the map around start and goal, m.
    pub beyond_m: f64,
}

/// Result of a look at an area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// The area contains no hazard.
    Safe,
    /// The area contains a hazard somewhere.
    Hazard,
}

/// Knowledge of a cell, in rising order.
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

/// Knowledge of an explorer, and its search.
#[derive(Clone, Debug)]
pub struct Explorer {
    settings: ExplorerSettings,
    start_m: [f64; 2],
    goal_m: [f64; 2],
    beyond_m: f64,
    map: TravelMap,
    costs: CostModel,
    cells: Vec<Cell>,
    /// Number of cells with hazards nearer than the margin, per cell.
    near: Vec<u16>,
    /// Offsets in rows and columns of the cells within the margin of a cell.
    margin: Vec<[i64; 2]>,
    goal: Node,
    search: DStarLite,
    /// Nodes whose steps have changed since the last search.
    changed: Vec<Node>,
}

impl Explorer {
    /// An explorer without knowledge.
    ///
    /// # Errors
    /// Settings out of range, or a map with too many cells.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_navigation::explorer::{Explorer, ExplorerSettings, Sight};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let settings = ExplorerSettings { cell_m: 0.1, margin_m: 0.2, arrive_m: 0.5, beyond_m: 2.0 };
    /// let mut explorer = Explorer::new(settings, [0.0, 0.0], [3.0, 0.4])?;
    /// // Nothing is known yet: straight to the goal.
    /// assert_eq!(explorer.plan([0.02, 0.03]), Some(vec![[0.02, 0.03], [3.0, 0.4]]));
    /// // A wall across the way: around it.
    /// explorer.see(&[[1.0, -1.0], [1.2, -1.0], [1.2, 1.0], [1.0, 1.0]], Sight::Hazard);
    /// assert!(explorer.is_blocked([1.1, 0.1]));
    /// assert!(explorer.plan([0.02, 0.03]).is_some_and(|points_m| points_m.len() > 2));
    /// # Ok(())
    /// # }
    /// ```
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

    /// Number of cells of the map.
    pub fn len(&self) -> usize {
        self.map.len()
    }

    /// Always false.
    pub fn is_empty(&self) -> bool {
        self.map.is_empty()
    }

    /// Vertices expanded by all searches on the current map.
    pub fn expansions(&self) -> u64 {
        self.search.expansions()
    }

    /// Whether a point lies in a blocked cell.
    pub fn is_blocked(&self, at_m: [f64; 2]) -> bool {
        self.node_at(at_m).is_some_and(|node| self.map.is_blocked(node))
    }

    /// Adds a look at the convex area with these corners, given in order around it. Observations outside the map are dropped: the map grows before a
    /// plan leads there.
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
        // All cells of the area were believed to be safe.
        if sight == Sight::Hazard && !nodes.iter().any(|node| self.map.is_blocked(*node)) {
            nodes.iter().for_each(|node| self.learn(*node, Cell::Fixed));
        }
    }

    /// Adds a look that found a hazard at a position: its cell becomes a fixed hazard. Observations outside the map are dropped.
    pub fn see_hazard_at(&mut self, at_m: [f64; 2]) {
        if let Some(node) = self.node_at(at_m) {
            self.learn(node, Cell::Fixed);
        }
    }

    /// Discards all knowledge.
    pub fn forget(&mut self) {
        for node in 0..self.map.len() as Node {
            self.cells[node as usize] = Cell::Unseen;
            if std::mem::take(&mut self.near[node as usize]) > 0 {
                self.map.unblock(node);
                self.changed.extend(self.map.around(node));
            }
        }
    }

    /// Raises the knowledge of a cell.
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

    /// Blocks or frees the cells within the margin of a cell.
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

    /// Waypoints from a position to the goal over the cells known so far. The first is the position itself; each next one is as far along the plan as
    /// a straight line reaches. `None` if there is no path.
    pub fn plan(&mut self, at_m: [f64; 2]) -> Option<Vec<[f64; 2]>> {
        loop {
            let Some(at) = self.node_at(at_m).filter(|node| !self.is_edge(*node)) else {
                // Outside the map or at its edge.
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
                return path.map(|path| self.waypoints(at_m, at, &path));
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

    /// Waypoints along a path of nodes that starts at the cell of a position, or at the free cell nearest to it.
    fn waypoints(&self, at_m: [f64; 2], at: Node, path: &[Node]) -> Vec<[f64; 2]> {
        let Some((first, rest)) = path.split_first() else { return vec![at_m] };
        let mut points_m = vec![at_m];
        let mut from = self.map.point_at(at_m);
        let mut rest = rest;
        // The map is level, so whatever is free is passable.
        let passable = |from: Point, node: Node| self.map.is_free_along(from, self.map.point(node));
        let centred = |from: Point| {
            let to = self.map.point(*first);
            (from[0] - to[0]).abs().max((from[1] - to[1]).abs()) <= AT_CENTRE
        };
        // Needed to leave blocked cells, and when the position is off its cell's centre and a step from there would touch a blocked cell.
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
        // Ends at the goal itself, not at the centre of its cell.
        if points_m.len() > 1 {
            points_m.pop();
        }
        points_m.push(self.goal_m);
        points_m
    }

    /// The free node reached in the fewest steps from a node, over cells that hold no hazard themselves, else over any cells; `None` if all are
    /// blocked.
    fn nearest_free(&self, at: Node) -> Option<Node> {
        let free = |node: &Node| !self.map.is_blocked(*node);
        let over = |all: bool| {
            let open = |node: Node| all || !self.cells[node as usize].is_hazard();
            self.flood(vec![at], open, &mut |node| free(&node))
        };
        if free(&at) { Some(at) } else { over(false).or_else(|| over(true)) }
    }

    /// Whether free cells lead from one of these nodes to the edge of the map.
    fn leads_out(&self, from: Vec<Node>) -> bool {
        let free = |node: Node| !self.map.is_blocked(node);
        let from = from.into_iter().filter(|node| free(*node)).collect();
        self.flood(from, free, &mut |node| self.is_edge(node)).is_some()
    }

    /// The first node that satisfies `found`, in order of steps along the axes over open cells.
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

    /// Doubles the border around start, goal and a position; false, without a change, if that would take too many cells.
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

    /// Geometry of a map that contains two positions and a border around them; cells lie at integer multiples of their side.
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

    /// Distance from the goal within which a cell's centre counts as at the goal, m.
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
    let refused = |error| ParameterError::new("cell_m", format!("cannot form a map: failed to {error}"));
    let map = TravelMap::new(Grid::filled(geometry, 0.0), limits).map_err(refused)?;
    let costs = CostModel::new(SlopeCost::Linear { up: 0.0, down: 0.0 }, None, &map)?;
    Ok((map, costs))
}

/// Whether a convex area contains a point: it lies on the same side of all edges, or on one of them if `edges_too`.
fn holds(corners: &[[f64; 2]; 4], [x, y]: [f64; 2], edges_too: bool) -> bool {
    let turn = |k: usize| {
        let ([ax, ay], [bx, by]) = (corners[k], corners[(k + 1) % 4]);
        (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    };
    let turns = [0, 1, 2, 3].map(turn);
    let inside = |sign: f64| turns.iter().all(|turn| sign * turn > 0.0 || edges_too && *turn == 0.0);
    inside(1.0) || inside(-1.0)
}

/// Steps between free cells, and an edge from every free cell within the tolerance to the goal.
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

    /// Free cells within the tolerance of the goal.
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
