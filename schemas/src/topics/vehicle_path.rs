//! Topic `/vehicle/path`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/path",
    schema: "foxglove.PosesInFrame",
    description: "the complete path driven, two poses per second, in one message at the mission's start",
    fields: &[],
};
