//! Table `samples`.
//!
//! Forces and the controller's state are quantised as in the topics `/wheels` and `/command`: more finely than the noise of any
//! sensor, and easy to compress.

super::table! {
    /// One row per recorded instant of a mission: base_link in the map frame, the commands, the wheels. A list has one value
    /// per wheel, in the order of the vehicle's wheels: axle by axle from the front, left before right.
    "samples" SampleRow file per terrain_id {
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
        /// Roughness class code under base_link (0 low, 1 semi, 2 high); null outside the map.
        class: Option<i64> [""],
        /// Distance from the mission line, left positive, in steps of 1/1024.
        cross_track_m: f64 ["m"],
        /// Bearing of the controller's look-ahead point relative to the vehicle, in steps of 1/32.
        heading_error_deg: f64 ["deg"],
        /// Distance to the goal, in steps of 1/1024.
        distance_to_goal_m: f64 ["m"],
        /// Magnitude of the ground force on the chassis, in steps of 1/4.
        chassis_force_n: f64 ["N"],
        /// Ground force on each wheel along the contact normal, 0 without contact, in steps of 1/4.
        wheel_normal_force_n: Vec<f32> ["N"],
        /// Ground force on each wheel along its rolling direction, in steps of 1/4.
        wheel_longitudinal_force_n: Vec<f32> ["N"],
        /// Ground force on each wheel across its rolling direction, left positive, in steps of 1/4.
        wheel_lateral_force_n: Vec<f32> ["N"],
        /// Slip ratio of each wheel: rim speed minus ground speed, over the larger of the two, in steps of 1/4096.
        wheel_slip_ratio: Vec<f32> ["1"],
        /// Spin of each wheel, in steps of 1/1024.
        wheel_spin_rad_s: Vec<f32> ["rad/s"],
        /// Drive torque on each wheel, in steps of 1/64.
        wheel_torque_n_m: Vec<f32> ["N m"],
        /// Steering angle of each wheel about the body's z axis, left positive, in steps of 1/32.
        wheel_steering_deg: Vec<f32> ["deg"],
        /// Easting of each wheel's contact point, in steps of 1/1024; null without contact.
        wheel_contact_x_m: Vec<f64> ["m"],
        /// Northing of each wheel's contact point, in steps of 1/1024; null without contact.
        wheel_contact_y_m: Vec<f64> ["m"],
        /// Height of each wheel's contact point, in steps of 1/1024; null without contact.
        wheel_contact_z_m: Vec<f64> ["m"],
        /// Outcome of the mission: `success`, `tipped`, `stuck`, `out_of_bounds` or `timeout`.
        outcome: String [""],
        /// `train`, `validation` or `test` (`[study] split`); null if the study has no splits or leaves this terrain out.
        split: Option<String> [""],
    }
}
