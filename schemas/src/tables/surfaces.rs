//! Table `surfaces`.

super::table! {
    /// One row per surface, relative to its least-squares plane: every heightfield (dem, terrain, texture), the residual of
    /// every fit, and every texture detrended and trimmed like that residual (parameters of ISO 25178-2).
    "surfaces" SurfaceRow {
        keys {
            /// Id of the heightfield, of the fit for its residual, or `<texture>.residual`.
            surface_id: String,
        }
        /// `dem`, `terrain` or `texture`; `fit` for the residual of a measured DEM; `texture_residual` for a texture detrended and trimmed like the DEM of its fit.
        stage: String [""],
        /// The fit whose window and trimming were applied; null for an unmodified heightfield.
        fit_id: Option<String> [""],
        /// Cell size east-west; slopes and extremes depend on it.
        cell_x_m: f64 ["m"],
        /// Cell size north-south.
        cell_y_m: f64 ["m"],
        /// Cells with data.
        cells: i64 ["1"],
        /// Share of cells with data.
        valid_share: f64 ["1"],
        /// Root mean square height Sq.
        sq_m: f64 ["m"],
        /// Mean absolute height Sa.
        sa_m: f64 ["m"],
        /// Skewness of the heights Ssk.
        ssk: f64 ["1"],
        /// Kurtosis of the heights Sku (3 for a normal distribution).
        sku: f64 ["1"],
        /// Highest peak Sp; it grows with the number of cells.
        sp_m: f64 ["m"],
        /// Deepest pit Sv.
        sv_m: f64 ["m"],
        /// Highest peak above deepest pit Sz.
        sz_m: f64 ["m"],
        /// Root mean square slope Sdq (central differences).
        sdq: f64 ["1"],
        /// Root mean square slope east-west.
        rms_slope_x: f64 ["1"],
        /// Root mean square slope north-south.
        rms_slope_y: f64 ["1"],
        /// Autocorrelation length Sal: the shortest distance at which the autocorrelation falls to 0.2; null if it does not.
        sal_m: f64 ["m"],
        /// Texture aspect ratio Str: that distance over the longest one; 1 for an isotropic texture, null if the autocorrelation does not fall in every direction.
        aspect_ratio: f64 ["1"],
        /// Texture direction Std: along ridges and furrows, clockwise from north, in [0, 180); meaningless if the aspect ratio is near 1.
        direction_deg: f64 ["deg"],
        /// Hurst exponent from the structure function along x and y.
        hurst_exponent: f64 ["1"],
        /// Jackknife standard error of the Hurst exponent.
        hurst_standard_error: f64 ["1"],
        /// Shortest lag used for the Hurst exponent.
        hurst_lag_min_m: f64 ["m"],
        /// Longest lag used for the Hurst exponent.
        hurst_lag_max_m: f64 ["m"],
        /// Structure exponent zeta(1): growth of the mean absolute increments with the lag (1 cell to an eighth of the shorter side); q H for a monofractal, concave in q for a multifractal.
        zeta_1: f64 ["1"],
        /// Jackknife standard error of zeta(1).
        zeta_1_standard_error: f64 ["1"],
        /// Structure exponent zeta(2): growth of the mean second power of absolute increments with the lag.
        zeta_2: f64 ["1"],
        /// Jackknife standard error of zeta(2).
        zeta_2_standard_error: f64 ["1"],
        /// Structure exponent zeta(3): growth of the mean third power of absolute increments with the lag.
        zeta_3: f64 ["1"],
        /// Jackknife standard error of zeta(3).
        zeta_3_standard_error: f64 ["1"],
        /// Structure exponent zeta(4): growth of the mean fourth power of absolute increments with the lag.
        zeta_4: f64 ["1"],
        /// Jackknife standard error of zeta(4).
        zeta_4_standard_error: f64 ["1"],
    }
}
