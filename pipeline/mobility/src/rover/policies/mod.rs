//! What a rover does about what it sees.

mod schoppers;
mod sojourner;

pub use schoppers::{SchoppersLike, SchoppersRules};
pub use sojourner::{SojournerLike, SojournerRules};

use super::draws::CycleDraws;
use super::pose::Pose;
use super::sensing::View;

/// What a policy may know in a cycle.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// Where the rover believes that it is.
    pub pose: Pose,
    /// The goal, m.
    pub goal_m: [f64; 2],
    /// What it sees.
    pub view: &'a View,
    /// Its draws of this cycle.
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

    /// The side of the goal.
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
    /// It believes to be at the goal.
    AtGoal,
    /// It knows of no way to the goal.
    NoWay,
}

/// What is to be done in a cycle: a turn in place, then a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// To the left, rad.
    pub turn_rad: f64,
    /// Ahead; below 0 back, m.
    pub drive_m: f64,
    /// Stop for good.
    pub stop: Option<Stop>,
}

impl Command {
    /// A turn in place.
    pub fn turn(turn_rad: f64) -> Self {
        Self { turn_rad, ..Self::default() }
    }

    /// A drive straight ahead, or back.
    pub fn drive(drive_m: f64) -> Self {
        Self { drive_m, ..Self::default() }
    }

    /// The end.
    pub fn stop(stop: Stop) -> Self {
        Self { stop: Some(stop), ..Self::default() }
    }
}

/// A rover's mind: called once a cycle, with what the rover sees.
pub trait Policy {
    /// What to do.
    fn decide(&mut self, situation: &Situation<'_>) -> Command;

    /// What it is at, for recordings.
    fn state(&self) -> &'static str;

    /// The way that it plans to take, from where it believes to be, m; empty for policies without plans.
    fn plan(&self) -> &[[f64; 2]] {
        &[]
    }
}
