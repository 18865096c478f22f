//! Table `profile_psd`.

super::table! {
    /// One row per frequency band of a surface's one-dimensional power spectral density (two-sided, mean over all
    /// profiles, spatial frequency in cycles per metre).
    "profile_psd" ProfilePsdRow {
        keys {
            /// Id of the surface (table `surfaces`).
            surface_id: String,
            /// Direction of the profiles: `x` east-west, `y` north-south.
            direction: String,
            /// Number of the band, from 0.
            bin: i64,
        }
        /// Mean spatial frequency.
        frequency_cycles_m: f64 ["1/m"],
        /// Mean power spectral density.
        psd_m3: f64 ["m3"],
        /// Frequencies in the band.
        modes: i64 ["1"],
    }
}
