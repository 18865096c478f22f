//! Table `routes`.

super::table! {
    /// One row per planned route.
    "routes" RouteRow {
        keys {
            /// Id of the terrain.
            terrain_id: String,
            /// Id of the route on that terrain: id of the route stage and number of the pair, `<id>-0001`.
            route_id: String,
        }
        /// Label of the terrain.
        group: Option<String> [""],
        /// Swept parameters of terrain and stage that differ from the study's plain route; null for the plain route.
        variant: Option<String> [""],
        /// Routes with the same `pair_id` have the same start and goal.
        pair_id: String [""],
        /// Id of the route stage.
        stage_id: String [""],
        /// Search: `grid`, `roadmap`, `theta_star` or `anytime`.
        method: String [""],
        /// Neighbours of a cell: 4 or 8.
        neighbours: i64 ["1"],
        /// Height-difference threshold of the roadmap's vertices; null without one (NoHDT), and for other methods.
        threshold_m: f64 ["m"],
        /// Cost function: `slope`, `energy`, `class`, `band_rms` or `raster`.
        cost: String [""],
        /// Vehicle whose slope limits apply; null if the study states the limits.
        vehicle: Option<String> [""],
        /// Largest slope uphill that is allowed.
        max_up_deg: f64 ["deg"],
        /// Largest slope downhill that is allowed.
        max_down_deg: f64 ["deg"],
        /// Width of the team for which the route leaves room; null without a team.
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
        /// `found`, `no_path`, or `budget` if an anytime search used up its expansions before finding a path.
        outcome: String [""],
        /// Cells of the terrain that may be entered.
        free_cells: i64 ["1"],
        /// Number of vertices of the search graph: those of the roadmap, or the free cells.
        vertices: i64 ["1"],
        /// Directed edges between them.
        edges: i64 ["1"],
        /// Number of vertices added to restore connections that exist on the ground.
        repaired: i64 ["1"],
        /// Number of vertices expanded by the search.
        expansions: i64 ["1"],
        /// Cost of the path in the search, in metres of level ground.
        search_cost_m: f64 ["m"],
        /// Upper bound of that cost over the optimal cost: 1 if it is optimal, null if no bound is known (Theta*).
        cost_bound: f64 ["1"],
        /// Cost of the same path in steps of quarter cells, including lateral clearance; comparable between methods.
        path_cost_m: f64 ["m"],
        /// Cost of the smoothed path in steps of quarter cells.
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
