//! Topic `/vehicle/state`.

use super::FieldKind::{Double, Float};
use super::{Topic, field};

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/state",
    schema: "sastrugi.VehicleState",
    description: "pose and motion of base_link, at the sampling rate; same values as in the table `samples`",
    fields: &[
        field("x_m", Double, "m", "position in the map frame, east"),
        field("y_m", Double, "m", "position in the map frame, north"),
        field("z_m", Double, "m", "position in the map frame, up"),
        field("qx", Double, "1", "orientation quaternion (map from base_link), x"),
        field("qy", Double, "1", "orientation quaternion, y"),
        field("qz", Double, "1", "orientation quaternion, z"),
        field("qw", Double, "1", "orientation quaternion, w"),
        field("vx_m_s", Double, "m/s", "velocity in the map frame, east"),
        field("vy_m_s", Double, "m/s", "velocity in the map frame, north"),
        field("vz_m_s", Double, "m/s", "velocity in the map frame, up"),
        field("roll_rate_rad_s", Double, "rad/s", "angular velocity about the body's x axis"),
        field("pitch_rate_rad_s", Double, "rad/s", "angular velocity about the body's y axis"),
        field("yaw_rate_rad_s", Double, "rad/s", "angular velocity about the body's z axis"),
        field("roll_deg", Float, "deg", "roll for plots, in steps of 1/64 degree"),
        field("pitch_deg", Float, "deg", "pitch for plots (nose down positive), in steps of 1/64 degree"),
    ],
};
