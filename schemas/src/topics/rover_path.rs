//! Topic `/vehicle/path` of a rover.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/path",
    schema: "foxglove.PosesInFrame",
    description: "the complete path of the rover, one pose every 10 s and the last one, in one message at the start",
    fields: &[],
};
