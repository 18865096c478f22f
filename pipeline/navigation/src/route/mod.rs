//! Routes from one cell to another: settings in, scored paths out.
//!
//! [`plan`] plans one route. A [`Planner`] prepares everything that does not depend on start and goal (vertices, roadmap, landmarks), for many routes
//! over the same ground. Every path is scored twice, as found and smoothed, by the one integral of [`crate::line`], in addition to the cost from its
//! own search. Search costs are not comparable: a search over the roadmap charges for narrow ground only at the ends of its edges, one over the grid
//! at every cell.

mod query;
mod settings;
#[cfg(test)]
mod tests;

pub use settings::{Method, RouteSettings};

use crate::line::{Ground, Travelled};
use crate::map::{Neighbourhood, Node, TravelMap};
use crate::roadmap::Roadmap;
use crate::search::anytime::Outcome;
use crate::search::grid::GridNetwork;
use crate::search::landmarks::Landmarks;
use crate::search::{Found, Network, anytime, astar, theta_star};
use crate::smoothing::smoothed;
use crate::vertices::{VertexSettings, Vertices};
use query::Query;
use sastrugi_schemas::{ParameterError, counted};

/// A cell: row and column.
pub type Cell = [usize; 2];

/// Why a route could not be planned. Messages read after "failed to".
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RouteError {
    /// A setting out of range.
    #[error("plan a route: {0}")]
    Parameter(#[from] ParameterError),
    /// Start or goal is outside the map.
    #[error(
        "plan a route: the {end} (row {}, column {}) is outside the map; rows are 0 to {}, columns 0 to {}",
        cell[0], cell[1], shape[0] - 1, shape[1] - 1
    )]
    Outside {
        /// `start` or `goal`.
        end: &'static str,
        /// Row and column.
        cell: Cell,
        /// Rows and columns of the map.
        shape: [usize; 2],
    },
    /// Start or goal is blocked.
    #[error(
        "plan a route: the {end} (row {}, column {}, height {height_m} m) is blocked; choose a cell that has a height and \
         lies outside all obstacles",
        cell[0], cell[1]
    )]
    Blocked {
        /// `start` or `goal`.
        end: &'static str,
        /// Row and column.
        cell: Cell,
        /// Height, m; NaN without data.
        height_m: f64,
    },
    /// Start and goal are the same cell.
    #[error("plan a route: start and goal are both row {}, column {}; choose two different cells", cell[0], cell[1])]
    Equal {
        /// Row and column.
        cell: Cell,
    },
    /// No path exists between valid ends.
    #[error(
        "find a path from row {}, column {} to row {}, column {}: none exists with {} neighbours and slopes of at most \
         {} degrees uphill and {} degrees downhill",
        start[0], start[1], goal[0], goal[1], neighbourhood.name(), limits_deg[0], limits_deg[1]
    )]
    NoPath {
        /// Row and column.
        start: Cell,
        /// Row and column.
        goal: Cell,
        /// Allowed steps.
        neighbourhood: Neighbourhood,
        /// Slope limits uphill and downhill, degrees.
        limits_deg: [f64; 2],
    },
    /// An anytime search used up its budget before it found a path.
    #[error("find a path within {}; raise the budget or the weight", counted(.budget, "expansion"))]
    Budget {
        /// The budget.
        budget: u64,
    },
    /// The search found a path that the line integral refuses.
    #[error(
        "score a path from row {}, column {} to row {}, column {}: rounding puts a leg beyond the slope limit",
        start[0], start[1], goal[0], goal[1]
    )]
    Score {
        /// Row and column.
        start: Cell,
        /// Row and column.
        goal: Cell,
    },
}

/// A route and how it was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// Nodes of the path as found: adjacent cells, or ends of straight legs.
    pub path: Vec<Node>,
    /// Nodes that remain after smoothing.
    pub smoothed: Vec<Node>,
    /// Cost according to the search, metres of level ground.
    pub search_cost: f64,
    /// Score of the path as found, by the line integral.
    pub path_score: Travelled,
    /// Score of the smoothed path, by the line integral.
    pub smoothed_score: Travelled,
    /// Proven upper bound on the search cost relative to the cheapest path of the same network; 1 for an optimal path, `None` for lines at any angle.
    pub cost_ratio_max: Option<f64>,
    /// Vertices of the network.
    pub vertices: usize,
    /// Directed edges of the network.
    pub edges: usize,
    /// Vertices that the repair added.
    pub repaired: usize,
    /// Vertices that the search expanded.
    pub expansions: u64,
}

