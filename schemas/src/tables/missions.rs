//! Table `missions`.

super::table! {
    /// One row per mission.
    "missions" MissionRow {
        keys {
            /// Id of the terrain.
            terrain_id: String,
            /// Id of the mission on that terrain.
            mission_id: String,
        }
        /// Label of the terrain.
        group: Option<String> [""],
        /// Swept parameters of terrain and traverse that differ from the study's plain run, such as `surface.wheel_friction = 0.7`; null
        /// for the plain run.
        variant: Option<String> [""],
        /// `train`, `validation` or `test` (`[study] split`); null if the study has no splits or leaves this terrain out.
        split: Option<String> [""],
        /// Missions with the same `pair_id` have the same start and goal, on one terrain or (with `pairing = "common"`) on terrains that
        /// share their random draws.
        pair_id: String [""],
        /// Id of the traverse stage.
        traverse_id: String [""],
        /// Vehicle.
        vehicle: String [""],
        /// Start point, easting.
        start_x_m: f64 ["m"],
        /// Start point, northing.
        start_y_m: f64 ["m"],
        /// Goal point, easting.
        goal_x_m: f64 ["m"],
        /// Goal point, northing.
        goal_y_m: f64 ["m"],
        /// Direction from start to goal, counterclockwise from east.
        heading_deg: f64 ["deg"],
        /// Number of random draws of start and heading until one was accepted.
        draws: i64 ["1"],
        /// `success`, `tipped`, `stuck`, `out_of_bounds` or `timeout`.
        outcome: String [""],
        /// Time from start to outcome.
        time_s: f64 ["s"],
        /// Length of the path driven, in plan, from the recorded samples.
        path_length_m: f64 ["m"],
        /// Distance along the mission's line from start to outcome: the largest of all samples, at most the line's length.
        progress_m: f64 ["m"],
        /// Straight distance from the first to the last sample over path length; null unless the mission succeeded.
        efficiency: f64 ["1"],
        /// Root mean square of the vertical acceleration, from the recorded heights differentiated twice.
        rms_vertical_acceleration_m_s2: f64 ["m/s2"],
        /// Root mean square of the derivative of the pitch angle.
        rms_pitch_rate_deg_s: f64 ["deg/s"],
        /// Root mean square of the derivative of the roll angle.
        rms_roll_rate_deg_s: f64 ["deg/s"],
        /// Root mean square of the angular velocity about the transverse body axis.
        rms_body_pitch_rate_deg_s: f64 ["deg/s"],
        /// Root mean square of the angular velocity about the longitudinal body axis.
        rms_body_roll_rate_deg_s: f64 ["deg/s"],
        /// Largest absolute pitch.
        max_pitch_deg: f64 ["deg"],
        /// Largest absolute roll.
        max_roll_deg: f64 ["deg"],
        /// Length of the mission's line: the straight line, or the polyline of a route or trail.
        line_length_m: f64 ["m"],
        /// Root mean square of the distance from that line.
        rms_cross_track_m: f64 ["m"],
        /// Largest distance from that line.
        max_cross_track_m: f64 ["m"],
        /// Share of the mission's line over cells of low roughness (class map before closing).
        line_share_low: f64 ["1"],
        /// Share of the mission's line over cells of semi roughness.
        line_share_semi: f64 ["1"],
        /// Share of the mission's line over cells of high roughness.
        line_share_high: f64 ["1"],
        /// Largest gradient of the bilinear surface under the mission's line.
        line_max_slope: f64 ["1"],
        /// Standard deviation of the heights along the mission's line after a centred moving average over the vehicle's
        /// wheelbase is removed.
        line_band_rms_m: f64 ["m"],
        /// Number of starts of this mission: the drawn one, which all other columns describe, and perturbed ones.
        replicates: i64 ["1"],
        /// Share of these starts from which the goal was reached.
        success_probability: f64 ["1"],
        /// Recorded samples.
        samples: i64 ["1"],
        /// Rate of the recorded samples.
        sample_rate_hz: f64 ["Hz"],
        /// MCAP recording in the release.
        path: String [""],
    }
}
