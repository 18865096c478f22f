//! Elevation rasters of many formats, and point clouds gridded to one ([`points`]), read to one form and written
//! from it.
//!
//! Heights are metres as the file states them; `NaN` stands for no data. Cells follow the grid convention of
//! `sastrugi-numeric`: a PixelIsPoint raster is shifted by half a cell so that its posts become cell centres. What is
//! read equals what GDAL reads, value for value.
//!
//! Every size a file claims is checked against [`MAX_CELLS`] and against the bytes that are there before memory is
//! asked for.

mod ascii;
mod band;
mod blocks;
mod checks;
mod classes;
mod crs;
mod formats;
mod geotiff;
mod hgt;
mod mesh;
mod npy;
mod png;
pub mod points;
mod raster;
pub mod simulators;
mod tiff_writer;

#[cfg(test)]
mod tests;

pub use band::Values;
pub use blocks::BlockReader;
pub use classes::{read_classes, write_classes};
pub use crs::{Crs, GeoKey};
pub use formats::WRITTEN_ENDINGS;
pub use mesh::{Decimation, MeshLimits};
pub use png::{HeightScale, write_png_heights, write_png16};
pub use raster::{Claimed, Compression, Dem, DemError, DemInfo, Format, MAX_CELLS, NO_DATA, ReadOptions, WriteOptions};

pub(crate) use ascii::looks_like as is_grid_text;
pub(crate) use raster::Refusal;

use crate::atomic::Target;
use checks::{check_place, checked};
use formats::READ_FORMATS;
use points::GridSettings;
use raster::save;
use sastrugi_numeric::Grid;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Number of the first bytes of a file, which tell what is not read whole.
const FIRST_BYTES: u64 = 4;

/// Reads a raster.
///
/// # Errors
/// See [`DemError`]: a missing file, one that is no single-band raster of heights, one without any data, or one whose
/// cells are rotated.
pub fn read(path: &Path) -> Result<Dem, DemError> {
    read_with(path, &ReadOptions::default())
}

/// Reads a raster with what the caller knows about it. A point cloud becomes the mean of each cell, without filling.
///
/// # Errors
/// As [`read`].
pub fn read_with(path: &Path, options: &ReadOptions) -> Result<Dem, DemError> {
    read_gridded(path, options, &GridSettings::default())
}

/// As [`read_with`], with the settings by which a point cloud is gridded. The cell size of a cloud is that of the settings,
/// or else that of the options.
///
/// # Errors
/// As [`read`]; also [`DemError::Unfit`] when a setting is out of range, or the file is a raster, which takes none.
pub fn read_gridded(path: &Path, options: &ReadOptions, settings: &GridSettings) -> Result<Dem, DemError> {
    let reading = |e| DemError::reading(path, e);
    let (mut file, mut bytes) = opened(path).map_err(reading)?;
    let codec = formats::of_start(&bytes);
    if let Some(grid) = codec.and_then(|codec| codec.grid) {
        return grid(path, file, options, settings);
    }
    if (GridSettings { cell_m: None, ..*settings }) != GridSettings::default() {
        let reason = "is no point cloud; statistic, filling and ground points are for .las and .laz";
        return Err(Refusal::new(reason).unfit(path));
    }
    let dem = match codec.and_then(|codec| codec.stream) {
        Some(stream) => stream(path, options)?,
        None => {
            file.read_to_end(&mut bytes).map_err(reading)?;
            parse(path, bytes, options).map_err(|refusal| refusal.about(path))?
        }
    };
    checked(dem).map_err(|refusal| refusal.about(path))
}

/// A file behind its first bytes, and these.
fn opened(path: &Path) -> io::Result<(File, Vec<u8>)> {
    let mut file = crate::file::open(path)?;
    let mut first = Vec::new();
    file.by_ref().take(FIRST_BYTES).read_to_end(&mut first)?;
    Ok((file, first))
}

