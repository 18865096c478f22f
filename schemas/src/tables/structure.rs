//! Table `structure`.

super::table! {
    /// One row per lag of a surface's structure function: mean squared increment over all pairs of cells with data.
    "structure" StructureRow {
        keys {
            /// Id of the surface (table `surfaces`).
            surface_id: String,
            /// `all` for rings over all directions, `x` east-west, `y` north-south.
            direction: String,
            /// Number of the lag, from 0.
            bin: i64,
        }
        /// Mean lag of the pairs.
        lag_m: f64 ["m"],
        /// Mean squared increment (twice the semivariance).
        value_m2: f64 ["m2"],
        /// Pairs of cells.
        pairs: i64 ["1"],
    }
}
