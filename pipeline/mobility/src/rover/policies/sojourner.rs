//! The Sojourner-like navigator: it turns away from a hazard, passes it, and turns back to the goal.
//!
//! Each cycle, in this order:
//! 1. Within the goal tolerance it stops.
//! 2. At a hazard it turns in place: away from the hazard if only one side has hazards, else towards the goal, and further in the same
//!    direction until the view is clear. After a full turn without a clear view it backs up by one step and turns the other way.
//! 3. With a clear view it drives straight on until it has passed the hazard; then it turns to the goal and drives one step.
//!
//! The paper gives the steps (at most the wheel radius), the sensing and the names of the behaviours; Mishkin et al. (1998) describe
//! the hazards and the turn back to the goal. The angles, the distance to pass a hazard and the backing up are our choice.

use super::{Command, Policy, Side, Situation, Stop};
use crate::rover::draws::Purpose;
use std::f64::consts::TAU;

/// Parameters of the navigator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SojournerRules {
    /// Distance from the goal at which it stops, m.
    pub goal_tolerance_m: f64,
    /// Turn per cycle, rad.
    pub turn_rad: f64,
    /// Standard deviation of turns away from a hazard, rad.
    pub turn_noise_rad: f64,
    /// Distance driven straight on after a hazard, m.
    pub pass_m: f64,
    /// Distance driven per cycle, m.
    pub step_m: f64,
    /// Bearing error that it does not correct, rad.
    pub bearing_tolerance_rad: f64,
}

/// The navigator and its memory.
#[derive(Clone, Debug)]
pub struct SojournerLike {
    rules: SojournerRules,
    latched: Option<Side>,
    /// Angle turned since the view was last clear, rad.
    turned_rad: f64,
    /// Remaining distance to drive straight on, m.
    pass_m: f64,
    state: &'static str,
}

impl SojournerLike {
    /// A navigator in its initial state.
    pub fn new(rules: SojournerRules) -> Self {
        Self { rules, latched: None, turned_rad: 0.0, pass_m: 0.0, state: "start" }
    }

    fn avoid(&mut self, situation: &Situation<'_>) -> Command {
        let side = *self.latched.get_or_insert_with(|| away_from_hazards(situation));
        self.pass_m = self.rules.pass_m;
        if self.turned_rad >= TAU {
            self.turned_rad = 0.0;
            self.latched = Some(side.other());
            self.state = "back up";
            return Command::drive(-self.rules.step_m);
        }
        self.state = "avoid";
        let noise_rad = self.rules.turn_noise_rad * situation.draws.normal(Purpose::Turn);
        self.turned_rad += self.rules.turn_rad;
        Command::turn(side.sign() * (self.rules.turn_rad + noise_rad))
    }

    fn proceed(&mut self, situation: &Situation<'_>) -> Command {
        self.latched = None;
        self.turned_rad = 0.0;
        let step_m = self.rules.step_m;
        if self.pass_m > 0.0 {
            self.pass_m -= step_m;
            self.state = "pass";
            return Command::drive(step_m);
        }
        let error_rad = situation.goal_error_rad();
        if error_rad.abs() <= self.rules.bearing_tolerance_rad {
            self.state = "drive";
            return Command::drive(step_m);
        }
        self.state = "turn to goal";
        let turn_rad = error_rad.clamp(-self.rules.turn_rad, self.rules.turn_rad);
        // The rest of the turn follows after another look.
        let drive_m = if error_rad.abs() > self.rules.turn_rad { 0.0 } else { step_m };
        Command { turn_rad, drive_m, stop: None }
    }
}

/// Right if all hazards are on the left, left if all are on the right, else towards the goal.
fn away_from_hazards(situation: &Situation<'_>) -> Side {
    let on = |sign: f64| situation.view.areas.iter().any(|area| area.hazard && sign * area.left_m() > 1e-9);
    match (on(1.0), on(-1.0)) {
        (true, false) => Side::Right,
        (false, true) => Side::Left,
        _ => situation.goal_side(),
    }
}

impl Policy for SojournerLike {
    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        if situation.goal_distance_m() <= self.rules.goal_tolerance_m {
            self.state = "at goal";
            return Command::stop(Stop::AtGoal);
        }
        if situation.view.has_hazard() { self.avoid(situation) } else { self.proceed(situation) }
    }

    fn state(&self) -> &'static str {
        self.state
    }
}
