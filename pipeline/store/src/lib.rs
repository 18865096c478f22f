//! Files: DEM formats, point clouds, masks, transects, altimetry, GeoJSON, pictures, vehicles as MJCF and URDF, opening and atomic writes,
//! Parquet tables, MCAP recordings, and the release folder with its checksums.
//!
//! The only room that names `arrow`, `parquet`, `mcap`, `foxglove`, `prost`, `geotiff-*`, `tiff`, `png`, `las` and `tar`. Nothing
//! here computes: heights, rows and recordings come in and go out as they are. Only point clouds are gridded
//! ([`dem::points`]), polygons made masks ([`mask`]), meshes decimated ([`dem::decimate`]), and heights laid on the posts that a simulator takes ([`dem::simulators`]).
//!
//! * Same input, same bytes, on any x86-64 CPU and for any number of threads.
//! * A file appears under its name only when it is complete and on disk ([`atomic`]).
//! * Errors tell data that cannot be used (`unusable_input()`) from a file system that failed.

pub mod altimetry;
pub mod atomic;
pub mod csv;
pub mod dem;
pub mod digest;
pub mod file;
pub mod geojson;
pub mod mask;
pub mod mcap;
pub mod mechanism;
pub mod parquet;
pub mod picture;
pub mod release;
pub mod transect;

/// `sastrugi/<version>`: the name of the program in every file that has a place for it.
pub const PROGRAM: &str = concat!("sastrugi/", env!("CARGO_PKG_VERSION"));
