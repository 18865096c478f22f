//! Table `rovers`.

super::table! {
    /// One row per rover that made its own way.
    "rovers" RoverRow {
        keys {
            /// Id of the terrain, whose world the rover drove on.
            terrain_id: String,
            /// Id of the rover on that terrain: that of the rover stage and its number, `<id>-0001`.
            rover_id: String,
        }
        /// Label of the terrain.
        group: Option<String> [""],
        /// What differs from the study's plain trial: the swept parameters of terrain and rover; null for the plain one.
        variant: Option<String> [""],
        /// `train`, `validation` or `test` (`[study] split`); null where the study does not split its terrains, or leaves this one out.
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
        /// `reached`, `lost` (it believed to be at the goal), `no_way` (it knew of none), `distance_limit`, `cycle_limit`, or `off_ground`.
        outcome: String [""],
        /// Distance driven, back included.
        distance_m: f64 ["m"],
        /// Distance to the goal at the end.
        residual_m: f64 ["m"],
        /// `straight_m` over `distance_m` + `residual_m`.
        efficiency: f64 ["1"],
        /// The same had it stopped after half of the distance limit.
        efficiency_half_limit: f64 ["1"],
        /// Farthest that it may drive.
        distance_limit_m: f64 ["m"],
        /// Shortest way to the goal for a rover that knows the whole map; null where there is none. `straight_m` over it is the efficiency that the
        /// ground allows.
        oracle_m: f64 ["m"],
        /// `found`, or `none` where no way exists that keeps the wheels clear of rocks above the clearance and off steep sand.
        oracle: String [""],
        /// Time driving and turning.
        time_s: f64 ["s"],
        /// Cycles of sensing and deciding.
        cycles: i64 ["1"],
        /// Cycles with a turn.
        turns: i64 ["1"],
        /// Sum of all turns.
        turned_deg: f64 ["deg"],
        /// Drives back.
        reversals: i64 ["1"],
        /// Cycles with a hazard in view.
        hazards: i64 ["1"],
        /// Rocks above the clearance that came under the rover.
        contacts: i64 ["1"],
        /// Of those, the ones under its centre line.
        centre_contacts: i64 ["1"],
        /// Clearance that contacts are judged by.
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
        /// Why it went no farther, in words; null for rovers that reached the goal.
        note: Option<String> [""],
        /// MCAP recording in the release; null where it was not recorded.
        path: Option<String> [""],
    }
}
