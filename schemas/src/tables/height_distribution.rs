//! Table `height_distribution`.

super::table! {
    /// One row per bin of a heightfield's histogram, as drawn by the report.
    "height_distribution" HeightDistributionRow {
        keys {
            /// Id of the surface (table `surfaces`).
            surface_id: String,
            /// Number of the bin, from 0.
            bin: i64,
        }
        /// Lower edge of the bin.
        low_m: f64 ["m"],
        /// Upper edge of the bin.
        high_m: f64 ["m"],
        /// Cells in the bin.
        cells: i64 ["1"],
        /// Share of the cells with data per metre of height.
        density_per_m: f64 ["1/m"],
    }
}
