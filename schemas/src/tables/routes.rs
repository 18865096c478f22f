//! Table `routes`.

super::table! {
    /// One row per route that was planned.
    "routes" RouteRow {
        keys {
            /// Id of the terrain.
            terrain_id: String,
            /// Id of the route on that terrain: that of the route stage and the number of the pair, `<id>-0001`.
            route_id: String,
        }
        /// Label of the terrain.
        group: Option<String> [""],
        /// What differs from the study's plain route: the swept parameters of the terrain and of the stage; null for the plain one.
        variant: Option<String> [""],
        /// Routes with the same `pair_id` lead from the same start to the same goal.
        pair_id: String [""],
        /// Id of the route stage.
        stage_id: String [""],
        /// Search: `grid`, `roadmap`, `theta_star` or `anytime`.
        method: String [""],
        /// Neighbours of a cell: 4 or 8.
        neighbours: i64 ["1"],
        /// Height-difference threshold of the roadmap's vertices; null without one (NoHDT), and for other methods.
        threshold_m: f64 ["m"],
        /// What travel costs: `slope`, `energy`, `class`, `band_rms` or `raster`.
        cost: String [""],
        /// Vehicle whose limits of slope hold; null where the study states them.
        vehicle: Option<String> [""],
        /// Steepest slope that may be climbed.
        max_up_deg: f64 ["deg"],
        /// Steepest slope that may be descended.
        max_down_deg: f64 ["deg"],
        /// Width of the team that the route makes room for; null without one.
        width_m: f64 ["m"],
        /// Start point, easting.
        start_x_m: f64 ["m"],
        /// Start point, northing.
        start_y_m: f64 ["m"],
        /// Goal point, easting.
        goal_x_m: f64 ["m"],
        /// Goal point, northing.
        goal_y_m: f64 ["m"],
        /// Straight horizontal distance from start to goal.
        straight_m: f64 ["m"],
        /// `found`, `no_path`, or `budget` where an anytime search used up its expansions before it found a path.
        outcome: String [""],
        /// Cells of the terrain that may be entered.
        free_cells: i64 ["1"],
        /// Vertices searched: of the roadmap, or the free cells.
        vertices: i64 ["1"],
        /// Directed edges between them.
        edges: i64 ["1"],
        /// Vertices among them that were added to connect what the ground connects.
        repaired: i64 ["1"],
        /// Vertices whose edges the search looked at.
        expansions: i64 ["1"],
        /// Cost of the path as the search counts it, in metres of level ground.
        search_cost_m: f64 ["m"],
        /// Upper bound of that cost over the least one: 1 where it is the least, null where none is known (Theta*).
        cost_bound: f64 ["1"],
        /// Cost of the same path along quarter cells, with the room beside it: comparable between methods.
        path_cost_m: f64 ["m"],
        /// Cost of the smoothed path along quarter cells.
        smoothed_cost_m: f64 ["m"],
        /// Points of the path.
        path_points: i64 ["1"],
        /// Points of the smoothed path.
        smoothed_points: i64 ["1"],
        /// Length of the smoothed path in plan.
        length_m: f64 ["m"],
        /// Length of the smoothed path on the ground.
        ground_length_m: f64 ["m"],
        /// Steepest climb of the smoothed path.
        steepest_up_deg: f64 ["deg"],
        /// Steepest descent of the smoothed path.
        steepest_down_deg: f64 ["deg"],
        /// GeoJSON file in the release; null without a route.
        path: Option<String> [""],
    }
}
