//! Table `logs`.

super::table! {
    /// One row per analysed log; columns shared with `missions` have the same meaning.
    "logs" LogRow {
        keys {
            /// Name of the log's file.
            log_id: String,
        }
        /// Label for comparisons.
        group: Option<String> [""],
        /// Topic of the poses.
        topic: String [""],
        /// Message of that topic, or the transforms that were composed.
        message: String [""],
        /// Frame in which the vehicle moves.
        frame: String [""],
        /// Outcome stated in the log: the name of its last event.
        outcome: Option<String> [""],
        /// Time from the first to the last pose.
        time_s: f64 ["s"],
        /// Length of the path in plan.
        path_length_m: f64 ["m"],
        /// Plan distance between first and last sample over path length; null with gaps.
        efficiency: f64 ["1"],
        /// Root mean square of the vertical acceleration, from the recorded heights differentiated twice.
        rms_vertical_acceleration_m_s2: f64 ["m/s2"],
        /// Value expected from white noise alone.
        vertical_acceleration_floor_m_s2: f64 ["m/s2"],
        /// True if the value is at least three times its noise floor; false: cannot tell.
        vertical_acceleration_tells: bool [""],
        /// Root mean square of the derivative of the pitch angle.
        rms_pitch_rate_deg_s: f64 ["deg/s"],
        /// Value expected from white noise alone.
        pitch_rate_floor_deg_s: f64 ["deg/s"],
        /// True if the value is at least three times its noise floor; false: cannot tell.
        pitch_rate_tells: bool [""],
        /// Root mean square of the derivative of the roll angle.
        rms_roll_rate_deg_s: f64 ["deg/s"],
        /// Value expected from white noise alone.
        roll_rate_floor_deg_s: f64 ["deg/s"],
        /// True if the value is at least three times its noise floor; false: cannot tell.
        roll_rate_tells: bool [""],
        /// Root mean square of the angular velocity about the body's y axis.
        rms_body_pitch_rate_deg_s: f64 ["deg/s"],
        /// Root mean square of the angular velocity about the body's x axis.
        rms_body_roll_rate_deg_s: f64 ["deg/s"],
        /// Largest absolute pitch angle.
        max_pitch_deg: f64 ["deg"],
        /// Largest absolute roll angle.
        max_roll_deg: f64 ["deg"],
        /// Lower end of the frequency band for the next columns.
        band_low_hz: f64 ["Hz"],
        /// Upper end of the frequency band.
        band_high_hz: f64 ["Hz"],
        /// Root mean square of the vertical acceleration in the band, from the source named next.
        band_vertical_acceleration_m_s2: f64 ["m/s2"],
        /// `imu` if there is an inertial measurement unit, otherwise `poses`.
        band_source: Option<String> [""],
        /// Value expected from white noise alone.
        band_vertical_acceleration_floor_m_s2: f64 ["m/s2"],
        /// The same root mean square from the heights of the poses.
        band_vertical_acceleration_poses_m_s2: f64 ["m/s2"],
        /// Number of samples.
        samples: i64 ["1"],
        /// Rate of the samples.
        sample_rate_hz: f64 ["Hz"],
        /// Typical rate of the poses.
        pose_rate_hz: f64 ["Hz"],
        /// True if the poses were interpolated at the sampling rate.
        resampled: bool [""],
        /// Number of gaps.
        gaps: i64 ["1"],
        /// Time in gaps.
        gap_time_s: f64 ["s"],
        /// Share of the samples over ground with data, if a DEM was given.
        ground_share: f64 ["1"],
        /// Minimum height of the body's frame above the ground.
        min_clearance_m: f64 ["m"],
        /// Median height of the body's frame above the ground.
        median_clearance_m: f64 ["m"],
        /// Share of the samples on ground of class low.
        share_low: f64 ["1"],
        /// Share of the samples on ground of class semi.
        share_semi: f64 ["1"],
        /// Share of the samples on ground of class high.
        share_high: f64 ["1"],
        /// Where the file is truncated; null for a complete file.
        broken: Option<String> [""],
    }
}
