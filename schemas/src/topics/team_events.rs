//! Topic `/events` of a team.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/events",
    schema: "foxglove.Log",
    description: "what happened to the team or, with its name at the head of the message, to a member; the kind of event as `name`",
    fields: &[],
};
