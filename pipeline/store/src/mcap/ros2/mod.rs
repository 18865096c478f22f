//! ROS 2 flavour: CDR messages with their definitions, and the `metadata.yaml` that makes the folder a bag.
//!
//! Frames: `map` (the terrain's own coordinates, double precision), `base_link`, the wheels, and `terrain`, whose origin near the
//! terrain's corner is the reference of the cloud's single-precision points. Values are those of the recording, not rounded.

mod bag;
mod definitions;
pub(super) mod message;

pub(super) use bag::{metadata as bag_metadata, names as bag_names};
pub(super) use message::GridMap;

use super::frames::{BASE, IDENTITY, MAP, class_rgb, corridor, rotated, wheel_rotation};
use super::mesh::{self, Square};
use super::{Flavour, McapError, MissionMcap, TerrainView, Timeline};
use message::{
    Covariance, Dimension, Float32MultiArray, Header, Imu, JointState, Log, Odometry, PointCloud2, PointField, Pose,
    TransformStamped, TwistStamped, encode,
};
use sastrugi_numeric::{Grid, Surface};
use sastrugi_schemas::RoughnessClass;
use sastrugi_schemas::topics::ros2;
use sastrugi_schemas::topics::{
    CommandSample, Event, EventKind, ImuSample, Recording, StateSample, Topic, VehicleOutline, WheelSample,
};
use std::collections::BTreeMap;

/// The flavour.
pub(super) const FLAVOUR: Flavour =
    Flavour { profile: "ros2", message_encoding: "cdr", schema_encoding: "ros2msg", schema, channel_metadata };

/// Frame of the cloud's points.
pub(super) const TERRAIN: &str = "terrain";
/// Most cells along a side of the grid map.
const GRID_CELLS: usize = 128;
/// Bytes of a point of the cloud: x, y, z, colour.
const POINT_BYTES: u32 = 16;
/// `sensor_msgs/PointField`: single precision.
const FLOAT32: u8 = 7;
/// Zero covariance: the simulation has no measurement error. Readers of `sensor_msgs/Imu` interpret it as unknown.
pub(super) const EXACT: Covariance = [[0.0; 6]; 6];

fn schema(topic: &Topic) -> Result<Vec<u8>, McapError> {
    let text = definitions::of_schema(topic.schema);
    text.map(String::into_bytes).ok_or_else(|| McapError::unfit(format!("{} has no definition", topic.schema)))
}

fn channel_metadata(topic: &Topic) -> BTreeMap<String, String> {
    let pair = |key: &str, value: String| (key.to_owned(), value);
    BTreeMap::from([
        pair("description", topic.description.to_owned()),
        pair("offered_qos_profiles", bag::quality_of_service(topic)),
    ])
}

/// Adds all messages of a mission to the timeline.
pub(super) fn messages(mission: &MissionMcap, out: &mut Timeline) -> Result<(), McapError> {
    let recording = mission.recording;
    terrain_messages(mission.terrain, &corridor(mission), out)?;
    let wheels = recording.wheels.iter().map(Some).chain(std::iter::repeat(None));
    for (state, wheels) in recording.states.iter().zip(wheels) {
        out.add(&ros2::TF, state.time_s, |t| encode(&transforms(recording, state, wheels, t)?))?;
        out.add(&ros2::ODOM, state.time_s, |t| encode(&odometry(state, t)?))?;
    }
    for sample in &recording.imu {
        out.add(&ros2::IMU, sample.time_s, |t| encode(&imu(sample, t)?))?;
    }
    for sample in &recording.wheels {
        out.add(&ros2::JOINT_STATES, sample.time_s, |t| encode(&joint_states(&recording.vehicle, sample, t)?))?;
    }
    for sample in &recording.commands {
        out.add(&ros2::CMD_VEL, sample.time_s, |t| encode(&command(sample, t)?))?;
    }
    recording.events.iter().try_for_each(|event| out.add(&ros2::EVENTS, event.time_s, |t| encode(&log(event, t)?)))
}

/// Adds the terrain to the timeline, its cloud at full resolution wherever one of the squares lies.
pub(super) fn terrain_messages(
    terrain: &TerrainView<'_>,
    near: &[Square],
    out: &mut Timeline,
) -> Result<(), McapError> {
    out.add(&ros2::TF_STATIC, 0.0, |t| encode(&vec![terrain_frame(terrain, t)?]))?;
    out.add(&ros2::TERRAIN, 0.0, |t| encode(&GridMap { header: header(MAP, t)?, ..terrain.grid_map().clone() }))?;
    out.add(&ros2::TERRAIN_POINTS, 0.0, |t| encode(&terrain_points(terrain, near, t)?))
}

