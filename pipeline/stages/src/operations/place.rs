//! Position of heights in the raster from which they were read.

use crate::job::JobError;
use sastrugi_numeric::{Geometry, Grid};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// File with the position of the heights of a measured DEM in its raster, for masks; items of other stages have none.
pub const PLACE: &str = "place.json";

/// Position of a window in the raster from which it was cropped, in the raster's own coordinates.
///
/// ```
/// use sastrugi_numeric::Geometry;
/// use sastrugi_stages::operations::place::Place;
///
/// // A raster in degrees, and the heights of a window of it, which were converted to metres.
/// let raster = Geometry { rows: 10, cols: 20, cell: [0.5, 0.25], origin: [100.0, 50.0] };
/// let place = Place::of(&raster, &raster.window(2, 3, 4, 5));
/// let heights = Geometry { rows: 4, cols: 5, cell: [30.0, 40.0], origin: [0.0, 0.0] };
/// assert!(place.was_converted(&heights));
/// // One cell east and two cells north of the south-western corner of the window.
/// assert_eq!(place.to_heights([102.0, 51.5], &heights), [30.0, 80.0]);
/// assert_eq!(place.from_heights([30.0, 80.0], &heights), [102.0, 51.5]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Rows and columns of the complete raster.
    shape: [usize; 2],
    cell: [f64; 2],
    origin: [f64; 2],
    /// Row and column of the window's north-west cell.
    corner: [usize; 2],
    /// Rows and columns of the window.
    size: [usize; 2],
}

impl Place {
    /// The position of a window in a raster; for an uncropped raster, both geometries are the same.
    pub fn of(whole: &Geometry, window: &Geometry) -> Self {
        // Both have cells of the same size, aligned with each other.
        let steps = |axis: usize| ((window.origin[axis] - whole.origin[axis]) / whole.cell[axis]).round() as usize;
        Self {
            shape: [whole.rows, whole.cols],
            cell: whole.cell,
            origin: whole.origin,
            corner: [whole.rows - window.rows - steps(1), steps(0)],
            size: [window.rows, window.cols],
        }
    }

    /// The position written to `path` by the item of a measured DEM. Without such a file, the heights are the complete raster.
    ///
    /// # Errors
    /// A file that cannot be read, or whose window is not inside its raster.
    pub fn read(path: &Path, heights: &Geometry) -> Result<Self, JobError> {
        if !path.is_file() {
            return Ok(Self::of(heights, heights));
        }
        let bytes = sastrugi_store::file::read(path).map_err(|e| JobError::at(path, e))?;
        let place: Self = serde_json::from_slice(&bytes).map_err(JobError::new)?;
        if !(0..2).all(|axis| place.is_inside(axis)) {
            return Err(JobError::new(format!("{}: its window is not inside its raster", path.display())));
        }
        Ok(place)
    }

    /// Whether the window has cells along rows or columns, all of them of the raster.
    fn is_inside(&self, axis: usize) -> bool {
        let end = self.corner[axis].checked_add(self.size[axis]);
        self.size[axis] > 0 && end.is_some_and(|end| end <= self.shape[axis])
    }

    /// Geometry of the complete raster.
    pub fn whole(&self) -> Geometry {
        let [rows, cols] = self.shape;
        Geometry { rows, cols, cell: self.cell, origin: self.origin }
    }

    /// True if the cell size of the heights differs from that of their raster: they were converted from degrees to metres, starting at
    /// their own corner.
    pub fn was_converted(&self, heights: &Geometry) -> bool {
        (0..2).any(|k| (heights.cell[k] / self.cell[k] - 1.0).abs() > 1e-6)
    }

    /// Converts a point from the raster's own coordinates to those of the heights, m.
    pub fn to_heights(self, point: [f64; 2], heights: &Geometry) -> [f64; 2] {
        let corner = self.south_west();
        [0, 1].map(|k| heights.origin[k] + (point[k] - corner[k]) * self.scale(heights, k))
    }

    /// Converts a point from the coordinates of the heights, m, to the raster's own.
    pub fn from_heights(self, point: [f64; 2], heights: &Geometry) -> [f64; 2] {
        let corner = self.south_west();
        [0, 1].map(|k| corner[k] + (point[k] - heights.origin[k]) / self.scale(heights, k))
    }

