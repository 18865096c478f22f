//! Table `formation_samples`.

super::table! {
    /// One row per recorded instant of a member of a team.
    "formation_samples" FormationSampleRow file per terrain_id {
        keys {
            /// Id of the terrain.
            terrain_id: String,
            /// Id of the run on that terrain.
            run_id: String,
            /// Member, from 1.
            member: i64,
            /// Number of the sample, from 0.
            sample: i64,
        }
        /// Time since the start of the run.
        time_s: f64 ["s"],
        /// Easting.
        x_m: f64 ["m"],
        /// Northing.
        y_m: f64 ["m"],
        /// Height.
        z_m: f64 ["m"],
        /// Direction of travel, counterclockwise from east.
        heading_deg: f64 ["deg"],
        /// Speed in plan.
        speed_m_s: f64 ["m/s"],
        /// Slot of the member; null if it is lost.
        slot: Option<i64> [""],
        /// Current target, easting.
        target_x_m: f64 ["m"],
        /// Current target, northing.
        target_y_m: f64 ["m"],
        /// Distance behind the predecessor minus that of the slot; null for the leader.
        depth_error_m: f64 ["m"],
        /// Distance to the right of the predecessor minus that of the slot; null for the leader.
        width_error_m: f64 ["m"],
        /// `moving`, `waiting`, `arrived` or `lost`.
        state: String [""],
        /// `train`, `validation` or `test` (`[study] split`); null if the study has no splits or leaves this terrain out.
        split: Option<String> [""],
    }
}
