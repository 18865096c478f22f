//! Table `rover_samples`.

super::table! {
    /// One row per sampled instant of a rover.
    "rover_samples" RoverSampleRow file per terrain_id {
        keys {
            /// Id of the terrain on whose world the rover drives.
            terrain_id: String,
            /// Id of the rover on that terrain.
            rover_id: String,
            /// Number of the sample, from 0.
            sample: i64,
        }
        /// Cycle of sensing and deciding, from 0.
        cycle: i64 ["1"],
        /// Time since the start.
        time_s: f64 ["s"],
        /// Distance driven since the start.
        distance_m: f64 ["m"],
        /// Easting.
        x_m: f64 ["m"],
        /// Northing.
        y_m: f64 ["m"],
        /// Height of the plane through the wheel contacts at the centre.
        z_m: f64 ["m"],
        /// Heading, counterclockwise from east.
        heading_deg: f64 ["deg"],
        /// Roll, left side up positive.
        roll_deg: f64 ["deg"],
        /// Pitch, nose down positive.
        pitch_deg: f64 ["deg"],
        /// State of the navigator.
        state: String [""],
        /// Areas in view, from left to right: 1 for a hazard, 0 for none.
        hazards: String [""],
        /// Easting estimated by the rover.
        believed_x_m: f64 ["m"],
        /// Northing estimated by the rover.
        believed_y_m: f64 ["m"],
        /// `train`, `validation` or `test` (`[study] split`); null if the study has no splits or leaves this terrain out.
        split: Option<String> [""],
    }
}
