//! Topic `/team/state`.

use super::FieldKind::{Doubles, Texts};
use super::{Topic, field};

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/team/state",
    schema: "sastrugi.TeamState",
    description: "all members at one instant, at the sampling rate; each field has one value per member",
    fields: &[
        field("member", Texts, "", "name of the member and of its frame"),
        field("x_m", Doubles, "m", "position in the map frame, east"),
        field("y_m", Doubles, "m", "position in the map frame, north"),
        field("z_m", Doubles, "m", "position in the map frame, up"),
        field("heading_rad", Doubles, "rad", "direction of travel, counterclockwise from east"),
        field("speed_m_s", Doubles, "m/s", "speed in plan"),
        field("slot", Doubles, "1", "slot of the member, 0 if it is lost"),
        field(
            "depth_error_m",
            Doubles,
            "m",
            "distance behind the predecessor minus that of the slot, 0 without a predecessor",
        ),
        field(
            "width_error_m",
            Doubles,
            "m",
            "distance to the right of the predecessor minus that of the slot, 0 without a predecessor",
        ),
        field("target_distance_m", Doubles, "m", "distance in plan to the current target"),
    ],
};
