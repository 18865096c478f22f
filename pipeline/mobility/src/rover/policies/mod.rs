//! Policies: how a rover acts on its view.

mod schoppers;
mod sojourner;

pub use schoppers::{SchoppersLike, SchoppersRules};
pub use sojourner::{SojournerLike, SojournerRules};

use super::draws::CycleDraws;
use super::pose::Pose;
use super::sensing::View;

/// Everything that a policy knows in a cycle.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// The pose that the rover believes it has.
    pub pose: Pose,
    /// The goal, m.
    pub goal_m: [f64; 2],
    /// Sensor view.
    pub view: &'a View,
    /// Random numbers of this cycle.
    pub draws: CycleDraws,
}

impl Situation<'_> {
    /// Turn to the left after which the rover faces the goal, rad.
    pub fn goal_error_rad(&self) -> f64 {
        self.pose.bearing_error_rad(self.goal_m)
    }

    /// Distance to the goal, m.
    pub fn goal_distance_m(&self) -> f64 {
        self.pose.distance_m(self.goal_m)
    }

    /// The side on which the goal lies.
    pub fn goal_side(&self) -> Side {
        if self.goal_error_rad() >= 0.0 { Side::Left } else { Side::Right }
    }
}

/// A side of the rover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// To the left.
    Left,
    /// To the right.
    Right,
}

impl Side {
    /// 1 to the left, -1 to the right.
    pub fn sign(self) -> f64 {
        match self {
            Self::Left => 1.0,
            Self::Right => -1.0,
        }
    }

    /// The other side.
    pub fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }
}

/// Why a policy stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// It believes that it is at the goal.
    AtGoal,
    /// It finds no way to the goal.
    NoWay,
}

/// The command of a cycle: a turn in place, then a straight drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Turn, left positive, rad.
    pub turn_rad: f64,
    /// Distance ahead, m; negative backwards.
    pub drive_m: f64,
    /// Ends the drive.
    pub stop: Option<Stop>,
}

impl Command {
    /// A turn in place.
    pub fn turn(turn_rad: f64) -> Self {
        Self { turn_rad, ..Self::default() }
    }

    /// A straight drive, ahead or back.
    pub fn drive(drive_m: f64) -> Self {
        Self { drive_m, ..Self::default() }
    }

    /// The end of the drive.
    pub fn stop(stop: Stop) -> Self {
        Self { stop: Some(stop), ..Self::default() }
    }
}

/// A navigation policy, called once per cycle with the rover's view.
pub trait Policy {
    /// The command for this cycle.
    fn decide(&mut self, situation: &Situation<'_>) -> Command;

    /// Its state, for recordings.
    fn state(&self) -> &'static str;

    /// The planned path from the believed position, m; empty for policies that do not plan.
    fn plan(&self) -> &[[f64; 2]] {
        &[]
    }
}
