//! Topic `/terrain/mesh`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/terrain/mesh",
    schema: "foxglove.SceneUpdate",
    description: "the terrain as triangles between cell centres, coloured by roughness class: every cell along the \
                  path, coarser elsewhere without gaps, heights in steps of 1/128 m; one message at the mission's start",
    fields: &[],
};
