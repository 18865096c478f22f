//! Table `psd`.

super::table! {
    /// One row per frequency bin of a heightfield's radially averaged two-dimensional power spectral density (two-sided,
    /// spatial frequency in cycles per metre).
    "psd" PsdRow {
        keys {
            /// Id of the surface (table `surfaces`).
            surface_id: String,
            /// Number of the bin, from 0.
            bin: i64,
        }
        /// Mean spatial frequency of the bin.
        frequency_cycles_m: f64 ["1/m"],
        /// Mean power spectral density.
        psd_m4: f64 ["m4"],
        /// Modes in the bin.
        modes: i64 ["1"],
    }
}
