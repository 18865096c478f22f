//! Topic `/team/paths`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/team/paths",
    schema: "foxglove.SceneUpdate",
    description: "the complete path of each member, two points per second in steps of 1/1024 m, in the member's colour; one message at the \
                  run's start",
    fields: &[],
};
