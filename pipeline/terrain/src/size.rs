//! The common size parameters `size_m`, `size_px` and `cell_m`.

use sastrugi_numeric::Geometry;
use sastrugi_schemas::{ParameterError, shown};

/// Minimum number of cells along a side.
pub(crate) const MIN_SIDE_PX: u32 = 3;
/// Maximum number of cells of a heightfield: 2 GiB of heights, the most that can be read back.
const MAX_CELLS: u64 = 1 << 28;
/// A quotient this close to an integer counts as that integer.
const INTEGER_TOLERANCE: f64 = 1e-6;

/// A checked size in cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Columns (east) and rows (north).
    pub px: [u32; 2],
    /// Side of the square cells, m.
    pub cell_m: f64,
    /// The requested size in m, if it is not a whole number of cells.
    rounded_from_m: Option<[f64; 2]>,
}

impl Size {
    /// The size from `size_m` or `size_px` (not both; `default_px` when neither is given) and `cell_m`. Metres become
    /// `round(size / cell)` cells if `size / cell` is within 1e-6 of an integer, else the number of complete cells that fit.
    ///
    /// # Errors
    /// A [`ParameterError`] for a size or a cell that is not positive and finite, fewer than 3 cells along a side, or
    /// more than 2^28 cells.
    pub fn check(
        size_m: Option<[f64; 2]>,
        size_px: Option<[u32; 2]>,
        cell_m: f64,
        default_px: [u32; 2],
    ) -> Result<Self, ParameterError> {
        ParameterError::positive("cell_m", cell_m)?;
        let size = match (size_m, size_px) {
            (Some(_), Some(_)) => Err(ParameterError::new(
                "size_m",
                "conflicts with `size_px`; give the size either in metres or in cells",
            )),
            (Some(metres), None) => Self::from_metres(metres, cell_m),
            (None, px) => Ok(Self { px: px.unwrap_or(default_px), cell_m, rounded_from_m: None }),
        }?;
        size.within_bounds(if size_m.is_some() { "size_m" } else { "size_px" })
    }

    fn from_metres(size_m: [f64; 2], cell_m: f64) -> Result<Self, ParameterError> {
        for side in size_m {
            ParameterError::positive("size_m", side)?;
        }
        let quotients = size_m.map(|side| side / cell_m);
        let is_whole = |q: f64| (q - q.round()).abs() <= INTEGER_TOLERANCE;
        let px = quotients.map(|q| if is_whole(q) { q.round() } else { q.floor() } as u32);
        let rounded_from_m = (!quotients.into_iter().all(is_whole)).then_some(size_m);
        Ok(Self { px, cell_m, rounded_from_m })
    }

    fn within_bounds(self, key: &str) -> Result<Self, ParameterError> {
        let [x, y] = self.px;
        if x < MIN_SIDE_PX || y < MIN_SIDE_PX {
            return Err(ParameterError::new(key, format!("gives {x} x {y} cells; it must give at least 3 x 3")));
        }
        if u64::from(x) * u64::from(y) > MAX_CELLS {
            return Err(ParameterError::new(key, format!("gives {x} x {y} cells; at most 2^28 cells are allowed")));
        }
        if !self.geometry().size().iter().all(|side| side.is_finite()) {
            let message = format!("is {}; the sides of {x} x {y} such cells overflow", shown(self.cell_m));
            return Err(ParameterError::new("cell_m", message));
        }
        Ok(self)
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.px[1] as usize
    }

    /// Number of columns.
    pub fn cols(&self) -> usize {
        self.px[0] as usize
    }

    /// Number of cells.
    pub fn cells(&self) -> u64 {
        u64::from(self.px[0]) * u64::from(self.px[1])
    }

    /// The grid of this size.
    pub fn geometry(&self) -> Geometry {
        Geometry::square(self.rows(), self.cols(), self.cell_m)
    }

    /// A note on the size, if it was rounded down.
    pub fn note(&self) -> Option<String> {
        let [x, y] = self.rounded_from_m?;
        let [achieved_x, achieved_y] = self.geometry().size();
        Some(format!(
            "{x} x {y} m is not a whole number of {} m cells; rounded down to {} x {} cells, {achieved_x} x {achieved_y} m",
            self.cell_m, self.px[0], self.px[1]
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEFAULT: [u32; 2] = [1009, 1009];

    #[test]
    fn val_metres_become_cells() {
        let cells = |m: [f64; 2], cell| Size::check(Some(m), None, cell, DEFAULT).unwrap();
        assert_eq!(cells([0.3, 50.4], 0.1).px, [3, 504]);
        assert_eq!(cells([50.4, 20.0], 0.05).px, [1008, 400]);
        assert_eq!(cells([50.4, 20.0], 0.05).note(), None);
        let odd = cells([10.06, 10.0], 0.1);
        assert_eq!(odd.px, [100, 100]);
        assert!(odd.note().unwrap().contains("10.06 x 10 m"));
        assert!(odd.note().unwrap().ends_with("rounded down to 100 x 100 cells, 10 x 10 m"), "{:?}", odd.note());
        assert_eq!(Size::check(None, None, 0.05, DEFAULT).unwrap().px, DEFAULT);
    }

    /// Columns come first in a size, rows in a shape.
    #[test]
    fn val_columns_lie_east_and_rows_north() {
        let size = Size::check(None, Some([7, 4]), 0.5, DEFAULT).unwrap();
        assert_eq!((size.cols(), size.rows(), size.cells()), (7, 4, 28));
        assert_eq!((size.geometry().rows, size.geometry().size()), (4, [3.5, 2.0]));
    }

    #[test]
    fn val_the_limits_are_allowed() {
        assert_eq!(Size::check(None, Some([16_384, 16_384]), 1.0, DEFAULT).unwrap().cells(), 1 << 28);
        assert_eq!(Size::check(None, Some([16_384, 16_385]), 1.0, DEFAULT).unwrap_err().key, "size_px");
        assert_eq!(Size::check(None, Some([3, 3]), 1.0, DEFAULT).unwrap().px, [3, 3]);
    }

    #[test]
    fn val_impossible_sizes_are_refused() {
        let refused = |m, px, cell| Size::check(m, px, cell, DEFAULT).unwrap_err().key;
        assert_eq!(refused(None, Some([2, 9]), 1.0), "size_px");
        assert_eq!(refused(None, Some([u32::MAX, u32::MAX]), 1.0), "size_px");
        assert_eq!(refused(Some([1.0, 1.0]), Some([9, 9]), 1.0), "size_m");
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(refused(None, None, bad), "cell_m");
            assert_eq!(refused(Some([bad, 5.0]), None, 0.1), "size_m");
        }
        assert_eq!(refused(Some([1e300, 1e300]), None, 0.1), "size_m");
        assert_eq!(refused(None, Some([9, 9]), 1e308), "cell_m");
    }
}
