//! Checks common to all formats.

use super::raster::{Dem, MAX_CELLS, NO_DATA, ReadOptions, Refusal, unplaced};
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::counted;

/// Checks common to all formats.
pub(crate) fn checked(mut dem: Dem) -> Result<Dem, Refusal> {
    let g = &dem.grid.geometry;
    check_place(g)?;
    let infinite = dem.grid.values.iter().filter(|v| v.is_infinite()).count();
    if infinite > 0 {
        dem.grid.values.iter_mut().filter(|v| v.is_infinite()).for_each(|v| *v = f64::NAN);
        dem.info.notes.push(format!("treated {} as no data", counted(infinite, "infinite value")));
    }
    if dem.grid.finite_count() == 0 {
        return Err(Refusal::new(format!("none of the {} x {} cells holds data", g.rows, g.cols)));
    }
    Ok(dem)
}

/// Checks that cell size and origin are valid.
pub(super) fn check_place(g: &Geometry) -> Result<(), Refusal> {
    if g.cell.iter().all(|c| c.is_finite() && *c > 0.0) && g.origin.iter().all(|o| o.is_finite()) {
        return Ok(());
    }
    Err(Refusal::new(format!(
        "cell size {:?} and origin {:?} must be finite, and the cell size positive",
        g.cell, g.origin
    )))
}

/// Number of cells of a claimed size, if it can be held in memory.
pub(super) fn cell_count(rows: u64, cols: u64) -> Result<usize, Refusal> {
    let (all_rows, all_cols) = (counted(rows, "row"), counted(cols, "column"));
    if rows == 0 || cols == 0 {
        return Err(Refusal::new(format!("has no cells ({all_rows}, {all_cols})")));
    }
    let cells = rows.checked_mul(cols).filter(|&n| n <= MAX_CELLS).ok_or_else(|| {
        Refusal::new(format!("claims {all_rows} of {all_cols}; at most {MAX_CELLS} cells can be read"))
    })?;
    usize::try_from(cells).map_err(|_| Refusal::new(format!("{cells} cells do not fit in memory")))
}

/// Geometry of a raster of a claimed size without georeferencing, before anything is decoded; `None` if the size cannot be held in
/// memory.
pub(super) fn unplaced_claim(rows: u64, cols: u64, options: &ReadOptions) -> Option<Geometry> {
    cell_count(rows, cols).ok()?;
    Some(unplaced(usize::try_from(rows).ok()?, usize::try_from(cols).ok()?, options, &mut Vec::new()))
}

/// Refuses heights equal to the no-data value, which would be read back as no data.
pub(super) fn free_of_no_data_value<T: Copy + Into<f64>>(grid: &Grid<T>) -> Result<(), Refusal> {
    if grid.values.iter().any(|z| (*z).into() == NO_DATA) {
        return Err(Refusal::new(format!("a height of {NO_DATA} m equals the no-data value")));
    }
    Ok(())
}

/// Refuses heights, m, beyond the range of single precision; `NaN` means no data.
pub(super) fn check_single_precision(mut heights: impl Iterator<Item = f64>) -> Result<(), Refusal> {
    match heights.find(|z| (*z as f32).is_infinite()) {
        // In powers of ten: such a number has 39 digits or more.
        Some(height) => Err(Refusal::new(format!("the height {height:e} m does not fit in single precision"))),
        None => Ok(()),
    }
}
