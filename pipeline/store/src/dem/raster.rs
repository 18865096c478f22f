//! The common form of a raster of heights, with its options and errors.

use super::band::Values;
use super::crs::Crs;
use super::mesh::Decimation;
use crate::atomic::{self, Target};
use sastrugi_numeric::{Geometry, Grid};
use std::io;
use std::path::{Path, PathBuf};

/// Most cells of a raster: 2 GiB of heights in memory.
pub const MAX_CELLS: u64 = 1 << 28;
/// Value for no data in formats that need a number.
pub const NO_DATA: f64 = -9999.0;

/// A raster that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Dem {
    /// Heights, m; `NaN` means no data.
    pub grid: Grid,
    /// Metadata of the file.
    pub info: DemInfo,
}

/// Metadata of a raster file.
#[derive(Clone, Debug, PartialEq)]
pub struct DemInfo {
    /// File format.
    pub format: Format,
    /// Type of the stored values, as rasterio and numpy name it: `float32`, `int16` ...
    pub dtype: &'static str,
    /// Value for no data, if the file defines one.
    pub nodata: Option<f64>,
    /// Coordinate reference system.
    pub crs: Crs,
    /// Kind of values, as stated in the file.
    pub values: Values,
    /// True if the file is georeferenced; otherwise the south-western corner is (0, 0).
    pub placed: bool,
    /// True if the values of the file are at points; the grid is then shifted by half a cell to centre them.
    pub pixel_is_point: bool,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Raster formats; `formats.rs` lists the capabilities of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// TIFF with or without GeoTIFF tags.
    GeoTiff,
    /// ESRI ASCII grid.
    EsriAscii,
    /// SRTM tile.
    Hgt,
    /// NumPy array.
    Npy,
    /// Greyscale PNG, 8 or 16 bit.
    Png,
    /// Wavefront mesh; written only.
    Obj,
    /// Binary glTF mesh; written only.
    Glb,
    /// OpenUSD mesh with collision, as text; written only.
    Usda,
    /// Point cloud, LAS or LAZ, which is gridded ([`super::points`]); read only.
    Las,
}

/// Failure to read or write a raster.
#[derive(Debug, thiserror::Error)]
pub enum DemError {
    /// The file does not exist.
    #[error("{}: no such file", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// The file is not a complete raster of heights.
    #[error("{}", sentence(path, reason))]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The grid does not fit the format, or a setting is out of range.
    #[error("{}: {reason}", path.display())]
    Unfit {
        /// The requested file.
        path: PathBuf,
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

/// What is wrong with a file; a reason that begins with its verb has the file as its subject.
fn sentence(path: &Path, reason: &str) -> String {
    let is_predicate = ["claims ", "has ", "holds ", "is "].iter().any(|verb| reason.starts_with(verb));
    let colon = if is_predicate { "" } else { ":" };
    format!("{}{colon} {reason}", path.display())
}

impl DemError {
    /// True if the cause is the given data (missing or unusable), not the file system.
    pub fn unusable_input(&self) -> bool {
        matches!(self, Self::Missing { .. } | Self::Unusable { .. })
    }

    pub(crate) fn reading(path: &Path, source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::NotFound => Self::Missing { path: path.to_owned() },
            io::ErrorKind::IsADirectory => Refusal::new("is a folder, not a raster").about(path),
            io::ErrorKind::InvalidInput => Refusal::new(source.to_string()).about(path),
            _ => Self::Io { path: path.to_owned(), source },
        }
    }
}

/// Reason why input or a request is unusable.
#[derive(Debug, thiserror::Error)]
#[error("{reason}")]
pub(crate) struct Refusal {
    reason: String,
    /// The cause is a lack of memory, not the file.
    lacks_memory: bool,
}

impl Refusal {
    pub(crate) fn new(reason: impl Into<String>) -> Self {
        Self { reason: reason.into(), lacks_memory: false }
    }

    /// A file that may be read once there is more memory.
    pub(crate) fn lack_of_memory(reason: impl Into<String>) -> Self {
        Self { reason: reason.into(), lacks_memory: true }
    }

    /// Error that blames the file.
    pub(crate) fn about(self, path: &Path) -> DemError {
        let (path, reason) = (path.to_owned(), self.reason);
        if self.lacks_memory {
            return DemError::Io { path, source: io::Error::new(io::ErrorKind::OutOfMemory, reason) };
        }
        DemError::Unusable { path, reason }
    }

    /// Error that blames the request.
    pub(crate) fn unfit(self, path: &Path) -> DemError {
        DemError::Unfit { path: path.to_owned(), reason: self.reason }
    }
}

/// Information that the file itself does not contain.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReadOptions {
    /// Cell size east-west and north-south, m, for formats without one (.npy, .png, TIFF without GeoTIFF tags), and the size
    /// of the square cells of a gridded point cloud.
    pub cell_m: Option<[f64; 2]>,
}

/// Size of a raster or point cloud according to its header, before decoding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claimed {
    /// Number of cells.
    pub cells: u64,
    /// Number of points; 0 for a raster.
    pub points: u64,
    /// Smaller side of a cell, m, if known from the header or the caller.
    pub cell_m: Option<f64>,
    /// Shape and position of a raster, in its own units, if known from the header or the caller; identical to those obtained by
    /// reading it.
    pub geometry: Option<Geometry>,
    /// True if coordinates are in degrees.
    pub geographic: bool,
}

impl Claimed {
    /// A raster with a georeferenced header.
    pub(super) fn raster(geometry: Geometry, geographic: bool) -> Self {
        let cell_m = (!geographic).then(|| geometry.cell[0].min(geometry.cell[1]));
        Self { cells: geometry.len() as u64, points: 0, cell_m, geometry: Some(geometry), geographic }
    }

    /// A raster or a point cloud of which only the size is known.
    pub fn size(cells: u64, points: u64, cell_m: Option<f64>) -> Self {
        Self { cells, points, cell_m, geometry: None, geographic: false }
    }
}

/// Compression of a written GeoTIFF.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// Uncompressed.
    None,
    /// Deflate with predictor.
    #[default]
    Deflate,
    /// Zstandard with predictor.
    Zstd,
}

/// How a raster is written.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Compression of a GeoTIFF; ignored for other formats.
    pub compression: Compression,
    /// Cloud-optimised GeoTIFF (COG): with overviews, laid out so that parts can be read over a network.
    pub cloud_optimised: bool,
    /// Kind of values.
    pub values: Values,
    /// For meshes, the decimation of the grid ([`super::decimate`]).
    pub decimation: Option<Decimation>,
}

/// Geometry of a raster without georeferencing, with a note if its cell size is unknown.
pub(super) fn unplaced(rows: usize, cols: usize, options: &ReadOptions, notes: &mut Vec<String>) -> Geometry {
    let cell = options.cell_m.unwrap_or_else(|| {
        notes.push("the file has no cell size; 1 m is assumed".to_owned());
        [1.0; 2]
    });
    Geometry { rows, cols, cell, origin: [0.0; 2] }
}

/// Writes a complete file.
pub(super) fn save(target: Target<'_>, bytes: &[u8]) -> Result<(), DemError> {
    atomic::write(target, bytes).map_err(|source| DemError::Io { path: target.path.to_owned(), source })
}
