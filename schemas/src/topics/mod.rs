//! MCAP topics of a release, and the recordings of missions, teams and rovers that fill them.
//!
//! ROS 2 flavour: see [`ros2`]. Viewer flavour: Foxglove's public protobuf messages where they exist, our own (package `sastrugi`) for the rest.
//! Each of our messages starts with field 1, `timestamp` (google.protobuf.Timestamp); the listed fields follow as numbers 2, 3 ... Fields are
//! appended, never renumbered, renamed or removed.

pub mod command;
pub mod events;
pub mod imu;
pub mod recording;
pub mod ros2;
pub mod rover;
pub mod rover_events;
pub mod rover_path;
pub mod rover_plan;
pub mod rover_shape;
pub mod rover_state;
pub mod rover_tf;
pub mod rover_view;
pub mod state;
pub mod team;
pub mod team_box;
pub mod team_events;
pub mod team_graph;
pub mod team_paths;
pub mod team_route;
pub mod team_shape;
pub mod team_state;
pub mod team_tf;
pub mod terrain_grid;
pub mod terrain_mesh;
pub mod tf;
pub mod vehicle_path;
pub mod vehicle_pose;
pub mod vehicle_shape;
pub mod wheels;

pub use recording::{
    CommandSample, Event, EventKind, ImuSample, Recording, StateSample, VehicleOutline, WheelOutline, WheelSample,
    WheelState,
};
pub use rover::{RoverCycle, RoverEvent, RoverEventKind, RoverPlan, RoverRecording, SeenArea, SeenRay};
pub use team::{
    DiscState, FormationBox, Member, MemberState, MovingDisc, PlannedRoute, TeamEvent, TeamEventKind, TeamRecording,
};

use serde::Serialize;

/// One topic; part of the public contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Topic {
    /// Name, such as `/vehicle/state`; if it contains [`MEMBER`], every member of a team has this topic.
    pub name: &'static str,
    /// Full name of its message, such as `foxglove.SceneUpdate` or `sastrugi.VehicleState`.
    pub schema: &'static str,
    /// Content of a message, and when it is written.
    pub description: &'static str,
    /// Fields of an own message; empty for a public one.
    pub fields: &'static [Field],
}

impl Topic {
    /// Its name for a member of a team.
    ///
    /// ```
    /// use sastrugi_schemas::topics::ros2::{MEMBER_ODOM, TEAM_EVENTS};
    ///
    /// assert_eq!(MEMBER_ODOM.of_member("member_2"), "/member_2/odom");
    /// assert_eq!(TEAM_EVENTS.of_member("member_2"), "/events");
    /// ```
    pub fn of_member(&self, member: &str) -> String {
        self.name.replace(MEMBER, member)
    }
}

/// One field of an own message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Field {
    /// Name, snake case, unit at the end.
    pub name: &'static str,
    /// Protobuf type.
    pub kind: FieldKind,
    /// Unit (`m`, `rad/s`, `1` for pure numbers, empty for words).
    pub unit: &'static str,
    /// Description.
    pub description: &'static str,
}

/// Protobuf type of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FieldKind {
    /// `double`
    Double,
    /// `float`
    Float,
    /// `repeated double`, packed.
    Doubles,
    /// `repeated float`, packed.
    Floats,
    /// `string`
    Text,
    /// `repeated string`
    Texts,
}

/// Placeholder for a member's name in the name of a topic.
pub const MEMBER: &str = "{member}";

/// All topics of a mission in the viewer flavour, in the order of their channels.
pub const VIEWER: [&Topic; 11] = [
    &terrain_mesh::TOPIC,
    &terrain_grid::TOPIC,
    &vehicle_shape::TOPIC,
    &vehicle_path::TOPIC,
    &tf::TOPIC,
    &vehicle_pose::TOPIC,
    &state::TOPIC,
    &imu::TOPIC,
    &wheels::TOPIC,
    &command::TOPIC,
    &events::TOPIC,
];

/// All topics of a team in the viewer flavour, in the order of their channels.
pub const TEAM_VIEWER: [&Topic; 10] = [
    &terrain_mesh::TOPIC,
    &terrain_grid::TOPIC,
    &team_shape::TOPIC,
    &team_route::TOPIC,
    &team_paths::TOPIC,
    &team_graph::TOPIC,
    &team_box::TOPIC,
    &team_tf::TOPIC,
    &team_state::TOPIC,
    &team_events::TOPIC,
];

/// All topics of a rover in the viewer flavour, in the order of their channels.
pub const ROVER_VIEWER: [&Topic; 10] = [
    &terrain_mesh::TOPIC,
    &terrain_grid::TOPIC,
    &rover_shape::TOPIC,
    &rover_path::TOPIC,
    &rover_plan::TOPIC,
    &rover_tf::TOPIC,
    &vehicle_pose::TOPIC,
    &rover_view::TOPIC,
    &rover_state::TOPIC,
    &rover_events::TOPIC,
];

/// Constructor that keeps the field lists of topics short.
const fn field(name: &'static str, kind: FieldKind, unit: &'static str, description: &'static str) -> Field {
    Field { name, kind, unit, description }
}

#[cfg(test)]
mod tests {
    use super::ros2::{ROS2, ROVER_ROS2, TEAM_ROS2};
    use super::*;
    use std::collections::{BTreeMap, BTreeSet};

    /// Names once in each recording; own messages have fields, public ones none; messages of one name have the same fields everywhere.
    #[test]
    fn val_topics_keep_their_contract() {
        let mut own: BTreeMap<&str, &[Field]> = BTreeMap::new();
        for topics in [&VIEWER[..], &ROS2, &TEAM_VIEWER, &TEAM_ROS2, &ROVER_VIEWER, &ROVER_ROS2] {
            let names: BTreeSet<&str> = topics.iter().map(|topic| topic.name).collect();
            assert_eq!(names.len(), topics.len(), "{names:?}");
            for topic in topics {
                assert!(topic.name.starts_with('/') && !topic.description.is_empty(), "{}", topic.name);
                let is_own = topic.schema.starts_with("sastrugi.");
                assert_eq!(is_own, !topic.fields.is_empty(), "{} {}", topic.name, topic.schema);
                let fields: BTreeSet<&str> = topic.fields.iter().map(|field| field.name).collect();
                assert_eq!(fields.len(), topic.fields.len(), "{}: {fields:?}", topic.name);
                if is_own {
                    assert_eq!(*own.entry(topic.schema).or_insert(topic.fields), topic.fields, "{}", topic.schema);
                }
            }
        }
        assert!(own.len() > 3, "{:?}", own.keys());
        // ROS 2 messages are public.
        for topic in [&ROS2[..], &TEAM_ROS2, &ROVER_ROS2].concat() {
            assert!(topic.schema.contains("/msg/"), "{}", topic.schema);
        }
    }

    #[test]
    fn val_names_of_events() {
        use EventKind::{OutOfBounds, Stuck, Success, Timeout, Tipped};
        for event in [Success, Tipped, Stuck, OutOfBounds, Timeout] {
            assert_eq!(EventKind::outcome(event.name()), Some(event));
        }
        assert_eq!((EventKind::outcome("start"), EventKind::outcome("")), (None, None));
        for kind in TeamEventKind::ALL {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.name());
        }
    }
}
