//! GeoJSON in a DEM's own coordinates: reads polygons (for masks and obstacles), writes routes.
//!
//! RFC 7946 only allows longitudes and latitudes on WGS 84. Files here hold the DEM's x and y, as its predecessor (GeoJSON 1.0,
//! 2008) allows. Written files name the coordinate reference system as that version does (`crs`), which GDAL and QGIS read.

#[cfg(test)]
pub(crate) mod documents;
pub(crate) mod polygons;
mod routes;
#[cfg(test)]
mod tests;

pub use routes::{Route, write_routes};

use std::io;
use std::path::PathBuf;

/// Failure to read or write GeoJSON.
#[derive(Debug, thiserror::Error)]
pub enum GeoJsonError {
    /// The routes cannot be written as GeoJSON.
    #[error("{reason}")]
    Unfit {
        /// What does not fit.
        reason: String,
    },
    /// The file system failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What failed.
        source: io::Error,
    },
}
