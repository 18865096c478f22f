//! Topic `/vehicle/state` of a rover.

use super::FieldKind::{Double, Float, Text};
use super::{Topic, field};

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/state",
    schema: "sastrugi.RoverState",
    description: "what the rover knows, is at and does, once a cycle; lengths and angles but those of poses in steps of 1/1024",
    fields: &[
        field("cycle", Double, "1", "number of the cycle, from 0"),
        field("x_m", Double, "m", "position in the map frame, east"),
        field("y_m", Double, "m", "position in the map frame, north"),
        field("z_m", Double, "m", "height of the plane of the wheels' contacts"),
        field("heading_rad", Double, "rad", "heading, counterclockwise from east"),
        field("believed_x_m", Double, "m", "position that the rover believes to have, east"),
        field("believed_y_m", Double, "m", "position that the rover believes to have, north"),
        field("believed_heading_rad", Double, "rad", "heading that the rover believes to have"),
        field("state", Text, "", "what the navigator is at"),
        field("hazards", Text, "", "areas that it sees, from left to right: 1 for a hazard, 0 for none"),
        field("turn_rad", Float, "rad", "turn in place of this cycle as carried out, left positive"),
        field("drive_m", Float, "m", "drive of this cycle after the turn as carried out, back negative"),
        field("roll_deg", Float, "deg", "left side up"),
        field("pitch_deg", Float, "deg", "nose down"),
        field("distance_m", Float, "m", "driven since the start"),
        field("goal_distance_m", Float, "m", "distance to the goal"),
        field("contacts", Float, "1", "rocks above the clearance that came under the rover so far"),
    ],
};
