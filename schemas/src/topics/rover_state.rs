//! Topic `/vehicle/state` of a rover.

use super::FieldKind::{Double, Float, Text};
use super::{Topic, field};

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/state",
    schema: "sastrugi.RoverState",
    description: "estimate, state and actions of the rover, once per cycle; lengths and angles, except those of poses, in steps of 1/1024",
    fields: &[
        field("cycle", Double, "1", "number of the cycle, from 0"),
        field("x_m", Double, "m", "position in the map frame, east"),
        field("y_m", Double, "m", "position in the map frame, north"),
        field("z_m", Double, "m", "height of the plane through the wheel contacts"),
        field("heading_rad", Double, "rad", "heading, counterclockwise from east"),
        field("believed_x_m", Double, "m", "position estimated by the rover, east"),
        field("believed_y_m", Double, "m", "position estimated by the rover, north"),
        field("believed_heading_rad", Double, "rad", "heading estimated by the rover"),
        field("state", Text, "", "state of the navigator"),
        field("hazards", Text, "", "areas in view, from left to right: 1 for a hazard, 0 for none"),
        field("turn_rad", Float, "rad", "executed turn in place of this cycle, left positive"),
        field("drive_m", Float, "m", "executed drive of this cycle after the turn, reverse negative"),
        field("roll_deg", Float, "deg", "roll, left side up positive"),
        field("pitch_deg", Float, "deg", "pitch, nose down positive"),
        field("distance_m", Float, "m", "distance driven since the start"),
        field("goal_distance_m", Float, "m", "distance to the goal"),
        field("contacts", Float, "1", "number of rocks above the clearance that came under the rover so far"),
    ],
};
