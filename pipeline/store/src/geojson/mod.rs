//! GeoJSON in a DEM's own coordinates: polygons in (for masks and obstacles), routes out.
//!
//! RFC 7946 knows longitudes and latitudes on WGS 84 only. Files here hold the DEM's x and y, as those of its predecessor (GeoJSON 1.0,
//! 2008) may; what is written names the coordinate reference system the same way (`crs`), which GDAL and QGIS read.

pub(crate) mod polygons;
mod routes;

#[cfg(test)]
mod tests;

pub use routes::{Route, write_routes};

use std::io;
use std::path::PathBuf;

/// Why GeoJSON was not read or written.
#[derive(Debug, thiserror::Error)]
pub enum GeoJsonError {
    /// The routes cannot be put into GeoJSON.
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
