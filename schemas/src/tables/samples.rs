//! Table `samples`.

super::table! {
    /// One row per recorded instant of a mission: the base_link frame in the map frame.
    "samples" SampleRow {
        keys {
            /// Id of the terrain.
            terrain_id: String,
            /// Id of the mission on that terrain.
            mission_id: String,
            /// Number of the sample, from 0.
            sample: i64,
        }
        /// Time since the mission's start.
        time_s: f64 ["s"],
        /// Easting of base_link.
        x_m: f64 ["m"],
        /// Northing of base_link.
        y_m: f64 ["m"],
        /// Height of base_link.
        z_m: f64 ["m"],
        /// Orientation quaternion (map from base_link), x.
        qx: f64 ["1"],
        /// Orientation quaternion, y.
        qy: f64 ["1"],
        /// Orientation quaternion, z.
        qz: f64 ["1"],
        /// Orientation quaternion, w.
        qw: f64 ["1"],
        /// Velocity of base_link in the map frame, east.
        vx_m_s: f64 ["m/s"],
        /// Velocity of base_link in the map frame, north.
        vy_m_s: f64 ["m/s"],
        /// Velocity of base_link in the map frame, up.
        vz_m_s: f64 ["m/s"],
        /// Roll about x forward.
        roll_deg: f64 ["deg"],
        /// Pitch about y left (nose down positive).
        pitch_deg: f64 ["deg"],
        /// Yaw about z up, counterclockwise from east.
        yaw_deg: f64 ["deg"],
        /// Angular velocity about the body's x axis.
        roll_rate_deg_s: f64 ["deg/s"],
        /// Angular velocity about the body's y axis.
        pitch_rate_deg_s: f64 ["deg/s"],
        /// Angular velocity about the body's z axis.
        yaw_rate_deg_s: f64 ["deg/s"],
        /// Commanded forward speed.
        command_speed_m_s: f64 ["m/s"],
        /// Commanded yaw rate.
        command_yaw_rate_deg_s: f64 ["deg/s"],
        /// Roughness class code under base_link (0 low, 1 semi, 2 high); null outside of the map.
        class: Option<i64> [""],
    }
}
