//! Viewer flavour of missions: the topics of `sastrugi_schemas::topics::VIEWER`, in protobuf.

use super::frames::{BASE, GOAL, IDENTITY, MAP, START, class_rgb, corridor, rotated, wheel_rotation};
use super::mesh::{self, Patch, Square};
use super::protobuf::{self, Value};
use super::{Flavour, McapError, MissionMcap, TerrainView, Timeline};
use foxglove::Encode;
use foxglove::messages as fox;
use foxglove::messages::{Color, Point3, Pose, Quaternion, Timestamp, Vector2, Vector3};
use prost::Message;
use sastrugi_numeric::{Geometry, Grid, Surface};
use sastrugi_schemas::RoughnessClass;
use sastrugi_schemas::topics::{
    self, CommandSample, Event, EventKind, ImuSample, Recording, StateSample, Topic, WheelSample, WheelState,
};
use std::collections::BTreeMap;

/// Most cells along a side of `/terrain/grid`.
const GRID_CELLS: usize = 64;
/// Poses per second of `/vehicle/path`.
const PATH_RATE_HZ: f64 = 2.0;
/// Quantisation of sensor-like values, steps per unit: finer than any sensor's noise, but compresses well.
/// Angles, rates, lengths.
const FINE: f64 = 1024.0;
/// Slip ratios.
const SLIP: f64 = 4096.0;
/// Specific forces.
const MEDIUM: f64 = 128.0;
/// Torques.
const TORQUE: f64 = 64.0;
/// Forces.
const COARSE: f64 = 4.0;
/// Drawn wheel poses: quaternions and hubs in base_link.
const DRAWN: f64 = 4096.0;
/// Plotted angles, in degrees.
const DEGREES: f64 = 64.0;
/// Elevation of `/terrain/grid`.
const ELEVATION: f64 = 256.0;

/// The flavour.
pub(super) const FLAVOUR: Flavour = Flavour {
    profile: "",
    message_encoding: "protobuf",
    schema_encoding: "protobuf",
    schema,
    channel_metadata: |topic| BTreeMap::from([("description".to_owned(), topic.description.to_owned())]),
};

fn schema(topic: &Topic) -> Result<Vec<u8>, McapError> {
    public_schema(topic).map_or_else(|| protobuf::descriptor_set(topic), Ok)
}

/// The schema of a topic with one of Foxglove's messages.
pub(super) fn public_schema(topic: &Topic) -> Option<Vec<u8>> {
    let schema = match topic.schema {
        "foxglove.FrameTransforms" => fox::FrameTransforms::get_schema(),
        "foxglove.Grid" => fox::Grid::get_schema(),
        "foxglove.Log" => fox::Log::get_schema(),
        "foxglove.PoseInFrame" => fox::PoseInFrame::get_schema(),
        "foxglove.PosesInFrame" => fox::PosesInFrame::get_schema(),
        "foxglove.SceneUpdate" => fox::SceneUpdate::get_schema(),
        _ => None,
    };
    schema.map(|s| s.data.into_owned())
}

/// Adds all messages of a mission to the timeline.
pub(super) fn messages(mission: &MissionMcap, out: &mut Timeline) -> Result<(), McapError> {
    let recording = mission.recording;
    out.add(&topics::terrain_mesh::TOPIC, 0.0, |t| {
        Ok(terrain_mesh(mission.terrain, &corridor(mission), timestamp(t)?).encode_to_vec())
    })?;
    out.add(&topics::terrain_grid::TOPIC, 0.0, |t| {
        Ok(terrain_from_above(mission.terrain, timestamp(t)?).encode_to_vec())
    })?;
    out.add(&topics::vehicle_shape::TOPIC, 0.0, |t| Ok(vehicle_shape(mission, timestamp(t)?).encode_to_vec()))?;
    out.add(&topics::vehicle_path::TOPIC, 0.0, |t| Ok(vehicle_path(recording, timestamp(t)?).encode_to_vec()))?;
    let wheels = recording.wheels.iter().map(Some).chain(std::iter::repeat(None));
    for (state, wheels) in recording.states.iter().zip(wheels) {
        out.add(&topics::tf::TOPIC, state.time_s, |t| {
            Ok(transforms(recording, state, wheels, timestamp(t)?).encode_to_vec())
        })?;
        out.add(
            &topics::vehicle_pose::TOPIC,
            state.time_s,
            |t| Ok(vehicle_pose(state, timestamp(t)?).encode_to_vec()),
        )?;
        out.add(&topics::state::TOPIC, state.time_s, |t| Ok(protobuf::encode(&timestamp(t)?, &state_values(state))))?;
    }
    for sample in &recording.imu {
        out.add(&topics::imu::TOPIC, sample.time_s, |t| Ok(protobuf::encode(&timestamp(t)?, &imu_values(sample))))?;
    }
    let names: Vec<String> = recording.vehicle.wheels.iter().map(|w| w.name.clone()).collect();
    for sample in &recording.wheels {
        out.add(&topics::wheels::TOPIC, sample.time_s, |t| {
            Ok(protobuf::encode(&timestamp(t)?, &wheel_values(&names, sample)))
        })?;
    }
    for sample in &recording.commands {
        out.add(&topics::command::TOPIC, sample.time_s, |t| {
            Ok(protobuf::encode(&timestamp(t)?, &command_values(sample)))
        })?;
    }
    for event in &recording.events {
        out.add(&topics::events::TOPIC, event.time_s, |t| Ok(log(event, timestamp(t)?).encode_to_vec()))?;
    }
    Ok(())
}

