//! Topic `/terrain/grid`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/terrain/grid",
    schema: "foxglove.Grid",
    description: "the terrain from above, at most 64 cells per side: colour of the roughness class and elevation in \
                  steps of 1/256 m; one message at the mission's start",
    fields: &[],
};
