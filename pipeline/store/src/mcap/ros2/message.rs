//! Messages in CDR, for writing and reading. Nested messages may be flattened, because CDR aligns numbers, not structures, so
//! that nesting does not affect the bytes.

use super::super::McapError;
use byteorder::{BigEndian, LittleEndian};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Encapsulation header for plain little-endian CDR.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Encodes a message after its four-byte encapsulation header.
pub(in super::super) fn encode<T: Serialize>(message: &T) -> Result<Vec<u8>, McapError> {
    let mut out = LITTLE_ENDIAN.to_vec();
    let body = cdr_encoding::to_vec::<T, LittleEndian>(message);
    out.extend(body.map_err(|e| McapError::unfit(format!("a message cannot be encoded in CDR: {e}")))?);
    Ok(out)
}

/// Decodes a message after its four-byte encapsulation header: plain CDR, big or little endian.
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

/// `geometry_msgs/PoseStamped`, and the start of `PoseWithCovarianceStamped`.
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
pub(in super::super) struct TwistStamped {
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

/// `nav_msgs/Path`.
#[derive(Serialize)]
pub(in super::super) struct Path {
    pub header: Header,
    pub poses: Vec<PoseStamped>,
}

/// The [`Marker`] types in use, with their numbers.
#[derive(Clone, Copy)]
pub(in super::super) enum MarkerKind {
    Cube = 1,
    Cylinder = 3,
    LineStrip = 4,
    LineList = 5,
    Spheres = 7,
    Points = 8,
    Triangles = 11,
}

/// `visualization_msgs/Marker`; `visualization_msgs/MarkerArray` is a list of them.
#[derive(Serialize)]
pub(in super::super) struct Marker {
    pub header: Header,
    pub ns: String,
    pub id: i32,
    pub kind: i32,
    pub action: i32,
    pub position: [f64; 3],
    pub orientation: [f64; 4],
    pub scale: [f64; 3],
    pub rgba: [f32; 4],
    pub lifetime: (i32, u32),
    pub frame_locked: bool,
    pub points: Vec<[f64; 3]>,
    pub colors: Vec<[f32; 4]>,
    pub texture_resource: String,
    pub texture: CompressedImage,
    pub uv_coordinates: Vec<[f32; 2]>,
    pub text: String,
    pub mesh_resource: String,
    pub mesh_file: MeshFile,
    pub mesh_use_embedded_materials: bool,
}

impl Marker {
    /// A single-colour marker without points, with id 0, at the origin of its frame, displayed until it is replaced.
    pub(in super::super) fn new(header: Header, kind: MarkerKind, ns: &str, scale: [f64; 3], rgb: [u8; 3]) -> Self {
        let [r, g, b] = rgb.map(|v| f32::from(v) / 255.0);
        Self {
            texture: CompressedImage {
                header: Header { sec: 0, nanosec: 0, frame_id: String::new() },
                format: String::new(),
                data: vec![],
            },
            header,
            ns: ns.to_owned(),
            id: 0,
            kind: kind as i32,
            action: 0,
            position: [0.0; 3],
            orientation: super::IDENTITY,
            scale,
            rgba: [r, g, b, 1.0],
            lifetime: (0, 0),
            frame_locked: false,
            points: vec![],
            colors: vec![],
            texture_resource: String::new(),
            uv_coordinates: vec![],
            text: String::new(),
            mesh_resource: String::new(),
            mesh_file: MeshFile { filename: String::new(), data: vec![] },
            mesh_use_embedded_materials: false,
        }
    }
}

/// `sensor_msgs/CompressedImage`.
#[derive(Serialize)]
pub(in super::super) struct CompressedImage {
    pub header: Header,
    pub format: String,
    pub data: Vec<u8>,
}

/// `visualization_msgs/MeshFile`.
#[derive(Serialize)]
pub(in super::super) struct MeshFile {
    pub filename: String,
    pub data: Vec<u8>,
}
