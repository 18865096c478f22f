//! Topic `/sensor/view` of a rover.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/sensor/view",
    schema: "foxglove.SceneUpdate",
    description: "what the rover sees, in map: areas and rays in the colour of their hazard (red: a hazard, green: none, grey: a ray that met nothing); once a cycle",
    fields: &[],
};
