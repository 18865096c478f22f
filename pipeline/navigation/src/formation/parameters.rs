//! Team parameters, as a study states them.

use super::crowd::CrowdSettings;
use super::obstacles::MovingObstacle;
use super::shape::{Formation, FormationError, MEMBERS_MAX, Pattern, SlotParameters};
use super::speeds::{Bands, SpeedLimits};
use sastrugi_schemas::{ParameterError, counted, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[cfg(test)]
mod tests;

/// A formation by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// One behind another.
    #[default]
    Column,
    /// Side by side, alternately to the left and to the right of the leader.
    Line,
    /// Behind the leader on both sides, in a V.
    Wedge,
    /// The slots listed in `slots`.
    Custom,
}

impl Shape {
    /// All shapes.
    pub const ALL: [Self; 4] = [Self::Column, Self::Line, Self::Wedge, Self::Custom];

    /// Name in studies and tables.
    pub fn name(self) -> &'static str {
        self.pattern().map_or("custom", Pattern::name)
    }

    /// The built-in pattern; `None` for custom slots.
    pub fn pattern(self) -> Option<Pattern> {
        match self {
            Self::Column => Some(Pattern::Column),
            Self::Line => Some(Pattern::Line),
            Self::Wedge => Some(Pattern::Wedge),
            Self::Custom => None,
        }
    }
}

/// A member that is lost during the run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Loss {
    /// Time since the start, 0 or later, s.
    #[schemars(transform = limits::not_negative)]
    pub time_s: f64,
    /// Member, counted from 1.
    pub member: u32,
}

/// Parameters of a team and its run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TeamParameters {
    /// Formation.
    pub formation: Shape,
    /// Number of members; 4 if absent. A custom formation has one per slot.
    #[schemars(range(min = 1, max = MEMBERS_MAX))]
    pub members: Option<u32>,
    /// Distance between adjacent slots, m. Errors up to 20 % of it count as in range, up to 40 % as tolerable.
    #[schemars(transform = limits::positive)]
    pub spacing_m: f64,
    /// Slots of a custom formation.
    pub slots: Vec<SlotParameters>,
    /// Radius of a member, m.
    #[schemars(transform = limits::positive)]
    pub radius_m: f64,
    /// Clearance between the discs of two members at their targets, m.
    #[schemars(transform = limits::not_negative)]
    pub margin_m: f64,
    /// Mean speed, m/s.
    #[schemars(transform = limits::positive)]
    pub speed_m_s: f64,
    /// Lowest speed of a moving member, m/s.
    #[schemars(transform = limits::positive)]
    pub speed_min_m_s: f64,
    /// Highest speed, m/s.
    #[schemars(transform = limits::positive)]
    pub speed_max_m_s: f64,
    /// Acceleration, m/s^2.
    #[schemars(transform = limits::positive)]
    pub accelerate_m_s2: f64,
    /// Deceleration, m/s^2.
    #[schemars(transform = limits::positive)]
    pub slow_m_s2: f64,
    /// Tolerated deviation from a slot's depth before speeds change, as a share of the depth, or of the spacing if that is larger.
    #[schemars(transform = limits::between(0.0, 0.5))]
    pub tolerance: f64,
    /// Adjust speeds as in the listing of Algorithm 8, which slows down a member that lags.
    pub literal_speeds: bool,
    /// Largest distance between waypoints, m: longer legs of the route are divided; `spacing_m` if absent.
    #[schemars(transform = limits::positive)]
    pub waypoint_spacing_m: Option<f64>,
    /// Use only the waypoints of the route, as in the thesis.
    pub literal_waypoints: bool,
    /// Let a member plan a detour if the directions of Algorithm 7 make no progress; the thesis has none.
    pub detours: bool,
    /// Distance at which a target counts as reached, m.
    #[schemars(transform = limits::positive)]
    pub arrive_m: f64,
    /// Time step, s.
    #[schemars(transform = limits::positive)]
    pub step_s: f64,
    /// Number of steps that members check ahead on the ground.
    #[schemars(range(min = 1))]
    pub look_ahead: u32,
    /// Distance from the leader within which the team sees the ground, m: it then plans from start to goal on the ground seen so far. If absent, it
    /// follows the route.
    #[schemars(transform = limits::positive)]
    pub sensing_radius_m: Option<f64>,
    /// Time limit of the run, s; if absent, ten times the time for the route at mean speed, plus ten minutes.
    #[schemars(transform = limits::positive)]
    pub time_max_s: Option<f64>,
    /// Rate of the recorded samples, Hz; it must be the rate of the steps divided by an integer.
    #[schemars(transform = limits::positive)]
    pub sample_rate_hz: f64,
    /// Members lost during the run.
    pub losses: Vec<Loss>,
    /// Number of additional losses, with members and times drawn at random.
    pub drawn_losses: u32,
    /// Obstacles that move on their own.
    pub obstacles: Vec<MovingObstacle>,
    /// Number of additional moving obstacles, drawn at random, which cross the route near the team.
    pub drawn_obstacles: u32,
}

