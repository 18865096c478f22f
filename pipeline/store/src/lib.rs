//! File input and output: DEM formats, point clouds, masks, transects, altimetry, GeoJSON, pictures, vehicles as MJCF and URDF,
//! atomic writes, Parquet tables, MCAP recordings, LeRobot datasets, the release folder with its checksums, and objects in a bucket.
//!
//! The only room that depends on `arrow`, `parquet`, `mcap`, `foxglove`, `prost`, `geotiff-*`, `tiff`, `png`, `las`, `tar` and
//! `object_store`.
//! It does no analysis: heights, rows and recordings are read and written unchanged. The exceptions are gridding of point clouds
//! ([`dem::points`]), rasterising of polygons to masks ([`mask`]), decimation of meshes ([`dem::decimate`]), and resampling of
//! heights to the posts of a simulator ([`dem::simulators`]).
//!
//! A file's way through the room:
//!
//! 1. Heights are read with [`dem::read`] (rasters, and point clouds gridded to cells) or row by row with [`dem::open`]; heights along
//!    lines with [`transect::read`], single points with [`altimetry::read`].
//! 2. [`mask::read`] selects cells of a raster.
//! 3. [`dem::write()`] writes heights, [`parquet::write_table`] and [`csv::write_records`] rows, [`geojson::write_routes`] routes, and
//!    [`mcap::write_mission`] a recording.
//! 4. [`release::ReleaseBuilder`] collects the files of a study and seals them with a manifest and checksums; [`release::verify`]
//!    checks them.
//!
//! # Example
//!
//! A DEM is written and read back, and the cells of its western half are selected:
//!
//! ```
//! use sastrugi_numeric::{Geometry, Grid};
//! use sastrugi_store::dem::{self, Crs, ReadOptions, WriteOptions};
//! use sastrugi_store::mask;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let folder = tempfile::tempdir()?;
//! let (heights, outline) = (folder.path().join("dem.tif"), folder.path().join("west.geojson"));
//!
//! // Three rows of four cells of half a metre, rising eastwards, with a hole.
//! let geometry = Geometry { rows: 3, cols: 4, cell: [0.5; 2], origin: [100.0, 200.0] };
//! let mut grid = Grid::new(geometry, (0..12).map(|k| f64::from(k % 4)).collect());
//! grid.values[5] = f64::NAN;
//! dem::write(&heights, &grid, &Crs::default(), &WriteOptions::default())?;
//!
//! let back = dem::read(&heights)?;
//! assert_eq!((back.grid.geometry, back.info.dtype), (geometry, "float32"));
//! assert!(back.grid.values[5].is_nan());
//! let mut rows = dem::open(&heights, &ReadOptions::default())?;
//! assert_eq!(rows.read_rows(2..3)?.values, [0.0, 1.0, 2.0, 3.0]);
//!
//! let polygon = r#"{"type": "Polygon", "coordinates": [[[100, 200], [101, 200], [101, 202], [100, 202], [100, 200]]]}"#;
//! std::fs::write(&outline, polygon)?;
//! assert_eq!(mask::read(&outline, &geometry)?[..4], [true, true, false, false]);
//! # Ok(())
//! # }
//! ```
//!
//! # Promises
//!
//! * Same input, same bytes, on any x86-64 CPU and for any number of threads.
//! * A file appears under its name only when it is complete and on disk ([`atomic`]).
//! * Errors distinguish unusable data (`unusable_input()`) from a failing file system.

pub mod altimetry;
pub mod atomic;
pub mod csv;
pub mod dem;
pub mod digest;
pub mod file;
pub mod geojson;
mod guard;
pub mod lerobot;
pub mod mask;
pub mod mcap;
pub mod mechanism;
pub mod objects;
pub mod parquet;
pub mod picture;
pub mod release;
pub mod transect;

/// `sastrugi/<version>`: name of the program, written to every file format that has a field for it.
pub const PROGRAM: &str = concat!("sastrugi/", env!("CARGO_PKG_VERSION"));
