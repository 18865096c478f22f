//! Drawing of a team, common to both flavours: bodies, lines on the ground, walls, and where the terrain is drawn at full resolution.
//!
//! Points of lines and walls are relative to a point near the terrain's corner and lowest height, so that viewers can store them in
//! single precision.

use super::super::TerrainView;
use super::super::mesh::Square;
use super::TeamMcap;
use sastrugi_numeric::{Grid, Surface};
use sastrugi_schemas::topics::{FormationBox, MemberState, TeamRecording};
use std::f64::consts::TAU;

/// Most points inserted between the given points of a line on the ground.
const LAID_POINTS: usize = 8192;
/// Most vertices of the roadmap.
const VERTICES: usize = 16384;
/// Points per second of a driven path.
const PATH_RATE_HZ: f64 = 2.0;
/// Steps per metre of drawn points.
const STEPS_PER_M: f64 = 1024.0;
/// Height of a wall around an obstacle, in radii of the largest member.
const WALL_RADII: f64 = 4.0;
/// Height of lines above the ground, in radii of the smallest member.
const LIFT_RADII: f64 = 0.5;
/// Colours of members, in turn.
const PALETTE: [[u8; 3]; 8] = [
    [0x1f, 0x77, 0xb4],
    [0xff, 0x7f, 0x0e],
    [0x94, 0x67, 0xbd],
    [0x17, 0xbe, 0xcf],
    [0xe3, 0x77, 0xc2],
    [0xbc, 0xbd, 0x22],
    [0x8c, 0x56, 0x4b],
    [0x7f, 0x7f, 0x7f],
];
/// Moving obstacles.
const MOVING: [u8; 3] = [0xb0, 0x3a, 0x2e];
/// Walls of obstacles.
pub(super) const WALL: [u8; 3] = [0x70, 0x4c, 0x3c];
/// Waypoints of the route.
pub(super) const ROUTE: [u8; 3] = [0xff, 0xd7, 0x00];
/// Path of the search.
pub(super) const SEARCH: [u8; 3] = [0xff, 0xff, 0xff];
/// Vertices of the roadmap.
pub(super) const VERTEX: [u8; 3] = [0x2b, 0x2b, 0x2b];

/// Colour of the formation's box.
pub(super) fn box_rgb(squeezed: bool) -> [u8; 3] {
    if squeezed { [0xd6, 0x27, 0x28] } else { [0x2c, 0xa0, 0x2c] }
}

/// A disc with a frame of its own, drawn as a cylinder as high as it is wide.
pub(super) struct Body {
    pub name: String,
    pub radius_m: f64,
    pub rgb: [u8; 3],
    /// Number of a member; `None` for a moving obstacle.
    pub number: Option<i64>,
}

/// Members, followed by moving obstacles.
pub(super) fn bodies(recording: &TeamRecording) -> Vec<Body> {
    let members = recording.members.iter().zip(PALETTE.into_iter().cycle()).map(|(member, rgb)| Body {
        name: member.name.clone(),
        radius_m: member.radius_m,
        rgb,
        number: Some(member.number),
    });
    let moving = recording.moving.iter().enumerate().map(|(index, disc)| Body {
        name: moving_name(index),
        radius_m: disc.radius_m,
        rgb: MOVING,
        number: None,
    });
    members.chain(moving).collect()
}

/// Frame of a moving obstacle.
pub(super) fn moving_name(index: usize) -> String {
    format!("moving_{}", index + 1)
}

/// Position and orientation of every body at a sample, in the order of [`bodies`].
pub(super) fn poses(recording: &TeamRecording, sample: usize) -> impl Iterator<Item = ([f64; 3], [f64; 4])> + '_ {
    let members = recording.members.iter().filter_map(move |member| member.states.get(sample));
    let discs = recording.moving.iter().filter_map(move |disc| disc.states.get(sample));
    let members = members.map(|state| (state.position_m, about_z(state.heading_rad)));
    members.chain(discs.map(|state| (state.position_m, about_z(0.0))))
}

/// Quaternion of a rotation about z.
pub(super) fn about_z(angle_rad: f64) -> [f64; 4] {
    let (sin, cos) = libm::sincos(0.5 * angle_rad);
    [0.0, 0.0, sin, cos]
}

