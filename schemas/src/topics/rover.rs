//! What one drive of a rover leaves behind for MCAP files. Times count from its start. Frames: map (x east, y north, z up), base_link (x
//! forward, y left, z up) at the centre of the plane of the wheels' contacts.

use super::StateSample;
use serde::{Deserialize, Serialize};

/// A recorded drive of a rover.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoverRecording {
    /// Axles ahead of and behind the centre, m.
    pub axle_m: f64,
    /// Wheels beside the centre line, m.
    pub track_m: f64,
    /// Pose and motion of base_link, at [`RoverRecording::RATE_HZ`] from time 0 on.
    pub states: Vec<StateSample>,
    /// What the rover saw and did, cycle by cycle.
    pub cycles: Vec<RoverCycle>,
    /// Planned ways, each from its time on; none for navigators without plans.
    pub plans: Vec<RoverPlan>,
    /// What happened, in order of time; the last one is the outcome.
    pub events: Vec<RoverEvent>,
}

impl RoverRecording {
    /// Rate of the states, Hz.
    pub const RATE_HZ: f64 = 1.0;
}

/// One cycle, as it was when the rover had looked and decided.
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
    /// Position that the rover believes to have, m.
    pub believed_m: [f64; 2],
    /// Heading that the rover believes to have, rad.
    pub believed_heading_rad: f64,
    /// Left side up and nose down, rad.
    pub roll_pitch_rad: [f64; 2],
    /// What the navigator is at.
    pub state: String,
    /// Turn to the left and drive ahead of this cycle, as carried out: rad, m.
    pub moved: [f64; 2],
    /// Their times, s.
    pub durations_s: [f64; 2],
    /// Driven before, m.
    pub distance_m: f64,
    /// Distance to the goal, m.
    pub goal_distance_m: f64,
    /// Rocks above the clearance met so far.
    pub contacts: u32,
    /// Areas that it sees, from left to right.
    pub areas: Vec<SeenArea>,
    /// Ranges, column by column from the left.
    pub rays: Vec<SeenRay>,
}

/// An area that a rover sees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeenArea {
    /// Corners in order around it, on the plane of the body, in the map frame, m.
    pub corners_m: [[f64; 3]; 4],
    /// Whether it holds a hazard.
    pub hazard: bool,
}

/// A range measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeenRay {
    /// Origin in the map frame, m.
    pub from_m: [f64; 3],
    /// Where it met the ground, or where it was given up, m.
    pub to_m: [f64; 3],
    /// Whether it met the ground.
    pub hit: bool,
    /// Whether its column is a hazard.
    pub hazard: bool,
}

/// The way that a rover plans to take from a time on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoverPlan {
    /// Time, s.
    pub time_s: f64,
    /// Way points in the map frame, m; the height is that of the rover.
    pub points_m: Vec<[f64; 3]>,
}

/// Something that happened to a rover.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoverEvent {
    /// Time, s.
    pub time_s: f64,
    /// What.
    pub kind: RoverEventKind,
    /// One sentence with the numbers.
    pub text: String,
}

/// Kinds of events of a rover; those from `Reached` on end a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoverEventKind {
    /// The clock starts.
    Start,
    /// A hazard comes into view.
    Hazard,
    /// First turn in place after a drive.
    Turn,
    /// A drive back.
    Reversal,
    /// A rock above the clearance came under the rover.
    Contact,
    /// At the goal.
    Reached,
    /// It believed to be at the goal, and was not.
    Lost,
    /// It knew of no way on.
    NoWay,
    /// It drove as far as it may.
    DistanceLimit,
    /// It took as many cycles as it may.
    CycleLimit,
    /// It looked or went beyond the ground that is known.
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
