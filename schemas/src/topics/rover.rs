//! The recording of a rover's drive, for MCAP files. Times count from its start. Frames: map (x east, y north, z up), base_link (x
//! forward, y left, z up) at the centre of the plane through the wheel contacts.

use super::StateSample;
use serde::{Deserialize, Serialize};

/// A recorded drive of a rover.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoverRecording {
    /// Distance of the axles ahead of and behind the centre, m.
    pub axle_m: f64,
    /// Distance of the wheels from the centre line, m.
    pub track_m: f64,
    /// Pose and motion of base_link, at [`RoverRecording::RATE_HZ`] from time 0.
    pub states: Vec<StateSample>,
    /// View and actions of the rover, by cycle.
    pub cycles: Vec<RoverCycle>,
    /// Planned paths, each valid from its time; none for navigators without a planner.
    pub plans: Vec<RoverPlan>,
    /// Events in order of time; the last one is the outcome.
    pub events: Vec<RoverEvent>,
}

impl RoverRecording {
    /// Rate of the states, Hz.
    pub const RATE_HZ: f64 = 1.0;
}

/// One cycle, after the rover has sensed and decided.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoverCycle {
    /// Time, s.
    pub time_s: f64,
    /// Number, from 0.
    pub number: u32,
    /// Position in the map frame, m.
    pub position_m: [f64; 3],
    /// Heading, counterclockwise from east, rad.
    pub heading_rad: f64,
    /// Position estimated by the rover, m.
    pub believed_m: [f64; 2],
    /// Heading estimated by the rover, rad.
    pub believed_heading_rad: f64,
    /// Roll (left side up positive) and pitch (nose down positive), rad.
    pub roll_pitch_rad: [f64; 2],
    /// State of the navigator.
    pub state: String,
    /// Executed turn (left positive, rad) and drive (ahead positive, m) of this cycle.
    pub moved: [f64; 2],
    /// Durations of turn and drive, s.
    pub durations_s: [f64; 2],
    /// Distance driven before, m.
    pub distance_m: f64,
    /// Distance to the goal, m.
    pub goal_distance_m: f64,
    /// Number of rocks above the clearance met so far.
    pub contacts: u32,
    /// Areas in view, from left to right.
    pub areas: Vec<SeenArea>,
    /// Ranges, column by column from the left.
    pub rays: Vec<SeenRay>,
}

/// An area in the rover's view.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeenArea {
    /// Corners in order around it, on the plane of the body, in the map frame, m.
    pub corners_m: [[f64; 3]; 4],
    /// Whether it contains a hazard.
    pub hazard: bool,
}

/// A range measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeenRay {
    /// Origin in the map frame, m.
    pub from_m: [f64; 3],
    /// Where it met the ground, or where it was cut off, m.
    pub to_m: [f64; 3],
    /// Whether it met the ground.
    pub hit: bool,
    /// Whether its column is a hazard.
    pub hazard: bool,
}

/// A path planned by a rover, valid from its time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoverPlan {
    /// Time, s.
    pub time_s: f64,
    /// Waypoints in the map frame, m; the height is that of the rover.
    pub points_m: Vec<[f64; 3]>,
}

/// An event of a rover.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoverEvent {
    /// Time, s.
    pub time_s: f64,
    /// Kind.
    pub kind: RoverEventKind,
    /// One sentence with the numbers.
    pub text: String,
}

/// Kinds of events of a rover; `Reached` and the following kinds end a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoverEventKind {
    /// The clock starts.
    Start,
    /// A hazard comes into view.
    Hazard,
    /// First turn in place after a drive.
    Turn,
    /// A reverse drive.
    Reversal,
    /// A rock above the clearance came under the rover.
    Contact,
    /// The goal was reached.
    Reached,
    /// The rover wrongly believed to be at the goal.
    Lost,
    /// The rover knew no way on.
    NoWay,
    /// The distance limit was reached.
    DistanceLimit,
    /// The cycle limit was reached.
    CycleLimit,
    /// The rover looked or drove beyond the known ground.
    OffGround,
}

impl RoverEventKind {
    /// Name in tables and recordings.
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Hazard => "hazard",
            Self::Turn => "turn",
            Self::Reversal => "reversal",
            Self::Contact => "contact",
            Self::Reached => "reached",
            Self::Lost => "lost",
            Self::NoWay => "no_way",
            Self::DistanceLimit => "distance_limit",
            Self::CycleLimit => "cycle_limit",
            Self::OffGround => "off_ground",
        }
    }
}
