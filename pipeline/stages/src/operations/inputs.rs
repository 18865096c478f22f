//! Reads the input files of generators. Shared by studies and verbs.

use super::dem::input_error;
use crate::job::JobError;
use sastrugi_store::altimetry;
use sastrugi_store::dem::{self, Crs};
use sastrugi_terrain::{Generator, Holds, Input, NamedInput};
use std::path::{Path, PathBuf};

/// An input of a generator; a raster comes with its coordinate system.
pub struct Loaded {
    /// Heights, other values, or points.
    pub input: Input,
    /// Coordinate system; `None` for points.
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

/// Reads heights.
fn read_heights(path: &Path) -> Result<Loaded, JobError> {
    let read = dem::read_as_claimed(path).map_err(input_error)?;
    Ok(Loaded { input: read.grid.into(), crs: Some(read.info.crs) })
}

/// Reads a raster of values other than heights, in the coordinates of a surface in metres.
fn read_values(path: &Path) -> Result<Loaded, JobError> {
    let read = read_heights(path)?;
    match &read.crs {
        Some(crs) if crs.geographic => Err(JobError::input(format!(
            "{}: is in degrees; reproject it to the coordinate system of its surface, in metres",
            path.display()
        ))),
        _ => Ok(read),
    }
}

/// Reads measured points.
fn read_points(path: &Path) -> Result<Loaded, JobError> {
    Ok(Loaded { input: Input::Points(altimetry::read(path).map_err(input_error)?), crs: None })
}

/// Checks that a raster of other values has the same coordinate system as the first input.
///
/// # Errors
/// When both have an EPSG code and the codes differ.
pub fn check_systems(named: &NamedInput, first: Option<&Crs>, own: &Crs) -> Result<(), JobError> {
    match (first.and_then(|crs| crs.epsg), own.epsg) {
        (Some(first), Some(other)) if first != other && named.holds == Holds::Values => {
            let name = &named.name;
            let message =
                format!("\"{name}\" is in EPSG:{other}, but its surface is in EPSG:{first}; reproject one of them");
            Err(JobError::input(message))
        }
        _ => Ok(()),
    }
}

/// Name of a kept input, without its extension.
pub fn kept(place: usize) -> String {
    format!("input-{}", place + 1)
}

/// Reads the inputs that an item kept next to its heights.
///
/// # Errors
/// A file that is missing or cannot be read.
pub fn read_kept(heights: &Path, generator: &dyn Generator) -> Result<Vec<Input>, JobError> {
    let folder = heights.parent().unwrap_or(Path::new(""));
    let one = |(k, named): (usize, NamedInput)| {
        let path = find_by_stem(folder, &kept(k)).map_err(|e| JobError::at(folder, e))?;
        let path = path.ok_or_else(|| JobError::new(format!("\"{}\" is missing next to the heights", named.name)))?;
        read(&named, &path).map(|read| read.input)
    };
    generator.inputs().into_iter().enumerate().map(one).collect()
}

/// The file in a folder with this name and any extension.
fn find_by_stem(folder: &Path, name: &str) -> std::io::Result<Option<PathBuf>> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.file_stem().is_some_and(|stem| stem == name) {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Only rasters of other values must have the system of their surface, and only where both codes are known.
    #[test]
    fn val_coordinate_systems_are_compared() {
        let system = |epsg: Option<u16>| Crs { epsg, ..Crs::default() };
        let named = |holds: Holds| NamedInput { key: "rocks.potential".to_owned(), name: "map.tif".to_owned(), holds };
        let check = |holds: Holds, first: Option<u16>, own: Option<u16>| {
            check_systems(&named(holds), Some(&system(first)), &system(own)).map_err(|e| e.message)
        };
        let message = "\"map.tif\" is in EPSG:32633, but its surface is in EPSG:32632; reproject one of them";
        assert_eq!(check(Holds::Values, Some(32632), Some(32633)), Err(message.to_owned()));
        assert_eq!(check(Holds::Heights, Some(32632), Some(32633)), Ok(()));
        for (first, own) in [(Some(32632), Some(32632)), (None, Some(32633)), (Some(32632), None)] {
            assert_eq!(check(Holds::Values, first, own), Ok(()));
        }
        assert!(check_systems(&named(Holds::Values), None, &system(Some(32633))).is_ok());
    }

    /// Kept inputs are found by their number, whatever their extension; `input-1` is not `input-10`.
    #[test]
    fn val_kept_inputs_are_found() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!([kept(0), kept(9)], ["input-1", "input-10"]);
        std::fs::write(folder.path().join("input-10.tif"), b"x").unwrap();
        assert_eq!(find_by_stem(folder.path(), &kept(0)).unwrap(), None);
        std::fs::write(folder.path().join("input-1.csv"), b"x").unwrap();
        assert_eq!(find_by_stem(folder.path(), &kept(0)).unwrap(), Some(folder.path().join("input-1.csv")));
        assert_eq!(find_by_stem(folder.path(), &kept(9)).unwrap(), Some(folder.path().join("input-10.tif")));
    }
}
