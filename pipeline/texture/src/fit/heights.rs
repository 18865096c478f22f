//! Sources of heights: a raster in memory, one that is read in parts, or transects.

use super::FitError;
use sastrugi_numeric::{Geometry, Grid};
use std::ops::Range;

/// Heights that are read in parts, so that a raster need not fit into memory.
pub trait Heights: Sync {
    /// Shape and position; cells in m.
    fn geometry(&self) -> Geometry;

    /// Replaces the contents of `part` by the heights of these rows and columns, m, row-major; not finite where there is no
    /// data. A fit calls this from one thread, and never from within the thread pool.
    ///
    /// # Errors
    /// Why the part could not be read, as a sentence.
    fn read(&self, rows: Range<usize>, cols: Range<usize>, part: &mut Vec<f64>) -> Result<(), String>;

    /// True if each row is a separate transect, so that adjacent rows are not neighbours on the ground.
    fn are_profiles(&self) -> bool {
        false
    }
}

impl Heights for Grid {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn read(&self, rows: Range<usize>, cols: Range<usize>, part: &mut Vec<f64>) -> Result<(), String> {
        part.clear();
        part.reserve(rows.len() * cols.len());
        rows.for_each(|r| part.extend_from_slice(&self.row(r)[cols.clone()]));
        Ok(())
    }
}

/// Transects with the same spacing.
#[derive(Clone, Debug)]
pub struct Profiles {
    /// One transect in each row; NaN where there is no height.
    grid: Grid,
}

impl Profiles {
    /// Transects of heights in m, one every `spacing_m`; shorter ones are padded with no data at their end.
    ///
    /// # Errors
    /// No transect with a height.
    ///
    /// ```
    /// use sastrugi_texture::{Heights, Profiles};
    ///
    /// let profiles = Profiles::new(0.1, &[vec![0.0, 0.02, 0.01], vec![0.03, 0.01]]).unwrap();
    /// let geometry = profiles.geometry();
    /// assert_eq!((geometry.rows, geometry.cols, geometry.cell[0]), (2, 3, 0.1));
    /// // The shorter one ends with no data.
    /// let mut heights = Vec::new();
    /// profiles.read(1..2, 0..3, &mut heights).unwrap();
    /// assert!(heights[..2] == [0.03, 0.01] && heights[2].is_nan());
    /// assert!(Profiles::new(0.1, &[]).is_err());
    /// ```
    pub fn new(spacing_m: f64, heights_m: &[Vec<f64>]) -> Result<Self, FitError> {
        let cols = heights_m.iter().map(Vec::len).max().unwrap_or(0);
        if cols == 0 {
            return Err(FitError::NoData { cells: 0 });
        }
        let mut values = Vec::with_capacity(cols * heights_m.len());
        for profile in heights_m {
            values.extend_from_slice(profile);
            values.resize(values.len() + cols - profile.len(), f64::NAN);
        }
        Ok(Self::of(Grid::new(Geometry::square(heights_m.len(), cols, spacing_m), values)))
    }

    /// The rows of a grid.
    pub(super) fn of(grid: Grid) -> Self {
        Self { grid }
    }
}

impl Heights for Profiles {
    fn geometry(&self) -> Geometry {
        self.grid.geometry
    }

    fn read(&self, rows: Range<usize>, cols: Range<usize>, part: &mut Vec<f64>) -> Result<(), String> {
        self.grid.read(rows, cols, part)
    }

    fn are_profiles(&self) -> bool {
        true
    }
}
