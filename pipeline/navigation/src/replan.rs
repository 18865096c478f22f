//! A walk over ground that is known only as far as it has been seen.
//!
//! At every node the walker senses all cells within a radius, remembers them, and goes one step along the cheapest path to the goal as far as
//! is known. Cells that it has not seen it takes for free and level: a step to or from such a cell costs its horizontal length. What it
//! sees changes these costs, and [`DStarLite`] searches again only what that changes. Costs are by slope alone: factors and clearance
//! would have to be known ahead.

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

/// How a walker sees and steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WalkSettings {
    /// Distance within which cells are seen, m; at least the diagonal of a cell, so that every step is seen before it is taken.
    pub sensing_radius_m: f64,
    /// Cost of slopes.
    pub slope: SlopeCost,
    /// Steps that may be taken.
    #[serde(default)]
    pub neighbourhood: Neighbourhood,
}

/// A walk to the goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Walk {
    /// Nodes from start to goal, in steps.
    pub path: Vec<Node>,
    /// What the walk cost, by the fine integral.
    pub travelled: Travelled,
    /// Cost of its steps.
    pub cost: f64,
    /// Cost of the cheapest steps with full knowledge.
    pub informed_cost: f64,
    /// Searches after the first, each because something seen changed the costs.
    pub replans: u64,
    /// Vertices expanded by all searches.
    pub expansions: u64,
    /// Vertices expanded by one search with full knowledge.
    pub informed_expansions: u64,
}

/// Walks from start to goal.
///
/// # Errors
/// A radius below the diagonal of a cell, weights out of range, ends that are outside, blocked or equal, or no path between them.
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

    /// Nodes to the goal; `None` once no path is left.
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

/// The grid as far as it has been seen.
#[derive(Clone, Debug)]
pub(crate) struct Known<'a> {
    grid: GridNetwork<'a>,
    radius_m: f64,
    /// Where it was last seen from.
    from: Node,
    seen: Vec<bool>,
}

impl<'a> Known<'a> {
    /// The grid as far as it is seen from a node.
    pub(crate) fn new(grid: GridNetwork<'a>, radius_m: f64, from: Node) -> Self {
        let mut known = Self { grid, radius_m, from, seen: vec![false; grid.len()] };
        for row in 0..grid.ground.map.shape()[0] {
            let columns = known.in_sight(from, row);
            let first = grid.ground.map.node(row, 0) as usize;
            known.seen[first + columns.start..first + columns.end].fill(true);
        }
        known
    }

    /// Sees the cells within the radius; returns those whose steps may have changed, ascending. Only the part of the circle is looked at that
    /// lies outside the last one.
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

    /// Columns of a row with their centres within the radius of a node.
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

    /// Cost of a step as far as is known; `None` where it may not be taken.
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

    /// By horizontal length: heights are not known ahead.
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
