//! Recordings of rovers: writers, and parts common to both flavours.

mod ros2;
mod viewer;

#[cfg(test)]
mod tests;

use super::mesh::Square;
use super::{Channel, Flavour, McapError, McapSummary, TerrainView, Timeline, encode, write};
use crate::atomic::Target;
use sastrugi_numeric::Surface;
use sastrugi_schemas::study::McapFlavour;
use sastrugi_schemas::topics::ros2::ROVER_ROS2;
use sastrugi_schemas::topics::{ROVER_VIEWER, RoverCycle, RoverEventKind, RoverRecording, SeenRay, StateSample, Topic};
use std::collections::BTreeMap;

/// States per pose of the driven path.
const PATH_STEP: usize = 10;
/// Steps per metre of drawn points.
const STEPS_PER_M: f64 = 1024.0;
/// Height of drawn areas and plans above the plane of the body, m.
const LIFT_M: f64 = 0.02;
/// Wheel radius over the distance of the axles from the centre: with our axles it gives the paper's 65 mm.
const WHEEL: f64 = 0.26;
/// Diameter of the spheres at start and goal, m.
const END_M: f64 = 0.3;
/// Colour of areas and rays with a hazard.
const HAZARD: [u8; 3] = [0xd6, 0x27, 0x28];
/// Colour of areas and rays without a hazard.
const CLEAR: [u8; 3] = [0x2c, 0xa0, 0x2c];
/// Colour of rays without a hit.
const MISSED: [u8; 3] = [0x9a, 0x9a, 0x94];
/// Colour of the body.
const BODY: [u8; 3] = [0xd8, 0xb0, 0x20];
/// Colour of the wheels.
const WHEELS: [u8; 3] = [0x28, 0x28, 0x28];

/// A rover's drive to write.
#[derive(Clone, Copy, Debug)]
pub struct RoverMcap<'a> {
    /// Messages and their encoding.
    pub flavour: McapFlavour,
    /// Recording.
    pub recording: &'a RoverRecording,
    /// The ground around the path.
    pub terrain: &'a TerrainView<'a>,
    /// Start, m.
    pub start_m: [f64; 2],
    /// Goal, m.
    pub goal_m: [f64; 2],
    /// Start of the clock, ns since 1970-01-01 UTC.
    pub epoch_ns: u64,
    /// Metadata records by name.
    pub metadata: &'a BTreeMap<String, BTreeMap<String, String>>,
}

/// Writes a drive to a file.
///
/// # Errors
/// See [`McapError`].
pub fn write_rover<'a>(target: impl Into<Target<'a>>, rover: &RoverMcap<'_>) -> Result<McapSummary, McapError> {
    write(target.into(), encode_rover(rover)?)
}

