//! Table `covariance`.

super::table! {
    /// One row per lag bin of a fit: empirical covariance of the residual, and fitted model including the bias of detrending and trimming.
    "covariance" CovarianceRow {
        keys {
            /// Id of the fit.
            fit_id: String,
            /// Number of the bin, from 0.
            bin: i64,
        }
        /// Mean lag of the pairs in the bin.
        lag_m: f64 ["m"],
        /// Azimuth of the sector's centre, clockwise from north; null for all directions combined.
        azimuth_deg: Option<f64> ["deg"],
        /// Empirical covariance.
        covariance_m2: f64 ["m2"],
        /// Pairs of cells in the bin.
        pairs: i64 ["1"],
        /// Fitted model in the same bin, after the same detrending and trimming if the mode corrects for them.
        model_m2: f64 ["m2"],
        /// Fitted model itself, before detrending and trimming; null by direction.
        surface_model_m2: f64 ["m2"],
        /// Lower end of the 95 % band of the empirical covariance, from the differences between blocks of the site; null if there are too few blocks.
        covariance_low_m2: f64 ["m2"],
        /// Upper end of that band.
        covariance_high_m2: f64 ["m2"],
    }
}
