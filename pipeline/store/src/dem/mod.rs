//! Elevation rasters of many formats, and gridded point clouds ([`points`]), read into and written from one common form.
//!
//! Heights are the file's own values, in metres; `NaN` means no data. Cells follow the grid convention of
//! `sastrugi-numeric`: a PixelIsPoint raster is shifted by half a cell so that its posts become cell centres. Values are
//! identical to those that GDAL reads.
//!
//! Before memory is allocated, every size that a file claims is checked against [`MAX_CELLS`] and against the bytes actually
//! present.

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
use std::path::{Path, PathBuf};

/// Number of leading bytes read to recognise a format before the rest of the file: the signatures, and the first word of an ASCII grid.
const FIRST_BYTES: u64 = 64;
/// Memory of a raster while it is read, bytes per cell: its heights, decoded and in their final order.
const BYTES_PER_CELL: u64 = 16;

/// Reads a raster.
///
/// # Errors
/// See [`DemError`]: a file that is missing, is not a single-band raster of heights, has no data, or has rotated cells.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("a.asc");
/// std::fs::write(&path, "ncols 2\nnrows 1\nxllcorner 10\nyllcorner 20\ncellsize 0.5\nNODATA_value -1\n7.5 -1\n")?;
/// let dem = sastrugi_store::dem::read(&path)?;
/// assert_eq!((dem.grid.geometry.origin, dem.grid.geometry.cell), ([10.0, 20.0], [0.5, 0.5]));
/// assert!(dem.grid.values[0] == 7.5 && dem.grid.values[1].is_nan());
/// # Ok(())
/// # }
/// ```
pub fn read(path: &Path) -> Result<Dem, DemError> {
    read_with(path, &ReadOptions::default())
}

/// Reads a raster with options. A point cloud is gridded to the mean of each cell, without filling.
///
/// # Errors
/// As [`read`].
pub fn read_with(path: &Path, options: &ReadOptions) -> Result<Dem, DemError> {
    read_gridded(path, options, &GridSettings::default())
}

/// As [`read_with`], with settings for gridding a point cloud. The cell size of a cloud is that of the settings, or else that of
/// the options.
///
/// # Errors
/// As [`read`]; also [`DemError::Unfit`] if a setting is out of range, or is given for a raster.
pub fn read_gridded(path: &Path, options: &ReadOptions, settings: &GridSettings) -> Result<Dem, DemError> {
    let reading = |e| DemError::reading(path, e);
    let (mut file, mut bytes) = opened(path).map_err(reading)?;
    let codec = formats::of_start(&bytes);
    if let Some(grid) = codec.and_then(|codec| codec.grid) {
        return grid(path, file, options, settings);
    }
    if (GridSettings { cell_m: None, planned_cells: None, ..*settings }) != GridSettings::default() {
        let reason = "not a point cloud; statistic, filling and ground-only apply to .las and .laz";
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

/// Reads a raster whose memory was planned by [`reading_bytes`]. As [`read`], but refuses a point cloud that covers more cells than were
/// planned from its header ([`points`]).
///
/// # Errors
/// As [`read`].
pub fn read_as_claimed(path: &Path) -> Result<Dem, DemError> {
    let options = ReadOptions::default();
    let planned_cells = claimed(path, &options).map(|claimed| claimed.cells);
    read_gridded(path, &options, &GridSettings { planned_cells, ..GridSettings::default() })
}

/// Approximate memory that [`read_as_claimed`] needs, bytes, from the header and the size of the file.
///
/// # Errors
/// A file that cannot be opened.
pub fn reading_bytes(path: &Path) -> io::Result<u64> {
    let bytes = crate::file::open(path)?.metadata()?.len();
    // Other formats take at least one byte per cell.
    let claimed = claimed(path, &ReadOptions::default()).unwrap_or_else(|| Claimed::size(bytes, 0, None));
    let cells = match claimed.points {
        0 => BYTES_PER_CELL * claimed.cells,
        _ => points::SEARCH_BYTES + points::BYTES_PER_CELL * claimed.cells,
    };
    Ok(2 * bytes + cells)
}

/// Opens a file and returns it, positioned after its first bytes, with those bytes.
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
        None => Err(Refusal::new(format!("not a supported raster; supported are {READ_FORMATS}"))),
    }
}