/// A drive as the bytes of an MCAP file.
///
/// # Errors
/// [`McapError::Unfit`] for a recording without states or with a number that is not finite.
pub fn encode_rover(rover: &RoverMcap) -> Result<(Vec<u8>, McapSummary), McapError> {
    check(rover)?;
    let (listed, messages): (&[&'static Topic], fn(&RoverMcap, &mut Timeline) -> _) = match rover.flavour {
        McapFlavour::Viewer => (&ROVER_VIEWER, viewer::messages),
        McapFlavour::Ros2 => (&ROVER_ROS2, ros2::messages),
    };
    let mut timeline = Timeline::new(listed.iter().map(|topic| Channel::of(topic)).collect(), rover.epoch_ns);
    messages(rover, &mut timeline)?;
    encode(Flavour::of(rover.flavour), timeline, rover.metadata)
}

fn check(rover: &RoverMcap) -> Result<(), McapError> {
    let recording = rover.recording;
    if recording.states.is_empty() {
        return Err(McapError::unfit("it has no states"));
    }
    let finite = |what: &str, time_s: f64, values: &[f64]| match values.iter().find(|value| !value.is_finite()) {
        Some(value) => {
            Err(McapError::unfit(format!("{what} at {time_s} s contains {value}; every number must be finite")))
        }
        None => Ok(()),
    };
    finite("the start or goal", 0.0, &[rover.start_m, rover.goal_m].concat())?;
    for state in &recording.states {
        finite("a state", state.time_s, &[&[state.time_s][..], &state.position_m, &state.orientation].concat())?;
    }
    for cycle in &recording.cycles {
        let corners = cycle.areas.iter().flat_map(|area| area.corners_m.iter().flatten());
        let ends = cycle.rays.iter().flat_map(|ray| ray.from_m.iter().chain(&ray.to_m));
        let all: Vec<f64> = corners.chain(ends).chain(&cycle.position_m).copied().chain([cycle.time_s]).collect();
        finite("a cycle", cycle.time_s, &all)?;
    }
    recording.plans.iter().try_for_each(|plan| finite("a plan", plan.time_s, plan.points_m.as_flattened()))
}

/// Level of an event, from 1 (debug) to 3 (warning): the numbers of `foxglove.Log`, and tenths of those of `rcl_interfaces/msg/Log`.
fn level(kind: RoverEventKind) -> u8 {
    use RoverEventKind as Kind;
    match kind {
        Kind::Turn => 1,
        Kind::Start | Kind::Hazard | Kind::Reversal | Kind::Reached => 2,
        Kind::Contact | Kind::Lost | Kind::NoWay | Kind::DistanceLimit | Kind::CycleLimit | Kind::OffGround => 3,
    }
}

/// States of the driven path: every tenth, plus the last.
fn path_states(recording: &RoverRecording) -> Vec<&StateSample> {
    let states = &recording.states;
    let last = states.last().filter(|_| !(states.len() - 1).is_multiple_of(PATH_STEP));
    states.iter().step_by(PATH_STEP).chain(last).collect()
}

/// Where the terrain is drawn at full resolution: under the body and in the areas that the rover sees.
fn corridor(rover: &RoverMcap) -> Vec<Square> {
    let [dx, dy] = rover.terrain.dem.geometry.cell;
    let RoverRecording { axle_m, track_m, states, cycles, .. } = rover.recording;
    let half_side = axle_m.max(*track_m) + dx.max(dy);
    let under = states.iter().map(|state| Square { centre: [state.position_m[0], state.position_m[1]], half_side });
    let seen = cycles.iter().flat_map(|cycle| &cycle.areas).flat_map(|area| &area.corners_m);
    under.chain(seen.map(|corner| Square { centre: [corner[0], corner[1]], half_side: dx.max(dy) })).collect()
}

/// Size and centre of the body box in base_link, m.
fn body(recording: &RoverRecording) -> [[f64; 3]; 2] {
    let radius_m = WHEEL * recording.axle_m;
    [[2.0 * recording.axle_m, 1.6 * recording.track_m, 1.5 * radius_m], [0.0, 0.0, 2.75 * radius_m]]
}

/// Wheel centres in base_link, m, with wheel radius and width, m.
fn wheels(recording: &RoverRecording) -> ([[f64; 3]; 4], f64, f64) {
    let RoverRecording { axle_m: a, track_m: t, .. } = *recording;
    let radius_m = WHEEL * a;
    ([[a, t, radius_m], [a, -t, radius_m], [-a, t, radius_m], [-a, -t, radius_m]], radius_m, 0.8 * radius_m)
}

/// A point relative to the terrain's origin, rounded to steps.
fn relative(rover: &RoverMcap, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let [x0, y0, z0] = rover.terrain.origin_m();
    [x - x0, y - y0, z - z0].map(|v| (v * STEPS_PER_M).round() / STEPS_PER_M)
}

fn lifted(rover: &RoverMcap, [x, y, z]: [f64; 3]) -> [f64; 3] {
    relative(rover, [x, y, z + LIFT_M])
}

/// A plan position projected onto the ground, in the map frame.
fn on_ground(rover: &RoverMcap, [x, y]: [f64; 2]) -> [f64; 3] {
    let height_m = rover.terrain.dem.height(x, y).filter(|z| z.is_finite());
    [x, y, height_m.unwrap_or(rover.terrain.range_m.0)]
}

/// Triangles of the areas with or without a hazard, relative to the terrain's origin.
fn area_triangles(rover: &RoverMcap, cycle: &RoverCycle, hazard: bool) -> Vec<[f64; 3]> {
    let areas = cycle.areas.iter().filter(|area| area.hazard == hazard);
    areas
        .flat_map(|area| {
            let [a, b, c, d] = area.corners_m.map(|corner| lifted(rover, corner));
            // Counter-clockwise from above, for corners in the order near right, near left, far left, far right.
            [a, c, b, a, d, c]
        })
        .collect()
}

/// Rays of one colour as pairs of end points, relative to the terrain's origin.
fn ray_lines(rover: &RoverMcap, cycle: &RoverCycle, rgb: [u8; 3]) -> Vec<[f64; 3]> {
    let rays = cycle.rays.iter().filter(|ray| ray_rgb(ray) == rgb);
    rays.flat_map(|ray| [relative(rover, ray.from_m), relative(rover, ray.to_m)]).collect()
}

fn ray_rgb(ray: &SeenRay) -> [u8; 3] {
    match (ray.hit, ray.hazard) {
        (false, _) => MISSED,
        (true, true) => HAZARD,
        (true, false) => CLEAR,
    }
}
