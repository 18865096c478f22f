//! Topic `/vehicle/pose`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/pose",
    schema: "foxglove.PoseInFrame",
    description: "pose of base_link in the map frame, at the sampling rate",
    fields: &[],
};
