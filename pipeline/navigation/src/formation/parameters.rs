//! Parameters of a team as a study writes them.

use super::crowd::CrowdSettings;
use super::obstacles::MovingObstacle;
use super::shape::{Formation, FormationError, Pattern, SlotParameters};
use super::speeds::{Bands, SpeedLimits};
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[cfg(test)]
mod tests;

/// A formation by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// One behind the other.
    #[default]
    Column,
    /// Side by side, alternately to the left and to the right of the leader.
    Line,
    /// Back from the leader on both sides.
    Wedge,
    /// The slots of `slots`.
    Custom,
}

impl Shape {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Column, Self::Line, Self::Wedge, Self::Custom];

    /// Name in studies and tables.
    pub fn name(self) -> &'static str {
        self.pattern().map_or("custom", Pattern::name)
    }

    /// The built-in pattern; custom slots have none.
    pub fn pattern(self) -> Option<Pattern> {
        match self {
            Self::Column => Some(Pattern::Column),
            Self::Line => Some(Pattern::Line),
            Self::Wedge => Some(Pattern::Wedge),
            Self::Custom => None,
        }
    }
}

/// A member that is lost on the way.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Loss {
    /// Time since the start, 0 or later, s.
    pub time_s: f64,
    /// Member, from 1.
    pub member: u32,
}

/// Parameters of a team and its run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TeamParameters {
    /// Formation.
    pub formation: Shape,
    /// Members; 4 when absent. Custom formations have one for each slot.
    pub members: Option<u32>,
    /// Distance between neighbouring slots, m. Errors in range are at most 20 % of it, tolerable ones 40 %.
    pub spacing_m: f64,
    /// Slots of a custom formation.
    pub slots: Vec<SlotParameters>,
    /// Radius of a member, m.
    pub radius_m: f64,
    /// Room between the discs of two members at their targets, m.
    pub margin_m: f64,
    /// Mean speed, m/s.
    pub speed_m_s: f64,
    /// Least speed of a moving member, m/s.
    pub speed_min_m_s: f64,
    /// Greatest speed, m/s.
    pub speed_max_m_s: f64,
    /// Acceleration, m/s^2.
    pub accelerate_m_s2: f64,
    /// Deceleration, m/s^2.
    pub slow_m_s2: f64,
    /// Deviation from the depth of a slot at which speeds change, a share of the depth and at least of the spacing.
    pub tolerance: f64,
    /// Speeds as in the listing of Algorithm 8, which slows a member that lags.
    pub literal_speeds: bool,
    /// Distance between waypoints, m: longer legs of the route are divided; the spacing when absent.
    pub waypoint_spacing_m: Option<f64>,
    /// The waypoints of the route alone, as in the thesis.
    pub literal_waypoints: bool,
    /// Members plan a way round where Algorithm 7 leads them nowhere; as in the thesis without.
    pub detours: bool,
    /// Distance at which a target counts as reached, m.
    pub arrive_m: f64,
    /// Length of a step, s.
    pub step_s: f64,
    /// Steps for which members look at the ground ahead.
    pub look_ahead: u32,
    /// Distance from its leader within which the team sees the ground, m: it plans from start to goal on what it has seen. It follows the route
    /// when absent.
    pub sensing_radius_m: Option<f64>,
    /// Time after which the run ends, s; ten times that of the route at mean speed, plus ten minutes, when absent.
    pub time_max_s: Option<f64>,
    /// Rate of the recorded samples, Hz: the rate of the steps over a whole number.
    pub sample_rate_hz: f64,
    /// Members lost on the way.
    pub losses: Vec<Loss>,
    /// Number of further losses, drawn: members and times.
    pub drawn_losses: u32,
    /// Obstacles that move on their own.
    pub obstacles: Vec<MovingObstacle>,
    /// Number of further moving obstacles, drawn, which cross the route near the team.
    pub drawn_obstacles: u32,
}

