//! Topic `/vehicle/shape`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/shape",
    schema: "foxglove.SceneUpdate",
    description: "outline of chassis and wheels, moving with their frames; spheres at start and goal; one message at \
                  the mission's start",
    fields: &[],
};
