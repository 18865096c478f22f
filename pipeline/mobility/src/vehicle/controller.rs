//! Pure pursuit of the straight line from start to goal (Coulter, 1992).
//!
//! The look-ahead point lies on the line, `lookahead` beyond the foot of the vehicle, and not beyond the goal. With `a`
//! the bearing of that point relative to the vehicle and `d` its distance, the arc through it asks for the yaw rate
//! `gain * speed * 2 sin a / d`. When the point falls behind the vehicle (`|a|` above `turn_start`) the vehicle turns on
//! the spot, or on its smallest circle where it cannot, always in the direction in which it began, until `|a|` is below
//! `turn_stop`. Speed and yaw rate change no
//! faster than the vehicle's limits allow.

use super::actuation::{Command, Limits};
use super::settings::TraverseSettings;
use crate::missions::Mission;
use std::f64::consts::{PI, TAU};

/// Pose of the base_link origin in plan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanPose {
    pub x: f64,
    pub y: f64,
    pub yaw: f64,
}

/// Steering of one mission.
#[derive(Clone, Debug)]
pub(crate) struct Controller {
    start: [f64; 2],
    goal: [f64; 2],
    direction: [f64; 2],
    length: f64,
    /// Sign of the turn on the spot that is under way; 0 while following the line.
    turning: f64,
    /// Commands in force.
    pub command: Command,
}

impl Controller {
    pub(crate) fn new(mission: &Mission) -> Self {
        let length = mission.length_m();
        Self {
            start: mission.start_m,
            goal: mission.goal_m,
            direction: [0, 1].map(|axis| (mission.goal_m[axis] - mission.start_m[axis]) / length),
            length,
            turning: 0.0,
            command: Command::default(),
        }
    }

    /// Looks at the pose without changing the commands in force; returns the distance of the look-ahead point, m.
    pub(crate) fn observe(&mut self, pose: PlanPose, settings: &TraverseSettings) -> f64 {
        let from_start = [pose.x - self.start[0], pose.y - self.start[1]];
        let [cos, sin] = self.direction;
        let along = from_start[0] * cos + from_start[1] * sin;
        let ahead = (along + settings.lookahead_m()).min(self.length);
        let target = [self.start[0] + ahead * cos - pose.x, self.start[1] + ahead * sin - pose.y];
        self.command.cross_track_m = from_start[1] * cos - from_start[0] * sin;
        self.command.heading_error_rad = wrapped(libm::atan2(target[1], target[0]) - pose.yaw);
        self.command.distance_to_goal_m = self.distance_to_goal_m([pose.x, pose.y]);
        length(target)
    }

    /// Distance from a point to the goal, m.
    pub(crate) fn distance_to_goal_m(&self, at: [f64; 2]) -> f64 {
        length([self.goal[0] - at[0], self.goal[1] - at[1]])
    }

    /// Looks at the pose and sets the commands for the coming `period_s`.
    pub(crate) fn update(&mut self, pose: PlanPose, settings: &TraverseSettings, limits: &Limits, period_s: f64) {
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

    /// Starts and ends turns on the spot.
    fn switch(&mut self, settings: &TraverseSettings) {
        let error = self.command.heading_error_rad;
        if self.turning == 0.0 && error.abs() > settings.turn_start_rad() {
            self.turning = if error > 0.0 { 1.0 } else { -1.0 };
        } else if self.turning != 0.0 && error.abs() < settings.turn_stop_rad() {
            self.turning = 0.0;
        }
    }

    /// Speed and yaw rate before the vehicle's limits of speed and acceleration.
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

/// The look-ahead point is never taken nearer than this, m.
const DISTANCE_MIN_M: f64 = 0.1;

fn length(v: [f64; 2]) -> f64 {
    (v[0] * v[0] + v[1] * v[1]).sqrt()
}

/// The value moved towards a target by at most `change`.
fn towards(value: f64, target: f64, change: f64) -> f64 {
    value + (target - value).clamp(-change, change)
}

/// An angle brought to [-pi, pi].
pub(crate) fn wrapped(angle: f64) -> f64 {
    let turns = ((angle + PI) / TAU).floor();
    angle - turns * TAU
}
