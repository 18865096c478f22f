//! Topic `/events` of a rover.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/events",
    schema: "foxglove.Log",
    description: "start, hazards that come into view, first turns, drives back, contacts and the end; the name of the event in `name`",
    fields: &[],
};
