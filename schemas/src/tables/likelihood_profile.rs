//! Table `likelihood_profile`.

super::table! {
    /// One row per fixed range of a fit, with all other parameters refitted: the profile likelihood.
    "likelihood_profile" LikelihoodProfileRow {
        keys {
            /// Id of the fit.
            fit_id: String,
            /// Number of the point, from 0.
            point: i64,
        }
        /// Fixed range.
        range_m: f64 ["m"],
        /// Rise of the generalised sum of squares above its minimum; 3.84 is the limit of a 95 % interval if the model is right.
        chi2_rise: f64 ["1"],
    }
}
