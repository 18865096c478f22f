//! Topic `/vehicle/plan` of a rover.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/vehicle/plan",
    schema: "foxglove.PosesInFrame",
    description: "the way that a rover with a planner plans to take, from where it believes to be; whenever that changes",
    fields: &[],
};
