//! A DEM as it is read: its window cut, degrees turned into metres.

use crate::job::JobError;
use sastrugi_numeric::{Geometry, Grid, resample};
use sastrugi_store::dem::{self, Claimed, Crs, Dem};

/// The cells of a window in the DEM's own coordinates.
///
/// # Errors
/// A window without cells, or without data.
pub fn window_of(grid: &Grid, window: [f64; 4]) -> Result<Grid, JobError> {
    let part = resample::crop(grid, window).ok_or_else(|| JobError::input(no_cell(&grid.geometry, window)))?;
    if part.finite_count() == 0 {
        return Err(JobError::input(format!("the window {window:?} holds no cell with data")));
    }
    Ok(part)
}

/// The sentence on a window without cells.
fn no_cell(g: &Geometry, window: [f64; 4]) -> String {
    let reach = [g.origin[0], g.origin[1], g.origin[0] + g.size()[0], g.origin[1] + g.size()[1]];
    format!("the window {window:?} holds no cell of the DEM, which covers {reach:?}")
}

/// Shape and place that an item of `[[dem]]` will have, before its heights are read: the window cut, degrees turned into metres. `None`
/// where the file's header does not tell.
///
/// # Errors
/// The sentence on a window without cells.
pub fn expected(claimed: &Claimed, window: Option<[f64; 4]>) -> Result<Option<Geometry>, String> {
    let Some(whole) = claimed.geometry else { return Ok(None) };
    let part = match window {
        None => whole,
        Some(window) => resample::cropped(&whole, window).ok_or_else(|| no_cell(&whole, window))?,
    };
    Ok(Some(if claimed.geographic { resample::in_metres(&part) } else { part }))
}

/// A DEM in metres, and a warning where it was in degrees.
pub fn to_metres(dem: Dem) -> (Dem, Option<String>) {
    if !dem.info.crs.geographic {
        return (dem, None);
    }
    let grid = resample::geographic_to_metres(&dem.grid);
    let note = metres_note(&dem.grid.geometry, &grid.geometry);
    (Dem { grid, info: dem::DemInfo { crs: Crs::default(), ..dem.info } }, Some(note))
}

/// The sentence on a geographic raster that was brought to metres.
pub fn metres_note(degrees: &Geometry, metres: &Geometry) -> String {
    let latitude = degrees.origin[1] + 0.5 * degrees.size()[1];
    let [x, y] = metres.cell;
    format!(
        "geographic raster converted to metres at its centre latitude {latitude:.4} deg: cells of {x:.3} x {y:.3} m"
    )
}

/// A store error as a job's.
pub fn input_error(error: dem::DemError) -> JobError {
    if error.unusable_input() { JobError::input(error) } else { JobError::io(error) }
}