/// Plans one route.
///
/// # Errors
/// Settings out of range; ends outside the map, blocked or equal; no path between them.
///
/// # Examples
/// ```
/// use sastrugi_navigation::{CostModel, Ground, RouteError, RouteSettings, SlopeCost, SlopeLimits, TravelMap, plan};
/// use sastrugi_numeric::{Geometry, Grid};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let heights = Grid::filled(Geometry::square(3, 5, 1.0), 0.0);
/// let mut map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0)?)?;
/// let costs = CostModel::new(SlopeCost::THESIS, None, &map)?;
/// // By default over a roadmap, along rows and columns; smoothing makes it one straight line.
/// let route = plan(&Ground { map: &map, costs: &costs, clearance: None }, &RouteSettings::default(), [0, 0], [2, 4])?;
/// assert_eq!(route.search_cost, 6.0);
/// assert_eq!(route.smoothed, [map.node(0, 0), map.node(2, 4)]);
///
/// for row in 0..3 {
///     map.block(map.node(row, 2));
/// }
/// let ground = Ground { map: &map, costs: &costs, clearance: None };
/// let refused = plan(&ground, &RouteSettings::default(), [0, 0], [2, 4]);
/// assert!(matches!(refused, Err(RouteError::NoPath { .. })));
/// # Ok(())
/// # }
/// ```
pub fn plan(ground: &Ground<'_>, settings: &RouteSettings, start: Cell, goal: Cell) -> Result<Route, RouteError> {
    settings.check()?;
    let ends = check_ends(ground.map, start, goal)?;
    let planner = Planner::prepared(*ground, RouteSettings { landmarks: 0, ..*settings }, &ends);
    planner.route_between(ends)
}

/// Planner for many routes over the same ground.
#[derive(Clone, Debug)]
pub struct Planner<'a> {
    ground: Ground<'a>,
    settings: RouteSettings,
    network: Prepared<'a>,
    repaired: usize,
}

