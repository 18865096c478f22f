//! Tables `scoreboard` and `scoreboard_covariance`.

super::table! {
    /// One row per synthesis method of a texture with `methods`: predicted errors, and measurements on a few realisations.
    "scoreboard" ScoreRow {
        keys {
            /// Id of the texture.
            texture_id: String,
            /// Synthesis method.
            method: String,
        }
        /// Largest error of the expected covariance, as a share of the variance.
        covariance_error_max: f64 ["1"],
        /// Root mean square error of the expected covariance, as a share of the variance.
        covariance_error_rms: f64 ["1"],
        /// Number of realisations.
        realisations: i64 ["1"],
        /// Mean variance of the realisations, as a share of the target variance.
        variance_mean: f64 ["1"],
        /// Standard deviation of the realisations' variances, as a share of the target variance.
        variance_spread: f64 ["1"],
        /// Target ratio of the range across the long axis to the range along it.
        ratio_wanted: f64 ["1"],
        /// The same ratio, measured on the realisations.
        ratio_found: f64 ["1"],
        /// Mean square step across the tile's edges over that between neighbours inside; 1 without a seam.
        seam_jump_ratio: f64 ["1"],
        /// Predicted number of arithmetic operations of one realisation.
        operations: f64 ["1"],
        /// Predicted working memory.
        memory_bytes: f64 ["B"],
        /// Why the method was not used; empty if it was.
        refused: String [""],
    }
}

super::table! {
    /// One row per method of a scoreboard and lag along rows: target and achieved covariance.
    "scoreboard_covariance" ScoreCovarianceRow {
        keys {
            /// Id of the texture.
            texture_id: String,
            /// Synthesis method.
            method: String,
            /// Number of the lag, from 0.
            bin: i64,
        }
        /// Lag, east-west.
        lag_m: f64 ["m"],
        /// Target covariance.
        wanted_m2: f64 ["m2"],
        /// Expected covariance of the method.
        achieved_m2: f64 ["m2"],
        /// Mean covariance of the realisations.
        measured_m2: f64 ["m2"],
    }
}
