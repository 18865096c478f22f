//! Topic `/tf`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/tf",
    schema: "foxglove.FrameTransforms",
    description: "map -> base_link and base_link -> each wheel (as displaced by the suspension, steered and turned by its angle, in \
                  steps of 1/4096), at the sampling rate",
    fields: &[],
};
