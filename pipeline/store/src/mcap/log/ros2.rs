//! Reading of ROS 2 messages in CDR, following their published definitions (`common_interfaces`, `geometry2`).

use super::super::ros2::message::{Header, Imu, Log, Odometry, Pose, PoseStamped, TransformStamped, decode};
use super::{Content, Decoder, Transform};
use sastrugi_schemas::log::{TimedForce, TimedPose};

/// Decoder for the messages of a schema.
pub(super) fn decoder(schema: &str) -> Option<Decoder> {
    match schema {
        "nav_msgs/msg/Odometry" => Some(odometry),
        "geometry_msgs/msg/PoseStamped" => Some(pose_stamped),
        // A pose with covariance starts with the same bytes as one without.
        "geometry_msgs/msg/PoseWithCovarianceStamped" => Some(pose_stamped),
        "geometry_msgs/msg/TransformStamped" => Some(transform_stamped),
        "tf2_msgs/msg/TFMessage" => Some(tf),
        "sensor_msgs/msg/Imu" => Some(imu),
        "rcl_interfaces/msg/Log" => Some(event),
        _ => None,
    }
}

/// The stamp, or the time of the log if there is none.
fn time_ns(sec: i32, nanosec: u32, log_time_ns: i64) -> i64 {
    match i64::from(sec) * 1_000_000_000 + i64::from(nanosec) {
        0 => log_time_ns,
        stamp => stamp,
    }
}

impl Header {
    fn time_ns(&self, log_time_ns: i64) -> i64 {
        time_ns(self.sec, self.nanosec, log_time_ns)
    }
}

impl Pose {
    fn at(&self, time_ns: i64) -> TimedPose {
        let Self { position, orientation } = *self;
        TimedPose { time_ns, position_m: position, orientation, angular_velocity_rad_s: None }
    }
}

fn pose_stamped(data: &[u8], log_time_ns: i64) -> Option<Content> {
    let PoseStamped { header, pose } = decode(data)?;
    let pose = pose.at(header.time_ns(log_time_ns));
    Some(Content::Pose { frame: header.frame_id, body: String::new(), pose })
}

fn odometry(data: &[u8], log_time_ns: i64) -> Option<Content> {
    let odometry: Odometry = decode(data)?;
    let mut pose = odometry.pose.at(odometry.header.time_ns(log_time_ns));
    pose.angular_velocity_rad_s = Some(odometry.angular);
    Some(Content::Pose { frame: odometry.header.frame_id, body: odometry.child_frame_id, pose })
}

impl TransformStamped {
    fn link(self, log_time_ns: i64) -> Transform {
        let pose = self.transform.at(self.header.time_ns(log_time_ns));
        Transform { parent: self.header.frame_id, child: self.child_frame_id, pose }
    }
}

fn transform_stamped(data: &[u8], log_time_ns: i64) -> Option<Content> {
    let one: TransformStamped = decode(data)?;
    Some(Content::Transforms(vec![one.link(log_time_ns)]))
}

fn tf(data: &[u8], log_time_ns: i64) -> Option<Content> {
    let all: Vec<TransformStamped> = decode(data)?;
    Some(Content::Transforms(all.into_iter().map(|t| t.link(log_time_ns)).collect()))
}

fn imu(data: &[u8], log_time_ns: i64) -> Option<Content> {
    let imu: Imu = decode(data)?;
    let sample = TimedForce {
        time_ns: imu.header.time_ns(log_time_ns),
        angular_velocity_rad_s: imu.angular_velocity,
        specific_force_m_s2: imu.linear_acceleration,
    };
    Some(Content::Imu { frame: imu.header.frame_id, sample })
}

fn event(data: &[u8], log_time_ns: i64) -> Option<Content> {
    let log: Log = decode(data)?;
    Some(Content::Event(time_ns(log.sec, log.nanosec, log_time_ns), log.name))
}
