//! Table `formation_events`.

super::table! {
    /// One row per event of a team's run.
    "formation_events" FormationEventRow {
        keys {
            /// Id of the terrain.
            terrain_id: String,
            /// Id of the run on that terrain.
            run_id: String,
            /// Number of the event, in order of time, from 0.
            event: i64,
        }
        /// Time since the start of the run.
        time_s: f64 ["s"],
        /// `start`, `wait` (the first step of a wait), `dodge` (the first step of one), `lost`, `rearranged`, `squeezed`, `replanned`,
        /// `stuck`, `arrived` (a member at its last target), `timeout` or `end`.
        kind: String [""],
        /// Member concerned; null for the whole team.
        member: Option<i64> [""],
        /// Description, one sentence.
        text: String [""],
    }
}
