//! Routes over heightfields: arrays in, paths out.
//!
//! A route leads from one cell to another over ground that is not too steep, around what is blocked. Vertices are the cells where
//! the ground changes ([`vertices`]), edges the straight lines between them ([`roadmap`]); a search gives the cheapest path
//! ([`search`]), and smoothing straightens it ([`smoothing`]).
//!
//! Source: A. G. Bayrak, MSc thesis, Middle East Technical University, August 2008 ("the thesis"). Where its listings are wrong or
//! silent each module says what is done instead.
//!
//! A node is a cell of the raster, at its centre; positions between nodes are given in columns and rows. All comparisons and sums
//! are made in a fixed order, so that a route has the same bits on any number of threads.

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
