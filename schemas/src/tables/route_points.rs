//! Table `route_points`.

super::table! {
    /// One row per point of a route.
    "route_points" RoutePointRow {
        keys {
            /// Id of the terrain.
            terrain_id: String,
            /// Id of the route on that terrain.
            route_id: String,
            /// `searched`: the path found by the search; `smoothed`: the route.
            form: String,
            /// Number of the point, from 0.
            point: i64,
        }
        /// Easting.
        x_m: f64 ["m"],
        /// Northing.
        y_m: f64 ["m"],
        /// Height.
        z_m: f64 ["m"],
        /// Distance from the start along the path, in plan.
        distance_m: f64 ["m"],
    }
}
