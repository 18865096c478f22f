//! Topic `/tf` of a team.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/tf",
    schema: "foxglove.FrameTransforms",
    description: "map -> each member and each moving obstacle, at the sampling rate",
    fields: &[],
};
