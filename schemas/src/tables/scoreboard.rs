//! Tables `scoreboard` and `scoreboard_covariance`.

super::table! {
    /// One row per synthesis method of a texture with `methods`: what the method promises, and what a few realisations show.
    "scoreboard" ScoreRow {
        keys {
            /// Id of the texture.
            texture_id: String,
            /// Synthesis method.
            method: String,
        }
        /// Largest error of the covariance on average, as a share of the variance.
        covariance_error_max: f64 ["1"],
        /// Root mean square error of the covariance on average, as a share of the variance.
        covariance_error_rms: f64 ["1"],
        /// Realisations that were made.
        realisations: i64 ["1"],
        /// Mean of the realisations' variances, as a share of the variance asked for.
        variance_mean: f64 ["1"],
        /// Standard deviation of the realisations' variances, as a share of the variance asked for.
        variance_spread: f64 ["1"],
        /// Range across the long axis over range along it that was asked for.
        ratio_wanted: f64 ["1"],
        /// The same as the realisations have it.
        ratio_found: f64 ["1"],
        /// Mean square step across the tile's edges over that between neighbours inside: 1 without a seam.
        seam_jump_ratio: f64 ["1"],
        /// Predicted arithmetic operations of one realisation.
        operations: f64 ["1"],
        /// Predicted working memory.
        memory_bytes: f64 ["B"],
        /// Why the method was not used; empty when it was.
        refused: String [""],
    }
}

super::table! {
    /// One row per lag along rows of a method of a scoreboard: covariance asked for and made.
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
        /// Covariance asked for.
        wanted_m2: f64 ["m2"],
        /// Covariance that the method gives on average.
        achieved_m2: f64 ["m2"],
        /// Mean covariance of the realisations.
        measured_m2: f64 ["m2"],
    }
}
