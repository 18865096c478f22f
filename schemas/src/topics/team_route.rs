//! Topic `/team/route`.

use super::Topic;

/// The topic.
pub const TOPIC: Topic = Topic {
    name: "/team/route",
    schema: "foxglove.PosesInFrame",
    description: "the planned route: its waypoints and, between them, one pose per cell on the ground, at most 8192; one \
                  message at the run's start, and one whenever a team replans",
    fields: &[],
};