fn parse(path: &Path, bytes: Vec<u8>, options: &ReadOptions) -> Result<Dem, Refusal> {
    if bytes.is_empty() {
        return Err(Refusal::new("the file is empty"));
    }
    match formats::of_raster(path, &bytes).and_then(|codec| codec.parse) {
        Some(parse) => parse(path, bytes, options),
        None => Err(Refusal::new(format!("is no raster that can be read; {READ_FORMATS} can"))),
    }
}

/// Opens a raster for reading rows.
///
/// # Errors
/// As [`read`]; what is wrong with the cells themselves is found when they are read.
pub fn open(path: &Path, options: &ReadOptions) -> Result<BlockReader, DemError> {
    let (_, first) = opened(path).map_err(|e| DemError::reading(path, e))?;
    match formats::of_raster(path, &first).and_then(|codec| codec.open) {
        Some(open) => open(path, options),
        None => read_with(path, options).map(|dem| BlockReader::of_dem(path, dem)),
    }
}

/// What a file claims of its size and place; `None` for files whose header cannot be read.
pub fn claimed(path: &Path, options: &ReadOptions) -> Option<Claimed> {
    let (file, first) = opened(path).ok()?;
    let claim = formats::of_header(path, &first)?.claimed?;
    claim(path, file, options).filter(|claimed| claimed.geometry.is_none_or(|g| check_place(&g).is_ok()))
}

/// Writes heights in the format of the name's ending: `.tif` (float32, tiles of 256, no data -9999, PixelIsArea),
/// `.asc`, `.npy` (float64), `.hgt` (whole metres, 1201 or 3601 posts), `.png` (16 bit, scaled), or `.obj`, `.glb`, `.usda`
/// (meshes). Returns sentences on what the format lost.
///
/// # Errors
/// [`DemError::Unfit`] when the format cannot hold the grid, [`DemError::Io`] when the file cannot be written.
pub fn write<'a>(
    target: impl Into<Target<'a>>,
    grid: &Grid,
    crs: &Crs,
    options: &WriteOptions,
) -> Result<Vec<String>, DemError> {
    let target = target.into();
    let (bytes, notes) = render(target.path, grid, crs, options).map_err(|refusal| refusal.unfit(target.path))?;
    save(target, &bytes)?;
    Ok(notes)
}

/// Decimates the mesh of a grid in metres, to be written with [`WriteOptions::decimation`].
///
/// # Errors
/// [`DemError::Unfit`] for a limit out of range or one that the rims of holes exceed, for a grid without three neighbouring cells with
/// data, and for one that is too large for a mesh.
pub fn decimate(path: &Path, grid: &Grid, limits: &MeshLimits) -> Result<Decimation, DemError> {
    Decimation::new(grid, limits).map_err(|refusal| refusal.unfit(path))
}

/// Most memory that [`write()`] takes for a GeoTIFF beside its grid, bytes.
pub fn writing_bytes(cells: u64) -> u64 {
    tiff_writer::MEMORY_PER_CELL * cells
}

/// The bytes that [`write()`] would put into a file of that name, and sentences on what the format lost.
///
/// # Errors
/// [`DemError::Unfit`] when the format cannot hold the grid.
pub fn encode(name: &Path, grid: &Grid, crs: &Crs, options: &WriteOptions) -> Result<(Vec<u8>, Vec<String>), DemError> {
    render(name, grid, crs, options).map_err(|refusal| refusal.unfit(name))
}

/// The bytes of a file, and sentences on what the format lost.
fn render(path: &Path, grid: &Grid, crs: &Crs, options: &WriteOptions) -> Result<(Vec<u8>, Vec<String>), Refusal> {
    let unknown = || Refusal::new(format!("the ending names no DEM format; {WRITTEN_ENDINGS} do"));
    let codec = formats::of_name(path).ok_or_else(unknown)?;
    let render = codec.render.ok_or_else(|| Refusal::new("point clouds are read, not written"))?;
    render(path, grid, crs, options)
}
