//! Pure pursuit (Coulter 1992, CMU-RI-TR-92-01) of the mission's course: the straight line from start to goal, or a polyline.
//!
//! The look-ahead point lies on the course, `lookahead` beyond the vehicle's foot as measured along the course, but not beyond
//! the goal. (Coulter takes the point of the path at that distance from the vehicle; measured along the path, there is always
//! exactly one such point.) With `a` the bearing of that point relative to the vehicle and `d` its distance, the arc through it
//! requires the yaw rate `gain * speed * 2 sin a / d`. When the point falls behind the vehicle (`|a|` above `turn_start`), the
//! vehicle turns on the spot, or on its smallest circle if it cannot turn on the spot, without changing direction, until `|a|`
//! is below `turn_stop`. The vehicle's limits bound the rates of change of speed and yaw rate.
//!
//! The foot on a polyline never moves back, and never beyond the look-ahead point of the previous foot ([`Polyline::foot`]).

use super::actuation::{Command, Limits};
use super::settings::TraverseSettings;
use crate::missions::{Foot, Mission, Polyline};
use std::f64::consts::{PI, TAU};

/// Pose of the base_link origin in plan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanPose {
    pub x: f64,
    pub y: f64,
    pub yaw: f64,
}

/// The course that a vehicle follows.
#[derive(Clone, Debug)]
enum Course {
    Straight {
        start: [f64; 2],
        direction: [f64; 2],
        length: f64,
    },
    /// A polyline and the vehicle's foot on it.
    Along {
        line: Polyline,
        foot_m: f64,
    },
}

impl Course {
    fn of(mission: &Mission) -> Self {
        if let Some(line) = &mission.line {
            return Self::Along { line: line.clone(), foot_m: 0.0 };
        }
        let length = mission.length_m();
        let direction = [0, 1].map(|axis| (mission.goal_m[axis] - mission.start_m[axis]) / length);
        Self::Straight { start: mission.start_m, direction, length }
    }

    /// The look-ahead point of a vehicle, and its cross-track error, m.
    fn aim(&self, at: [f64; 2], lookahead_m: f64) -> ([f64; 2], f64) {
        match self {
            Self::Straight { start, direction: [cos, sin], length } => {
                let from_start = [at[0] - start[0], at[1] - start[1]];
                let along = from_start[0] * cos + from_start[1] * sin;
                let ahead = (along + lookahead_m).min(*length);
                ([start[0] + ahead * cos, start[1] + ahead * sin], from_start[1] * cos - from_start[0] * sin)
            }
            Self::Along { line, foot_m } => {
                let Foot { along_m, cross_track_m } = line.foot(at, *foot_m, lookahead_m);
                (line.point_at(along_m + lookahead_m), cross_track_m)
            }
        }
    }

    /// Advances the foot for a vehicle at a point.
    fn advance(&mut self, at: [f64; 2], lookahead_m: f64) {
        if let Self::Along { line, foot_m } = self {
            *foot_m = line.foot(at, *foot_m, lookahead_m).along_m;
        }
    }
}

/// Controller of one mission.
#[derive(Clone, Debug)]
pub(crate) struct Controller {
    course: Course,
    goal: [f64; 2],
    /// Sign of the current turn on the spot; 0 while following the course.
    turning: f64,
    /// Current commands.
    pub command: Command,
}

impl Controller {
    pub(crate) fn new(mission: &Mission) -> Self {
        Self { course: Course::of(mission), goal: mission.goal_m, turning: 0.0, command: Command::default() }
    }

    /// Updates the errors for a pose without changing the commands; returns the distance of the look-ahead point, m.
    pub(crate) fn observe(&mut self, pose: PlanPose, settings: &TraverseSettings) -> f64 {
        let at = [pose.x, pose.y];
        let (aim, cross_track_m) = self.course.aim(at, self.lookahead_m(settings));
        let target = [aim[0] - pose.x, aim[1] - pose.y];
        self.command.cross_track_m = cross_track_m;
        self.command.heading_error_rad = wrapped(libm::atan2(target[1], target[0]) - pose.yaw);
        self.command.distance_to_goal_m = self.distance_to_goal_m(at);
        length(target)
    }

