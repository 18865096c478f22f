//! The messages as they stand in CDR, for writing and for reading. Structures are flat where a message holds another one: CDR
//! aligns numbers, not structures, so that nesting leaves no trace in the bytes.

use super::super::McapError;
use byteorder::{BigEndian, LittleEndian};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// What says that little-endian plain CDR follows.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// A message behind the four bytes that tell the encoding.
pub(in super::super) fn encode<T: Serialize>(message: &T) -> Result<Vec<u8>, McapError> {
    let mut out = LITTLE_ENDIAN.to_vec();
    let body = cdr_encoding::to_vec::<T, LittleEndian>(message);
    out.extend(body.map_err(|e| McapError::unfit(format!("a message does not go into CDR: {e}")))?);
    Ok(out)
}

/// A message behind the four bytes that tell the encoding: plain CDR, big or little endian.
pub(in super::super) fn decode<T: DeserializeOwned>(data: &[u8]) -> Option<T> {
    let (header, body) = data.split_at_checked(4)?;
    match header[..2] {
        [0, 0] => cdr_encoding::from_bytes::<T, BigEndian>(body).ok().map(|(value, _)| value),
        [0, 1] => cdr_encoding::from_bytes::<T, LittleEndian>(body).ok().map(|(value, _)| value),
        _ => None,
    }
}

/// `std_msgs/Header`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in super::super) struct Header {
    pub sec: i32,
    pub nanosec: u32,
    pub frame_id: String,
}

/// `geometry_msgs/Pose` and `geometry_msgs/Transform`.
#[derive(Clone, Serialize, Deserialize)]
pub(in super::super) struct Pose {
    pub position: [f64; 3],
    pub orientation: [f64; 4],
}

/// `geometry_msgs/PoseStamped`, and the beginning of one with covariance.
#[derive(Serialize, Deserialize)]
pub(in super::super) struct PoseStamped {
    pub header: Header,
    pub pose: Pose,
}

/// A 6 x 6 matrix.
pub(in super::super) type Covariance = [[f64; 6]; 6];

/// `nav_msgs/Odometry`; the twist is in the child frame (REP 105 and the message's own comment).
#[derive(Serialize, Deserialize)]
pub(in super::super) struct Odometry {
    pub header: Header,
    pub child_frame_id: String,
    pub pose: Pose,
    pub pose_covariance: Covariance,
    pub linear: [f64; 3],
    pub angular: [f64; 3],
    pub twist_covariance: Covariance,
}

/// `geometry_msgs/TransformStamped`; `tf2_msgs/TFMessage` is a list of them.
#[derive(Serialize, Deserialize)]
pub(in super::super) struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub transform: Pose,
}

/// `sensor_msgs/Imu`.
#[derive(Serialize, Deserialize)]
pub(in super::super) struct Imu {
    pub header: Header,
    pub orientation: [f64; 4],
    pub orientation_covariance: [f64; 9],
    pub angular_velocity: [f64; 3],
    pub angular_velocity_covariance: [f64; 9],
    pub linear_acceleration: [f64; 3],
    pub linear_acceleration_covariance: [f64; 9],
}

/// `geometry_msgs/TwistStamped`.
#[derive(Serialize)]
pub(super) struct TwistStamped {
    pub header: Header,
    pub linear: [f64; 3],
    pub angular: [f64; 3],
}

/// `sensor_msgs/JointState`.
#[derive(Serialize)]
pub(super) struct JointState {
    pub header: Header,
    pub name: Vec<String>,
    pub position: Vec<f64>,
    pub velocity: Vec<f64>,
    pub effort: Vec<f64>,
}

/// `rcl_interfaces/Log`.
#[derive(Serialize, Deserialize)]
pub(in super::super) struct Log {
    pub sec: i32,
    pub nanosec: u32,
    pub level: u8,
    pub name: String,
    pub msg: String,
    pub file: String,
    pub function: String,
    pub line: u32,
}

/// `grid_map_msgs/GridMap`.
#[derive(Clone, Debug, Serialize)]
pub(in super::super) struct GridMap {
    pub header: Header,
    pub resolution: f64,
    pub length_x: f64,
    pub length_y: f64,
    pub position: [f64; 3],
    pub orientation: [f64; 4],
    pub layers: Vec<String>,
    pub basic_layers: Vec<String>,
    pub data: Vec<Float32MultiArray>,
    pub outer_start_index: u16,
    pub inner_start_index: u16,
}

/// `std_msgs/Float32MultiArray`.
#[derive(Clone, Debug, Serialize)]
pub(in super::super) struct Float32MultiArray {
    pub dim: Vec<Dimension>,
    pub data_offset: u32,
    pub data: Vec<f32>,
}

/// `std_msgs/MultiArrayDimension`.
#[derive(Clone, Debug, Serialize)]
pub(in super::super) struct Dimension {
    pub label: String,
    pub size: u32,
    pub stride: u32,
}

/// `sensor_msgs/PointCloud2`.
#[derive(Serialize)]
pub(super) struct PointCloud2 {
    pub header: Header,
    pub height: u32,
    pub width: u32,
    pub fields: Vec<PointField>,
    pub is_bigendian: bool,
    pub point_step: u32,
    pub row_step: u32,
    pub data: Vec<u8>,
    pub is_dense: bool,
}

/// `sensor_msgs/PointField`.
#[derive(Serialize)]
pub(super) struct PointField {
    pub name: String,
    pub offset: u32,
    pub datatype: u8,
    pub count: u32,
}