/// Opens a raster for reading rows.
///
/// # Errors
/// As [`read`]; errors in the cells themselves are found when they are read.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_store::dem::{self, Crs, ReadOptions, WriteOptions};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("a.tif");
/// let grid = Grid::new(Geometry::square(600, 2, 1.0), (0..1200).map(f64::from).collect());
/// dem::write(&path, &grid, &Crs::default(), &WriteOptions::default())?;
/// let mut reader = dem::open(&path, &ReadOptions::default())?;
/// let (rows, block) = (reader.geometry().rows, reader.block_rows());
/// let mut sum = 0.0;
/// for first in (0..rows).step_by(block) {
///     sum += reader.read_rows(first..rows.min(first + block))?.values.iter().sum::<f64>();
/// }
/// assert_eq!((block, sum), (256, 1199.0 * 600.0));
/// # Ok(())
/// # }
/// ```
pub fn open(path: &Path, options: &ReadOptions) -> Result<BlockReader, DemError> {
    let (_, first) = opened(path).map_err(|e| DemError::reading(path, e))?;
    match formats::of_raster(path, &first).and_then(|codec| codec.open) {
        Some(open) => open(path, options),
        None => read_with(path, options).map(|dem| BlockReader::of_dem(path, dem)),
    }
}

/// Size and position according to the header; `None` if the header cannot be read.
pub fn claimed(path: &Path, options: &ReadOptions) -> Option<Claimed> {
    let (file, first) = opened(path).ok()?;
    let claim = formats::of_header(path, &first)?.claimed?;
    claim(path, file, options).filter(|claimed| claimed.geometry.is_none_or(|g| check_place(&g).is_ok()))
}

/// The file beside a raster that [`read`] opens too: the `.prj` file of an ESRI ASCII grid, whatever the name of the grid.
pub fn sidecar(path: &Path) -> Option<PathBuf> {
    let (_, first) = opened(path).ok()?;
    let is_grid = formats::of_header(path, &first).is_some_and(|codec| codec.format == Format::EsriAscii);
    Some(ascii::prj_beside(path)).filter(|prj| is_grid && prj.exists())
}

/// Writes heights in the format given by the file name's ending: `.tif` (float32, tiles of 256, no data -9999, PixelIsArea),
/// `.asc`, `.npy` (float64), `.hgt` (whole metres, 1201 or 3601 posts), `.png` (16 bit, scaled), or `.obj`, `.glb`, `.usda`
/// (meshes). Returns notes on what the format loses.
///
/// # Errors
/// [`DemError::Unfit`] if the format cannot represent the grid, [`DemError::Io`] if the file cannot be written.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_store::dem::{Crs, WriteOptions, read, write};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("a.tif");
/// let grid = Grid::new(Geometry::square(2, 3, 0.5), vec![1.5, 2.0, f64::NAN, -0.25, 0.0, 7.0]);
/// write(&path, &grid, &Crs::default(), &WriteOptions::default())?;
/// let again = read(&path)?.grid;
/// assert_eq!((again.geometry, again.at(1, 0)), (grid.geometry, -0.25));
/// assert!(again.at(0, 2).is_nan());
/// # Ok(())
/// # }
/// ```
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

/// Decimates the mesh of a grid in metres, for writing with [`WriteOptions::decimation`].
///
/// # Errors
/// [`DemError::Unfit`] for a limit that is out of range or that outline and hole rims alone exceed, for a grid without three
/// neighbouring cells with data, and for a grid that is too large for a mesh.
pub fn decimate(path: &Path, grid: &Grid, limits: &MeshLimits) -> Result<Decimation, DemError> {
    Decimation::new(grid, limits).map_err(|refusal| refusal.unfit(path))
}

/// Upper bound on the memory that [`write()`] needs for a GeoTIFF in addition to the grid, bytes.
pub fn writing_bytes(cells: u64) -> u64 {
    tiff_writer::MEMORY_PER_CELL * cells
}

/// The bytes that [`write()`] would write to a file of that name, and notes on what the format loses.
///
/// # Errors
/// [`DemError::Unfit`] if the format cannot represent the grid.
pub fn encode(name: &Path, grid: &Grid, crs: &Crs, options: &WriteOptions) -> Result<(Vec<u8>, Vec<String>), DemError> {
    render(name, grid, crs, options).map_err(|refusal| refusal.unfit(name))
}

/// The bytes of a file, and notes on what the format loses.
fn render(path: &Path, grid: &Grid, crs: &Crs, options: &WriteOptions) -> Result<(Vec<u8>, Vec<String>), Refusal> {
    let unknown = || Refusal::new(format!("unknown extension; DEMs are written as {WRITTEN_ENDINGS}"));
    let codec = formats::of_name(path).ok_or_else(unknown)?;
    let render = codec.render.ok_or_else(|| Refusal::new("point clouds can be read but not written"))?;
    render(path, grid, crs, options)
}
