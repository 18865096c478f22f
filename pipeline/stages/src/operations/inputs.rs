//! What generators take as input, as files: the same for studies and verbs.

use super::dem::input_error;
use crate::job::JobError;
use sastrugi_store::altimetry;
use sastrugi_store::dem::{self, Crs};
use sastrugi_terrain::{Generator, Holds, Input, NamedInput};
use std::path::{Path, PathBuf};

/// An input of a generator, with the coordinate system of a raster.
pub struct Loaded {
    /// Heights, other values, or points.
    pub input: Input,
    /// Coordinate system; points state none.
    pub crs: Option<Crs>,
}

/// Reads an input.
///
/// # Errors
/// A file that cannot be read.
pub fn read(named: &NamedInput, path: &Path) -> Result<Loaded, JobError> {
    match named.holds {
        Holds::Heights => read_heights(path),
        Holds::Values => read_values(path),
        Holds::Points => read_points(path),
    }
}

/// Heights as an item of a study holds them.
fn read_heights(path: &Path) -> Result<Loaded, JobError> {
    let read = dem::read(path).map_err(input_error)?;
    Ok(Loaded { input: read.grid.into(), crs: Some(read.info.crs) })
}

/// A raster of values that are no heights, in the coordinates of a surface in metres.
fn read_values(path: &Path) -> Result<Loaded, JobError> {
    let read = read_heights(path)?;
    match &read.crs {
        Some(crs) if crs.geographic => Err(JobError::input(format!(
            "{}: is in degrees; reproject it to the metres of the surface that it is laid on",
            path.display()
        ))),
        _ => Ok(read),
    }
}

/// Measured points.
fn read_points(path: &Path) -> Result<Loaded, JobError> {
    Ok(Loaded { input: Input::Points(altimetry::read(path).map_err(input_error)?), crs: None })
}

/// Whether a raster of other values can lie on the first input, by their coordinate systems.
///
/// # Errors
/// When both systems have a code, and not the same.
pub fn check_systems(named: &NamedInput, first: Option<&Crs>, own: &Crs) -> Result<(), JobError> {
    match (first.and_then(|crs| crs.epsg), own.epsg) {
        (Some(first), Some(other)) if first != other && named.holds == Holds::Values => {
            let name = &named.name;
            let message =
                format!("\"{name}\" is in EPSG:{other}, what it is laid on in EPSG:{first}; reproject one of them");
            Err(JobError::input(message))
        }
        _ => Ok(()),
    }
}

/// Name of a kept input, without its ending.
pub fn kept(place: usize) -> String {
    format!("input-{}", place + 1)
}

/// The inputs that an item kept beside its heights.
///
/// # Errors
/// A file that is missing or cannot be read.
pub fn read_kept(heights: &Path, generator: &dyn Generator) -> Result<Vec<Input>, JobError> {
    let folder = heights.parent().unwrap_or(Path::new(""));
    let one = |(k, named): (usize, NamedInput)| {
        let path = beside(folder, &kept(k)).map_err(|e| JobError::at(folder, e))?;
        let path = path.ok_or_else(|| JobError::new(format!("\"{}\" is not beside the heights", named.name)))?;
        read(&named, &path).map(|read| read.input)
    };
    generator.inputs().into_iter().enumerate().map(one).collect()
}

/// The file of a folder with a name, whatever its ending.
fn beside(folder: &Path, name: &str) -> std::io::Result<Option<PathBuf>> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.file_stem().is_some_and(|stem| stem == name) {
            return Ok(Some(path));
        }
    }
    Ok(None)
}
