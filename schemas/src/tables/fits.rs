//! Table `fits`.

super::table! {
    /// One row per covariance fit of a measured DEM.
    "fits" FitRow {
        keys {
            /// Id of the fit.
            fit_id: String,
        }
        /// Id of the DEM.
        dem_id: String [""],
        /// `corrected` or `paper`.
        mode: String [""],
        /// Covariance model.
        model: String [""],
        /// Standard deviation of the texture.
        sigma_m: f64 ["m"],
        /// Range b of the exponential covariance sigma^2 exp(-lag / b).
        range_m: f64 ["m"],
        /// Nugget (white) variance.
        nugget_m2: f64 ["m2"],
        /// sigma^2 / b: identified even where neither is.
        sigma2_over_range_m: f64 ["m"],
        /// True window of the moving average (an odd number of cells), east-west.
        window_x_m: f64 ["m"],
        /// True window of the moving average (an odd number of cells), north-south.
        window_y_m: f64 ["m"],
        /// Share of residuals trimmed as outliers.
        trim_level: f64 ["1"],
        /// Residuals beyond this were trimmed.
        trim_threshold_m: f64 ["m"],
        /// Share of the DEM's cells that entered the covariance.
        used_share: f64 ["1"],
        /// Root mean square misfit of the covariance bins.
        misfit_m2: f64 ["m2"],
        /// Warnings, joined by `; `.
        warnings: String [""],
    }
}
