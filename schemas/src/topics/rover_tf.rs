//! Topic `/tf` of a rover.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/tf",
    schema: "foxglove.FrameTransforms",
    description: "map -> base_link, once a second",
    fields: &[],
};