    /// South-west corner of the window in the raster's own coordinates.
    fn south_west(self) -> [f64; 2] {
        let below = self.shape[0] - self.corner[0] - self.size[0];
        [self.origin[0] + self.corner[1] as f64 * self.cell[0], self.origin[1] + below as f64 * self.cell[1]]
    }

    /// Metres of the heights per unit of the raster, along x or y.
    fn scale(self, heights: &Geometry, axis: usize) -> f64 {
        heights.size()[axis] / (self.cell[axis] * self.size[1 - axis] as f64)
    }

    /// Crops a grid that covers the complete raster to the window.
    pub fn part<T: Copy>(&self, whole: Grid<T>) -> Grid<T> {
        let ([row, col], [rows, cols]) = (self.corner, self.size);
        if self.size == self.shape { whole } else { whole.window(row, col, rows, cols) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: Geometry = Geometry { rows: 10, cols: 20, cell: [0.5, 0.25], origin: [100.0, 50.0] };

    fn place() -> Place {
        Place::of(&WHOLE, &WHOLE.window(2, 3, 4, 5))
    }

    #[test]
    fn val_a_window_is_found_again() {
        let place = place();
        assert_eq!((place.shape, place.corner, place.size), ([10, 20], [2, 3], [4, 5]));
        assert_eq!(place.whole(), WHOLE);
        let numbers = Grid::new(WHOLE, (0..200).collect::<Vec<u32>>());
        let part = place.part(numbers.clone());
        assert_eq!((part.geometry, part.at(0, 0), part.at(3, 4)), (WHOLE.window(2, 3, 4, 5), 43, 107));
        assert_eq!(Place::of(&WHOLE, &WHOLE).part(numbers.clone()), numbers);
    }

    /// Heights that were not converted keep the coordinates of their raster; converted ones start at their own corner, and each axis has
    /// its own scale.
    #[test]
    fn val_points_move_between_raster_and_heights() {
        let place = place();
        let window = WHOLE.window(2, 3, 4, 5);
        assert!(!place.was_converted(&window));
        assert_eq!(place.to_heights([102.25, 51.75], &window), [102.25, 51.75]);
        let metres = Geometry { cell: [30.0, 40.0], origin: [0.0; 2], ..window };
        assert!(place.was_converted(&metres));
        let corners = [([101.5, 51.0], [0.0, 0.0]), ([104.0, 52.0], [150.0, 160.0]), ([102.0, 51.5], [30.0, 80.0])];
        for (point, at) in corners {
            assert_eq!((place.to_heights(point, &metres), place.from_heights(at, &metres)), (at, point));
        }
    }

    /// Rounding of the cell size is not a conversion; a change of either side is.
    #[test]
    fn val_conversions_are_told_from_rounding() {
        let place = place();
        let sized = |cell: [f64; 2]| Geometry { cell, ..WHOLE.window(2, 3, 4, 5) };
        assert!(!place.was_converted(&sized([0.5 * (1.0 + 1e-7), 0.25 * (1.0 - 1e-7)])));
        assert!(place.was_converted(&sized([0.5 * (1.0 + 1e-5), 0.25])));
        assert!(place.was_converted(&sized([0.5, 0.25 * (1.0 - 1e-5)])));
    }

    /// Without a file, the heights are the complete raster; a damaged file is an error, not the complete raster.
    #[test]
    fn val_places_are_read_from_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(PLACE);
        assert_eq!(Place::read(&path, &WHOLE).unwrap(), Place::of(&WHOLE, &WHOLE));
        std::fs::write(&path, serde_json::to_vec(&place()).unwrap()).unwrap();
        assert_eq!(Place::read(&path, &WHOLE).unwrap(), place());
        std::fs::write(&path, b"{}").unwrap();
        assert!(Place::read(&path, &WHOLE).is_err());
        // One column or row too many, no rows, and numbers that overflow.
        for (corner, size) in [([2, 16], [4, 5]), ([7, 3], [4, 5]), ([2, 3], [0, 5]), ([2, usize::MAX], [4, 5])] {
            std::fs::write(&path, serde_json::to_vec(&Place { corner, size, ..place() }).unwrap()).unwrap();
            let error = Place::read(&path, &WHOLE).unwrap_err().to_string();
            assert!(error.contains("its window is not inside its raster"), "{error}");
        }
    }
}
