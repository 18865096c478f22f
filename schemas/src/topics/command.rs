//! Topic `/command`.

use super::FieldKind::Float;
use super::{Topic, field};

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/command",
    schema: "sastrugi.Command",
    description: "command and state of the controller, at the sampling rate; all values except the speed in steps of 1/1024",
    fields: &[
        field("speed_m_s", Float, "m/s", "commanded forward speed"),
        field("yaw_rate_rad_s", Float, "rad/s", "commanded yaw rate"),
        field("cross_track_m", Float, "m", "distance from the mission line, left positive"),
        field("heading_error_rad", Float, "rad", "bearing of the look-ahead point relative to the vehicle"),
        field("distance_to_goal_m", Float, "m", "distance to the goal"),
    ],
};
