//! Teams that keep a formation along a route (the thesis, chapter 4).
//!
//! A [`shape::Formation`] has a slot for each member. At every waypoint of the route, [`placement`] gives each slot a target that fits the ground;
//! [`crowd`] moves the members from target to target, step by step and without collisions; [`speeds`] keeps their distances. A [`Team`] combines
//! these, handles losses of members, and measures how well it keeps its formation. It follows a given route, or one that it plans on the ground it
//! has seen.
//!
//! Positions are eastings and northings in the coordinates of the map's heights, m.

pub mod crowd;
mod detour;
pub mod draws;
pub mod footing;
pub mod metrics;
pub mod obstacles;
pub mod parameters;
pub mod placement;
mod plane;
mod scout;
pub mod shape;
pub mod speeds;
pub mod team;

pub use footing::TeamGround;
pub use parameters::TeamParameters;
pub use shape::{Formation, FormationError};
pub use team::{Outcome, Team, TeamError};
