//! Rasters of items: those that an item reads in addition to its own, and the layout that a study chooses for those that it writes.

use crate::builder::{HEIGHTS, Heightfield};
use crate::job::{ItemRef, JobError, Work};
use crate::operations::dem::input_error;
use sastrugi_schemas::study::GeoTiff;
use sastrugi_store::dem::{self, Dem, WriteOptions};
use serde_json::Value;

/// Approximate time to write one raster cell, s.
pub const SECONDS_PER_WRITTEN_CELL: f64 = 6e-8;

/// A heightfield that an item reads in addition to its own: a factor, a friction, heights to subtract.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// The item that produces it.
    pub item: ItemRef,
    /// Memory of its values once they are read, bytes.
    pub bytes: u64,
}

impl From<&Heightfield> for Raster {
    fn from(field: &Heightfield) -> Self {
        Self { item: field.item.clone(), bytes: field.heights_bytes() }
    }
}

impl Raster {
    /// Reads its values.
    ///
    /// # Errors
    /// When the item is not a parent, or its file cannot be read.
    pub fn read(&self, work: &Work<'_>) -> Result<Dem, JobError> {
        dem::read(&work.parent(&self.item, HEIGHTS)?).map_err(input_error)
    }
}

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
