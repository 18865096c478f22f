//! A walk over ground that is discovered on the way.
//!
//! At every node the walker senses all cells within a radius, remembers them, and takes one step along the cheapest path to the goal given what it
//! has seen. Unseen cells count as free and level: a step to or from one costs its horizontal length. New cells change these costs, and [`DStarLite`]
//! searches again only what they affect. Costs depend on slope alone: factors and clearance would have to be known in advance.

use crate::cost::{CostModel, SlopeCost};
use crate::line::{Ground, Travelled};
use crate::map::{Direction, Neighbourhood, Node, TravelMap};
use crate::route::{Cell, RouteError, check_ends};
use crate::search::dstar_lite::DStarLite;
use crate::search::grid::GridNetwork;
use crate::search::{Network, Reversible, astar};
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ops::Range;

#[cfg(test)]
mod tests;

/// Settings of a walk.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WalkSettings {
    /// Sensing radius, m; at least the diagonal of a cell, so that every step is seen before it is taken.
    pub sensing_radius_m: f64,
    /// Cost of slopes.
    pub slope: SlopeCost,
    /// Allowed steps.
    #[serde(default)]
    pub neighbourhood: Neighbourhood,
}

/// A walk to the goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Walk {
    /// Nodes from start to goal, one step apart.
    pub path: Vec<Node>,
    /// Score of the walk, by the line integral.
    pub travelled: Travelled,
    /// Sum of the costs of its steps.
    pub cost: f64,
    /// Cost of the cheapest path of steps with full knowledge.
    pub informed_cost: f64,
    /// Searches after the first, each triggered by a change of costs.
    pub replans: u64,
    /// Vertices expanded by all searches.
    pub expansions: u64,
    /// Vertices expanded by one search with full knowledge.
    pub informed_expansions: u64,
}

/// Walks from start to goal.
///
/// # Errors
/// A radius below the diagonal of a cell; weights out of range; ends outside the map, blocked or equal; no path between them.
///
/// # Examples
/// ```
/// use sastrugi_navigation::replan::{WalkSettings, walk};
/// use sastrugi_navigation::{Neighbourhood, SlopeCost, SlopeLimits, TravelMap};
/// use sastrugi_numeric::{Geometry, Grid};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // A wall leaves only the southernmost row open.
/// let heights = Grid::filled(Geometry::square(5, 7, 1.0), 0.0);
/// let mut map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0)?)?;
/// for row in 0..4 {
///     map.block(map.node(row, 3));
/// }
/// let settings =
///     |sensing_radius_m| WalkSettings { sensing_radius_m, slope: SlopeCost::THESIS, neighbourhood: Neighbourhood::Four };
/// let sees_little = walk(&map, &settings(1.5), [0, 0], [0, 6])?;
/// assert!(sees_little.replans > 0 && sees_little.cost >= sees_little.informed_cost);
/// // With everything in sight, the first plan is the cheapest path.
/// let sees_all = walk(&map, &settings(100.0), [0, 0], [0, 6])?;
/// assert_eq!((sees_all.cost, sees_all.informed_cost, sees_all.replans), (14.0, 14.0, 0));
/// # Ok(())
/// # }
/// ```
pub fn walk(map: &TravelMap, settings: &WalkSettings, start: Cell, goal: Cell) -> Result<Walk, RouteError> {
    check_radius(map, settings.sensing_radius_m)?;
    let costs = CostModel::new(settings.slope, None, map)?;
    let ends = check_ends(map, start, goal)?;
    let grid =
        GridNetwork { ground: Ground { map, costs: &costs, clearance: None }, neighbourhood: settings.neighbourhood };
    let no_path =
        RouteError::NoPath { start, goal, neighbourhood: settings.neighbourhood, limits_deg: map.limits().degrees() };
    let informed = astar::search(&grid, ends[0], ends[1]).ok_or(no_path.clone())?;
    let mut walker = Walker::new(grid, settings.sensing_radius_m, ends);
    let path = walker.walk().ok_or(no_path)?;
    Ok(Walk {
        travelled: grid.ground.path(&path).ok_or(RouteError::Score { start, goal })?,
        cost: walker.cost,
        path,
        informed_cost: informed.cost,
        replans: walker.replans,
        expansions: walker.search.expansions(),
        informed_expansions: informed.expansions,
    })
}

fn check_radius(map: &TravelMap, radius_m: f64) -> Result<(), ParameterError> {
    let diagonal_m = map.step_m(Direction { rows: 1, cols: 1 });
    if radius_m >= diagonal_m && radius_m.is_finite() {
        return Ok(());
    }
    let message = format!("is {radius_m} m; it must be at least the diagonal of a cell, {diagonal_m} m");
    Err(ParameterError::new("sensing_radius_m", message))
}

struct Walker<'a> {
    known: Known<'a>,
    search: DStarLite,
    at: Node,
    goal: Node,
    cost: f64,
    replans: u64,
}