pub(super) fn timestamp(log_time: u64) -> Result<Timestamp, McapError> {
    let seconds = u32::try_from(log_time / 1_000_000_000);
    let seconds = seconds.map_err(|_| McapError::unfit(format!("a time of {log_time} ns is beyond the year 2106")))?;
    Ok(Timestamp::new(seconds, (log_time % 1_000_000_000) as u32))
}

pub(super) fn state_values(s: &StateSample) -> Vec<Value> {
    let parts = [&s.position_m[..], &s.orientation, &s.velocity_m_s, &s.angular_velocity_rad_s];
    let angles = roll_and_pitch(s.orientation).map(|angle| Value::Float(in_steps(angle.to_degrees(), DEGREES)));
    parts.concat().into_iter().map(Value::Double).chain(angles).collect()
}

/// Roll and pitch (nose down positive) in rad, in the order yaw, pitch, roll; recorded because viewers do not compute them.
fn roll_and_pitch(orientation: [f64; 4]) -> [f64; 2] {
    let up = |axis| rotated(orientation, axis)[2];
    let roll = libm::atan2(up([0.0, 1.0, 0.0]), up([0.0, 0.0, 1.0]));
    [roll, libm::asin((-up([1.0, 0.0, 0.0])).clamp(-1.0, 1.0))]
}

pub(super) fn imu_values(s: &ImuSample) -> Vec<Value> {
    let rates = s.angular_velocity_rad_s.map(|v| in_steps(v, FINE));
    let forces = s.specific_force_m_s2.map(|v| in_steps(v, MEDIUM));
    rates.into_iter().chain(forces).map(Value::Float).collect()
}

pub(super) fn command_values(c: &CommandSample) -> Vec<Value> {
    let values = [c.speed_m_s, c.yaw_rate_rad_s, c.cross_track_m, c.heading_error_rad, c.distance_to_goal_m];
    values.map(|v| Value::Float(in_steps(v, FINE))).into()
}

pub(super) fn wheel_values(names: &[String], sample: &WheelSample) -> Vec<Value> {
    let all = |steps: f64, f: fn(&WheelState) -> f64| {
        Value::Floats(sample.wheels.iter().map(|w| in_steps(f(w), steps)).collect())
    };
    let contact = |axis: usize| {
        let touching = |w: &WheelState| if w.normal_force_n == 0.0 { 0.0 } else { in_steps(w.contact_m[axis], FINE) };
        Value::Doubles(sample.wheels.iter().map(touching).collect())
    };
    vec![
        Value::Texts(names.to_vec()),
        all(FINE, |w| w.angle_rad),
        all(FINE, |w| w.spin_rad_s),
        all(TORQUE, |w| w.torque_n_m),
        all(COARSE, |w| w.normal_force_n),
        all(COARSE, |w| w.longitudinal_force_n),
        all(COARSE, |w| w.lateral_force_n),
        all(SLIP, |w| w.slip_ratio),
        contact(0),
        contact(1),
        contact(2),
        all(FINE, |w| w.steering_rad),
        Value::Float(in_steps(sample.chassis_force_n, COARSE)),
    ]
}

pub(super) fn in_steps(value: f64, steps: f64) -> f64 {
    (value * steps).round() / steps
}

