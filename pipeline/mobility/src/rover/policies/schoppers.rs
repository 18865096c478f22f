//! The Schoppers-like navigator: keep what is straight ahead safe, and turn to the goal where that stays so.
//!
//! With the inner rectangles safe:
//! * no commitment left, and the outer rectangle on the side of the goal safe or the error of the bearing small: it turns towards the goal,
//!   and back again where the inner rectangles are unsafe from there;
//! * it drives by a step.
//!
//! Otherwise it turns to the side with more safe rectangles, or to that of the goal, and commits itself to the new direction for a distance.
//! After a full turn without a way it backs up, turns the other way from then on, and commits itself for longer, until it has come
//! nearer to the goal.
//!
//! The paper has the rectangles and that they are safe or unsafe; the rules are ours.

use super::{Command, Policy, Side, Situation, Stop};
use std::f64::consts::TAU;

/// Numbers of the navigator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SchoppersRules {
    /// Distance from the goal at which it stops, m.
    pub goal_tolerance_m: f64,
    /// Turn of a cycle, rad.
    pub turn_rad: f64,
    /// Drive of a cycle, m.
    pub step_m: f64,
    /// Error of the bearing at which it turns to the goal whatever is beside it, rad.
    pub bearing_tolerance_rad: f64,
    /// Drive after a turn away before it turns to the goal again, m.
    pub commit_m: f64,
    /// Factor of that after a full turn.
    pub commit_growth: f64,
    /// Its largest value, m.
    pub commit_max_m: f64,
    /// Nearer to the goal by this, it commits itself as at first, m.
    pub progress_m: f64,
}

/// The navigator, and what it remembers.
#[derive(Clone, Debug)]
pub struct SchoppersLike {
    rules: SchoppersRules,
    latched: Option<Side>,
    /// Turned since the way was free, rad.
    turned_rad: f64,
    /// Left of the commitment, m.
    committed_m: f64,
    /// Next commitment, m.
    commit_m: f64,
    /// Distance to the goal when the commitment grew last, m.
    grown_at_m: f64,
    /// A turn to the goal that is being tried, rad.
    tried_rad: Option<f64>,
    state: &'static str,
}

impl SchoppersLike {
    /// A navigator at the start.
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

    fn go_on(&mut self, situation: &Situation<'_>) -> Command {
        let error_rad = situation.goal_error_rad();
        let areas = &situation.view.areas;
        let outer = match situation.goal_side() {
            Side::Left => areas.first(),
            Side::Right => areas.last(),
        };
        let room = outer.is_some_and(|area| !area.hazard) || error_rad.abs() < self.rules.bearing_tolerance_rad;
        if self.committed_m <= 0.0 && room && error_rad != 0.0 {
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

/// The side with more safe rectangles; with as many, that of the goal.
fn freer_side(situation: &Situation<'_>) -> Side {
    let areas = &situation.view.areas;
    let safe = |sign: f64| areas.iter().filter(|area| !area.hazard && sign * area.left_m() > 0.0).count();
    match safe(1.0).cmp(&safe(-1.0)) {
        std::cmp::Ordering::Greater => Side::Left,
        std::cmp::Ordering::Less => Side::Right,
        std::cmp::Ordering::Equal => situation.goal_side(),
    }
}

/// Whether the rectangles beside the centre line are safe: the middle one of an odd number.
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
            (None, true) => self.go_on(situation),
            (None, false) => self.avoid(situation),
        }
    }

    fn state(&self) -> &'static str {
        self.state
    }
}
