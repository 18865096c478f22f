//! Table `rovers`.

super::table! {
    /// One row per rover.
    "rovers" RoverRow {
        keys {
            /// Id of the terrain on whose world the rover drove.
            terrain_id: String,
            /// Id of the rover on that terrain: id of the rover stage and number of the rover, `<id>-0001`.
            rover_id: String,
        }
        /// Label of the terrain.
        group: Option<String> [""],
        /// Swept parameters of terrain and rover that differ from the study's plain trial; null for the plain trial.
        variant: Option<String> [""],
        /// `train`, `validation` or `test` (`[study] split`); null if the study has no splits or leaves this terrain out.
        split: Option<String> [""],
        /// Id of the rover stage.
        stage_id: String [""],
        /// Navigator: `sojourner_like`, `schoppers_like`, `planner`.
        navigator: String [""],
        /// Start, easting.
        start_x_m: f64 ["m"],
        /// Start, northing.
        start_y_m: f64 ["m"],
        /// Heading at the start, counterclockwise from east.
        start_heading_deg: f64 ["deg"],
        /// Goal, easting.
        goal_x_m: f64 ["m"],
        /// Goal, northing.
        goal_y_m: f64 ["m"],
        /// Distance from start to goal.
        straight_m: f64 ["m"],
        /// `reached`, `lost` (it wrongly believed to be at the goal), `no_way` (it knew no way on), `distance_limit`, `cycle_limit`, or `off_ground`.
        outcome: String [""],
        /// Distance driven, including reverse.
        distance_m: f64 ["m"],
        /// Remaining distance to the goal at the end.
        residual_m: f64 ["m"],
        /// `straight_m` over `distance_m` + `residual_m`.
        efficiency: f64 ["1"],
        /// The efficiency if the rover had stopped after half of the distance limit.
        efficiency_half_limit: f64 ["1"],
        /// Maximum distance allowed.
        distance_limit_m: f64 ["m"],
        /// Length of the shortest path to the goal for a rover that knows the complete map; null if there is none. `straight_m` over this length is
        /// the highest efficiency that the ground allows.
        oracle_m: f64 ["m"],
        /// `found`, or `none` if no path keeps the wheels clear of rocks above the clearance and off steep sand.
        oracle: String [""],
        /// Time driving and turning.
        time_s: f64 ["s"],
        /// Cycles of sensing and deciding.
        cycles: i64 ["1"],
        /// Cycles with a turn.
        turns: i64 ["1"],
        /// Sum of all turns.
        turned_deg: f64 ["deg"],
        /// Number of reverse drives.
        reversals: i64 ["1"],
        /// Cycles with a hazard in view.
        hazards: i64 ["1"],
        /// Number of rocks above the clearance that came under the rover.
        contacts: i64 ["1"],
        /// Number of those under its centre line.
        centre_contacts: i64 ["1"],
        /// Clearance above which a rock counts as a contact.
        clearance_m: f64 ["m"],
        /// Largest tilt.
        max_tilt_deg: f64 ["deg"],
        /// Largest pitch over the sampled poses.
        max_pitch_deg: f64 ["deg"],
        /// Largest roll over the sampled poses.
        max_roll_deg: f64 ["deg"],
        /// Root mean square of the derivative of the pitch angle, at 1 Hz.
        rms_pitch_rate_deg_s: f64 ["deg/s"],
        /// Root mean square of the derivative of the roll angle, at 1 Hz.
        rms_roll_rate_deg_s: f64 ["deg/s"],
        /// Why the rover stopped; null if it reached the goal.
        note: Option<String> [""],
        /// MCAP recording in the release; null if not recorded.
        path: Option<String> [""],
    }
}
