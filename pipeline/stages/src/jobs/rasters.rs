//! Raster packing: the compression and layout that a study chooses for the rasters of its release.

use sastrugi_schemas::study::GeoTiff;
use sastrugi_store::dem::WriteOptions;
use serde_json::Value;

/// Approximate time to write one raster cell, s.
pub const SECONDS_PER_WRITTEN_CELL: f64 = 6e-8;

/// Options for writing the heights of a release.
pub fn raster_options(geotiff: GeoTiff) -> WriteOptions {
    WriteOptions { cloud_optimised: geotiff == GeoTiff::Cog, ..WriteOptions::default() }
}

/// The value of [`crate::job::Job::packing`] for rasters written with [`raster_options`].
pub fn raster_packing(geotiff: GeoTiff) -> Value {
    match geotiff {
        GeoTiff::Plain => Value::Null,
        GeoTiff::Cog => "cog".into(),
    }
}
