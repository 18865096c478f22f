//! Masks: which cells of a DEM take part.
//!
//! * GeoJSON (RFC 7946: Polygon, MultiPolygon, Feature, FeatureCollection) with coordinates in the DEM's own x and y: a cell
//!   is kept when its centre lies inside.
//! * A raster of any format that [`dem::read`] knows: a cell is kept when the cell of the mask under its centre holds a
//!   finite number other than 0; cells beyond the mask are dropped. A raster that says neither place nor cell size (.npy,
//!   .png, TIFF without georeferencing) must have the DEM's shape, and is taken cell by cell.

mod polygons;

#[cfg(test)]
mod tests;

use crate::dem::{self, DemError};
use crate::geojson;
use sastrugi_numeric::{Geometry, Grid};
use std::path::{Path, PathBuf};

/// Why a mask was not read.
#[derive(Debug, thiserror::Error)]
pub enum MaskError {
    /// The file is missing, is no raster that can be read, or could not be read.
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
    /// True when the data that was given is the cause (missing or unusable), not the file system.
    pub fn unusable_input(&self) -> bool {
        match self {
            Self::File(error) => error.unusable_input(),
            Self::Unusable { .. } => true,
        }
    }
}

/// How a mask is understood.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaskOptions {
    /// Drop what the mask marks, and keep the rest.
    pub invert: bool,
}

/// Reads a mask for a grid: `rows * cols` values from the north-west cell, true where a cell is kept.
///
/// # Errors
/// A file that is missing or no mask; a raster without a place and with another shape; a mask that keeps no cell.
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
        of_raster(&dem::read(path)?, geometry).map_err(unusable)?
    };
    if options.invert {
        keep.iter_mut().for_each(|keep| *keep = !*keep);
    }
    if !keep.contains(&true) {
        let ([x, y], [width, height]) = (geometry.origin, geometry.size());
        let reach = format!("x {x} to {}, y {y} to {}", x + width, y + height);
        return Err(unusable(format!("keeps none of the DEM's cells ({reach}); is it in the DEM's coordinates?")));
    }
    Ok(keep)
}

/// What a file of obstacles marks.
#[derive(Clone, Debug, PartialEq)]
pub enum Obstacles {
    /// Polygons, each with its rings (an outline and its holes, even-odd rule), in the DEM's own coordinates.
    Polygons(Vec<Vec<Vec<[f64; 2]>>>),
    /// `rows * cols` values from the north-west cell, true where a cell is marked.
    Cells(Vec<bool>),
}

/// Reads obstacles for a grid: polygons of a GeoJSON file, or the cells that a raster marks.
///
/// # Errors
/// A file that is missing or neither; a raster without a place and with another shape.
pub fn read_obstacles(path: &Path, geometry: &Geometry) -> Result<Obstacles, MaskError> {
    let unusable = |reason: String| MaskError::Unusable { path: path.to_owned(), reason };
    let bytes = crate::file::read(path).map_err(|e| DemError::reading(path, e))?;
    if looks_like_json(&bytes) {
        return geojson::polygons::parse(&bytes).map(Obstacles::Polygons).map_err(unusable);
    }
    drop(bytes);
    of_raster(&dem::read(path)?, geometry).map(Obstacles::Cells).map_err(unusable)
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
                "states no place, so it needs the DEM's {rows} x {cols} cells; it has {} x {}",
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
