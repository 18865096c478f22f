//! Rovers that find their own way: they sense the ground around them, decide, and move until they reach the goal or give up.
//!
//! * [`sensing`] computes a [`View`] from ground and pose: five strips of rays, or four rectangles, each safe or not.
//! * [`policies`] turn a view into a command: the trait [`Policy`], and two navigators that use only the current view. (The
//!   planner used for comparison is implemented outside this module.)
//! * [`motion`] executes commands, with slip and drift if noise is enabled.
//! * [`trial`] drives one rover from a start to a goal; [`starts`] places starts and goals; [`contacts`] counts rock contacts;
//!   [`efficiency`](mod@efficiency) rates a drive.
//! * [`obstacles`] maps the obstacles that a rover with complete knowledge would avoid, to separate hard terrain from a poor
//!   navigator.
//! * [`track`] and [`recorder`] keep a drive for tables and recordings, [`surroundings`] the ground around it.
//! * [`quantised`] detects heights quantised too coarsely for rovers.
//! * [`parameters`] holds every parameter with its source.
//!
//! # Source
//! The paper in `docs/papers/jpl.md`, sections 3 and 4. The flight code was not available: the implementation follows what the
//! paper states about the two navigators; the rest is our choice and marked as such.
//!
//! # Random numbers
//! Every random number of a rover is a function of its own key, the cycle and the purpose ([`draws`]): one more turn does not
//! reshuffle the others, and two designs on the same ground share their noise.
//!
//! # Cost
//! A cycle with rays samples about 700 points of the ground, one with rectangles 5000 at cells of 2 cm.

pub mod contacts;
pub mod draws;
pub mod efficiency;
pub mod motion;
pub mod obstacles;
pub mod parameters;
pub mod policies;
pub mod pose;
pub mod quantised;
pub mod recorder;
pub mod sand;
pub mod sensing;
pub mod starts;
pub mod surroundings;
pub mod track;
pub mod trial;

#[cfg(test)]
mod tests;

pub use efficiency::efficiency;
pub use parameters::{
    Navigator, PlannerEyes, PlannerMap, PlannerParameters, PlannerSensor, RoverParameters, SchoppersParameters,
    SojournerParameters,
};
pub use policies::{Command, Policy, Situation, Stop};
pub use pose::{Body, Chassis, Pose};
pub use recorder::Recorder;
pub use sensing::{Area, Ray, Sensor, View};
pub use starts::{Facing, Start};
pub use surroundings::Surroundings;
pub use track::{Track, Tracked};
pub use trial::{Cycle, Drive, Ending, Task, drive};