/// Seconds and nanoseconds of a time in ns.
pub(super) fn stamp(log_time: u64) -> Result<(i32, u32), McapError> {
    let seconds = i32::try_from(log_time / 1_000_000_000);
    let seconds = seconds.map_err(|_| {
        McapError::unfit(format!("a time of {log_time} ns is beyond the year 2038, the limit of ROS 2"))
    })?;
    Ok((seconds, (log_time % 1_000_000_000) as u32))
}

pub(super) fn header(frame: &str, log_time: u64) -> Result<Header, McapError> {
    let (sec, nanosec) = stamp(log_time)?;
    Ok(Header { sec, nanosec, frame_id: frame.to_owned() })
}

pub(super) fn transform(
    parent: &str,
    child: &str,
    position: [f64; 3],
    orientation: [f64; 4],
    log_time: u64,
) -> Result<TransformStamped, McapError> {
    let transform = Pose { position, orientation };
    Ok(TransformStamped { header: header(parent, log_time)?, child_frame_id: child.to_owned(), transform })
}

fn terrain_frame(terrain: &TerrainView<'_>, log_time: u64) -> Result<TransformStamped, McapError> {
    transform(MAP, TERRAIN, terrain.origin_m(), IDENTITY, log_time)
}

fn transforms(
    recording: &Recording,
    state: &StateSample,
    wheels: Option<&WheelSample>,
    log_time: u64,
) -> Result<Vec<TransformStamped>, McapError> {
    let body = transform(MAP, BASE, state.position_m, state.orientation, log_time);
    let wheels = recording.vehicle.wheels.iter().enumerate().map(|(index, outline)| {
        let wheel = wheels.and_then(|sample| sample.wheels.get(index));
        let (hub_m, steering_rad, angle_rad) =
            wheel.map_or((outline.hub_m, 0.0, 0.0), |w| (w.hub_m, w.steering_rad, w.angle_rad));
        transform(BASE, &outline.name, hub_m, wheel_rotation(steering_rad, angle_rad), log_time)
    });
    std::iter::once(body).chain(wheels).collect()
}

fn odometry(state: &StateSample, log_time: u64) -> Result<Odometry, McapError> {
    // The recorded quaternion has unit length only to the recording's resolution.
    let length = state.orientation.iter().map(|c| c * c).sum::<f64>().sqrt();
    let [x, y, z, w] = state.orientation.map(|c| c / length);
    Ok(Odometry {
        header: header(MAP, log_time)?,
        child_frame_id: BASE.to_owned(),
        pose: Pose { position: state.position_m, orientation: state.orientation },
        pose_covariance: EXACT,
        linear: rotated([-x, -y, -z, w], state.velocity_m_s),
        angular: state.angular_velocity_rad_s,
        twist_covariance: EXACT,
    })
}

fn imu(sample: &ImuSample, log_time: u64) -> Result<Imu, McapError> {
    Ok(Imu {
        header: header(BASE, log_time)?,
        orientation: sample.orientation,
        orientation_covariance: [0.0; 9],
        angular_velocity: sample.angular_velocity_rad_s,
        angular_velocity_covariance: [0.0; 9],
        linear_acceleration: sample.specific_force_m_s2,
        linear_acceleration_covariance: [0.0; 9],
    })
}

fn joint_states(vehicle: &VehicleOutline, sample: &WheelSample, log_time: u64) -> Result<JointState, McapError> {
    Ok(JointState {
        header: header(BASE, log_time)?,
        name: vehicle.wheels.iter().map(|wheel| wheel.name.clone()).collect(),
        position: sample.wheels.iter().map(|wheel| wheel.angle_rad).collect(),
        velocity: sample.wheels.iter().map(|wheel| wheel.spin_rad_s).collect(),
        effort: sample.wheels.iter().map(|wheel| wheel.torque_n_m).collect(),
    })
}

fn command(sample: &CommandSample, log_time: u64) -> Result<TwistStamped, McapError> {
    let (linear, angular) = ([sample.speed_m_s, 0.0, 0.0], [0.0, 0.0, sample.yaw_rate_rad_s]);
    Ok(TwistStamped { header: header(BASE, log_time)?, linear, angular })
}

fn log(event: &Event, log_time: u64) -> Result<Log, McapError> {
    let (sec, nanosec) = stamp(log_time)?;
    // The levels of rcl_interfaces/Log.
    let level = match event.kind {
        EventKind::Start | EventKind::Success => 20,
        EventKind::Timeout | EventKind::OutOfBounds | EventKind::Stuck => 30,
        EventKind::Tipped => 40,
    };
    let (name, msg) = (event.kind.name().to_owned(), event.text.clone());
    Ok(Log { sec, nanosec, level, name, msg, file: String::new(), function: String::new(), line: 0 })
}