impl Default for TeamParameters {
    /// The thesis' team of four, spacing of 10, in metres for its map units; it gives no other values.
    fn default() -> Self {
        Self {
            formation: Shape::default(),
            members: None,
            spacing_m: 10.0,
            slots: Vec::new(),
            radius_m: 0.5,
            margin_m: 0.1,
            speed_m_s: 1.0,
            speed_min_m_s: 0.25,
            speed_max_m_s: 1.5,
            accelerate_m_s2: 0.5,
            slow_m_s2: 0.5,
            tolerance: 0.2,
            literal_speeds: false,
            waypoint_spacing_m: None,
            literal_waypoints: false,
            detours: true,
            arrive_m: 1.0,
            step_s: 0.1,
            look_ahead: 3,
            sensing_radius_m: None,
            time_max_s: None,
            sample_rate_hz: 1.0,
            losses: Vec::new(),
            drawn_losses: 0,
            obstacles: Vec::new(),
            drawn_obstacles: 0,
        }
    }
}

/// Members of a built-in formation where the study states none: the thesis' four.
const MEMBERS: u32 = 4;

impl TeamParameters {
    /// Refuses what no team can have, whatever the terrain.
    ///
    /// # Errors
    /// The first key that is wrong.
    pub fn check(&self) -> Result<(), ParameterError> {
        let positive = [
            ("spacing_m", self.spacing_m),
            ("radius_m", self.radius_m),
            ("speed_m_s", self.speed_m_s),
            ("speed_min_m_s", self.speed_min_m_s),
            ("speed_max_m_s", self.speed_max_m_s),
            ("accelerate_m_s2", self.accelerate_m_s2),
            ("slow_m_s2", self.slow_m_s2),
            ("arrive_m", self.arrive_m),
            ("step_s", self.step_s),
            ("sample_rate_hz", self.sample_rate_hz),
        ];
        positive.into_iter().try_for_each(|(key, value)| ParameterError::positive(key, value).map(drop))?;
        let optional = [
            ("waypoint_spacing_m", self.waypoint_spacing_m),
            ("sensing_radius_m", self.sensing_radius_m),
            ("time_max_s", self.time_max_s),
        ];
        optional.into_iter().try_for_each(|(key, value)| match value {
            Some(value) => ParameterError::positive(key, value).map(drop),
            None => Ok(()),
        })?;
        ParameterError::not_negative("margin_m", self.margin_m)?;
        self.check_speeds()?;
        if !(self.tolerance > 0.0 && self.tolerance < 0.5) {
            return Err(ParameterError::new(
                "tolerance",
                format!("is {}; it must lie above 0 and below 0.5", self.tolerance),
            ));
        }
        if self.look_ahead == 0 {
            return Err(ParameterError::new("look_ahead", "is 0; it must be at least 1 step"));
        }
        self.sample_every()?;
        let formation = self.formation()?;
        self.check_losses(formation)?;
        let mut obstacles = self.obstacles.iter().enumerate();
        obstacles.try_for_each(|(k, one)| one.check().map_err(|e| e.within(&format!("obstacles.{k}"))))
    }

    fn check_speeds(&self) -> Result<(), ParameterError> {
        let Self { speed_m_s, speed_min_m_s, speed_max_m_s, .. } = *self;
        if speed_min_m_s > speed_m_s {
            let message = format!("is {speed_min_m_s}; it must be at most `speed_m_s`, {speed_m_s}");
            return Err(ParameterError::new("speed_min_m_s", message));
        }
        if speed_max_m_s < speed_m_s {
            let message = format!("is {speed_max_m_s}; it must be at least `speed_m_s`, {speed_m_s}");
            return Err(ParameterError::new("speed_max_m_s", message));
        }
        Ok(())
    }

