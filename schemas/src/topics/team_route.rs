//! Topic `/team/route`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/team/route",
    schema: "foxglove.PosesInFrame",
    description: "the planned route: its waypoints, and between them a pose a cell on the ground, at most 8192 of those; one \
                  message at the run's start, and one whenever a team that plans on its way is led on",
    fields: &[],
};
