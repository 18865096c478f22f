//! A raster of heights: what all formats read to and write from, and why one does not.

use super::band::Values;
use super::crs::Crs;
use super::mesh::Decimation;
use crate::atomic::{self, Target};
use sastrugi_numeric::{Geometry, Grid};
use std::io;
use std::path::{Path, PathBuf};

/// Most cells of a raster: 2 GiB of heights in memory.
pub const MAX_CELLS: u64 = 1 << 28;
/// Heights without data in the formats that need a number for it.
pub const NO_DATA: f64 = -9999.0;

/// A raster that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Dem {
    /// Heights, m; `NaN` without data.
    pub grid: Grid,
    /// What the file says about them.
    pub info: DemInfo,
}

/// What a raster file says beside its heights.
#[derive(Clone, Debug, PartialEq)]
pub struct DemInfo {
    /// File format.
    pub format: Format,
    /// Type of the stored values, as rasterio and numpy name it: `float32`, `int16` ...
    pub dtype: &'static str,
    /// Value that stands for no data, when the file names one.
    pub nodata: Option<f64>,
    /// Coordinate reference system.
    pub crs: Crs,
    /// What the values are, as the file says.
    pub values: Values,
    /// True when the file says where the raster lies; the south-western corner of others is (0, 0).
    pub placed: bool,
    /// True when the file places its values at points (and the grid was shifted by half a cell to centre them).
    pub pixel_is_point: bool,
    /// Sentences a user must know.
    pub notes: Vec<String>,
}

/// Raster formats; `formats.rs` says what each can do.
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

/// Why a raster was not read or written.
#[derive(Debug, thiserror::Error)]
pub enum DemError {
    /// There is no such file.
    #[error("{}: no such file", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// The file is not a raster of heights, or not a whole one.
    #[error("{}: {reason}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The grid does not fit the format, or a setting is out of range.
    #[error("{}: {reason}", path.display())]
    Unfit {
        /// The file that was asked for.
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

impl DemError {
    /// True when the data that was given is the cause (missing or unusable), not the file system.
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

/// Why bytes are no usable raster.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Refusal(String);

impl Refusal {
    pub(crate) fn new(reason: impl Into<String>) -> Self {
        Self(reason.into())
    }

    /// The file is at fault.
    pub(crate) fn about(self, path: &Path) -> DemError {
        DemError::Unusable { path: path.to_owned(), reason: self.0 }
    }

    /// What was asked for is at fault.
    pub(crate) fn unfit(self, path: &Path) -> DemError {
        DemError::Unfit { path: path.to_owned(), reason: self.0 }
    }
}

/// What a caller knows about a file that the file does not say.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReadOptions {
    /// Cell size east-west and north-south, m, for formats that carry none (.npy, .png, TIFF without GeoTIFF tags), and
    /// the size of the square cells of a gridded point cloud.
    pub cell_m: Option<[f64; 2]>,
}

/// What the header of a raster or a point cloud says of its size, nothing decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claimed {
    /// Number of cells.
    pub cells: u64,
    /// Number of points; 0 for a raster.
    pub points: u64,
    /// Smaller side of a cell, m, where the header or the caller says.
    pub cell_m: Option<f64>,
    /// Shape and place of a raster, in its own units, where the header or the caller says: those that reading it gives.
    pub geometry: Option<Geometry>,
    /// True when coordinates are degrees.
    pub geographic: bool,
}

impl Claimed {
    /// A raster whose header says where it lies.
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
    /// As they are.
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
    /// Compression of a GeoTIFF; other formats have one way.
    pub compression: Compression,
    /// A GeoTIFF with overviews, laid out so that a part can be read over a network (COG).
    pub cloud_optimised: bool,
    /// What its values are.
    pub values: Values,
    /// A decimation of the grid that is written, for meshes ([`super::decimate`]).
    pub decimation: Option<Decimation>,
}

/// Geometry of a raster that does not say where it lies, with a note where nobody knows the size of its cells.
pub(super) fn unplaced(rows: usize, cols: usize, options: &ReadOptions, notes: &mut Vec<String>) -> Geometry {
    let cell = options.cell_m.unwrap_or_else(|| {
        notes.push("the file states no cell size; 1 m is assumed".to_owned());
        [1.0; 2]
    });
    Geometry { rows, cols, cell, origin: [0.0; 2] }
}

/// Writes the whole of a file.
pub(super) fn save(target: Target<'_>, bytes: &[u8]) -> Result<(), DemError> {
    atomic::write(target, bytes).map_err(|source| DemError::Io { path: target.path.to_owned(), source })
}
