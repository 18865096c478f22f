//! Table `parameters`.

super::table! {
    /// One row per number of a run: vehicle, surface, steering and rules, defaults included.
    "parameters" ParameterRow {
        keys {
            /// Id of the traverse stage.
            traverse_id: String,
            /// Dotted name; `vehicle.` stands before the numbers of the vehicle.
            parameter: String,
        }
        /// Value as JSON.
        value: String [""],
        /// Where a number of the vehicle or the surface comes from, or that it is assumed; null for settings and for what the
        /// study changed.
        source: Option<String> [""],
    }
}