/// Indices and times of the samples.
pub(super) fn samples(recording: &TeamRecording) -> impl Iterator<Item = (usize, f64)> + '_ {
    recording.members.iter().take(1).flat_map(|member| member.states.iter().map(|state| state.time_s)).enumerate()
}

/// Mean yaw rate from one state to the next, rad/s, in the direction of the shorter turn.
pub(super) fn yaw_rate(before: &MemberState, after: &MemberState) -> f64 {
    let (turn, time_s) = (after.heading_rad - before.heading_rad, after.time_s - before.time_s);
    if time_s > 0.0 { (turn - TAU * (turn / TAU).round()) / time_s } else { 0.0 }
}

/// States of a driven path: at [`PATH_RATE_HZ`], plus the last.
pub(super) fn path_states(states: &[MemberState], sample_rate_hz: f64) -> Vec<&MemberState> {
    let step = (sample_rate_hz / PATH_RATE_HZ).round().max(1.0) as usize;
    let last = states.last().filter(|_| !(states.len() - 1).is_multiple_of(step));
    states.iter().step_by(step).chain(last).collect()
}

/// The boxes that differ from the one before.
pub(super) fn changes(boxes: &[FormationBox]) -> impl Iterator<Item = &FormationBox> {
    let same = |a: &FormationBox, b: &FormationBox| a.corners_m == b.corners_m && a.squeezed == b.squeezed;
    let befores = std::iter::once(None).chain(boxes.iter().map(Some));
    boxes.iter().zip(befores).filter(move |(one, before)| !before.is_some_and(|b| same(one, b))).map(|(one, _)| one)
}

/// Lines and walls of a team on its terrain.
pub(super) struct Drawing<'a> {
    terrain: &'a TerrainView<'a>,
    /// Origin of the points of lines and walls: whole metres near the south-west corner and the lowest height.
    pub origin: [f64; 3],
    /// Times and planned routes on the ground, in the map frame.
    pub routes: Vec<(f64, Vec<[f64; 3]>)>,
    /// Waypoints of a route planned in advance, in the map frame; empty if routes are replanned on the way.
    pub waypoints: &'a [[f64; 3]],
    /// The search path on the ground, in the map frame.
    pub search_path: Vec<[f64; 3]>,
    /// Height of lines above the ground, m.
    pub lift_m: f64,
    wall_m: f64,
}

impl<'a> Drawing<'a> {
    /// The drawing of a checked recording.
    pub(super) fn new(team: &TeamMcap<'a>) -> Self {
        let (terrain, recording) = (team.terrain, team.recording);
        let radii = || recording.members.iter().map(|member| member.radius_m);
        Self {
            terrain,
            origin: terrain.origin_m(),
            routes: recording.routes.iter().map(|route| (route.time_s, laid(terrain.dem, &route.points_m))).collect(),
            waypoints: match &recording.routes[..] {
                [route] => &route.points_m,
                _ => &[],
            },
            search_path: laid(terrain.dem, &recording.search_path_m),
            lift_m: LIFT_RADII * radii().fold(f64::INFINITY, f64::min),
            wall_m: WALL_RADII * radii().fold(0.0, f64::max),
        }
    }

    /// Where the terrain is drawn at full resolution: under the members and along the routes and the search path, with a margin of one
    /// cell.
    pub(super) fn corridor(&self, recording: &TeamRecording) -> Vec<Square> {
        let [dx, dy] = self.terrain.dem.geometry.cell;
        let cell = dx.max(dy);
        let square = |[x, y, _]: [f64; 3], half_side: f64| Square { centre: [x, y], half_side };
        let under = recording
            .members
            .iter()
            .flat_map(|member| member.states.iter().map(move |state| square(state.position_m, member.radius_m + cell)));
        let lines =
            self.routes.iter().flat_map(|(_, route)| route).chain(&self.search_path).map(|&point| square(point, cell));
        under.chain(lines).collect()
    }

    /// Points relative to the origin, lifted above the ground and rounded to steps.
    pub(super) fn lifted(&self, points: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let up = |&[x, y, z]: &[f64; 3]| self.relative([x, y, z + self.lift_m]);
        points.iter().map(up).collect()
    }

