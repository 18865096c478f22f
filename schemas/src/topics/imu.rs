//! Topic `/imu`.

use super::FieldKind::Float;
use super::{Topic, field};

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/imu",
    schema: "sastrugi.Imu",
    description: "an ideal inertial measurement unit at base_link, at its own rate; rates in steps of 1/1024 rad/s, \
                  specific forces in steps of 1/128 m/s2",
    fields: &[
        field("roll_rate_rad_s", Float, "rad/s", "angular velocity about the body's x axis"),
        field("pitch_rate_rad_s", Float, "rad/s", "angular velocity about the body's y axis"),
        field("yaw_rate_rad_s", Float, "rad/s", "angular velocity about the body's z axis"),
        field("specific_force_x_m_s2", Float, "m/s2", "mean specific force since the previous sample, forward"),
        field("specific_force_y_m_s2", Float, "m/s2", "mean specific force since the previous sample, left"),
        field("specific_force_z_m_s2", Float, "m/s2", "mean specific force since the previous sample, up (+g at rest)"),
    ],
};
