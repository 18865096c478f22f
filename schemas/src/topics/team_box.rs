//! Topic `/team/box`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/team/box",
    schema: "foxglove.SceneUpdate",
    description: "bounding box of the formation, in another colour where it is squeezed, in steps of 1/1024 m; whenever it changes",
    fields: &[],
};