impl<'a> Walker<'a> {
    fn new(grid: GridNetwork<'a>, radius_m: f64, [start, goal]: [Node; 2]) -> Self {
        let known = Known::new(grid, radius_m, start);
        let search = DStarLite::new(&known, start, goal);
        Self { known, search, at: start, goal, cost: 0.0, replans: 0 }
    }

    /// Nodes to the goal; `None` once there is no path.
    fn walk(&mut self) -> Option<Vec<Node>> {
        let mut walked = vec![self.at];
        let mut plan = self.search.search(&self.known)?.path.into_iter().skip(1);
        while self.at != self.goal {
            let next = plan.next()?;
            self.known.edges(self.at, |target, cost| self.cost += if target == next { cost } else { 0.0 });
            self.at = next;
            walked.push(next);
            let changed = self.known.sense(next);
            if !changed.is_empty() && next != self.goal {
                self.search.move_to(&self.known, next);
                self.search.changed(&self.known, changed);
                self.replans += 1;
                plan = self.search.search(&self.known)?.path.into_iter().skip(1);
            }
        }
        Some(walked)
    }
}

/// The part of the grid seen so far.
#[derive(Clone, Debug)]
pub(crate) struct Known<'a> {
    grid: GridNetwork<'a>,
    radius_m: f64,
    /// Node that the last look was taken from.
    from: Node,
    seen: Vec<bool>,
}

impl<'a> Known<'a> {
    /// The grid as seen from a node.
    pub(crate) fn new(grid: GridNetwork<'a>, radius_m: f64, from: Node) -> Self {
        let mut known = Self { grid, radius_m, from, seen: vec![false; grid.len()] };
        for row in 0..grid.ground.map.shape()[0] {
            let columns = known.in_sight(from, row);
            let first = grid.ground.map.node(row, 0) as usize;
            known.seen[first + columns.start..first + columns.end].fill(true);
        }
        known
    }

    /// Senses the cells within the radius and returns those whose steps may have changed, ascending. Only the part of the circle outside the previous
    /// one is visited.
    pub(crate) fn sense(&mut self, from: Node) -> Vec<Node> {
        let map = self.grid.ground.map;
        let before = std::mem::replace(&mut self.from, from);
        let mut changed = Vec::new();
        for row in 0..map.shape()[0] {
            let [now, known] = [from, before].map(|place| self.in_sight(place, row));
            for col in (now.start..now.end.min(known.start)).chain(now.start.max(known.end)..now.end) {
                let node = map.node(row, col);
                if !std::mem::replace(&mut self.seen[node as usize], true) {
                    changed.extend(map.around(node));
                }
            }
        }
        changed.sort_unstable();
        changed.dedup();
        changed
    }

    /// Columns of a row whose centres lie within the radius of a node.
    fn in_sight(&self, from: Node, row: usize) -> Range<usize> {
        let map = self.grid.ground.map;
        let ([from_row, from_col], [dx, dy], cols) = (map.place(from), map.cell_m(), map.shape()[1]);
        let away_m = row.abs_diff(from_row) as f64 * dy;
        if away_m > self.radius_m {
            return 0..0;
        }
        let reach = libm::floor((self.radius_m * self.radius_m - away_m * away_m).sqrt() / dx) as usize;
        from_col.saturating_sub(reach)..from_col.saturating_add(reach).saturating_add(1).min(cols)
    }

    /// Cost of a step given what has been seen; `None` if the step is not allowed.
    fn step(&self, node: Node, target: Node, direction: Direction) -> Option<f64> {
        let Ground { map, costs, .. } = self.grid.ground;
        let ([row, col], [target_row, target_col]) = (map.place(node), map.place(target));
        let cells = [node, target, map.node(row, target_col), map.node(target_row, col)];
        let seen = |cell: &Node| self.seen[*cell as usize];
        if cells.iter().all(seen) {
            return map.accessible(node, direction).map(|_| costs.step(map, node, target, direction));
        }
        let free = !cells.iter().any(|cell| seen(cell) && map.is_blocked(*cell));
        free.then(|| costs.piece(map.step_m(direction), 0.0))
    }
}

impl Network for Known<'_> {
    fn len(&self) -> usize {
        self.grid.len()
    }

    fn edges(&self, node: Node, mut visit: impl FnMut(Node, f64)) {
        for &direction in self.grid.neighbourhood.directions() {
            let Some(target) = self.grid.ground.map.neighbour(node, direction) else { continue };
            self.step(node, target, direction).into_iter().for_each(|cost| visit(target, cost));
        }
    }

    /// From the horizontal length alone, because heights are not known in advance.
    fn bound(&self, from: Node, to: Node) -> f64 {
        self.grid.ground.costs.level_bound(self.grid.ground.map, from, to, self.grid.neighbourhood)
    }
}

impl Reversible for Known<'_> {
    fn edges_into(&self, node: Node, mut visit: impl FnMut(Node, f64)) {
        for &direction in self.grid.neighbourhood.directions() {
            let Some(source) = self.grid.ground.map.neighbour(node, direction.back()) else { continue };
            self.step(source, node, direction).into_iter().for_each(|cost| visit(source, cost));
        }
    }
}
