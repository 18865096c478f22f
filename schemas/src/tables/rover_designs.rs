//! Table `rover_designs`.

super::table! {
    /// One row per design that `perturb` of a rover stage tried on a world: averages over its rovers.
    "rover_designs" RoverDesignRow {
        keys {
            /// Id of the rover stage.
            stage_id: String,
            /// Id of the terrain, whose world the rovers drove on.
            terrain_id: String,
            /// Number of the trajectory, from 1; the same trajectories on every world.
            trajectory: i64,
            /// Design along the trajectory, from 0; each differs from the one before in one parameter.
            step: i64,
        }
        /// Label of the terrain.
        group: Option<String> [""],
        /// What differs from the study's plain trial: the swept parameters of terrain and rover; null for the plain one.
        variant: Option<String> [""],
        /// `train`, `validation` or `test` (`[study] split`); null where the study does not split its terrains, or leaves this one out.
        split: Option<String> [""],
        /// Parameter that moved in this step; null for the first design.
        parameter: Option<String> [""],
        /// Value over the study's value of every perturbed parameter, as a JSON object by name.
        factors: String [""],
        /// Rovers that drove.
        rovers: i64 ["1"],
        /// Rovers that reached the goal.
        arrived: i64 ["1"],
        /// Mean efficiency.
        efficiency: f64 ["1"],
        /// Mean distance driven; censored, since rovers that stopped short of the goal count with what they drove.
        distance_m: f64 ["m"],
        /// Rovers that stopped at their distance or cycle limit.
        at_limit: i64 ["1"],
    }
}
