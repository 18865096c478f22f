//! Table `images`.

super::table! {
    /// One row per rendered image.
    "images" ImageRow {
        keys {
            /// Id of the image: id of the item, with swept values and, if it has several surfaces, the surface.
            image_id: String,
        }
        /// Id of the item in the study.
        item_id: String [""],
        /// Swept parameters that differ from the item's plain image; null for the plain image.
        variant: Option<String> [""],
        /// Id of the surface.
        surface_id: String [""],
        /// Label of the surface.
        group: Option<String> [""],
        /// Camera: `nadir`, `parallel` or `pinhole`.
        camera: String [""],
        /// Azimuth of the sun, clockwise from north.
        sun_azimuth_deg: f64 ["deg"],
        /// Elevation of the sun above the horizon.
        sun_elevation_deg: f64 ["deg"],
        /// Rows of the image.
        rows: i64 ["1"],
        /// Columns of the image.
        cols: i64 ["1"],
        /// Pixel size perpendicular to the rays; null for a pinhole camera.
        pixel_m: f64 ["m"],
        /// Factor on the brightness.
        exposure: f64 ["1"],
        /// Uniform additive brightness (I/F).
        haze: f64 ["1"],
        /// Relative standard deviation of the noise.
        noise_relative: f64 ["1"],
        /// Absolute standard deviation of the noise (I/F).
        noise_absolute: f64 ["1"],
        /// Rays per pixel along each side.
        samples: i64 ["1"],
        /// Whether the surface has an albedo map.
        has_albedo_map: bool [""],
        /// Mean brightness (I/F) of the pixels that see ground.
        mean_brightness: f64 ["1"],
        /// Share of the visible ground in cast or attached shadow, 0 to 1.
        share_in_shadow: f64 ["1"],
        /// Share of the image without ground, 0 to 1.
        share_without_ground: f64 ["1"],
        /// Brightness (I/F) of white in the PNG.
        png_white: f64 ["1"],
        /// Image in the release, GeoTIFF; the `.json` and `.png` have the same name.
        path: String [""],
    }
}
