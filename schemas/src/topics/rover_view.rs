//! Topic `/sensor/view` of a rover.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/sensor/view",
    schema: "foxglove.SceneUpdate",
    description: "the rover's view, in map: areas and rays coloured by hazard (red: a hazard, green: none, grey: a ray that met nothing); once per cycle",
    fields: &[],
};
