//! The recording of a team's run: the only form in which it passes from the planner to MCAP files. Times count from the
//! run's start. Frames: map (x east, y north, z up) and one per member (x forward along its heading, y left, z up; no roll or
//! pitch), at its ground point.

use serde::{Deserialize, Serialize};

/// A recorded run of a team of discs in formation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TeamRecording {
    /// Rate of the states, Hz.
    pub sample_rate_hz: f64,
    /// Members in the order of their numbers; all have states at the same times.
    pub members: Vec<Member>,
    /// Planned routes in order of time: one, or several if the team replans; may be empty.
    pub routes: Vec<PlannedRoute>,
    /// Path of the search before smoothing, m; may be empty.
    pub search_path_m: Vec<[f64; 3]>,
    /// Vertices of the roadmap, m; may be empty.
    pub vertices_m: Vec<[f64; 3]>,
    /// Bounding boxes of the formation, in order of time; may be empty.
    pub boxes: Vec<FormationBox>,
    /// Rings of the obstacles' corners in the map frame, m, without repeating the first corner.
    pub obstacles: Vec<Vec<[f64; 2]>>,
    /// Moving obstacles (discs), with states at the same times as the members.
    pub moving: Vec<MovingDisc>,
    /// Events in order of time.
    pub events: Vec<TeamEvent>,
}

/// A planned route, valid from its time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedRoute {
    /// Time since the start, s.
    pub time_s: f64,
    /// Waypoints in the map frame, m.
    pub points_m: Vec<[f64; 3]>,
}

/// A member of a team.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Member {
    /// Number, from 1.
    pub number: i64,
    /// Name of its frame and topics, such as `member_1`: letters, digits and underscores.
    pub name: String,
    /// Radius, m.
    pub radius_m: f64,
    /// States, at [`TeamRecording::sample_rate_hz`] from time 0.
    pub states: Vec<MemberState>,
}

/// Position, motion and formation errors of a member.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MemberState {
    /// Time, s.
    pub time_s: f64,
    /// Position on the ground in the map frame, m.
    pub position_m: [f64; 3],
    /// Direction of travel, counterclockwise from east, rad.
    pub heading_rad: f64,
    /// Velocity in the map frame, m/s.
    pub velocity_m_s: [f64; 3],
    /// Slot of the member, from 1; `None` if it is lost.
    pub slot: Option<i64>,
    /// Distance behind the predecessor minus that of the slot, m; `None` without a predecessor.
    pub depth_error_m: Option<f64>,
    /// Distance to the right of the predecessor minus that of the slot, m; `None` without a predecessor.
    pub width_error_m: Option<f64>,
    /// Distance in plan to the current target, m.
    pub target_distance_m: f64,
}

/// Bounding box of a formation, valid from its time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FormationBox {
    /// Time, s.
    pub time_s: f64,
    /// Corners in the map frame, in order around the box, m.
    pub corners_m: [[f64; 3]; 4],
    /// True if there is too little room for the formation, even compressed.
    pub squeezed: bool,
}

/// A moving obstacle: a disc.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MovingDisc {
    /// Radius, m.
    pub radius_m: f64,
    /// States.
    pub states: Vec<DiscState>,
}

/// Position of a moving disc.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiscState {
    /// Time, s.
    pub time_s: f64,
    /// Position on the ground in the map frame, m.
    pub position_m: [f64; 3],
}

/// An event of a team.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TeamEvent {
    /// Time, s.
    pub time_s: f64,
    /// Kind.
    pub kind: TeamEventKind,
    /// Number of the member concerned; `None` for the whole team.
    pub member: Option<i64>,
    /// One sentence with the numbers.
    pub text: String,
}

/// Kinds of events of a team.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TeamEventKind {
    /// The clock starts.
    Start,
    /// First step of a wait.
    Wait,
    /// First step to the side.
    Dodge,
    /// A member is lost and becomes an obstacle.
    Lost,
    /// Members changed slots.
    Rearranged,
    /// Too little room for the formation, even compressed.
    Squeezed,
    /// A member is stuck.
    Stuck,
    /// A member reached its last target.
    Arrived,
    /// A new route was planned.
    Replanned,
    /// The time limit was reached.
    Timeout,
    /// The run is over.
    End,
}

impl TeamEventKind {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Start,
        Self::Wait,
        Self::Dodge,
        Self::Lost,
        Self::Rearranged,
        Self::Squeezed,
        Self::Stuck,
        Self::Arrived,
        Self::Replanned,
        Self::Timeout,
        Self::End,
    ];

    /// Name in tables and recordings.
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Wait => "wait",
            Self::Dodge => "dodge",
            Self::Lost => "lost",
            Self::Rearranged => "rearranged",
            Self::Squeezed => "squeezed",
            Self::Stuck => "stuck",
            Self::Arrived => "arrived",
            Self::Replanned => "replanned",
            Self::Timeout => "timeout",
            Self::End => "end",
        }
    }
}