impl Default for TeamParameters {
    /// The thesis' team of four with a spacing of 10, its map units taken as metres; it gives no other values.
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

/// Default time limit, as a multiple of the time for the route at mean speed.
const TIME_FACTOR: f64 = 10.0;
/// Time added to the default time limit, s.
const TIME_MORE_S: f64 = 600.0;

/// Members of a built-in formation if the study states none: four, as in the thesis.
const MEMBERS: u32 = 4;

impl TeamParameters {
    /// Refuses values that are invalid on any terrain.
    ///
    /// # Errors
    /// The first invalid key.
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
                format!("is {}; it must be above 0 and below 0.5", self.tolerance),
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

    /// Applies the losses in order, to a copy of the formation.
    fn check_losses(&self, mut formation: Formation) -> Result<(), ParameterError> {
        for (k, loss) in self.losses.iter().enumerate() {
            ParameterError::not_negative("time_s", loss.time_s).map_err(|e| e.within(&format!("losses.{k}")))?;
            let lost = formation.lose(loss.member);
            lost.map_err(|e| ParameterError::new(format!("losses.{k}"), format!("cannot happen: {e}")))?;
        }
        match formation.slots().len() > self.drawn_losses as usize {
            true => Ok(()),
            false => {
                let left = counted(formation.slots().len(), "remaining member");
                let message = format!("is {}; of {left}, at least one must be kept", self.drawn_losses);
                Err(ParameterError::new("drawn_losses", message))
            }
        }
    }

    /// The formation at the start of the run.
    ///
    /// # Errors
    /// Slots that do not form a formation, or keys that exclude each other.
    pub fn formation(&self) -> Result<Formation, ParameterError> {
        let slots = match self.formation.pattern() {
            Some(_) if !self.slots.is_empty() => {
                let message =
                    format!("apply only to a custom formation, but `formation` is \"{}\"", self.formation.name());
                return Err(ParameterError::new("slots", message));
            }
            Some(pattern) => {
                let members = self.members.unwrap_or(MEMBERS);
                if !(1..=MEMBERS_MAX as u32).contains(&members) {
                    let message = format!("is {members}; it must be from 1 to {MEMBERS_MAX}");
                    return Err(ParameterError::new("members", message));
                }
                return Formation::new(&pattern.slots(members, self.spacing_m), self.radius_m)
                    .map_err(|e| refused("spacing_m", &e));
            }
            None if self.members.is_some() => {
                return Err(ParameterError::new(
                    "members",
                    "does not apply to a custom formation, which has one member per slot",
                ));
            }
            None => &self.slots,
        };
        Formation::new(slots, self.radius_m).map_err(|e| refused("slots", &e))
    }

    /// Distance between adjacent slots, m; NaN for a custom formation, whose slots are given individually.
    pub fn pattern_spacing_m(&self) -> f64 {
        self.formation.pattern().map_or(f64::NAN, |_| self.spacing_m)
    }

    /// Number of steps between recorded samples.
    ///
    /// # Errors
    /// A rate that is not the rate of the steps divided by an integer.
    pub fn sample_every(&self) -> Result<u64, ParameterError> {
        let steps = 1.0 / (self.sample_rate_hz * self.step_s);
        let count = steps.round();
        if count >= 1.0 && (steps - count).abs() <= 1e-9 * count && count <= f64::from(u32::MAX) {
            return Ok(count as u64);
        }
        let message = format!(
            "is {}; with steps of {} s it must be {} Hz divided by an integer",
            self.sample_rate_hz,
            self.step_s,
            1.0 / self.step_s
        );
        Err(ParameterError::new("sample_rate_hz", message))
    }

    /// Time limit of a run along a route of this length, m, in s.
    pub fn time_limit_s(&self, route_m: f64) -> f64 {
        self.time_max_s.unwrap_or_else(|| TIME_FACTOR * route_m / self.speed_m_s + TIME_MORE_S)
    }

    /// Largest distance between waypoints, m.
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
