//! Topic `/vehicle/plan` of a rover.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/plan",
    schema: "foxglove.PosesInFrame",
    description: "the path planned by a rover with a planner, from its estimated position; whenever it changes",
    fields: &[],
};