    /// Distance from a point to the goal, m.
    pub(crate) fn distance_to_goal_m(&self, at: [f64; 2]) -> f64 {
        length([self.goal[0] - at[0], self.goal[1] - at[1]])
    }

    /// Remaining distance from a point to the goal, m: the straight distance or the rest of the polyline, whichever is longer.
    pub(crate) fn left_m(&self, at: [f64; 2], settings: &TraverseSettings) -> f64 {
        let distance_m = self.distance_to_goal_m(at);
        match &self.course {
            Course::Straight { .. } => distance_m,
            Course::Along { line, foot_m } => {
                let foot = line.foot(at, *foot_m, self.lookahead_m(settings));
                distance_m.max(line.length_m() - foot.along_m)
            }
        }
    }

    fn lookahead_m(&self, settings: &TraverseSettings) -> f64 {
        settings.lookahead_m(self.command.speed_m_s)
    }

    /// Updates the errors for a pose and sets the commands for the next `period_s`.
    pub(crate) fn update(&mut self, pose: PlanPose, settings: &TraverseSettings, limits: &Limits, period_s: f64) {
        let lookahead_m = self.lookahead_m(settings);
        self.course.advance([pose.x, pose.y], lookahead_m);
        let distance = self.observe(pose, settings);
        self.switch(settings);
        let (speed, yaw_rate) = self.wanted(distance, settings, limits);
        let yaw_limit = limits.yaw_rate_rad_s;
        let (yaw_rate, speed) = (yaw_rate.clamp(-yaw_limit, yaw_limit), speed.min(limits.speed_m_s));
        let yaw_step = limits.yaw_acceleration_rad_s2 * period_s;
        let command = &mut self.command;
        command.speed_m_s = towards(command.speed_m_s, speed, limits.acceleration_m_s2 * period_s);
        command.yaw_rate_rad_s = towards(command.yaw_rate_rad_s, yaw_rate, yaw_step);
    }

    /// Starts or ends a turn on the spot.
    fn switch(&mut self, settings: &TraverseSettings) {
        let error = self.command.heading_error_rad;
        if self.turning == 0.0 && error.abs() > settings.turn_start_rad() {
            self.turning = if error > 0.0 { 1.0 } else { -1.0 };
        } else if self.turning != 0.0 && error.abs() < settings.turn_stop_rad() {
            self.turning = 0.0;
        }
    }

    /// Desired speed and yaw rate, before the vehicle's limits apply.
    fn wanted(&self, distance_m: f64, settings: &TraverseSettings, limits: &Limits) -> (f64, f64) {
        let controller = settings.controller();
        let speed = settings.speed_m_s().min(limits.speed_m_s);
        if self.turning != 0.0 && limits.turn_radius_m == 0.0 {
            return (0.0, self.turning * controller.turn_rate_rad_s);
        }
        let tightest = 1.0 / limits.turn_radius_m;
        if self.turning != 0.0 {
            return (speed, self.turning * speed * tightest);
        }
        let arc = 2.0 * libm::sin(self.command.heading_error_rad) / distance_m.max(DISTANCE_MIN_M);
        let curvature = (controller.steering_gain * arc).clamp(-tightest, tightest);
        (speed, speed * curvature)
    }
}

/// Smallest distance assumed for the look-ahead point, m.
const DISTANCE_MIN_M: f64 = 0.1;

fn length(v: [f64; 2]) -> f64 {
    (v[0] * v[0] + v[1] * v[1]).sqrt()
}

/// The value moved towards a target by at most `change`.
fn towards(value: f64, target: f64, change: f64) -> f64 {
    value + (target - value).clamp(-change, change)
}

/// An angle wrapped to [-pi, pi].
pub(crate) fn wrapped(angle: f64) -> f64 {
    let turns = ((angle + PI) / TAU).floor();
    angle - turns * TAU
}