    /// Loses the members in order, on a copy.
    fn check_losses(&self, mut formation: Formation) -> Result<(), ParameterError> {
        for (k, loss) in self.losses.iter().enumerate() {
            ParameterError::not_negative("time_s", loss.time_s).map_err(|e| e.within(&format!("losses.{k}")))?;
            let lost = formation.lose(loss.member);
            lost.map_err(|e| ParameterError::new(format!("losses.{k}"), format!("cannot happen: {e}")))?;
        }
        match formation.slots().len() > self.drawn_losses as usize {
            true => Ok(()),
            false => {
                let left = formation.slots().len();
                let message = format!("is {}; of the {left} members that are left one must stay", self.drawn_losses);
                Err(ParameterError::new("drawn_losses", message))
            }
        }
    }

    /// The formation at the start.
    ///
    /// # Errors
    /// Slots that make no formation, or keys that do not go together.
    pub fn formation(&self) -> Result<Formation, ParameterError> {
        let slots = match self.formation.pattern() {
            Some(_) if !self.slots.is_empty() => {
                let message =
                    format!("are those of a custom formation, but `formation` is \"{}\"", self.formation.name());
                return Err(ParameterError::new("slots", message));
            }
            Some(pattern) => {
                let members = self.members.unwrap_or(MEMBERS);
                if !(1..=1000).contains(&members) {
                    return Err(ParameterError::new("members", format!("is {members}; it must be from 1 to 1000")));
                }
                return Formation::new(&pattern.slots(members, self.spacing_m), self.radius_m)
                    .map_err(|e| refused("spacing_m", &e));
            }
            None if self.members.is_some() => {
                return Err(ParameterError::new(
                    "members",
                    "has no meaning for a custom formation: each slot has a member",
                ));
            }
            None => &self.slots,
        };
        Formation::new(slots, self.radius_m).map_err(|e| refused("slots", &e))
    }

    /// Distance between neighbouring slots, m; NaN for a custom formation, whose slots lie as they are given.
    pub fn pattern_spacing_m(&self) -> f64 {
        self.formation.pattern().map_or(f64::NAN, |_| self.spacing_m)
    }

    /// Steps from one recorded sample to the next.
    ///
    /// # Errors
    /// A rate that is not that of the steps over a whole number.
    pub fn sample_every(&self) -> Result<u64, ParameterError> {
        let steps = 1.0 / (self.sample_rate_hz * self.step_s);
        let whole = steps.round();
        if whole >= 1.0 && (steps - whole).abs() <= 1e-9 * whole && whole <= f64::from(u32::MAX) {
            return Ok(whole as u64);
        }
        let message = format!(
            "is {}; with steps of {} s it must be {} Hz over a whole number",
            self.sample_rate_hz,
            self.step_s,
            1.0 / self.step_s
        );
        Err(ParameterError::new("sample_rate_hz", message))
    }

    /// Greatest distance between waypoints, m.
    pub(crate) fn leg_max_m(&self) -> f64 {
        match self.literal_waypoints {
            true => f64::INFINITY,
            false => self.waypoint_spacing_m.unwrap_or(self.spacing_m),
        }
    }

    pub(crate) fn crowd(&self) -> CrowdSettings {
        let Self { step_s, radius_m, arrive_m, look_ahead, detours, .. } = *self;
        CrowdSettings { step_s, radius_m, arrive_m, look_ahead, detours }
    }

    pub(crate) fn speeds(&self) -> SpeedLimits {
        SpeedLimits {
            mean_m_s: self.speed_m_s,
            min_m_s: self.speed_min_m_s,
            max_m_s: self.speed_max_m_s,
            accelerate_m_s2: self.accelerate_m_s2,
            slow_m_s2: self.slow_m_s2,
        }
    }

    pub(crate) fn bands(&self) -> Bands {
        Bands { tolerance: self.tolerance, spacing_m: self.spacing_m, literal: self.literal_speeds }
    }
}

fn refused(key: &str, error: &FormationError) -> ParameterError {
    ParameterError::new(key, format!("cannot form a team: {error}"))
}
