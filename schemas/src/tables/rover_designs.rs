//! Table `rover_designs`.

super::table! {
    /// One row per design of a perturbed rover stage and world: averages over its rovers.
    "rover_designs" RoverDesignRow {
        keys {
            /// Id of the rover stage.
            stage_id: String,
            /// Id of the terrain on whose world the rovers drove.
            terrain_id: String,
            /// Number of the trajectory, from 1; trajectories are the same on every world.
            trajectory: i64,
            /// Number of the design along the trajectory, from 0; each differs from the previous one in one parameter.
            step: i64,
        }
        /// Label of the terrain.
        group: Option<String> [""],
        /// Swept parameters of terrain and rover that differ from the study's plain trial; null for the plain trial.
        variant: Option<String> [""],
        /// `train`, `validation` or `test` (`[study] split`); null if the study has no splits or leaves this terrain out.
        split: Option<String> [""],
        /// Parameter that changed in this step; null for the first design.
        parameter: Option<String> [""],
        /// Value over the study's value of every perturbed parameter, as a JSON object by name.
        factors: String [""],
        /// Number of rovers.
        rovers: i64 ["1"],
        /// Rovers that reached the goal.
        arrived: i64 ["1"],
        /// Mean efficiency.
        efficiency: f64 ["1"],
        /// Mean distance driven; censored, since rovers that stopped before the goal count with the distance they drove.
        distance_m: f64 ["m"],
        /// Rovers that stopped at their distance or cycle limit.
        at_limit: i64 ["1"],
    }
}
