//! How a study asks for the rasters of its release to be packed.

use sastrugi_schemas::study::GeoTiff;
use sastrugi_store::dem::WriteOptions;
use serde_json::Value;

/// Rough time of writing a cell of a raster, s.
pub const SECONDS_PER_WRITTEN_CELL: f64 = 1e-7;

/// How the heights of a release are written.
pub fn raster_options(geotiff: GeoTiff) -> WriteOptions {
    WriteOptions { cloud_optimised: geotiff == GeoTiff::Cog, ..WriteOptions::default() }
}

/// What [`crate::job::Job::packing`] says of rasters written with [`raster_options`].
pub fn raster_packing(geotiff: GeoTiff) -> Value {
    match geotiff {
        GeoTiff::Plain => Value::Null,
        GeoTiff::Cog => "cog".into(),
    }
}
