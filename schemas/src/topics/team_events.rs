//! Topic `/events` of a team.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/events",
    schema: "foxglove.Log",
    description: "events of the team or of a member, whose name then begins the message, with the kind of event as `name`",
    fields: &[],
};
