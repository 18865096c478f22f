//! Table `terrains`.

super::table! {
    /// One row per heightfield of the release: generated terrains, measured DEMs and textures.
    "terrains" TerrainRow {
        keys {
            /// Id of the terrain.
            terrain_id: String,
        }
        /// Label for statistics.
        group: Option<String> [""],
        /// Swept parameters that differ from other terrains of the group, such as `z_scale_percent = 1.0`; null for plain terrains.
        variant: Option<String> [""],
        /// `train`, `validation` or `test` (`[study] split`); null if the study has no splits or leaves this terrain out.
        split: Option<String> [""],
        /// `terrain`, `dem` or `texture`: the stage that produced it.
        stage: String [""],
        /// Generator, or the file format of a measured DEM.
        kind: String [""],
        /// All parameters after checking, as JSON.
        params: String [""],
        /// Rows (north to south).
        rows: i64 ["1"],
        /// Columns (west to east).
        cols: i64 ["1"],
        /// Cell size east-west.
        cell_x_m: f64 ["m"],
        /// Cell size north-south.
        cell_y_m: f64 ["m"],
        /// Share of cells with data.
        valid_share: f64 ["1"],
        /// Lowest height.
        height_min_m: f64 ["m"],
        /// Highest height.
        height_max_m: f64 ["m"],
        /// Highest minus lowest height.
        relief_m: f64 ["m"],
        /// Standard deviation of the heights about their mean.
        rms_height_m: f64 ["m"],
        /// Skewness of the heights.
        skewness: f64 ["1"],
        /// Kurtosis of the heights (3 for a normal distribution).
        kurtosis: f64 ["1"],
        /// Root mean square of the gradient's magnitude (central differences).
        rms_slope: f64 ["1"],
        /// Standard deviation of the heights after a centred moving average of `band_window_m` is removed.
        band_rms_m: f64 ["m"],
        /// Window of that moving average.
        band_window_m: f64 ["m"],
        /// Share of low roughness, excluding the border.
        share_low: f64 ["1"],
        /// Share of semi roughness, excluding the border.
        share_semi: f64 ["1"],
        /// Share of high roughness, excluding the border.
        share_high: f64 ["1"],
        /// Border excluded from the shares.
        share_border_m: f64 ["m"],
        /// Slope of the radially averaged 2-D power spectral density in log-log axes.
        psd_slope: f64 ["1"],
        /// Label of the random stream.
        stream: Option<String> [""],
        /// Heightfield in the release.
        path: String [""],
    }
}
