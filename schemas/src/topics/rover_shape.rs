//! Topic `/vehicle/shape` of a rover.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/shape",
    schema: "foxglove.SceneUpdate",
    description: "body and wheels of the rover in base_link; start and goal in map; one message at the start",
    fields: &[],
};
