//! Table `rover_samples`.

super::table! {
    /// One row per sampled instant of a rover.
    "rover_samples" RoverSampleRow file per terrain_id {
        keys {
            /// Id of the terrain, whose world the rover drives on.
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
        /// Height of the plane of the wheels' contacts at the centre.
        z_m: f64 ["m"],
        /// Heading, counterclockwise from east.
        heading_deg: f64 ["deg"],
        /// Left side up.
        roll_deg: f64 ["deg"],
        /// Nose down.
        pitch_deg: f64 ["deg"],
        /// What the navigator is at.
        state: String [""],
        /// Areas that it sees, from left to right: 1 for a hazard, 0 for none.
        hazards: String [""],
        /// Easting that it believes to have.
        believed_x_m: f64 ["m"],
        /// Northing that it believes to have.
        believed_y_m: f64 ["m"],
        /// `train`, `validation` or `test` (`[study] split`); null where the study does not split its terrains, or leaves this one out.
        split: Option<String> [""],
    }
}
