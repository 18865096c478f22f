//! Tables `photoclinometry` and `photoclinometry_bands`.

super::table! {
    /// One row per surface recovered from images, with its errors if the true surface is known.
    "photoclinometry" PhotoclinometryRow {
        keys {
            /// Id of the recovered surface.
            photoclinometry_id: String,
        }
        /// Id of the item in the study.
        item_id: String [""],
        /// Swept settings that differ from the plain item; null for the plain item.
        variant: Option<String> [""],
        /// Label for statistics.
        group: Option<String> [""],
        /// Id of the surface that the images show.
        surface_id: String [""],
        /// Images.
        images: i64 ["1"],
        /// Rows of the map.
        rows: i64 ["1"],
        /// Columns of the map.
        cols: i64 ["1"],
        /// Cell size of the map.
        cell_m: f64 ["m"],
        /// Rounds of re-projection.
        rounds: i64 ["1"],
        /// Whether heights converged within the maximum number of rounds.
        converged: bool [""],
        /// RMS difference between observed brightness and that of the recovered surface over the mean brightness, in the last round.
        brightness_rms: f64 ["1"],
        /// RMS change of heights in the last round.
        change_m: f64 ["m"],
        /// Stereo points in the last round.
        stereo_points: i64 ["1"],
        /// Mean number of images in which a cell is lit.
        lit_mean: f64 ["1"],
        /// Share of the cells visible in images whose albedo is taken from neighbouring cells, 0 to 1.
        share_leaning: f64 ["1"],
        /// Median condition number of the equations of a cell.
        condition: f64 ["1"],
        /// Median multiple correlation of albedo and slopes, 0 to 1.
        albedo_slope_correlation: f64 ["1"],
        /// Estimated over assumed noise of the images; 1 if it was not estimated.
        noise_scale: f64 ["1"],
        /// RMS standard deviation of heights; null if not requested.
        height_sigma_m: f64 ["m"],
        /// Mean albedo.
        albedo_mean: f64 ["1"],
        /// Cells compared with the true surface.
        cells: Option<i64> ["1"],
        /// Normalised correlation of the shaded true and recovered surface.
        shaded_correlation: f64 ["1"],
        /// The same for the true surface averaged over the map's cells.
        shaded_correlation_ceiling: f64 ["1"],
        /// RMS error of slopes (length of the difference of gradients).
        slope_error_rms: f64 ["1"],
        /// The same for the true surface averaged over the map's cells.
        slope_error_rms_ceiling: f64 ["1"],
        /// RMS slope of the true surface.
        slope_rms: f64 ["1"],
        /// RMS error of heights, minus the mean error.
        height_error_rms_m: f64 ["m"],
        /// RMS error of heights, minus the plane through the errors.
        height_error_rms_detrended_m: f64 ["m"],
        /// RMS height of the true surface.
        height_rms_m: f64 ["m"],
        /// Recovered heights in the release, GeoTIFF; the maps (`.albedo.tif` and others) have the same name.
        path: String [""],
    }
}

super::table! {
    /// One row per octave of wavelength: true and recovered surface, minus their planes, under a Hann window.
    "photoclinometry_bands" PhotoclinometryBandRow {
        keys {
            /// Id of the recovered surface.
            photoclinometry_id: String,
            /// Number of the octave, from 0; its shortest wavelength is twice the cell size times two to this power.
            octave: i64,
        }
        /// Shortest wavelength of the band.
        wavelength_min_m: f64 ["m"],
        /// Longest wavelength of the band.
        wavelength_max_m: f64 ["m"],
        /// Fourier modes in the band.
        modes: i64 ["1"],
        /// RMS height of the true surface in the band.
        truth_rms_m: f64 ["m"],
        /// RMS height of the recovered surface in the band.
        recovered_rms_m: f64 ["m"],
        /// RMS slope (length of the gradient) of the true surface in the band, from squared heights times the squared angular wavenumber.
        truth_slope_rms: f64 ["1"],
        /// RMS slope of the recovered surface in the band.
        recovered_slope_rms: f64 ["1"],
        /// Covariance of both in the band.
        covariance_m2: f64 ["m2"],
        /// Squared coherence of both in the band, 0 to 1.
        coherence: f64 ["1"],
    }
}
