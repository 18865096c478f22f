//! What one run of a team leaves behind: the only form in which it passes from the planner to MCAP files. Times count from the
//! run's start. Frames: map (x east, y north, z up) and one per member (x forward along its heading, y left, z up; no roll or
//! pitch), at the point of the ground that it stands on.

use serde::{Deserialize, Serialize};

/// A recorded run of a team of discs in formation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TeamRecording {
    /// Rate of the states, Hz.
    pub sample_rate_hz: f64,
    /// Members in the order of their numbers; all have their states at the same times.
    pub members: Vec<Member>,
    /// Planned routes, in order of time: one, or those of a team that plans on its way; may be empty.
    pub routes: Vec<PlannedRoute>,
    /// Path of the search before it was smoothed, m; may be empty.
    pub search_path_m: Vec<[f64; 3]>,
    /// Vertices of the roadmap, m; may be empty.
    pub vertices_m: Vec<[f64; 3]>,
    /// Bounding boxes of the formation, in order of time; may be empty.
    pub boxes: Vec<FormationBox>,
    /// Rings of the obstacles' corners in the map frame, m, without the first corner again as the last.
    pub obstacles: Vec<Vec<[f64; 2]>>,
    /// Discs that cross the team's way, with their states at the times of the members'.
    pub moving: Vec<MovingDisc>,
    /// What happened, in order of time.
    pub events: Vec<TeamEvent>,
}

/// The route that a team makes for from a time on.
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
    /// Name of its frame and of its topics, as `member_1`: letters, digits and underscores.
    pub name: String,
    /// Radius, m.
    pub radius_m: f64,
    /// States, at [`TeamRecording::sample_rate_hz`] from time 0 on.
    pub states: Vec<MemberState>,
}

/// Where a member is, how it moves, and how well it keeps its place.
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
    /// Slot that the member holds, from 1; `None` when it is lost.
    pub slot: Option<i64>,
    /// Distance behind the predecessor less the slot's, m; `None` without a predecessor.
    pub depth_error_m: Option<f64>,
    /// Distance to the right of the predecessor less the slot's, m; `None` without a predecessor.
    pub width_error_m: Option<f64>,
    /// Distance in plan to the target that it makes for, m.
    pub target_distance_m: f64,
}

/// Bounding box of a formation from a time on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FormationBox {
    /// Time, s.
    pub time_s: f64,
    /// Corners in the map frame, in order around the box, m.
    pub corners_m: [[f64; 3]; 4],
    /// True where there is too little room for the formation, even compressed.
    pub squeezed: bool,
}

/// A disc that moves on its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MovingDisc {
    /// Radius, m.
    pub radius_m: f64,
    /// Where it is.
    pub states: Vec<DiscState>,
}

/// Where a moving disc is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiscState {
    /// Time, s.
    pub time_s: f64,
    /// Position on the ground in the map frame, m.
    pub position_m: [f64; 3],
}

/// Something that happened to a team.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TeamEvent {
    /// Time, s.
    pub time_s: f64,
    /// What.
    pub kind: TeamEventKind,
    /// Number of the member that it happened to; `None` for the team as a whole.
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
    /// Members took over slots.
    Rearranged,
    /// Too little room for the formation, even compressed.
    Squeezed,
    /// No way on.
    Stuck,
    /// At the last target.
    Arrived,
    /// A new route was found on the way.
    Replanned,
    /// Out of time.
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
