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
mod crs;
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
pub use blocks::{BlockReader, open};
pub use crs::{Crs, GeoKey};
pub use png::{HeightScale, write_png_heights, write_png16};
pub use raster::{Claimed, Compression, Dem, DemError, DemInfo, Format, MAX_CELLS, NO_DATA, ReadOptions, WriteOptions};

pub(crate) use raster::Refusal;

use crate::atomic::Target;
use checks::checked;
use points::GridSettings;
use raster::save;
use sastrugi_numeric::Grid;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

/// Bytes that tell a point cloud, which is not read whole.
const SNIFFED_BYTES: u64 = 4;
/// Endings of names that [`write()`] takes.
pub const WRITTEN_ENDINGS: &str = ".tif, .asc, .hgt, .png, .npy, .obj, .glb and .usda";

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
    let mut file = File::open(path).map_err(reading)?;
    let mut bytes = Vec::new();
    file.by_ref().take(SNIFFED_BYTES).read_to_end(&mut bytes).map_err(reading)?;
    if points::looks_like(&bytes) {
        let cell_m = settings.cell_m.map_or_else(|| square_cell(path, options), |cell| Ok(Some(cell)))?;
        return Ok(points::read_open(path, file, &GridSettings { cell_m, ..*settings })?.dem);
    }
    if (GridSettings { cell_m: None, ..*settings }) != GridSettings::default() {
        let reason = "is no point cloud; statistic, filling and ground points are for .las and .laz".to_owned();
        return Err(DemError::Unfit { path: path.to_owned(), reason });
    }
    if geotiff::looks_like(&bytes) {
        return geotiff::read(path, options).and_then(|dem| checked(dem).map_err(|refusal| refusal.about(path)));
    }
    file.read_to_end(&mut bytes).map_err(reading)?;
    parse(path, bytes, options).and_then(checked).map_err(|refusal| refusal.about(path))
}

/// The claims of a GeoTIFF, PNG, LAS or LAZ file; `None` for other formats, whose files have a byte or more for a cell, and
/// for files that cannot be read.
pub fn claimed(path: &Path, options: &ReadOptions) -> Option<Claimed> {
    let mut file = File::open(path).ok()?;
    let mut first = Vec::new();
    file.by_ref().take(SNIFFED_BYTES).read_to_end(&mut first).ok()?;
    if points::looks_like(&first) {
        return points::claimed(file, options.cell_m.map(|[x, y]| x.min(y)));
    }
    match first.as_slice() {
        bytes if geotiff::looks_like(bytes) => geotiff::claimed(path, options),
        [0x89, b'P', b'N', b'G'] => png::claimed(file, options),
        _ => None,
    }
}

fn square_cell(path: &Path, options: &ReadOptions) -> Result<Option<f64>, DemError> {
    match options.cell_m {
        Some([x, y]) if x != y => {
            let reason = format!("a point cloud is gridded to square cells, not to cells of {x} x {y} m");
            Err(DemError::Unfit { path: path.to_owned(), reason })
        }
        cell => Ok(cell.map(|[side, _]| side)),
    }
}

/// True for the text of an ESRI ASCII grid.
pub(crate) fn is_grid_text(bytes: &[u8]) -> bool {
    ascii::looks_like(bytes)
}

/// The format of a file: by its first bytes, and by its name where those say nothing.
fn format_of(path: &Path, bytes: &[u8]) -> Option<Format> {
    match bytes {
        _ if geotiff::looks_like(bytes) => Some(Format::GeoTiff),
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => Some(Format::Npy),
        [0x89, b'P', b'N', b'G', ..] => Some(Format::Png),
        _ if ascii::looks_like(bytes) => Some(Format::EsriAscii),
        _ => Format::of_name(path),
    }
}

