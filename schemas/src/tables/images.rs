//! Table `images`.

super::table! {
    /// One row per rendered image.
    "images" ImageRow {
        keys {
            /// Id of the image: that of its item, with the swept values and, where it has several surfaces, the surface.
            image_id: String,
        }
        /// Id of the item in the study.
        item_id: String [""],
        /// What differs from the item's plain image: the swept parameters; null for the plain one.
        variant: Option<String> [""],
        /// Id of the surface.
        surface_id: String [""],
        /// Label of the surface.
        group: Option<String> [""],
        /// Camera: `nadir`, `parallel` or `pinhole`.
        camera: String [""],
        /// Azimuth that the light comes from, clockwise from north.
        sun_azimuth_deg: f64 ["deg"],
        /// Elevation of the sun above the horizon.
        sun_elevation_deg: f64 ["deg"],
        /// Rows of the image.
        rows: i64 ["1"],
        /// Columns of the image.
        cols: i64 ["1"],
        /// Pixel size across the rays; null for a pinhole.
        pixel_m: f64 ["m"],
        /// Factor on the brightness.
        exposure: f64 ["1"],
        /// Brightness (I/F) added everywhere.
        haze: f64 ["1"],
        /// Relative standard deviation of the noise.
        noise_relative: f64 ["1"],
        /// Absolute standard deviation of the noise (I/F).
        noise_absolute: f64 ["1"],
        /// Rays along a side of a pixel.
        samples: i64 ["1"],
        /// Whether the surface has a map of its albedo.
        has_albedo_map: bool [""],
        /// Mean brightness (I/F) of the pixels that see ground.
        mean_brightness: f64 ["1"],
        /// Share of the ground seen that lies in shadow, cast or turned away from the sun, 0 to 1.
        share_in_shadow: f64 ["1"],
        /// Share of the image that sees no ground, 0 to 1.
        share_without_ground: f64 ["1"],
        /// Brightness (I/F) that the PNG shows white.
        png_white: f64 ["1"],
        /// Image in the release, GeoTIFF; `.json` and `.png` beside it have its name.
        path: String [""],
    }
}
