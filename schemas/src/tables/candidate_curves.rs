//! Table `candidate_curves`.

super::table! {
    /// One row per candidate model and lag bin of a fit: the model including the bias of detrending and trimming.
    "candidate_curves" CandidateCurveRow {
        keys {
            /// Id of the fit.
            fit_id: String,
            /// Rank of the candidate (table `candidates`).
            rank: i64,
            /// Number of the bin, from 0 (table `covariance`).
            bin: i64,
        }
        /// Mean lag of the bin.
        lag_m: f64 ["m"],
        /// Candidate model after the same detrending and trimming.
        model_m2: f64 ["m2"],
    }
}
