//! Topic `/team/graph`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/team/graph",
    schema: "foxglove.SceneUpdate",
    description: "waypoints of the route, path of the search before smoothing, and vertices of the roadmap (evenly spaced in \
                  their order if there are more than 16384), in steps of 1/1024 m; one message at the run's start",
    fields: &[],
};
