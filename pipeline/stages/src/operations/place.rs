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
        let bytes = sastrugi_store::file::read(path).map_err(|e| JobError::at(path, e))?;
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

    /// A point of the raster's own coordinates in those of the heights, m.
    pub fn to_heights(self, point: [f64; 2], heights: &Geometry) -> [f64; 2] {
        let corner = self.south_west();
        [0, 1].map(|k| heights.origin[k] + (point[k] - corner[k]) * self.scale(heights, k))
    }

    /// A point of the heights' coordinates, m, in the raster's own.
    pub fn from_heights(self, point: [f64; 2], heights: &Geometry) -> [f64; 2] {
        let corner = self.south_west();
        [0, 1].map(|k| corner[k] + (point[k] - heights.origin[k]) / self.scale(heights, k))
    }

    /// South-west corner of the window in the raster's own coordinates.
    fn south_west(self) -> [f64; 2] {
        let below = self.shape[0] - self.corner[0] - self.size[0];
        [self.origin[0] + self.corner[1] as f64 * self.cell[0], self.origin[1] + below as f64 * self.cell[1]]
    }

    /// Metres of the heights over a unit of the raster, along x or y.
    fn scale(self, heights: &Geometry, axis: usize) -> f64 {
        heights.size()[axis] / (self.cell[axis] * self.size[1 - axis] as f64)
    }

    /// The window of what covers the whole raster.
    pub fn part<T: Copy>(&self, whole: Grid<T>) -> Grid<T> {
        let ([row, col], [rows, cols]) = (self.corner, self.size);
        if self.size == self.shape { whole } else { whole.window(row, col, rows, cols) }
    }
}
