//! Where heights lie in the raster that they were read from.

use crate::job::JobError;
use sastrugi_numeric::{Geometry, Grid};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Where the heights of a measured DEM lie in its file, for masks; items of other stages have none.
pub const PLACE: &str = "place.json";

/// Where the cells of a window lie in the raster that they were cut from, in the raster's own coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Rows and columns of the whole raster.
    shape: [usize; 2],
    cell: [f64; 2],
    origin: [f64; 2],
    /// Row and column of the window's north-west cell.
    corner: [usize; 2],
    /// Rows and columns of the window.
    size: [usize; 2],
}

impl Place {
    /// The whole raster, or the window that was cut from it.
    pub fn of(whole: &Geometry, window: &Geometry) -> Self {
        // Both count in whole cells of one size.
        let steps = |axis: usize| ((window.origin[axis] - whole.origin[axis]) / whole.cell[axis]).round() as usize;
        Self {
            shape: [whole.rows, whole.cols],
            cell: whole.cell,
            origin: whole.origin,
            corner: [whole.rows - window.rows - steps(1), steps(0)],
            size: [window.rows, window.cols],
        }
    }

    /// The place that a measured DEM's item left at `path`; without one, the heights' own.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read(path: &Path, heights: &Geometry) -> Result<Self, JobError> {
        if !path.is_file() {
            return Ok(Self::of(heights, heights));
        }
        let bytes = std::fs::read(path).map_err(|e| JobError::at(path, e))?;
        serde_json::from_slice(&bytes).map_err(JobError::new)
    }

    /// Geometry of the whole raster.
    pub fn whole(&self) -> Geometry {
        let [rows, cols] = self.shape;
        Geometry { rows, cols, cell: self.cell, origin: self.origin }
    }

    /// True where the heights of the item have other cells than its raster: they were in degrees and are in metres, from their
    /// own corner.
    pub fn was_converted(&self, heights: &Geometry) -> bool {
        (0..2).any(|k| (heights.cell[k] / self.cell[k] - 1.0).abs() > 1e-6)
    }

    /// The window of what covers the whole raster.
    pub fn part<T: Copy>(&self, whole: Grid<T>) -> Grid<T> {
        let ([row, col], [rows, cols]) = (self.corner, self.size);
        if self.size == self.shape { whole } else { whole.window(row, col, rows, cols) }
    }
}
