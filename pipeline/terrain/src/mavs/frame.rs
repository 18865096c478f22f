//! The cells of a surface in the world that it is a part of.

use crate::size::Size;
use sastrugi_numeric::Geometry;
use sastrugi_schemas::ParameterError;

/// A quotient this near to an integer is that integer.
const INTEGER_TOLERANCE: f64 = 1e-6;
/// Farthest from the world's origin, cells.
const CELLS_MAX: f64 = 1e12;

/// A checked size, and the cells of the world before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The size.
    pub size: Size,
    /// Cells of the world west and south of the surface.
    before: [i64; 2],
}

impl Frame {
    /// The frame of a surface whose south-west corner lies at `origin_m`.
    ///
    /// # Errors
    /// An origin that is no whole number of cells (to 1e-6 of one), or more than 1e12 of them.
    pub fn check(size: Size, origin_m: [f64; 2]) -> Result<Self, ParameterError> {
        let cells = origin_m.map(|o| o / size.cell_m);
        let whole = |q: &f64| (q - q.round()).abs() <= INTEGER_TOLERANCE && q.abs() <= CELLS_MAX;
        if cells.iter().all(whole) {
            Ok(Self { size, before: cells.map(|q| q.round() as i64) })
        } else {
            let [x, y] = origin_m;
            let message = format!("is [{x}, {y}]; it must be whole cells of {} m, at most 1e12 of them", size.cell_m);
            Err(ParameterError::new("origin_m", message))
        }
    }

    /// Refuses a length, that of the lattice or the correlation behind a parameter, that cells cannot show.
    ///
    /// # Errors
    /// A length that is not finite and above 0, or below a cell.
    pub fn resolves(&self, key: &str, length_m: f64) -> Result<(), ParameterError> {
        ParameterError::positive(key, length_m)?;
        let cell_m = self.size.cell_m;
        if length_m >= cell_m {
            Ok(())
        } else {
            Err(ParameterError::new(
                key,
                format!("makes a length of {length_m} m; it must be at least a cell, {cell_m} m"),
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

    /// The grid, where it lies in the world.
    pub fn geometry(&self) -> Geometry {
        Geometry { origin: self.origin_m(), ..self.size.geometry() }
    }

    /// Shorter and longer side, m.
    pub fn sides_m(&self) -> [f64; 2] {
        let [x, y] = self.geometry().size();
        [x.min(y), x.max(y)]
    }
}
