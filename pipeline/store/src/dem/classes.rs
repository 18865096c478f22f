//! Class maps: 8-bit GeoTIFFs.

use super::crs::Crs;
use super::raster::{DemError, ReadOptions, Refusal, save};
use super::{geotiff, tiff_writer};
use crate::atomic::Target;
use sastrugi_numeric::Grid;
use sastrugi_schemas::RoughnessClass;
use std::path::Path;

/// Writes a class map: 8-bit GeoTIFF, no data 255.
///
/// # Errors
/// The file cannot be written.
pub fn write_classes<'a>(target: impl Into<Target<'a>>, grid: &Grid<u8>, crs: &Crs) -> Result<(), DemError> {
    let target = target.into();
    save(target, &tiff_writer::classes(grid, crs).map_err(|refusal| refusal.unfit(target.path))?)
}

/// Reads a class map written by [`write_classes`].
///
/// # Errors
/// As [`super::read`]; also if the raster does not hold 8-bit classes.
pub fn read_classes(path: &Path) -> Result<Grid<u8>, DemError> {
    let bytes = crate::file::read(path).map_err(|e| DemError::reading(path, e))?;
    let dem = geotiff::parse(bytes, &ReadOptions::default()).map_err(|refusal| refusal.about(path))?;
    if dem.info.dtype != "uint8" {
        return Err(Refusal::new(format!("holds {} values, expected uint8 classes", dem.info.dtype)).about(path));
    }
    Ok(dem.grid.map(|v| if v.is_nan() { RoughnessClass::NO_DATA } else { v as u8 }))
}
