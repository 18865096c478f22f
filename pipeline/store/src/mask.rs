//! Masks: which cells of a DEM are used.
//!
//! * GeoJSON (RFC 7946: Polygon, MultiPolygon, Feature, FeatureCollection) with coordinates in the DEM's own x and y: a cell
//!   is kept if its centre lies inside. A ring has at least 3 corners; the first may be repeated as the last.
//! * A raster of any format that [`dem::read`] supports: a cell is kept if the mask cell under its centre holds a finite number
//!   other than 0; cells beyond the mask are dropped. A raster without georeferencing (.npy, .png, plain TIFF) must have the
//!   DEM's shape, and is applied cell by cell. A point cloud is gridded, to at most four cells per point ([`dem::read_as_claimed`]).

mod polygons;

#[cfg(test)]
mod tests;

use crate::dem::{self, DemError};
use crate::geojson;
use sastrugi_numeric::{Geometry, Grid};
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

/// Bytes of a file that are searched for the first that is not blank.
const START_BYTES: u64 = 1 << 12;

/// Failure to read a mask.
#[derive(Debug, thiserror::Error)]
pub enum MaskError {
    /// The file is missing, is not a supported raster, or could not be read.
    #[error(transparent)]
    File(#[from] DemError),
    /// The mask cannot be used for this DEM.
    #[error("{}: {reason}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

impl MaskError {
    /// True if the cause is the given data (missing or unusable), not the file system.
    pub fn unusable_input(&self) -> bool {
        match self {
            Self::File(error) => error.unusable_input(),
            Self::Unusable { .. } => true,
        }
    }
}

/// How a mask is interpreted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaskOptions {
    /// Drop the marked cells and keep the others.
    pub invert: bool,
}

/// Reads a mask for a grid: `rows * cols` values from the north-west cell, true where a cell is kept.
///
/// # Errors
/// A file that is missing or not a mask; a raster without georeferencing and with a different shape; a mask that keeps no cell.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_numeric::Geometry;
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("mask.geojson");
/// // The outline of a square with a hole in its middle.
/// std::fs::write(
///     &path,
///     r#"{"type": "Polygon", "coordinates": [
///         [[0, 0], [3, 0], [3, 3], [0, 3], [0, 0]],
///         [[1, 1], [2, 1], [2, 2], [1, 2], [1, 1]]
///     ]}"#,
/// )?;
/// let keep = sastrugi_store::mask::read(&path, &Geometry::square(3, 4, 1.0))?;
/// assert_eq!(keep[..4], [true, true, true, false]);
/// assert_eq!(keep[4..8], [true, false, true, false]);
/// # Ok(())
/// # }
/// ```
pub fn read(path: &Path, geometry: &Geometry) -> Result<Vec<bool>, MaskError> {
    read_with(path, geometry, &MaskOptions::default())
}

/// As [`read`], with options.
///
/// # Errors
/// As [`read`].
pub fn read_with(path: &Path, geometry: &Geometry, options: &MaskOptions) -> Result<Vec<bool>, MaskError> {
    let unusable = |reason: String| MaskError::Unusable { path: path.to_owned(), reason };
    let bytes = crate::file::read(path).map_err(|e| DemError::reading(path, e))?;
    let mut keep = if looks_like_json(&bytes) {
        geojson::polygons::parse(&bytes).map(|found| polygons::inside(&found, geometry)).map_err(unusable)?
    } else {
        drop(bytes);
        of_raster(&dem::read_as_claimed(path)?, geometry).map_err(unusable)?
    };
    if options.invert {
        keep.iter_mut().for_each(|keep| *keep = !*keep);
    }
    if !keep.contains(&true) {
        let ([x, y], [width, height]) = (geometry.origin, geometry.size());
        let extent = format!("x {x} to {}, y {y} to {}", x + width, y + height);
        return Err(unusable(format!(
            "keeps none of the DEM's cells ({extent}); check that it is in the DEM's coordinates"
        )));
    }
    Ok(keep)
}

/// Obstacles read from a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Obstacles {
    /// Polygons, each with its rings (an outline and its holes, even-odd rule), in the DEM's own coordinates.
    Polygons(Vec<Vec<Vec<[f64; 2]>>>),
    /// `rows * cols` values from the north-west cell, true where an obstacle is marked.
    Cells(Vec<bool>),
}

/// Reads obstacles for a grid: polygons of a GeoJSON file, or the cells that a raster marks.
///
/// # Errors
/// A file that is missing or neither of the two; a raster without georeferencing and with a different shape.
pub fn read_obstacles(path: &Path, geometry: &Geometry) -> Result<Obstacles, MaskError> {
    let unusable = |reason: String| MaskError::Unusable { path: path.to_owned(), reason };
    let bytes = crate::file::read(path).map_err(|e| DemError::reading(path, e))?;
    if looks_like_json(&bytes) {
        return geojson::polygons::parse(&bytes).map(Obstacles::Polygons).map_err(unusable);
    }
    drop(bytes);
    of_raster(&dem::read_as_claimed(path)?, geometry).map(Obstacles::Cells).map_err(unusable)
}

/// Approximate memory that reading a mask or obstacles needs besides the cells of the grid, bytes: from the header of a raster, or by
/// counting the values of a GeoJSON text.
///
/// # Errors
/// A file that cannot be read.
pub fn reading_bytes(path: &Path) -> io::Result<u64> {
    if !looks_like_json(&crate::file::head(path, START_BYTES)?) {
        return dem::reading_bytes(path);
    }
    geojson::polygons::parsing_bytes(BufReader::new(crate::file::open(path)?))
}

fn looks_like_json(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    text.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{')
}

fn of_raster(mask: &dem::Dem, geometry: &Geometry) -> Result<Vec<bool>, String> {
    let (marks, shape) = (&mask.grid, (geometry.rows, geometry.cols));
    if !mask.info.placed {
        if (marks.rows(), marks.cols()) != shape {
            let (rows, cols) = shape;
            return Err(format!(
                "has no georeferencing, so it must have the DEM's {rows} x {cols} cells; it has {} x {}",
                marks.rows(),
                marks.cols()
            ));
        }
        return Ok(marks.values.iter().copied().map(marked).collect());
    }
    let under = |row: usize, col: usize| under(marks, geometry.x(col), geometry.y(row));
    Ok((0..geometry.rows).flat_map(|row| (0..geometry.cols).map(move |col| under(row, col))).collect())
}

fn under(marks: &Grid, x: f64, y: f64) -> bool {
    marks.geometry.cell_at(x, y).is_some_and(|(row, col)| marked(marks.at(row, col)))
}

fn marked(value: f64) -> bool {
    value.is_finite() && value != 0.0
}