#[derive(Clone, Debug)]
enum Prepared<'a> {
    Grid { grid: GridNetwork<'a>, vertices: usize, edges: usize },
    Roads { roadmap: Roadmap<'a>, landmarks: Landmarks },
}

impl<'a> Planner<'a> {
    /// Prepares the network of a ground.
    ///
    /// # Errors
    /// Settings out of range.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_navigation::{CostModel, Ground, Method, Planner, RouteSettings, SlopeCost, SlopeLimits, TravelMap};
    /// use sastrugi_numeric::{Geometry, Grid};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let heights = Grid::filled(Geometry::square(3, 5, 1.0), 0.0);
    /// let map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0)?)?;
    /// let costs = CostModel::new(SlopeCost::THESIS, None, &map)?;
    /// let ground = Ground { map: &map, costs: &costs, clearance: None };
    /// let planner = Planner::new(ground, RouteSettings { method: Method::GridAstar, ..RouteSettings::default() })?;
    /// // 15 cells, with 12 steps along rows and 10 along columns, each in both directions.
    /// assert_eq!(planner.size(), [15, 44]);
    /// for (start, goal, cost) in [([0, 0], [2, 4], 6.0), ([2, 4], [0, 0], 6.0), ([1, 1], [1, 3], 2.0)] {
    ///     assert_eq!(planner.route(start, goal)?.search_cost, cost);
    /// }
    /// # Ok(())
    /// # }
    /// ```
    pub fn new(ground: Ground<'a>, settings: RouteSettings) -> Result<Self, RouteError> {
        settings.check()?;
        Ok(Self::prepared(ground, settings, &[]))
    }

    fn prepared(ground: Ground<'a>, settings: RouteSettings, ends: &[Node]) -> Self {
        let (network, repaired) = match &settings.method {
            Method::Roadmap(vertices) => {
                let vertices = Vertices::of(ground.map, settings.neighbourhood, vertices, ends);
                let roadmap = Roadmap::new(ground, &vertices.marks, settings.neighbourhood);
                let landmarks = Landmarks::new(roadmap.graph(), settings.landmarks as usize);
                (Prepared::Roads { roadmap, landmarks }, vertices.repaired)
            }
            _ => {
                let grid = GridNetwork { ground, neighbourhood: settings.neighbourhood };
                let vertices = Vertices::every(ground.map).count();
                (Prepared::Grid { grid, vertices, edges: grid.edge_count() }, 0)
            }
        };
        Self { ground, settings, network, repaired }
    }

    /// Plans a route. On a roadmap, start and goal are linked to the first vertices along the lines through them. If that yields no path and repair
    /// is on, the roadmap is rebuilt with both as vertices, which decides whether a path exists.
    ///
    /// # Errors
    /// Ends outside the map, blocked or equal; no path between them.
    pub fn route(&self, start: Cell, goal: Cell) -> Result<Route, RouteError> {
        let ends = check_ends(self.ground.map, start, goal)?;
        match self.route_between(ends) {
            Err(RouteError::NoPath { .. }) if self.may_lack_links() => plan(&self.ground, &self.settings, start, goal),
            result => result,
        }
    }

    fn may_lack_links(&self) -> bool {
        matches!(self.settings.method, Method::Roadmap(VertexSettings { repair: true, .. }))
    }

    fn route_between(&self, ends: [Node; 2]) -> Result<Route, RouteError> {
        let (found, cost_ratio_max) = self.search(ends)?;
        let [start, goal] = ends.map(|node| self.ground.map.place(node));
        let path_score = self.ground.path(&found.path).ok_or(RouteError::Score { start, goal })?;
        let (smoothed, smoothed_score) = smoothed(&self.ground, &found.path, self.settings.smoothing_tolerance)
            .ok_or(RouteError::Score { start, goal })?;
        let [vertices, edges] = self.size();
        Ok(Route {
            path: found.path,
            smoothed,
            search_cost: found.cost,
            path_score,
            smoothed_score,
            cost_ratio_max,
            vertices,
            edges,
            repaired: self.repaired,
            expansions: found.expansions,
        })
    }

    /// Vertices and directed edges of the network.
    pub fn size(&self) -> [usize; 2] {
        match &self.network {
            Prepared::Grid { vertices, edges, .. } => [*vertices, *edges],
            Prepared::Roads { roadmap, .. } => [roadmap.len(), roadmap.graph().edge_count()],
        }
    }

    /// The search alone, between two free nodes: the path as nodes, and the proven bound on its cost.
    ///
    /// # Errors
    /// No path, or none found within the budget.
    pub fn search(&self, [start, goal]: [Node; 2]) -> Result<(Found, Option<f64>), RouteError> {
        let exact = |found: Option<Found>| found.map(|found| (found, Some(1.0)));
        let found = match (&self.network, self.settings.method) {
            (Prepared::Roads { roadmap, landmarks }, _) => exact(Query::new(roadmap, landmarks, start, goal).search()),
            (Prepared::Grid { grid, .. }, Method::ThetaStar) => {
                theta_star::search(grid, start, goal).map(|found| (found, None))
            }
            (Prepared::Grid { grid, .. }, Method::Anytime { weight, budget }) => {
                match anytime::search(grid, start, goal, weight, budget) {
                    Outcome::Found(found, ratio) => Some((found, Some(ratio))),
                    Outcome::NoPath => None,
                    Outcome::Spent => return Err(RouteError::Budget { budget }),
                }
            }
            (Prepared::Grid { grid, .. }, _) => exact(astar::search(grid, start, goal)),
        };
        let map = self.ground.map;
        found.ok_or_else(|| RouteError::NoPath {
            start: map.place(start),
            goal: map.place(goal),
            neighbourhood: self.settings.neighbourhood,
            limits_deg: map.limits().degrees(),
        })
    }
}

/// Checks start and goal and returns their nodes.
pub(crate) fn check_ends(map: &TravelMap, start: Cell, goal: Cell) -> Result<[Node; 2], RouteError> {
    let shape = map.shape();
    for (end, cell) in [("start", start), ("goal", goal)] {
        if cell[0] >= shape[0] || cell[1] >= shape[1] {
            return Err(RouteError::Outside { end, cell, shape });
        }
        let node = map.node(cell[0], cell[1]);
        if map.is_blocked(node) {
            return Err(RouteError::Blocked { end, cell, height_m: map.height_m(node) });
        }
    }
    if start == goal {
        return Err(RouteError::Equal { cell: start });
    }
    Ok([start, goal].map(|[row, col]| map.node(row, col)))
}
