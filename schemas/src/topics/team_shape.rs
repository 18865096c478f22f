//! Topic `/team/shape`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/team/shape",
    schema: "foxglove.SceneUpdate",
    description: "members and moving obstacles as cylinders in their frames, spheres at start and goal, walls around obstacles; one \
                  message at the run's start",
    fields: &[],
};