fn parse(path: &Path, bytes: Vec<u8>, options: &ReadOptions) -> Result<Dem, Refusal> {
    if bytes.is_empty() {
        return Err(Refusal::new("the file is empty"));
    }
    match format_of(path, &bytes) {
        Some(Format::GeoTiff) => geotiff::parse(bytes, options),
        Some(Format::EsriAscii) => ascii::parse(&bytes, fs::read_to_string(path.with_extension("prj")).ok().as_deref()),
        Some(Format::Hgt) => hgt::parse(path, &bytes),
        Some(Format::Npy) => npy::parse(&bytes, options),
        Some(Format::Png) => png::parse(&bytes, options),
        Some(Format::Las) => Err(Refusal::new("is no point cloud: LAS and LAZ files start with \"LASF\"")),
        Some(Format::Obj | Format::Glb | Format::Usda) | None => Err(Refusal::new(
            "is no raster that can be read; GeoTIFF, ESRI ASCII, .hgt, .npy, greyscale .png, .las and .laz can",
        )),
    }
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
    let path = target.path;
    let unfit = |refusal: Refusal| refusal.unfit(path);
    let (bytes, notes) = match Format::of_name(path) {
        Some(Format::GeoTiff) => (tiff_writer::heights(grid, crs, options).map_err(unfit)?, vec![]),
        Some(Format::EsriAscii) => (ascii::render(grid).map_err(unfit)?, lost_crs(crs)),
        Some(Format::Hgt) => hgt::render(path, grid, crs).map_err(unfit)?,
        Some(Format::Npy) => (npy::render(grid), vec!["a .npy file keeps no cell size, place or CRS".to_owned()]),
        Some(Format::Png) => {
            let scale = write_png_heights(target, grid)?;
            return Ok(vec![scale.sentence()]);
        }
        Some(Format::Obj) => (mesh::obj(grid).map_err(unfit)?, lost_crs(crs)),
        Some(Format::Glb) => (mesh::glb(grid).map_err(unfit)?, shifted(grid, crs)),
        Some(Format::Usda) => (mesh::usda(grid).map_err(unfit)?, shifted(grid, crs)),
        Some(Format::Las) => return Err(unfit(Refusal::new("point clouds are read, not written"))),
        None => {
            return Err(unfit(Refusal::new(format!("the ending names no DEM format; {WRITTEN_ENDINGS} do"))));
        }
    };
    save(target, &bytes)?;
    Ok(notes)
}

fn lost_crs(crs: &Crs) -> Vec<String> {
    let known = *crs != Crs::default();
    known.then(|| "the format keeps no coordinate reference system".to_owned()).into_iter().collect()
}

/// As [`lost_crs`], for meshes of single precision, whose coordinates must stay small.
fn shifted(grid: &Grid, crs: &Crs) -> Vec<String> {
    let [x, y] = grid.geometry.origin;
    let shift = format!("x and y of the mesh count from the DEM's south-west corner, ({x}, {y})");
    lost_crs(crs).into_iter().chain(([x, y] != [0.0; 2]).then_some(shift)).collect()
}

/// Writes a class map: 8-bit GeoTIFF, no data 255.
///
/// # Errors
/// The file cannot be written.
pub fn write_classes<'a>(target: impl Into<Target<'a>>, grid: &Grid<u8>, crs: &Crs) -> Result<(), DemError> {
    let target = target.into();
    save(target, &tiff_writer::classes(grid, crs).map_err(|refusal| refusal.unfit(target.path))?)
}

/// Reads a class map that [`write_classes`] wrote.
///
/// # Errors
/// As [`read`]; also when the raster is not of 8-bit classes.
pub fn read_classes(path: &Path) -> Result<Grid<u8>, DemError> {
    let bytes = fs::read(path).map_err(|e| DemError::reading(path, e))?;
    let dem = geotiff::parse(bytes, &ReadOptions::default()).map_err(|refusal| refusal.about(path))?;
    if dem.info.dtype != "uint8" {
        return Err(Refusal::new(format!("holds {} values, not classes", dem.info.dtype)).about(path));
    }
    let no_data = sastrugi_schemas::RoughnessClass::NO_DATA;
    Ok(dem.grid.map(|v| if v.is_nan() { no_data } else { v as u8 }))
}
