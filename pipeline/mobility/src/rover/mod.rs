//! Rovers that find their own way: they sense the ground around them, decide, and move, until they reach a goal or give up.
//!
//! * [`sensing`] turns ground and pose into a [`View`]: five strips of rays, or four rectangles, safe or not.
//! * [`policies`] decide on a view: the trait [`Policy`], and two navigators that know nothing else. (A planner to compare with is made elsewhere: its
//!   search is not of this room.)
//! * [`motion`] carries out what was decided, with slip and drift where they are asked for.
//! * [`trial`] drives one rover from a start to a goal; [`starts`] places starts and goals; [`contacts`] counts the rocks met;
//!   [`efficiency`](mod@efficiency) judges.
//! * [`obstacles`] maps what a rover that knows everything would keep clear of, to tell hard ground from a poor navigator.
//! * [`track`] and [`recorder`] keep what tables and recordings show of a way, [`surroundings`] the ground around it.
//! * [`quantised`] finds heights that come in steps too coarse for rovers.
//! * [`parameters`] holds every number with its source.
//!
//! # Source
//! The paper in `docs/papers/jpl.md`, sections 3 and 4. The flight code was not available to us: what the paper says of the two navigators
//! is followed, the rest is ours, and marked so.
//!
//! # Draws
//! Every draw of a rover is a function of its own key, the cycle and the purpose ([`draws`]): one more turn reshuffles nothing, and two
//! designs on the same ground share their noise.
//!
//! # Cost
//! A cycle of rays asks for about 700 points of the ground, one of rectangles for 5000 at cells of 2 cm.

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
