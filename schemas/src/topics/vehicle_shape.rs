//! Topic `/vehicle/shape`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/shape",
    schema: "foxglove.SceneUpdate",
    description: "chassis box and wheels as drawn, moving with their frames; spheres at start and goal; one message at \
                  the mission's start",
    fields: &[],
};
