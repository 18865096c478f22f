//! Topic `/events` of a rover.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/events",
    schema: "foxglove.Log",
    description: "start, hazards coming into view, first turns, reverse drives, contacts and the end, with the kind of event as `name`",
    fields: &[],
};