fn transforms(
    recording: &Recording,
    state: &StateSample,
    wheels: Option<&WheelSample>,
    time: Timestamp,
) -> fox::FrameTransforms {
    let transform = |parent: &str, child: &str, translation: [f64; 3], rotation: [f64; 4]| fox::FrameTransform {
        timestamp: Some(time),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(vector(translation)),
        rotation: Some(quaternion(rotation)),
    };
    let mut all = vec![transform(MAP, BASE, state.position_m, state.orientation)];
    for (index, outline) in recording.vehicle.wheels.iter().enumerate() {
        let wheel = wheels.and_then(|sample| sample.wheels.get(index));
        let (hub_m, steering, angle) =
            wheel.map_or((outline.hub_m, 0.0, 0.0), |w| (w.hub_m, w.steering_rad, w.angle_rad));
        let rotation = wheel_rotation(steering, angle).map(|v| in_steps(v, DRAWN));
        all.push(transform(BASE, &outline.name, hub_m.map(|v| in_steps(v, DRAWN)), rotation));
    }
    fox::FrameTransforms { transforms: all }
}

fn vehicle_pose(state: &StateSample, time: Timestamp) -> fox::PoseInFrame {
    fox::PoseInFrame { timestamp: Some(time), frame_id: MAP.to_owned(), pose: Some(pose_of(state)) }
}

fn vehicle_path(recording: &Recording, time: Timestamp) -> fox::PosesInFrame {
    let step = (recording.sample_rate_hz / PATH_RATE_HZ).round().max(1.0) as usize;
    let last = recording.states.last().filter(|_| !(recording.states.len() - 1).is_multiple_of(step));
    let poses = recording.states.iter().step_by(step).chain(last).map(pose_of).collect();
    fox::PosesInFrame { timestamp: Some(time), frame_id: MAP.to_owned(), poses }
}

fn log(event: &Event, time: Timestamp) -> fox::Log {
    let level = match event.kind {
        EventKind::Start | EventKind::Success => fox::log::Level::Info,
        EventKind::Timeout | EventKind::OutOfBounds | EventKind::Stuck => fox::log::Level::Warning,
        EventKind::Tipped => fox::log::Level::Error,
    };
    fox::Log {
        timestamp: Some(time),
        level: level as i32,
        message: event.text.clone(),
        name: event.kind.name().to_owned(),
        ..fox::Log::default()
    }
}

fn vehicle_shape(mission: &MissionMcap, time: Timestamp) -> fox::SceneUpdate {
    let vehicle = &mission.recording.vehicle;
    let body = fox::SceneEntity {
        cubes: vec![fox::CubePrimitive {
            pose: Some(pose(vehicle.chassis_centre_m, IDENTITY)),
            size: Some(vector(vehicle.chassis_size_m)),
            color: Some(colour([0xd8, 0xb0, 0x20], 0.9)),
        }],
        ..entity(time, BASE, "chassis", true)
    };
    let wheels = vehicle.wheels.iter().map(|wheel| {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let cylinder = fox::CylinderPrimitive {
            // A cylinder's axis is z; rotated by a right angle about x it lies along the axle.
            pose: Some(pose([0.0; 3], [half, 0.0, 0.0, half])),
            size: Some(vector([2.0 * wheel.radius_m, 2.0 * wheel.radius_m, wheel.width_m])),
            bottom_scale: 1.0,
            top_scale: 1.0,
            color: Some(colour([0x28, 0x28, 0x28], 1.0)),
        };
        fox::SceneEntity { cylinders: vec![cylinder], ..entity(time, &wheel.name, &wheel.name, true) }
    });
    let marker = |id: &str, [x, y]: [f64; 2], rgb| fox::SceneEntity {
        spheres: vec![fox::SpherePrimitive {
            pose: Some(pose([x, y, mission.terrain.dem.height(x, y).unwrap_or(0.0)], IDENTITY)),
            size: Some(vector([0.4; 3])),
            color: Some(colour(rgb, 0.8)),
        }],
        ..entity(time, MAP, id, false)
    };
    let markers = [marker("start", mission.start_m, START), marker("goal", mission.goal_m, GOAL)];
    fox::SceneUpdate { deletions: vec![], entities: std::iter::once(body).chain(wheels).chain(markers).collect() }
}

/// The terrain as triangles, at full resolution wherever one of the squares lies.
pub(super) fn terrain_mesh(terrain: &TerrainView<'_>, near: &[Square], time: Timestamp) -> fox::SceneUpdate {
    let &TerrainView { dem, classes, range_m: (low_m, high_m), .. } = terrain;
    let patches = mesh::terrain(dem, classes, mesh::base(low_m, high_m), near);
    let triangles = patches.into_iter().map(triangle_list).collect();
    let entity = fox::SceneEntity { triangles, ..entity(time, MAP, "terrain", false) };
    fox::SceneUpdate { deletions: vec![], entities: vec![entity] }
}

