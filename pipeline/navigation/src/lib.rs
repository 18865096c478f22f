//! Route planning over heightfields: arrays in, paths out.
//!
//! A route leads from one cell to another, over ground that is not too steep and around blocked cells. A team follows it in formation; a rover finds
//! its own way over ground that it discovers.
//!
//! # Flow
//!
//! 1. [`TravelMap::new`]: heights and slope limits. [`obstacles::block`] blocks polygons.
//! 2. [`CostModel::new`]: what a metre of path costs. [`clearance::Clearance::new`] makes gaps that are narrower than a team cost more.
//! 3. [`plan`], or a [`Planner`] for many routes over the same ground: a [`Method`] searches ([`search`]) all cells, or a [`roadmap`] whose vertices are
//!    the cells where the ground changes ([`vertices`]) and whose edges are the straight lines between them.
//! 4. [`Route`]: the path as found and as straightened by [`smoothing`], each scored by the same integral ([`mod@line`]).
//! 5. [`formation::Team`] moves a team along a route. [`replan::walk`] and [`explorer::Explorer`] plan on what has been seen so far.
//!
//! # Example
//!
//! Around a wall, by steps to four neighbours and then straightened:
//!
//! ```
//! use sastrugi_navigation::{CostModel, Ground, Method, Neighbourhood, RouteSettings, SlopeCost, SlopeLimits, TravelMap, plan};
//! use sastrugi_numeric::{Geometry, Grid};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Level ground: 5 x 7 cells of 1 m. A wall leaves only the southernmost row open.
//! let heights = Grid::filled(Geometry::square(5, 7, 1.0), 0.0);
//! let mut map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0)?)?;
//! for row in 0..4 {
//!     map.block(map.node(row, 3));
//! }
//! let costs = CostModel::new(SlopeCost::THESIS, None, &map)?;
//! let ground = Ground { map: &map, costs: &costs, clearance: None };
//! let settings =
//!     RouteSettings { method: Method::GridAstar, neighbourhood: Neighbourhood::Four, ..RouteSettings::default() };
//!
//! let route = plan(&ground, &settings, [0, 0], [0, 6])?;
//! // Four rows down, six columns along, four rows up.
//! assert_eq!((route.search_cost, route.path.len()), (14.0, 15));
//! assert!(route.smoothed.len() < 15 && route.smoothed_score.cost < 14.0);
//! assert_eq!(route.smoothed.last(), Some(&map.node(0, 6)));
//! # Ok(())
//! # }
//! ```
//!
//! # Source and conventions
//!
//! Source: A. G. Bayrak, MSc thesis, Middle East Technical University, August 2008 ("the thesis"). Where its listings are wrong or silent, the module
//! states what is done instead.
//!
//! A node is a cell of the raster, at the cell's centre; positions between nodes are given in rows and columns. All comparisons and sums are made in
//! a fixed order, so a route has the same bits on any number of threads.

pub mod clearance;
pub mod cost;
pub mod explorer;
pub mod formation;
pub mod line;
pub mod map;
pub mod obstacles;
pub mod pairs;
pub mod parameters;
pub mod replan;
pub mod roadmap;
pub mod route;
pub mod search;
pub mod smoothing;
pub mod vertices;

#[cfg(test)]
mod testing;

pub use cost::{CostModel, SlopeCost};
pub use line::{Ground, Travelled};
pub use map::{Direction, MapError, Neighbourhood, Node, SlopeLimits, TravelMap};
pub use route::{Method, Planner, Route, RouteError, RouteSettings, plan};
