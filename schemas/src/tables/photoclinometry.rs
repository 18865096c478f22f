//! Tables `photoclinometry` and `photoclinometry_bands`.

super::table! {
    /// One row per surface recovered from images, with its errors where the true surface is known.
    "photoclinometry" PhotoclinometryRow {
        keys {
            /// Id of the recovered surface.
            photoclinometry_id: String,
        }
        /// Id of the item in the study.
        item_id: String [""],
        /// What differs from the plain item: the swept settings; null for the plain one.
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
        /// Whether heights came to rest before the rounds were used up.
        converged: bool [""],
        /// Rms difference of observed brightness and that of the recovered surface over the mean brightness, in the last round.
        brightness_rms: f64 ["1"],
        /// Rms change of heights in the last round.
        change_m: f64 ["m"],
        /// Stereo points in the last round.
        stereo_points: i64 ["1"],
        /// Mean number of images that show a cell lit.
        lit_mean: f64 ["1"],
        /// Of the cells that an image shows, the share whose albedo leans on their neighbours, 0 to 1.
        share_leaning: f64 ["1"],
        /// Median condition number of the equations of a cell.
        condition: f64 ["1"],
        /// Median multiple correlation of albedo and slopes, 0 to 1.
        albedo_slope_correlation: f64 ["1"],
        /// Noise of the images over the noise assumed; 1 where it was not estimated.
        noise_scale: f64 ["1"],
        /// Rms standard deviation of heights; null where it was not asked for.
        height_sigma_m: f64 ["m"],
        /// Mean albedo.
        albedo_mean: f64 ["1"],
        /// Cells compared with the true surface.
        cells: Option<i64> ["1"],
        /// Normalised correlation of the shaded true and recovered surface.
        shaded_correlation: f64 ["1"],
        /// The same for the true surface averaged over the map's cells.
        shaded_correlation_ceiling: f64 ["1"],
        /// Rms error of slopes (length of the difference of gradients).
        slope_error_rms: f64 ["1"],
        /// The same for the true surface averaged over the map's cells.
        slope_error_rms_ceiling: f64 ["1"],
        /// Rms slope of the true surface.
        slope_rms: f64 ["1"],
        /// Rms error of heights less their mean.
        height_error_rms_m: f64 ["m"],
        /// Rms error of heights less the plane through the errors.
        height_error_rms_detrended_m: f64 ["m"],
        /// Rms height of the true surface.
        height_rms_m: f64 ["m"],
        /// Recovered heights in the release, GeoTIFF; its maps (`.albedo.tif` and others) have its name.
        path: String [""],
    }
}

super::table! {
    /// True and recovered surface by octave of wavelength, less their planes, under a Hann window.
    "photoclinometry_bands" PhotoclinometryBandRow {
        keys {
            /// Id of the recovered surface.
            photoclinometry_id: String,
            /// Number of the octave, from 0: twice the cell size times two to this power is its shortest wavelength.
            octave: i64,
        }
        /// Shortest wavelength of the band.
        wavelength_min_m: f64 ["m"],
        /// Longest wavelength of the band.
        wavelength_max_m: f64 ["m"],
        /// Fourier modes in the band.
        modes: i64 ["1"],
        /// Rms height of the true surface in the band.
        truth_rms_m: f64 ["m"],
        /// Rms height of the recovered surface in the band.
        recovered_rms_m: f64 ["m"],
        /// Rms slope of the true surface in the band: length of the gradient, from squared heights times the squared angular wavenumber.
        truth_slope_rms: f64 ["1"],
        /// Rms slope of the recovered surface in the band.
        recovered_slope_rms: f64 ["1"],
        /// Covariance of both in the band.
        covariance_m2: f64 ["m2"],
        /// Squared coherence of both in the band, 0 to 1.
        coherence: f64 ["1"],
    }
}
