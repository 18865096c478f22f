//! Table `formations`.

super::table! {
    /// One row per run of a team.
    "formations" FormationRow {
        keys {
            /// Id of the terrain.
            terrain_id: String,
            /// Id of the run on that terrain: id of the navigate stage, number of the route, number of the run, `<id>-0001-01`.
            run_id: String,
        }
        /// Label of the terrain.
        group: Option<String> [""],
        /// Swept parameters of terrain, route and run that differ from the study's plain run; null for the plain run.
        variant: Option<String> [""],
        /// `train`, `validation` or `test` (`[study] split`); null if the study has no splits or leaves this terrain out.
        split: Option<String> [""],
        /// Route that the team followed.
        route_id: String [""],
        /// Id of the navigate stage.
        stage_id: String [""],
        /// Formation: `column`, `line`, `wedge` or `custom`.
        formation: String [""],
        /// Members at the start.
        members: i64 ["1"],
        /// Members lost during the run.
        lost: i64 ["1"],
        /// Distance between neighbouring slots; null for custom slots.
        spacing_m: f64 ["m"],
        /// `arrived`, `stuck`, `timeout`, or `no_room` if there was no room for the team at the start.
        outcome: String [""],
        /// Member that was stuck; null otherwise.
        stuck_member: Option<i64> [""],
        /// Time from the start to the outcome.
        time_s: f64 ["s"],
        /// Length of the route in plan.
        route_length_m: f64 ["m"],
        /// Mean distance driven by a member, in plan.
        path_length_m: f64 ["m"],
        /// Mean absolute error of the distance behind the predecessor, over followers and time.
        depth_error_m: f64 ["m"],
        /// Mean absolute error of the lateral distance from the predecessor.
        width_error_m: f64 ["m"],
        /// Largest mean depth error of a follower.
        worst_depth_error_m: f64 ["m"],
        /// Largest mean width error of a follower.
        worst_width_error_m: f64 ["m"],
        /// Share of time, over all followers, with both errors at most 20 % of the spacing.
        in_range: f64 ["1"],
        /// Share of time, over all followers, with both errors at most 40 % of the spacing.
        tolerable: f64 ["1"],
        /// Minimum distance between the centres of two members.
        least_separation_m: f64 ["m"],
        /// Steps spent waiting, over all members.
        waits: i64 ["1"],
        /// Steps of sideways motion, over all members.
        dodges: i64 ["1"],
        /// Waypoints with too little room for the formation, even compressed.
        squeezed: i64 ["1"],
        /// Steps in which a moving obstacle touched a member.
        obstacle_contacts: i64 ["1"],
        /// Number of replanned routes.
        replans: i64 ["1"],
        /// Recorded samples of each member.
        samples: i64 ["1"],
        /// Rate of the recorded samples.
        sample_rate_hz: f64 ["Hz"],
        /// MCAP recording in the release; null if there was no room for the team at the start.
        path: Option<String> [""],
    }
}

impl FormationRow {
    /// The row of a run that did not begin: empty texts, counts of 0, NaN for everything else.
    pub fn without_run() -> Self {
        Self {
            terrain_id: String::new(),
            run_id: String::new(),
            group: None,
            variant: None,
            split: None,
            route_id: String::new(),
            stage_id: String::new(),
            formation: String::new(),
            members: 0,
            lost: 0,
            spacing_m: f64::NAN,
            outcome: String::new(),
            stuck_member: None,
            time_s: f64::NAN,
            route_length_m: f64::NAN,
            path_length_m: f64::NAN,
            depth_error_m: f64::NAN,
            width_error_m: f64::NAN,
            worst_depth_error_m: f64::NAN,
            worst_width_error_m: f64::NAN,
            in_range: f64::NAN,
            tolerable: f64::NAN,
            least_separation_m: f64::NAN,
            waits: 0,
            dodges: 0,
            squeezed: 0,
            obstacle_contacts: 0,
            replans: 0,
            samples: 0,
            sample_rate_hz: f64::NAN,
            path: None,
        }
    }
}
