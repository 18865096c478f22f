//! Reading of Foxglove's messages and our own, in protobuf.

use super::{Content, Decoder, Transform};
use foxglove::messages as fox;
use foxglove::messages::{Pose, Quaternion, Timestamp, Vector3};
use prost::Message;
use sastrugi_schemas::log::{TimedForce, TimedPose};
use sastrugi_schemas::topics;

/// Decoder for the messages of a schema.
pub(super) fn decoder(schema: &str) -> Option<Decoder> {
    match schema {
        _ if schema == topics::state::TOPIC.schema => Some(vehicle_state),
        _ if schema == topics::imu::TOPIC.schema => Some(imu),
        "foxglove.Odometry" => Some(odometry),
        "foxglove.PoseInFrame" => Some(pose_in_frame),
        "foxglove.FrameTransform" => Some(transform),
        "foxglove.FrameTransforms" => Some(transforms),
        "foxglove.Log" => Some(event),
        _ => None,
    }
}

/// The stamp of a message, or the time of the log if there is none.
fn stamp(timestamp: Option<Timestamp>, time_ns: i64) -> i64 {
    let of = |t: Timestamp| i64::from(t.sec()) * 1_000_000_000 + i64::from(t.nsec());
    timestamp.map(of).filter(|&t| t != 0).unwrap_or(time_ns)
}

fn posed(time_ns: i64, pose: Option<Pose>) -> TimedPose {
    let Pose { position, orientation } = pose.unwrap_or_default();
    let position = position.unwrap_or_default();
    TimedPose {
        time_ns,
        position_m: [position.x, position.y, position.z],
        orientation: quaternion(orientation),
        angular_velocity_rad_s: None,
    }
}

/// The quaternion, or zeros if there is none.
fn quaternion(q: Option<Quaternion>) -> [f64; 4] {
    q.map_or([0.0; 4], |q| [q.x, q.y, q.z, q.w])
}

fn pose_in_frame(data: &[u8], time_ns: i64) -> Option<Content> {
    let message = fox::PoseInFrame::decode(data).ok()?;
    let pose = posed(stamp(message.timestamp, time_ns), message.pose);
    Some(Content::Pose { frame: message.frame_id, body: String::new(), pose })
}

fn odometry(data: &[u8], time_ns: i64) -> Option<Content> {
    let message = fox::Odometry::decode(data).ok()?;
    let mut pose = posed(stamp(message.timestamp, time_ns), message.pose);
    pose.angular_velocity_rad_s = message.angular_velocity.map(|Vector3 { x, y, z }| [x, y, z]);
    Some(Content::Pose { frame: message.frame_id, body: message.body_frame_id, pose })
}

fn transforms(data: &[u8], time_ns: i64) -> Option<Content> {
    let all = fox::FrameTransforms::decode(data).ok()?.transforms;
    Some(Content::Transforms(all.into_iter().map(|t| link(t, time_ns)).collect()))
}

fn transform(data: &[u8], time_ns: i64) -> Option<Content> {
    Some(Content::Transforms(vec![link(fox::FrameTransform::decode(data).ok()?, time_ns)]))
}

fn link(message: fox::FrameTransform, time_ns: i64) -> Transform {
    let Vector3 { x, y, z } = message.translation.unwrap_or_default();
    Transform {
        parent: message.parent_frame_id,
        child: message.child_frame_id,
        pose: TimedPose {
            time_ns: stamp(message.timestamp, time_ns),
            position_m: [x, y, z],
            orientation: quaternion(message.rotation),
            angular_velocity_rad_s: None,
        },
    }
}

fn event(data: &[u8], time_ns: i64) -> Option<Content> {
    let message = fox::Log::decode(data).ok()?;
    Some(Content::Event(stamp(message.timestamp, time_ns), message.name))
}

/// `sastrugi.VehicleState`: the fields of [`topics::state`], from number 2 on.
#[derive(Clone, PartialEq, Message)]
struct VehicleState {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<prost_types::Timestamp>,
    #[prost(double, tag = "2")]
    x: f64,
    #[prost(double, tag = "3")]
    y: f64,
    #[prost(double, tag = "4")]
    z: f64,
    #[prost(double, tag = "5")]
    qx: f64,
    #[prost(double, tag = "6")]
    qy: f64,
    #[prost(double, tag = "7")]
    qz: f64,
    #[prost(double, tag = "8")]
    qw: f64,
    #[prost(double, tag = "12")]
    roll_rate: f64,
    #[prost(double, tag = "13")]
    pitch_rate: f64,
    #[prost(double, tag = "14")]
    yaw_rate: f64,
}

/// `sastrugi.Imu`: the fields of [`topics::imu`], from number 2 on.
#[derive(Clone, PartialEq, Message)]
struct Imu {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<prost_types::Timestamp>,
    #[prost(float, tag = "2")]
    roll_rate: f32,
    #[prost(float, tag = "3")]
    pitch_rate: f32,
    #[prost(float, tag = "4")]
    yaw_rate: f32,
    #[prost(float, tag = "5")]
    force_x: f32,
    #[prost(float, tag = "6")]
    force_y: f32,
    #[prost(float, tag = "7")]
    force_z: f32,
}

fn own_stamp(timestamp: Option<prost_types::Timestamp>, time_ns: i64) -> i64 {
    timestamp.map_or(time_ns, |t| t.seconds.saturating_mul(1_000_000_000).saturating_add(i64::from(t.nanos)))
}

/// Frames of our own messages.
const MAP: &str = "map";
const BASE: &str = "base_link";

fn vehicle_state(data: &[u8], time_ns: i64) -> Option<Content> {
    let state = VehicleState::decode(data).ok()?;
    let pose = TimedPose {
        time_ns: own_stamp(state.timestamp, time_ns),
        position_m: [state.x, state.y, state.z],
        orientation: [state.qx, state.qy, state.qz, state.qw],
        angular_velocity_rad_s: Some([state.roll_rate, state.pitch_rate, state.yaw_rate]),
    };
    Some(Content::Pose { frame: MAP.to_owned(), body: BASE.to_owned(), pose })
}

fn imu(data: &[u8], time_ns: i64) -> Option<Content> {
    let imu = Imu::decode(data).ok()?;
    let sample = TimedForce {
        time_ns: own_stamp(imu.timestamp, time_ns),
        angular_velocity_rad_s: [imu.roll_rate, imu.pitch_rate, imu.yaw_rate].map(f64::from),
        specific_force_m_s2: [imu.force_x, imu.force_y, imu.force_z].map(f64::from),
    };
    Some(Content::Imu { frame: BASE.to_owned(), sample })
}
