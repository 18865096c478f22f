//! Topic `/wheels`.

use super::FieldKind::{Doubles, Float, Floats, Texts};
use super::{Topic, field};

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/wheels",
    schema: "sastrugi.Wheels",
    description: "all wheels at one instant, at the sampling rate; each field has one value per wheel unless stated otherwise; angles and spins \
                  in steps of 1/1024, slip ratios of 1/4096, torques of 1/64 N m, forces of 1/4 N, contact points of 1/1024 m",
    fields: &[
        field("wheel", Texts, "", "name of the wheel and of its frame"),
        field("angle_rad", Floats, "rad", "angle turned since the start, forward positive"),
        field("spin_rad_s", Floats, "rad/s", "spin"),
        field("torque_n_m", Floats, "N m", "drive torque on the wheel"),
        field("normal_force_n", Floats, "N", "ground force along the contact normal, 0 without contact"),
        field("longitudinal_force_n", Floats, "N", "ground force along the rolling direction"),
        field("lateral_force_n", Floats, "N", "ground force across the rolling direction, left positive"),
        field("slip_ratio", Floats, "1", "rim speed minus ground speed, over the larger of the two"),
        field("contact_x_m", Doubles, "m", "contact point in the map frame, east, to 1 mm; 0 without contact"),
        field("contact_y_m", Doubles, "m", "contact point in the map frame, north, to 1 mm; 0 without contact"),
        field("contact_z_m", Doubles, "m", "contact point in the map frame, up, to 1 mm; 0 without contact"),
        field("steering_rad", Floats, "rad", "steering angle, left positive"),
        field("chassis_force_n", Float, "N", "magnitude of the ground force on the chassis; one value"),
    ],
};
