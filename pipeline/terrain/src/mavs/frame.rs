//! Position of a surface in the world that it is part of.

use crate::size::Size;
use sastrugi_numeric::Geometry;
use sastrugi_schemas::ParameterError;

/// A quotient this close to an integer counts as that integer.
const INTEGER_TOLERANCE: f64 = 1e-6;
/// Largest distance from the world's origin, cells.
const CELLS_MAX: f64 = 1e12;

/// A checked size and its offset in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The size.
    pub size: Size,
    /// Cells from the world's origin to the surface's south-west corner, east and north.
    before: [i64; 2],
}

impl Frame {
    /// The frame of a surface whose south-west corner lies at `origin_m`.
    ///
    /// # Errors
    /// An origin that is not a whole number of cells (to 1e-6 of a cell), or more than 1e12 cells away.
    pub fn check(size: Size, origin_m: [f64; 2]) -> Result<Self, ParameterError> {
        let cells = origin_m.map(|o| o / size.cell_m);
        let whole = |q: &f64| (q - q.round()).abs() <= INTEGER_TOLERANCE && q.abs() <= CELLS_MAX;
        if cells.iter().all(whole) {
            Ok(Self { size, before: cells.map(|q| q.round() as i64) })
        } else {
            let [x, y] = origin_m;
            let message = format!(
                "is [{x}, {y}]; both must be whole multiples of the {} m cell, at most 1e12 cells",
                size.cell_m
            );
            Err(ParameterError::new("origin_m", message))
        }
    }

    /// Refuses a lattice or correlation length, derived from the parameter `key`, that the cells cannot resolve.
    ///
    /// # Errors
    /// A length that is not finite and above 0, or shorter than a cell.
    pub fn resolves(&self, key: &str, length_m: f64) -> Result<(), ParameterError> {
        ParameterError::positive(key, length_m)?;
        let cell_m = self.size.cell_m;
        if length_m >= cell_m {
            Ok(())
        } else {
            Err(ParameterError::new(
                key,
                format!("gives a length of {length_m} m; it must be at least one cell, {cell_m} m"),
            ))
        }
    }

    /// The same cells with their corner at the origin of the world.
    pub fn at_origin(self) -> Self {
        Self { before: [0; 2], ..self }
    }

    /// Number of columns.
    pub fn cols(&self) -> usize {
        self.size.cols()
    }

    /// Easting of the centre of a column.
    pub fn x_m(&self, col: usize) -> f64 {
        ((self.before[0] + col as i64) as f64 + 0.5) * self.size.cell_m
    }

    /// Northing of the centre of a row.
    pub fn y_m(&self, row: usize) -> f64 {
        let north = (self.size.rows() - 1 - row) as i64;
        ((self.before[1] + north) as f64 + 0.5) * self.size.cell_m
    }

    /// The south-west corner, m.
    pub fn origin_m(&self) -> [f64; 2] {
        self.before.map(|cells| cells as f64 * self.size.cell_m)
    }

    /// The grid in world coordinates.
    pub fn geometry(&self) -> Geometry {
        Geometry { origin: self.origin_m(), ..self.size.geometry() }
    }

    /// Shorter and longer side, m.
    pub fn sides_m(&self) -> [f64; 2] {
        let [x, y] = self.geometry().size();
        [x.min(y), x.max(y)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 5 x 4 cells of 0.5 m.
    fn frame_at(origin_m: [f64; 2]) -> Result<Frame, ParameterError> {
        Frame::check(Size::check(None, Some([5, 4]), 0.5, [1, 1])?, origin_m)
    }

    #[test]
    fn val_cells_lie_where_the_geometry_puts_them() {
        let frame = frame_at([-1.0, 7.5]).unwrap();
        assert_eq!((frame.x_m(0), frame.x_m(4)), (-0.75, 1.25));
        // Row 0 is the northern one.
        assert_eq!((frame.y_m(0), frame.y_m(3)), (9.25, 7.75));
        let g = frame.geometry();
        assert!((0..5).all(|col| frame.x_m(col) == g.x(col)) && (0..4).all(|row| frame.y_m(row) == g.y(row)));
        assert_eq!((frame.sides_m(), frame.at_origin().origin_m()), ([2.0, 2.5], [0.0, 0.0]));
    }

    /// Origins count as whole cells up to 1e-6 of a cell, and up to 1e12 cells from the world's origin.
    #[test]
    fn val_origins_off_the_cells_are_refused() {
        for origin_m in [[0.25, 0.0], [0.0, 0.5 + 1e-6], [f64::NAN, 0.0], [0.0, f64::INFINITY], [6e11, 0.0]] {
            assert_eq!(frame_at(origin_m).map_err(|e| e.key), Err("origin_m".to_owned()), "{origin_m:?}");
        }
        assert_eq!(frame_at([0.5 + 1e-7, -5e11]).unwrap().origin_m(), [0.5, -5e11]);
    }

    #[test]
    fn val_lengths_below_a_cell_are_refused() {
        let frame = frame_at([0.0; 2]).unwrap();
        assert_eq!(frame.resolves("lo_len_m", 0.5), Ok(()));
        for length_m in [0.499, 0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(frame.resolves("lo_len_m", length_m).unwrap_err().key, "lo_len_m", "{length_m}");
        }
    }
}