/// The vertices of `/terrain/mesh`: every cell along the path, coarser elsewhere.
fn terrain_points(terrain: &TerrainView<'_>, near: &[Square], log_time: u64) -> Result<PointCloud2, McapError> {
    let TerrainView { dem, classes, .. } = terrain;
    let origin = terrain.origin_m();
    let mut data = Vec::new();
    let mut points = 0;
    for (row, col) in mesh::nodes(&dem.geometry, near) {
        let z = dem.at(row, col);
        if !z.is_finite() {
            continue;
        }
        points += 1;
        let point = [dem.geometry.x(col) - origin[0], dem.geometry.y(row) - origin[1], z - origin[2]];
        data.extend(point.into_iter().flat_map(|v| (v as f32).to_le_bytes()));
        let code = classes.map_or(RoughnessClass::NO_DATA, |classes| classes.at(row, col));
        let [red, green, blue] = class_rgb(code);
        data.extend([blue, green, red, 0]);
    }
    let field = |(name, offset): (&str, u32)| PointField { name: name.to_owned(), offset, datatype: FLOAT32, count: 1 };
    Ok(PointCloud2 {
        header: header(TERRAIN, log_time)?,
        height: 1,
        width: points,
        // By convention a colour is stored in the four bytes of a float.
        fields: [("x", 0), ("y", 4), ("z", 8), ("rgb", 12)].map(field).into(),
        is_bigendian: false,
        point_step: POINT_BYTES,
        row_step: POINT_BYTES * points,
        data,
        is_dense: true,
    })
}

/// The terrain as a grid map without a timestamp: layers `elevation` (m) and, if there are classes, `class` (code); NaN where there
/// is no data. A grid map has square cells; it starts at the north-east, with rows towards the west and columns towards the south.
pub(super) fn grid_map(dem: &Grid, classes: Option<&Grid<u8>>) -> GridMap {
    let g = &dem.geometry;
    let [width, height] = g.size();
    let cell = g.cell[0].max(g.cell[1]);
    let resolution = cell * (width.max(height) / (cell * GRID_CELLS as f64)).ceil().max(1.0);
    // Half a hundredth of a cell is rounding error, not extra ground.
    let [nx, ny] = [width, height].map(|size| ((size / resolution + 0.005).floor() as usize).max(1));
    let north = g.origin[1] + height;
    let layer = |value: &dyn Fn(f64, f64) -> f64| {
        let x = |i: usize| g.origin[0] + (nx - 1 - i) as f64 * resolution + 0.5 * resolution;
        let y = |j: usize| north - (j as f64 + 0.5) * resolution;
        let data = (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j))).map(|(i, j)| value(x(i), y(j)) as f32);
        let dimension = |label: &str, size: usize, stride: usize| Dimension {
            label: label.to_owned(),
            size: size as u32,
            stride: stride as u32,
        };
        let dim = vec![dimension("column_index", ny, nx * ny), dimension("row_index", nx, nx)];
        Float32MultiArray { dim, data_offset: 0, data: data.collect() }
    };
    let nearest = |x: f64, y: f64| {
        let col = ((x - g.origin[0]) / g.cell[0]) as usize;
        let row = ((north - y) / g.cell[1]) as usize;
        (row.min(g.rows - 1), col.min(g.cols - 1))
    };
    // Centres in the outer half cells have no bilinear height.
    let elevation = layer(&|x, y| {
        let (row, col) = nearest(x, y);
        dem.height(x, y).unwrap_or_else(|| dem.at(row, col))
    });
    let class = classes.map(|classes| {
        layer(&|x, y| {
            let (row, col) = nearest(x, y);
            let code = classes.at(row, col);
            if code == RoughnessClass::NO_DATA { f64::NAN } else { f64::from(code) }
        })
    });
    let names = ["elevation"].into_iter().chain(class.as_ref().map(|_| "class"));
    GridMap {
        header: Header { sec: 0, nanosec: 0, frame_id: MAP.to_owned() },
        resolution,
        length_x: nx as f64 * resolution,
        length_y: ny as f64 * resolution,
        position: [g.origin[0] + 0.5 * nx as f64 * resolution, north - 0.5 * ny as f64 * resolution, 0.0],
        orientation: IDENTITY,
        layers: names.map(str::to_owned).collect(),
        basic_layers: vec!["elevation".to_owned()],
        data: std::iter::once(elevation).chain(class).collect(),
        outer_start_index: 0,
        inner_start_index: 0,
    }
}
