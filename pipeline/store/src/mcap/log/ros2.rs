//! Messages of ROS 2 in CDR: the leading fields that are needed, in the order of their published definitions
//! (`common_interfaces`, `geometry2`).

use super::{Decoder, Said, Transform};
use byteorder::{BigEndian, LittleEndian};
use sastrugi_schemas::log::{TimedForce, TimedPose};
use serde::Deserialize;
use serde::de::DeserializeOwned;

/// How the messages of a schema are read.
pub(super) fn decoder(schema: &str) -> Option<Decoder> {
    match schema {
        "nav_msgs/msg/Odometry" => Some(odometry),
        "geometry_msgs/msg/PoseStamped" => Some(pose_stamped),
        // A pose with its covariance begins like one without.
        "geometry_msgs/msg/PoseWithCovarianceStamped" => Some(pose_stamped),
        "geometry_msgs/msg/TransformStamped" => Some(transform_stamped),
        "tf2_msgs/msg/TFMessage" => Some(tf),
        "sensor_msgs/msg/Imu" => Some(imu),
        _ => None,
    }
}

/// A value behind the four bytes that tell the encoding: plain CDR, big or little endian.
fn read<T: DeserializeOwned>(data: &[u8]) -> Option<T> {
    let (header, body) = data.split_at_checked(4)?;
    match header[..2] {
        [0, 0] => cdr_encoding::from_bytes::<T, BigEndian>(body).ok().map(|(value, _)| value),
        [0, 1] => cdr_encoding::from_bytes::<T, LittleEndian>(body).ok().map(|(value, _)| value),
        _ => None,
    }
}

#[derive(Deserialize)]
struct Header {
    sec: i32,
    nanosec: u32,
    frame_id: String,
}

impl Header {
    /// The stamp, or the log's time where there is none.
    fn time_ns(&self, log_time_ns: i64) -> i64 {
        match i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec) {
            0 => log_time_ns,
            stamp => stamp,
        }
    }
}

#[derive(Deserialize)]
struct Pose {
    position: [f64; 3],
    orientation: [f64; 4],
}

impl Pose {
    fn at(&self, time_ns: i64) -> TimedPose {
        let Self { position, orientation } = *self;
        TimedPose { time_ns, position_m: position, orientation, angular_velocity_rad_s: None }
    }
}

#[derive(Deserialize)]
struct PoseStamped {
    header: Header,
    pose: Pose,
}

fn pose_stamped(data: &[u8], log_time_ns: i64) -> Option<Said> {
    let PoseStamped { header, pose } = read(data)?;
    let pose = pose.at(header.time_ns(log_time_ns));
    Some(Said::Pose { frame: header.frame_id, body: String::new(), pose })
}

/// A 6 x 6 matrix.
type Covariance = [[f64; 6]; 6];

#[derive(Deserialize)]
struct Odometry {
    header: Header,
    child_frame_id: String,
    pose: Pose,
    #[serde(rename = "pose_covariance")]
    _covariance: Covariance,
    #[serde(rename = "linear")]
    _linear: [f64; 3],
    angular: [f64; 3],
}

/// The twist is in the child frame (REP 105 and the message's own comment).
fn odometry(data: &[u8], log_time_ns: i64) -> Option<Said> {
    let odometry: Odometry = read(data)?;
    let mut pose = odometry.pose.at(odometry.header.time_ns(log_time_ns));
    pose.angular_velocity_rad_s = Some(odometry.angular);
    Some(Said::Pose { frame: odometry.header.frame_id, body: odometry.child_frame_id, pose })
}

#[derive(Deserialize)]
struct TransformStamped {
    header: Header,
    child_frame_id: String,
    transform: Pose,
}

impl TransformStamped {
    fn link(self, log_time_ns: i64) -> Transform {
        let pose = self.transform.at(self.header.time_ns(log_time_ns));
        Transform { parent: self.header.frame_id, child: self.child_frame_id, pose }
    }
}

fn transform_stamped(data: &[u8], log_time_ns: i64) -> Option<Said> {
    let one: TransformStamped = read(data)?;
    Some(Said::Transforms(vec![one.link(log_time_ns)]))
}

fn tf(data: &[u8], log_time_ns: i64) -> Option<Said> {
    let all: Vec<TransformStamped> = read(data)?;
    Some(Said::Transforms(all.into_iter().map(|t| t.link(log_time_ns)).collect()))
}

#[derive(Deserialize)]
struct Imu {
    header: Header,
    #[serde(rename = "orientation")]
    _orientation: [f64; 4],
    #[serde(rename = "orientation_covariance")]
    _orientation_covariance: [f64; 9],
    angular_velocity: [f64; 3],
    #[serde(rename = "angular_velocity_covariance")]
    _angular_velocity_covariance: [f64; 9],
    linear_acceleration: [f64; 3],
}

fn imu(data: &[u8], log_time_ns: i64) -> Option<Said> {
    let imu: Imu = read(data)?;
    let sample = TimedForce {
        time_ns: imu.header.time_ns(log_time_ns),
        angular_velocity_rad_s: imu.angular_velocity,
        specific_force_m_s2: imu.linear_acceleration,
    };
    Some(Said::Imu { frame: imu.header.frame_id, sample })
}
