//! Topic `/events`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/events",
    schema: "foxglove.Log",
    description: "events of the mission: start and outcome, with the kind of event as `name`",
    fields: &[],
};
