//! Table `parameters`.

super::table! {
    /// One row per parameter of a traverse: vehicle, surface, steering and rules, including defaults.
    "parameters" ParameterRow {
        keys {
            /// Id of the traverse stage.
            traverse_id: String,
            /// Dotted name; parameters of the vehicle begin with `vehicle.`.
            parameter: String,
        }
        /// Value as JSON.
        value: String [""],
        /// Source of a value of the vehicle or the surface, or a note that it is assumed; null for settings and for values that the
        /// study changed.
        source: Option<String> [""],
    }
}
