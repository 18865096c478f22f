//! Table `replicates`.

super::table! {
    /// One row per start of a mission with several starts; the first is the drawn one.
    "replicates" ReplicateRow {
        keys {
            /// Id of the terrain.
            terrain_id: String,
            /// Id of the mission on that terrain.
            mission_id: String,
            /// Number of the start, from 1.
            replicate: i64,
        }
        /// Label of the terrain.
        group: Option<String> [""],
        /// Swept parameters that differ from the study's plain run, as in `missions`.
        variant: Option<String> [""],
        /// Start point, easting.
        start_x_m: f64 ["m"],
        /// Start point, northing.
        start_y_m: f64 ["m"],
        /// Heading of the vehicle at the start, counterclockwise from east.
        start_heading_deg: f64 ["deg"],
        /// `success`, `tipped`, `stuck`, `out_of_bounds` or `timeout`.
        outcome: String [""],
        /// Time from start to outcome.
        time_s: f64 ["s"],
        /// Distance along the mission's line from start to outcome.
        progress_m: f64 ["m"],
        /// Root mean square of the vertical acceleration, from the recorded heights differentiated twice.
        rms_vertical_acceleration_m_s2: f64 ["m/s2"],
        /// Root mean square of the derivative of the pitch angle.
        rms_pitch_rate_deg_s: f64 ["deg/s"],
        /// Root mean square of the derivative of the roll angle.
        rms_roll_rate_deg_s: f64 ["deg/s"],
    }
}
