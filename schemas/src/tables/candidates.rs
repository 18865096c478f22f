//! Table `candidates`.

super::table! {
    /// One row per covariance model that was a candidate in a fit.
    "candidates" CandidateRow {
        keys {
            /// Id of the fit.
            fit_id: String,
            /// Rank by AICc, from 1; the first is the fitted model.
            rank: i64,
        }
        /// Covariance model.
        model: String [""],
        /// Fitted parameters as JSON.
        parameters: String [""],
        /// Number of free parameters.
        free: i64 ["1"],
        /// Generalised sum of squares.
        chi2: Option<f64> ["1"],
        /// Akaike's corrected criterion (AICc) minus the smallest of all candidates.
        aicc_above_best: Option<f64> ["1"],
    }
}
