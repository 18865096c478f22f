//! Topic `/vehicle/path` of a rover.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/path",
    schema: "foxglove.PosesInFrame",
    description: "the whole path that the rover drove, a pose every 10 s and the last, in one message at the start",
    fields: &[],
};
