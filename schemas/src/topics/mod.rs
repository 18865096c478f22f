//! MCAP topics of a release and the recordings of a mission, of a team and of a rover that fill them.
//!
//! ROS 2 flavour: see [`ros2`]. Viewer flavour: Foxglove's public protobuf messages where there is one, own protobuf messages (package `sastrugi`)
//! for the rest. Each own message starts with field 1, `timestamp` (google.protobuf.Timestamp); the listed fields
//! follow as numbers 2, 3 ... A field is appended, never renumbered, renamed or removed.

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

/// One topic: part of the contract with readers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Topic {
    /// Name, as `/vehicle/state`; with [`MEMBER`] in it, a topic of every member of a team.
    pub name: &'static str,
    /// Full name of its message, as `foxglove.SceneUpdate` or `sastrugi.VehicleState`.
    pub schema: &'static str,
    /// What a message is, and when one is written.
    pub description: &'static str,
    /// Fields of an own message; empty for a public one.
    pub fields: &'static [Field],
}

impl Topic {
    /// Its name for a member of a team.
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
    /// What it is.
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

/// What stands for a member's name in the name of a topic.
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

/// A field; keeps the lists of the topics readable.
const fn field(name: &'static str, kind: FieldKind, unit: &'static str, description: &'static str) -> Field {
    Field { name, kind, unit, description }
}
