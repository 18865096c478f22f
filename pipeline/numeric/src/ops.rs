//! Cell-by-cell arithmetic on grids of the same shape.

use crate::grid::Grid;
use crate::sums;
use rayon::prelude::*;

/// `f(a, b)` in every cell.
///
/// # Panics
/// If the shapes differ (a bug of the caller).
pub fn combine(a: &Grid, b: &Grid, f: impl Fn(f64, f64) -> f64 + Sync + Send) -> Grid {
    assert_eq!((a.rows(), a.cols()), (b.rows(), b.cols()), "grids must have the same shape");
    let values = a.values.par_iter().with_min_len(1 << 14).zip(&b.values).map(|(&x, &y)| f(x, y)).collect();
    Grid { geometry: a.geometry, values }
}

/// Cell-by-cell sum.
pub fn add(a: &Grid, b: &Grid) -> Grid {
    combine(a, b, |x, y| x + y)
}

/// Cell-by-cell product.
pub fn multiply(a: &Grid, b: &Grid) -> Grid {
    combine(a, b, |x, y| x * y)
}

/// The grid minus the mean of its cells with data.
pub fn without_mean(grid: &Grid) -> Grid {
    let mean = sums::mean(&sums::finite(&grid.values));
    grid.map(|v| v - mean)
}

/// Largest absolute value of the cells with data; 0 if there are none.
pub fn max_abs(grid: &Grid) -> f64 {
    grid.values.iter().filter(|v| v.is_finite()).fold(0.0, |m, v| f64::max(m, v.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Geometry;

    const GEOMETRY: Geometry = Geometry { rows: 2, cols: 3, cell: [0.5, 0.25], origin: [3.0, -2.0] };

    fn grid(values: [f64; 6]) -> Grid {
        Grid::new(GEOMETRY, values.to_vec())
    }

    /// The result has the position of the first grid.
    #[test]
    fn val_arithmetic_is_cell_by_cell() {
        let a = grid([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let b = Grid::new(Geometry::square(2, 3, 1.0), vec![6.0, 5.0, 4.0, 3.0, 2.0, -1.0]);
        assert_eq!(add(&a, &b), grid([7.0, 7.0, 7.0, 7.0, 7.0, 5.0]));
        assert_eq!(multiply(&a, &b), grid([6.0, 10.0, 12.0, 12.0, 10.0, -6.0]));
        assert_eq!(combine(&a, &b, |x, y| x - y), grid([-5.0, -3.0, -1.0, 1.0, 3.0, 7.0]));
    }

    #[test]
    #[should_panic(expected = "grids must have the same shape")]
    fn val_transposed_grids_are_refused() {
        add(&Grid::filled(Geometry::square(2, 3, 1.0), 0.0), &Grid::filled(Geometry::square(3, 2, 1.0), 0.0));
    }

    /// Cells without data stay so, and count neither for the mean nor for the largest value.
    #[test]
    fn val_cells_without_data_do_not_count() {
        let holed = grid([1.0, -8.0, f64::NAN, 3.0, 6.0, f64::NAN]);
        let level = without_mean(&holed);
        assert_eq!([0, 1, 3, 4].map(|k| level.values[k]), [0.5, -8.5, 2.5, 5.5]);
        assert!(level.values[2].is_nan() && level.values[5].is_nan() && level.geometry == GEOMETRY);
        assert_eq!(max_abs(&holed), 8.0);
        assert_eq!(max_abs(&grid([f64::NAN; 6])), 0.0);
    }
}
