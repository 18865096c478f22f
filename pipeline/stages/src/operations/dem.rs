//! Prepares a DEM after reading: crops it to a window and converts degrees to metres.

use crate::job::JobError;
use sastrugi_numeric::{Geometry, Grid, resample};
use sastrugi_store::dem::{self, Claimed, Crs, Dem};

/// The cells of a window given in the DEM's own coordinates.
///
/// # Errors
/// A window without cells or without data.
pub fn window_of(grid: &Grid, window: [f64; 4]) -> Result<Grid, JobError> {
    let part = resample::crop(grid, window).ok_or_else(|| JobError::input(no_cell(&grid.geometry, window)))?;
    if part.finite_count() == 0 {
        return Err(JobError::input(format!("the window {window:?} contains no cell with data")));
    }
    Ok(part)
}

/// The message on a window without cells.
fn no_cell(g: &Geometry, window: [f64; 4]) -> String {
    let reach = [g.origin[0], g.origin[1], g.origin[0] + g.size()[0], g.origin[1] + g.size()[1]];
    format!("the window {window:?} contains no cell of the DEM, which covers {reach:?}")
}

/// Predicts the shape and position of an item of `[[dem]]`, cropped and in metres, before its heights are read. `None` if the header of
/// the file does not state them.
///
/// # Errors
/// The message on a window without cells.
pub fn expected(claimed: &Claimed, window: Option<[f64; 4]>) -> Result<Option<Geometry>, String> {
    let Some(whole) = claimed.geometry else { return Ok(None) };
    let part = match window {
        None => whole,
        Some(window) => resample::cropped(&whole, window).ok_or_else(|| no_cell(&whole, window))?,
    };
    Ok(Some(if claimed.geographic { resample::in_metres(&part) } else { part }))
}

/// Converts a DEM to metres, with a note if it was in degrees.
pub fn to_metres(dem: Dem) -> (Dem, Option<String>) {
    if !dem.info.crs.geographic {
        return (dem, None);
    }
    let grid = resample::geographic_to_metres(&dem.grid);
    let note = metres_note(&dem.grid.geometry, &grid.geometry);
    (Dem { grid, info: dem::DemInfo { crs: Crs::default(), ..dem.info } }, Some(note))
}

/// The note on a geographic raster that was converted to metres.
pub fn metres_note(degrees: &Geometry, metres: &Geometry) -> String {
    let latitude = degrees.origin[1] + 0.5 * degrees.size()[1];
    let [x, y] = metres.cell;
    format!(
        "geographic raster converted to metres at its centre latitude {latitude:.4} deg: cells of {x:.3} x {y:.3} m"
    )
}

/// Converts an error of the store to an error of a job.
pub fn input_error(error: dem::DemError) -> JobError {
    if error.unusable_input() { JobError::input(error) } else { JobError::io(error) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_store::dem::{DemInfo, Format, Values};

    const DEGREES: Geometry = Geometry { rows: 4, cols: 6, cell: [0.25, 0.5], origin: [7.0, 44.0] };

    fn numbers() -> Grid {
        Grid::new(DEGREES, (0..24).map(f64::from).collect())
    }

    fn dem(geographic: bool) -> Dem {
        let crs = Crs { geographic, epsg: Some(4326), ..Crs::default() };
        let info = DemInfo {
            format: Format::GeoTiff,
            dtype: "float32",
            nodata: None,
            crs,
            values: Values::Heights,
            placed: true,
            pixel_is_point: false,
            notes: vec!["kept".to_owned()],
        };
        Dem { grid: numbers(), info }
    }

    #[test]
    fn val_windows_in_the_coordinates_of_the_dem() {
        // Two columns and the southern row.
        let part = window_of(&numbers(), [7.25, 44.0, 7.75, 44.5]).unwrap();
        assert_eq!((part.values, part.geometry.origin), (vec![19.0, 20.0], [7.25, 44.0]));
        let error = window_of(&numbers(), [0.0, 0.0, 1.0, 1.0]).unwrap_err().message;
        let expected =
            "the window [0.0, 0.0, 1.0, 1.0] contains no cell of the DEM, which covers [7.0, 44.0, 8.5, 46.0]";
        assert_eq!(error, expected);
        let mut holed = numbers();
        holed.values[19] = f64::NAN;
        let error = window_of(&holed, [7.25, 44.0, 7.5, 44.5]).unwrap_err().message;
        assert_eq!(error, "the window [7.25, 44.0, 7.5, 44.5] contains no cell with data");
    }

    /// What is expected from the header is what reading, cropping and converting give.
    #[test]
    fn val_expected_geometry_is_that_of_the_result() {
        let window = [7.25, 44.0, 7.75, 45.0];
        for geographic in [false, true] {
            let claimed = Claimed { cells: 24, points: 0, cell_m: None, geometry: Some(DEGREES), geographic };
            let whole = dem(geographic);
            let cut = Dem { grid: window_of(&whole.grid, window).unwrap(), info: whole.info.clone() };
            let (metric, note) = to_metres(cut);
            assert_eq!(expected(&claimed, Some(window)), Ok(Some(metric.grid.geometry)), "{geographic}");
            assert_eq!((note.is_some(), metric.info.crs.geographic), (geographic, false));
            let (metric, _) = to_metres(whole);
            assert_eq!(expected(&claimed, None), Ok(Some(metric.grid.geometry)));
            assert!(expected(&claimed, Some([0.0, 0.0, 1.0, 1.0])).is_err());
        }
        let unknown = Claimed { cells: 24, points: 0, cell_m: None, geometry: None, geographic: false };
        assert_eq!(expected(&unknown, Some(window)), Ok(None));
    }

    /// The centre of the DEM lies at 45 degrees, where a degree has 78 847 m to the east and 111 132 m to the north.
    #[test]
    fn val_degrees_are_converted_with_a_note() {
        let (metric, note) = to_metres(dem(true));
        let note = note.unwrap();
        assert_eq!(
            note,
            "geographic raster converted to metres at its centre latitude 45.0000 deg: cells of 19711.709 x 55565.889 m"
        );
        assert_eq!((metric.info.crs, metric.info.notes), (Crs::default(), vec!["kept".to_owned()]));
        assert_eq!(metric.grid.values, numbers().values);
        let (same, note) = to_metres(dem(false));
        assert_eq!((same, note), (dem(false), None));
    }
}
