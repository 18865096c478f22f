//! The Schoppers-like navigator: it drives where the ground straight ahead is safe, and turns to the goal where it stays safe.
//!
//! If the inner rectangles are safe:
//! * if no commitment is left, and the outer rectangle on the side of the goal is safe or the bearing error is small, it turns
//!   towards the goal, and back again if the inner rectangles are unsafe in that direction;
//! * otherwise it drives one step.
//!
//! If they are unsafe, it turns to the side with more safe rectangles, or to the side of the goal, and commits itself to the new
//! direction for a distance. After a full turn without finding a way it backs up, turns the other way from then on, and commits
//! itself for longer, until it has come nearer to the goal.
//!
//! The paper describes the rectangles and their classification as safe or unsafe; the rules are our choice.

use super::{Command, Policy, Side, Situation, Stop};
use std::f64::consts::TAU;

/// Parameters of the navigator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SchoppersRules {
    /// Distance from the goal at which it stops, m.
    pub goal_tolerance_m: f64,
    /// Turn per cycle, rad.
    pub turn_rad: f64,
    /// Distance driven per cycle, m.
    pub step_m: f64,
    /// Bearing error below which it turns to the goal even if the outer rectangle on that side is unsafe, rad.
    pub bearing_tolerance_rad: f64,
    /// Commitment: distance driven after turning away before it turns to the goal again, m.
    pub commit_m: f64,
    /// Growth factor of the commitment after a full turn.
    pub commit_growth: f64,
    /// Largest commitment, m.
    pub commit_max_m: f64,
    /// Progress towards the goal after which the commitment is reset to `commit_m`, m.
    pub progress_m: f64,
}

/// The navigator and its memory.
#[derive(Clone, Debug)]
pub struct SchoppersLike {
    rules: SchoppersRules,
    latched: Option<Side>,
    /// Angle turned since the way was last free, rad.
    turned_rad: f64,
    /// Remaining commitment, m.
    committed_m: f64,
    /// Next commitment, m.
    commit_m: f64,
    /// Distance to the goal when the commitment last grew, m.
    grown_at_m: f64,
    /// A tentative turn to the goal, rad.
    tried_rad: Option<f64>,
    state: &'static str,
}

impl SchoppersLike {
    /// A navigator in its initial state.
    pub fn new(rules: SchoppersRules) -> Self {
        Self {
            rules,
            latched: None,
            turned_rad: 0.0,
            committed_m: 0.0,
            commit_m: rules.commit_m,
            grown_at_m: f64::INFINITY,
            tried_rad: None,
            state: "start",
        }
    }

    fn drive(&mut self, turn_rad: f64) -> Command {
        self.turned_rad = 0.0;
        self.committed_m -= self.rules.step_m;
        if self.committed_m <= 0.0 {
            self.latched = None;
        }
        Command { turn_rad, drive_m: self.rules.step_m, stop: None }
    }

    fn proceed(&mut self, situation: &Situation<'_>) -> Command {
        let error_rad = situation.goal_error_rad();
        let areas = &situation.view.areas;
        let outer = match situation.goal_side() {
            Side::Left => areas.first(),
            Side::Right => areas.last(),
        };
        let has_room = outer.is_some_and(|area| !area.hazard) || error_rad.abs() < self.rules.bearing_tolerance_rad;
        if self.committed_m <= 0.0 && has_room && error_rad != 0.0 {
            let turn_rad = error_rad.clamp(-self.rules.turn_rad, self.rules.turn_rad);
            self.tried_rad = Some(turn_rad);
            self.state = "turn to goal";
            return Command::turn(turn_rad);
        }
        self.state = if self.committed_m > 0.0 { "pass" } else { "drive" };
        self.drive(0.0)
    }

    fn avoid(&mut self, situation: &Situation<'_>) -> Command {
        let side = *self.latched.get_or_insert_with(|| freer_side(situation));
        if self.turned_rad >= TAU {
            self.turned_rad = 0.0;
            self.latched = Some(side.other());
            self.commit_m = (self.commit_m * self.rules.commit_growth).min(self.rules.commit_max_m);
            self.grown_at_m = situation.goal_distance_m();
            self.state = "back up";
            return Command::drive(-self.rules.step_m);
        }
        self.turned_rad += self.rules.turn_rad;
        self.committed_m = self.commit_m;
        self.state = "avoid";
        Command::turn(side.sign() * self.rules.turn_rad)
    }
}

/// The side with more safe rectangles; the side of the goal if they are equal in number.
fn freer_side(situation: &Situation<'_>) -> Side {
    let areas = &situation.view.areas;
    let safe = |sign: f64| areas.iter().filter(|area| !area.hazard && sign * area.left_m() > 0.0).count();
    match safe(1.0).cmp(&safe(-1.0)) {
        std::cmp::Ordering::Greater => Side::Left,
        std::cmp::Ordering::Less => Side::Right,
        std::cmp::Ordering::Equal => situation.goal_side(),
    }
}

/// Whether the rectangles next to the centre line are safe; of an odd number, the middle one.
fn inner_safe(situation: &Situation<'_>) -> bool {
    let count = situation.view.areas.len();
    let inner = (count.saturating_sub(1) / 2)..=(count / 2);
    !situation.view.tilted && inner.clone().all(|k| situation.view.areas.get(k).is_some_and(|area| !area.hazard))
}

impl Policy for SchoppersLike {
    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let distance_m = situation.goal_distance_m();
        if distance_m <= self.rules.goal_tolerance_m {
            self.state = "at goal";
            return Command::stop(Stop::AtGoal);
        }
        if distance_m <= self.grown_at_m - self.rules.progress_m {
            self.commit_m = self.rules.commit_m;
            self.grown_at_m = f64::INFINITY;
        }
        match (self.tried_rad.take(), inner_safe(situation)) {
            (Some(_), true) => self.drive(0.0),
            (Some(tried_rad), false) => {
                self.state = "turn back";
                self.drive(-tried_rad)
            }
            (None, true) => self.proceed(situation),
            (None, false) => self.avoid(situation),
        }
    }

    fn state(&self) -> &'static str {
        self.state
    }
}