    /// Vertices of the roadmap, lifted above the ground.
    pub(super) fn vertices(&self, recording: &TeamRecording) -> Vec<[f64; 3]> {
        self.lifted(&thinned(&recording.vertices_m, VERTICES))
    }

    /// A box as a closed line above the ground, with the first corner repeated as the last.
    pub(super) fn box_line(&self, one: &FormationBox) -> Vec<[f64; 3]> {
        let [a, b, c, d] = one.corners_m;
        self.lifted(&laid(self.terrain.dem, &[a, b, c, d, a]))
    }

    /// The wall around an obstacle, as triples of triangle corners.
    pub(super) fn wall(&self, ring: &[[f64; 2]]) -> Vec<[f64; 3]> {
        let closed = ring.iter().chain(ring.first());
        let closed: Vec<[f64; 3]> = closed.map(|&[x, y]| [x, y, self.ground_or_lowest(x, y)]).collect();
        let foot = laid(self.terrain.dem, &closed);
        let above = |[x, y, z]: [f64; 3]| [x, y, z + self.wall_m];
        let pairs = foot.iter().zip(foot.iter().skip(1));
        pairs.flat_map(|(&a, &b)| [a, b, above(b), a, above(b), above(a)]).map(|point| self.relative(point)).collect()
    }

    /// A plan position projected onto the ground, relative to the origin.
    pub(super) fn on_ground(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        self.relative([x, y, self.ground_or_lowest(x, y)])
    }

    fn ground_or_lowest(&self, x: f64, y: f64) -> f64 {
        ground(self.terrain.dem, x, y).unwrap_or(self.terrain.range_m.0)
    }

    fn relative(&self, point: [f64; 3]) -> [f64; 3] {
        let [x0, y0, z0] = self.origin;
        let [x, y, z] = point;
        [x - x0, y - y0, z - z0].map(|v| (v * STEPS_PER_M).round() / STEPS_PER_M)
    }
}

fn ground(dem: &Grid, x: f64, y: f64) -> Option<f64> {
    dem.height(x, y).filter(|z| z.is_finite())
}

/// A line on the ground: the given points, with one point per cell inserted between them, at most [`LAID_POINTS`]. An inserted point
/// without ground below lies on the straight line.
pub(super) fn laid(dem: &Grid, line: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let [dx, dy] = dem.geometry.cell;
    let pairs = || line.iter().zip(line.iter().skip(1));
    let distance = |a: &[f64; 3], b: &[f64; 3]| libm::hypot(b[0] - a[0], b[1] - a[1]);
    let length: f64 = pairs().map(|(a, b)| distance(a, b)).sum();
    let step = dx.max(dy).max(length / LAID_POINTS as f64);
    let mut points = vec![];
    for (a, b) in pairs() {
        points.push(*a);
        let pieces = (distance(a, b) / step).ceil().max(1.0) as usize;
        points.extend((1..pieces).map(|k| between(dem, a, b, k as f64 / pieces as f64)));
    }
    points.extend(line.last());
    points
}

fn between(dem: &Grid, a: &[f64; 3], b: &[f64; 3], share: f64) -> [f64; 3] {
    let [x, y, z] = [0, 1, 2].map(|axis| a[axis] + share * (b[axis] - a[axis]));
    [x, y, ground(dem, x, y).unwrap_or(z)]
}

/// At most `most` elements, evenly spaced in order, including the first.
pub(super) fn thinned<T: Copy>(all: &[T], most: usize) -> Vec<T> {
    let kept = all.len().min(most);
    (0..kept).filter_map(|k| all.get(k * all.len() / kept)).copied().collect()
}

/// Poses along a line, each facing the next point; the last has the heading of the one before.
pub(super) fn looking_ahead(points: &[[f64; 3]]) -> Vec<([f64; 3], [f64; 4])> {
    let pairs = points.iter().zip(points.iter().skip(1));
    let turns: Vec<[f64; 4]> = pairs.map(|(a, b)| about_z(libm::atan2(b[1] - a[1], b[0] - a[0]))).collect();
    let last = turns.last().copied().unwrap_or(about_z(0.0));
    points.iter().copied().zip(turns.into_iter().chain([last])).collect()
}
