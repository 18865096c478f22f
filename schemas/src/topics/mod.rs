//! MCAP topics of a release and the recording of a mission that fills them.
//!
//! ROS 2 flavour: see [`ros2`]. Viewer flavour: Foxglove's public protobuf messages where there is one, own protobuf messages (package `sastrugi`)
//! for the rest. Each own message starts with field 1, `timestamp` (google.protobuf.Timestamp); the listed fields
//! follow as numbers 2, 3 ... A field is appended, never renumbered, renamed or removed.

pub mod command;
pub mod events;
pub mod imu;
pub mod recording;
pub mod ros2;
pub mod state;
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

use serde::Serialize;

/// One topic: part of the contract with readers.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Topic {
    /// Name, as `/vehicle/state`.
    pub name: &'static str,
    /// Full name of its message, as `foxglove.SceneUpdate` or `sastrugi.VehicleState`.
    pub schema: &'static str,
    /// What a message is, and when one is written.
    pub description: &'static str,
    /// Fields of an own message; empty for a public one.
    pub fields: &'static [Field],
}

/// One field of an own message.
#[derive(Clone, Copy, Debug, Serialize)]
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
    /// `repeated string`
    Texts,
}

/// All topics of the viewer flavour, in the order of their channels.
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

/// A field; keeps the lists of the topics readable.
const fn field(name: &'static str, kind: FieldKind, unit: &'static str, description: &'static str) -> Field {
    Field { name, kind, unit, description }
}
