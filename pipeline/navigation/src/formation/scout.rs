//! Planning for a team that knows only the ground it has seen.
//!
//! The team sees the ground within a radius of its leader and remembers it. As in [`crate::replan`], D* Lite finds the cheapest steps to the goal,
//! with unseen ground counted as free and level, and searches again only what new observations affect. The team is led along the part of the plan
//! within the circle that it sees, straightened, so it stays on known ground. It gets a new route when the plan leaves that circle elsewhere, or when
//! half of the way to the circle's edge is left.

use super::footing::{Footing, TeamGround};
use super::plane::{Vector, distance};
use crate::map::{Direction, Neighbourhood, Node, TravelMap};
use crate::replan::Known;
use crate::search::dstar_lite::DStarLite;
use crate::search::grid::GridNetwork;
use crate::smoothing::smoothed;
use sastrugi_schemas::ParameterError;

#[cfg(test)]
mod tests;

/// Share of the radius by which the plan's exit from the circle must move for the plan to count as a different one.
const TURN: f64 = 0.25;
/// Least radius in cell diagonals, in addition to the distance at which targets count as reached, so that the end of the known ground stays ahead of
/// the leader.
const DIAGONALS: f64 = 4.0;

/// What a team should do after a look around.
#[derive(Clone, Debug, PartialEq)]
pub enum Advice {
    /// Continue as before.
    Continue,
    /// Follow another route: its points from the leader's node on, m.
    Lead {
        /// The points.
        ahead_m: Vec<Vector>,
        /// Whether the plan is a different one; otherwise it extends the old one.
        turns: bool,
    },
    /// There is no path to the goal.
    NoPath,
}

/// What a team has seen, and its plan.
#[derive(Clone, Debug)]
pub struct Scout<'a> {
    footing: Footing<'a>,
    known: Known<'a>,
    search: DStarLite,
    at: Node,
    goal: Node,
    /// Centre of the circle of the last plan.
    centre: Node,
    /// Node at which the plan leaves that circle.
    end: Node,
    /// Radius of the circles for plans: lines between nodes in them touch only seen cells.
    reach_m: f64,
    /// Distance to the end at which the team gets the next part of its route.
    extend_m: f64,
}

impl<'a> Scout<'a> {
    /// A scout at the start, with what is seen from there.
    ///
    /// # Errors
    /// The radius is too small for the cells.
    pub fn new(
        on: &'a TeamGround<'a>,
        radius_m: f64,
        arrive_m: f64,
        [start_m, goal_m]: [Vector; 2],
    ) -> Result<Self, ParameterError> {
        let ground = on.ground();
        let diagonal_m = ground.map.step_m(Direction { rows: 1, cols: 1 });
        let least_m = DIAGONALS * diagonal_m + arrive_m;
        if radius_m < least_m {
            let message = format!(
                "is {radius_m} m; on this terrain it must be at least {least_m:.3} m: {DIAGONALS} cell diagonals plus `arrive_m`"
            );
            return Err(ParameterError::new("sensing_radius_m", message));
        }
        let [start, goal] = [start_m, goal_m].map(|end_m| ground.map.nearest(ground.map.point_at(end_m)));
        let known = Known::new(GridNetwork { ground, neighbourhood: Neighbourhood::Eight }, radius_m, start);
        Ok(Self {
            footing: Footing::new(on, &[]),
            search: DStarLite::new(&known, start, goal),
            known,
            at: start,
            goal,
            centre: start,
            end: start,
            reach_m: radius_m - diagonal_m,
            extend_m: (0.5 * radius_m).max(arrive_m + 2.0 * diagonal_m),
        })
    }

    /// Whether the present route leads to the goal itself.
    pub fn leads_to_goal(&self) -> bool {
        self.end == self.goal
    }

    /// The first plan; `None` if there is no path.
    pub fn first_plan(&mut self) -> Option<Vec<Vector>> {
        let path = self.search.search(&self.known)?.path;
        Some(self.ahead(&path))
    }

    /// Looks around from the leader's present position.
    pub fn look(&mut self, leader_m: Vector) -> Advice {
        let near = self.footing.node_near(leader_m, 0, |node_m| self.footing.is_passable(leader_m, node_m));
        let Some(node) = near.filter(|node| *node != self.at && !self.leads_to_goal()) else { return Advice::Continue };
        self.at = node;
        let changed = self.known.sense(node);
        let ends_soon = self.distance_m(node, self.end) <= self.extend_m;
        if changed.is_empty() && !ends_soon {
            return Advice::Continue;
        }
        self.search.move_to(&self.known, node);
        self.search.changed(&self.known, changed);
        let Some(found) = self.search.search(&self.known) else { return Advice::NoPath };
        let turns = self.distance_m(self.leaves(&found.path), self.end) > TURN * self.reach_m;
        match turns || ends_soon {
            true => Advice::Lead { ahead_m: self.ahead(&found.path), turns },
            false => Advice::Continue,
        }
    }

    /// The last node of a plan before it leaves the circle of the last plan.
    fn leaves(&self, path: &[Node]) -> Node {
        let within = path.iter().take_while(|node| self.distance_m(self.centre, **node) <= self.reach_m);
        within.last().copied().unwrap_or(self.at)
    }

    /// The part of a plan within the circle around its start, straightened, m.
    fn ahead(&mut self, path: &[Node]) -> Vec<Vector> {
        self.centre = self.at;
        self.end = self.leaves(path);
        let inner = path.iter().position(|node| *node == self.end).map_or(path, |last| &path[..=last]);
        let straight = smoothed(&self.footing.ground(), inner, 0.0).map(|(nodes, _)| nodes);
        straight.as_deref().unwrap_or(inner).iter().map(|node| self.map().position_m(*node)).collect()
    }

    fn map(&self) -> &'a TravelMap {
        self.footing.ground().map
    }

    fn distance_m(&self, a: Node, b: Node) -> f64 {
        distance(self.map().position_m(a), self.map().position_m(b))
    }
}
