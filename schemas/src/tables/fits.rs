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
        /// Range b of the covariance model, along the long axis; for the exponential, the covariance is sigma^2 exp(-lag / b). Not given for
        /// `self_affine` or a sum of terms.
        range_m: f64 ["m"],
        /// Nugget (white) variance.
        nugget_m2: f64 ["m2"],
        /// sigma^2 / b, which is identified even if neither sigma nor b is.
        sigma2_over_range_m: f64 ["m"],
        /// True window of the moving average (an odd number of cells), east-west.
        window_x_m: f64 ["m"],
        /// True window of the moving average (an odd number of cells), north-south.
        window_y_m: f64 ["m"],
        /// Share of residuals trimmed.
        trim_level: f64 ["1"],
        /// Residuals beyond this were trimmed.
        trim_threshold_m: f64 ["m"],
        /// Share of the DEM's cells used for the covariance.
        used_share: f64 ["1"],
        /// Root mean square misfit of the covariance bins.
        misfit_m2: f64 ["m2"],
        /// Range across the long axis over range along it; 1 for an isotropic model.
        ratio: f64 ["1"],
        /// Direction of the long axis, clockwise from north.
        azimuth_deg: f64 ["deg"],
        /// Level of the intervals.
        interval_level: f64 ["1"],
        /// Replicates of the parametric bootstrap; 0 without intervals.
        replicates: i64 ["1"],
        /// Lower end of the interval of sigma (profile likelihood if open, otherwise bootstrap); 0 if open.
        sigma_low_m: f64 ["m"],
        /// Upper end of the interval of sigma (profile likelihood if open, otherwise bootstrap); infinite if open.
        sigma_high_m: f64 ["m"],
        /// Lower end of the interval of b (profile likelihood if open, otherwise bootstrap); 0 if open.
        range_low_m: f64 ["m"],
        /// Upper end of the interval of b (profile likelihood if open, otherwise bootstrap); infinite if open.
        range_high_m: f64 ["m"],
        /// Lower end of the interval of sigma^2 / b by parametric bootstrap.
        sigma2_over_range_low_m: f64 ["m"],
        /// Upper end of the interval of sigma^2 / b by parametric bootstrap.
        sigma2_over_range_high_m: f64 ["m"],
        /// Replicates of the block bootstrap; 0 without intervals.
        block_replicates: i64 ["1"],
        /// Lower end of the interval of sigma by block bootstrap; 0 if open.
        block_sigma_low_m: f64 ["m"],
        /// Upper end of the interval of sigma by block bootstrap; infinite if open.
        block_sigma_high_m: f64 ["m"],
        /// Lower end of the interval of b by block bootstrap; 0 if open.
        block_range_low_m: f64 ["m"],
        /// Upper end of the interval of b by block bootstrap; infinite if open.
        block_range_high_m: f64 ["m"],
        /// Lower end of the interval of sigma^2 / b by block bootstrap.
        block_sigma2_over_range_low_m: f64 ["m"],
        /// Upper end of the interval of sigma^2 / b by block bootstrap.
        block_sigma2_over_range_high_m: f64 ["m"],
        /// Generalised sum of squares per degree of freedom; 1 for a model that fits.
        misfit_chi2_per_freedom: f64 ["1"],
        /// p-value of the misfit of the bins.
        misfit_p: f64 ["1"],
        /// p-value of the test of isotropy against an anisotropic texture.
        isotropy_p: f64 ["1"],
        /// Axis ratio of the anisotropic alternative.
        isotropy_ratio: f64 ["1"],
        /// Direction of its long axis, clockwise from north.
        isotropy_azimuth_deg: f64 ["deg"],
        /// p-value of the test of equal variance in all blocks of the site.
        stationarity_p: f64 ["1"],
        /// Largest over smallest standard deviation of the blocks.
        block_sigma_max_over_min: f64 ["1"],
        /// p-value of the test of a normally distributed residual.
        normality_p: f64 ["1"],
        /// Largest disagreement of fits at half and twice the window, in standard errors.
        window_disagreement_z: f64 ["1"],
        /// Standard deviation of a least-squares fit without any correction.
        naive_sigma_m: f64 ["m"],
        /// Range of that fit.
        naive_range_m: f64 ["m"],
        /// Root mean square of the residual before trimming, that is of wavelengths below the window.
        band_rms_m: f64 ["m"],
        /// Standard deviation of increments over 1 m of the self-affine surface with the same covariance; given if fits at other windows
        /// disagree.
        increment_1m_m: f64 ["m"],
        /// Its Hurst exponent.
        hurst: f64 ["1"],
        /// Standard deviation of the DEM's white noise assumed in the fit.
        noise_sigma_m: f64 ["m"],
        /// Standard deviation of spatially correlated noise.
        correlated_noise_sigma_m: f64 ["m"],
        /// Lag at which the correlation of that noise falls to 1/e.
        correlated_noise_range_m: f64 ["m"],
        /// Shortest lag at which the texture's increments exceed those of the noise; at least the cell size and the width of the point-spread
        /// function.
        effective_resolution_m: f64 ["m"],
        /// Warnings, joined by `; `.
        warnings: String [""],
    }
}
