//! Table `rover_effects`.

super::table! {
    /// One row per perturbed parameter and measure of a rover stage: its elementary effects (Morris, 1991) on the worlds of one group.
    "rover_effects" RoverEffectRow {
        keys {
            /// Id of the rover stage.
            stage_id: String,
            /// Label of the terrains, or their kind if they have none.
            group: String,
            /// Swept parameters of the terrains; empty if none are swept.
            variant: String,
            /// `efficiency` (mean), `arrival` (share of rovers that reached the goal) or `distance_m` (mean, censored at the limits).
            measure: String,
            /// Perturbed parameter.
            parameter: String,
        }
        /// Rank by `mu_star`, from 1; parameters with equal effects share it.
        rank: i64 ["1"],
        /// Value in the study, in `unit`; null for lists, whose elements are scaled together.
        base: f64 ["as in unit"],
        /// Unit of `base`.
        unit: String [""],
        /// Unit of the measure, and so of `mu`, `mu_star`, `sigma` and their intervals: 1 or m.
        measure_unit: String [""],
        /// Mean of the measure over all designs and worlds.
        measure_mean: f64 ["as in measure_unit"],
        /// Mean elementary effect: change of the measure over relative change of the parameter, so that `mu` times 0.1 is the change for 10 % more.
        mu: f64 ["as in measure_unit"],
        /// Lower end of the 95 % interval of `mu`, which accounts for the choice of worlds and of trajectories; null with fewer than two of either.
        mu_low: f64 ["as in measure_unit"],
        /// Upper end of that interval.
        mu_high: f64 ["as in measure_unit"],
        /// Mean of the absolute elementary effects over the trajectories, each averaged over the worlds first. Exactly 0 for a parameter without any effect.
        mu_star: f64 ["as in measure_unit"],
        /// Lower end of the 95 % interval of `mu_star`, as for `mu`.
        mu_star_low: f64 ["as in measure_unit"],
        /// Upper end of that interval.
        mu_star_high: f64 ["as in measure_unit"],
        /// Standard deviation of the elementary effects over the trajectories: large if the effect depends on the other parameters; null with one trajectory.
        sigma: f64 ["as in measure_unit"],
        /// Expected `mu_star` if the parameter only changed the rovers' paths at random, from the scatter between worlds; null with one world.
        mu_star_noise: f64 ["as in measure_unit"],
        /// Largest relative change of a parameter in either direction.
        share: f64 ["1"],
        /// Number of levels of each parameter.
        levels: i64 ["1"],
        /// Number of trajectories.
        trajectories: i64 ["1"],
        /// Number of worlds.
        worlds: i64 ["1"],
        /// Number of rovers per design and world.
        rovers: i64 ["1"],
    }
}
