//! Topic `/team/paths`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/team/paths",
    schema: "foxglove.SceneUpdate",
    description: "the path that each member drove, two points per second in steps of 1/1024 m, in the member's colour; one message at the \
                  run's start",
    fields: &[],
};
