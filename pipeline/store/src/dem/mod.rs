//! Elevation rasters of many formats, and point clouds gridded to one ([`crate::points`]), read to one form and written
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
mod crs;
mod geotiff;
mod hgt;
mod mesh;
mod npy;
mod png;
pub mod simulators;
mod tiff_writer;

#[cfg(test)]
mod tests;

pub use band::Values;
pub use blocks::{BlockReader, open};
pub use crs::{Crs, GeoKey};
pub use png::{HeightScale, write_png_heights, write_png16};

use crate::atomic::{self, Target};
use crate::points::{self, GridSettings};
use sastrugi_numeric::{Geometry, Grid};
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Most cells of a raster: 2 GiB of heights in memory.
pub const MAX_CELLS: u64 = 1 << 28;
/// Bytes that tell a point cloud, which is not read whole.
const SNIFFED_BYTES: u64 = 4;
/// Endings of names that [`write()`] takes.
pub const WRITTEN_ENDINGS: &str = ".tif, .asc, .hgt, .png, .npy, .obj, .glb and .usda";
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
    /// True when the file places its values at points (and the grid was shifted by half a cell to centre them).
    pub pixel_is_point: bool,
    /// Sentences a user must know.
    pub notes: Vec<String>,
}

impl DemInfo {
    /// False for a raster that was read without a cell size and states none: then its place is unknown as well.
    pub(crate) fn placed(&self) -> bool {
        !self.notes.iter().any(|note| note == geotiff::NO_CELL_SIZE)
    }
}

/// Raster formats.
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
    /// Point cloud, LAS or LAZ, which is gridded ([`crate::points`]); read only.
    Las,
}

impl Format {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::GeoTiff => "geotiff",
            Self::EsriAscii => "esri_ascii",
            Self::Hgt => "hgt",
            Self::Npy => "npy",
            Self::Png => "png",
            Self::Obj => "obj",
            Self::Glb => "glb",
            Self::Usda => "usda",
            Self::Las => "las",
        }
    }

    /// The format of a file name's ending.
    pub fn of_name(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        match ending.as_str() {
            "tif" | "tiff" => Some(Self::GeoTiff),
            "asc" => Some(Self::EsriAscii),
            "hgt" => Some(Self::Hgt),
            "npy" => Some(Self::Npy),
            "png" => Some(Self::Png),
            "obj" => Some(Self::Obj),
            "glb" => Some(Self::Glb),
            "usda" => Some(Self::Usda),
            "las" | "laz" => Some(Self::Las),
            _ => None,
        }
    }

    /// True for formats that state metres, so that a raster in degrees is converted before it is written.
    pub fn in_metres(self) -> bool {
        matches!(self, Self::Obj | Self::Glb | Self::Usda)
    }

    /// The format of a file: by its first bytes, and by its name where those say nothing.
    fn of_file(path: &Path, bytes: &[u8]) -> Option<Self> {
        match bytes {
            _ if geotiff::looks_like(bytes) => Some(Self::GeoTiff),
            [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => Some(Self::Npy),
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            _ if ascii::looks_like(bytes) => Some(Self::EsriAscii),
            _ => Self::of_name(path),
        }
    }
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

    pub(crate) fn about(self, path: &Path) -> DemError {
        DemError::Unusable { path: path.to_owned(), reason: self.0 }
    }
}

/// What a caller knows about a file that the file does not say.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReadOptions {
    /// Cell size east-west and north-south, m, for formats that carry none (.npy, .png, TIFF without GeoTIFF tags), and
    /// the size of the square cells of a gridded point cloud.
    pub cell_m: Option<[f64; 2]>,
}

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

/// What the header of a raster or a point cloud says of its size, nothing decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claimed {
    /// Number of cells.
    pub cells: u64,
    /// Number of points; 0 for a raster.
    pub points: u64,
    /// Smaller side of a cell, m, where the header or the caller says.
    pub cell_m: Option<f64>,
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

fn parse(path: &Path, bytes: Vec<u8>, options: &ReadOptions) -> Result<Dem, Refusal> {
    if bytes.is_empty() {
        return Err(Refusal::new("the file is empty"));
    }
    match Format::of_file(path, &bytes) {
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

/// The checks that every format shares.
pub(crate) fn checked(mut dem: Dem) -> Result<Dem, Refusal> {
    let g = &dem.grid.geometry;
    check_place(g)?;
    let infinite = dem.grid.values.iter().filter(|v| v.is_infinite()).count();
    if infinite > 0 {
        dem.grid.values.iter_mut().filter(|v| v.is_infinite()).for_each(|v| *v = f64::NAN);
        dem.info.notes.push(format!("{infinite} infinite values are read as no data"));
    }
    if dem.grid.finite_count() == 0 {
        return Err(Refusal::new(format!("none of the {} x {} cells holds data", g.rows, g.cols)));
    }
    Ok(dem)
}

fn check_place(g: &Geometry) -> Result<(), Refusal> {
    if g.cell.iter().all(|c| c.is_finite() && *c > 0.0) && g.origin.iter().all(|o| o.is_finite()) {
        return Ok(());
    }
    Err(Refusal::new(format!("the cell size {:?} at {:?} is not usable", g.cell, g.origin)))
}

/// Number of cells of a claimed size, when it is one that can be held.
fn cell_count(rows: u64, cols: u64) -> Result<usize, Refusal> {
    if rows == 0 || cols == 0 {
        return Err(Refusal::new(format!("holds no cell ({rows} rows, {cols} columns)")));
    }
    let cells = rows.checked_mul(cols).filter(|&n| n <= MAX_CELLS).ok_or_else(|| {
        Refusal::new(format!("claims {rows} rows of {cols} columns; at most {MAX_CELLS} cells can be read"))
    })?;
    usize::try_from(cells).map_err(|_| Refusal::new(format!("{cells} cells do not fit in memory")))
}

/// A height that equals the number for no data would be read as no data.
fn free_of_no_data_value(grid: &Grid) -> Result<(), Refusal> {
    if grid.values.contains(&NO_DATA) {
        return Err(Refusal::new(format!("a height of {NO_DATA} m cannot be told from no data")));
    }
    Ok(())
}

/// Heights, m, of which none is beyond single precision; `NaN` stands for no data.
fn check_single_precision(mut heights: impl Iterator<Item = f64>) -> Result<(), Refusal> {
    match heights.find(|z| (*z as f32).is_infinite()) {
        // In powers of ten: such a number has 39 digits or more.
        Some(height) => Err(Refusal::new(format!("the height {height:e} m does not fit in single precision"))),
        None => Ok(()),
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
    let unfit = |refusal| unfit(path, refusal);
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

/// A grid that does not fit what was asked for.
fn unfit(path: &Path, Refusal(reason): Refusal) -> DemError {
    DemError::Unfit { path: path.to_owned(), reason }
}

fn save(target: Target<'_>, bytes: &[u8]) -> Result<(), DemError> {
    atomic::write(target, bytes).map_err(|source| DemError::Io { path: target.path.to_owned(), source })
}

/// Writes a class map: 8-bit GeoTIFF, no data 255.
///
/// # Errors
/// The file cannot be written.
pub fn write_classes<'a>(target: impl Into<Target<'a>>, grid: &Grid<u8>, crs: &Crs) -> Result<(), DemError> {
    let target = target.into();
    save(target, &tiff_writer::classes(grid, crs).map_err(|refusal| unfit(target.path, refusal))?)
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
