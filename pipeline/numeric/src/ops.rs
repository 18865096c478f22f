//! Cell-by-cell arithmetic on grids of one shape.

use crate::grid::Grid;
use crate::sums;
use rayon::prelude::*;

/// `f(a, b)` in every cell.
///
/// # Panics
/// If the shapes differ (a bug of the caller).
pub fn combine(a: &Grid, b: &Grid, f: impl Fn(f64, f64) -> f64 + Sync + Send) -> Grid {
    assert_eq!((a.rows(), a.cols()), (b.rows(), b.cols()), "grids of one shape");
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

/// The grid less the mean of its cells with data.
pub fn without_mean(grid: &Grid) -> Grid {
    let mean = sums::mean(&sums::finite(&grid.values));
    grid.map(|v| v - mean)
}

/// Largest absolute value of the cells with data; 0 when there is none.
pub fn max_abs(grid: &Grid) -> f64 {
    grid.values.iter().filter(|v| v.is_finite()).fold(0.0, |m, v| f64::max(m, v.abs()))
}