fn triangle_list(patch: Patch) -> fox::TriangleListPrimitive {
    let colours = patch.codes.iter().map(|&code| class_colour(code));
    let uniform = patch.codes.iter().all(|code| Some(code) == patch.codes.first());
    fox::TriangleListPrimitive {
        pose: Some(pose(patch.origin, IDENTITY)),
        points: patch.points.iter().map(|&[x, y, z]| Point3 { x, y, z }).collect(),
        color: colours.clone().next(),
        colors: if uniform { vec![] } else { colours.collect() },
        indices: patch.triangles.into_flattened(),
    }
}

/// The terrain from above, as a grid.
pub(super) fn terrain_from_above(terrain: &TerrainView<'_>, time: Timestamp) -> fox::Grid {
    fox::Grid { timestamp: Some(time), ..terrain.grid().clone() }
}

/// The terrain from above, as a grid without a timestamp.
pub(super) fn terrain_grid(dem: &Grid, classes: Option<&Grid<u8>>, low_m: f64) -> fox::Grid {
    use fox::packed_element_field::NumericType;
    let g = &dem.geometry;
    let step = g.rows.max(g.cols).div_ceil(GRID_CELLS).max(1);
    let (rows, cols) = (g.rows.div_ceil(step), g.cols.div_ceil(step));
    let mut data = Vec::with_capacity(rows * cols * 8);
    // Rows of the message run from south to north.
    for (row, col) in (0..rows).rev().flat_map(|r| (0..cols).map(move |c| (r, c))) {
        let (row, col) = ((row * step + step / 2).min(g.rows - 1), (col * step + step / 2).min(g.cols - 1));
        let z = in_steps(dem.at(row, col), ELEVATION);
        let rgb = class_rgb(classes.map_or(RoughnessClass::NO_DATA, |classes| classes.at(row, col)));
        data.extend(rgb);
        data.push(if z.is_finite() { 255 } else { 0 });
        data.extend((if z.is_finite() { z as f32 } else { 0.0 }).to_le_bytes());
    }
    let field = |name: &str, offset, kind: NumericType| fox::PackedElementField {
        name: name.to_owned(),
        offset,
        r#type: kind as i32,
    };
    let bytes = ["red", "green", "blue", "alpha"].into_iter().zip(0..).map(|(n, at)| field(n, at, NumericType::Uint8));
    fox::Grid {
        timestamp: None,
        frame_id: MAP.to_owned(),
        pose: Some(pose(grid_corner(g, rows, step, low_m), IDENTITY)),
        column_count: cols as u32,
        cell_size: Some(Vector2 { x: g.cell[0] * step as f64, y: g.cell[1] * step as f64 }),
        row_stride: cols as u32 * 8,
        cell_stride: 8,
        fields: bytes.chain([field("elevation", 4, NumericType::Float32)]).collect(),
        data: data.into(),
    }
}

/// South-west corner of a thinned grid whose rows are counted from the north.
fn grid_corner(g: &Geometry, rows: usize, step: usize, z: f64) -> [f64; 3] {
    let north = g.origin[1] + g.rows as f64 * g.cell[1];
    [g.origin[0], north - (rows * step) as f64 * g.cell[1], z]
}

pub(super) fn entity(time: Timestamp, frame: &str, id: &str, frame_locked: bool) -> fox::SceneEntity {
    fox::SceneEntity {
        timestamp: Some(time),
        frame_id: frame.to_owned(),
        id: id.to_owned(),
        frame_locked,
        ..fox::SceneEntity::default()
    }
}

fn class_colour(code: u8) -> Color {
    colour(class_rgb(code), 1.0)
}

pub(super) fn colour(rgb: [u8; 3], a: f64) -> Color {
    let [r, g, b] = rgb.map(|v| f64::from(v) / 255.0);
    Color { r, g, b, a }
}

fn pose_of(state: &StateSample) -> Pose {
    pose(state.position_m, state.orientation)
}

pub(super) fn pose(position: [f64; 3], orientation: [f64; 4]) -> Pose {
    Pose { position: Some(vector(position)), orientation: Some(quaternion(orientation)) }
}

pub(super) fn vector([x, y, z]: [f64; 3]) -> Vector3 {
    Vector3 { x, y, z }
}

pub(super) fn quaternion([x, y, z, w]: [f64; 4]) -> Quaternion {
    Quaternion { x, y, z, w }
}
