//! Smoothing filters.
//!
//! # Gaussian low-pass
//! Convolution with the sampled and normalised Gaussian `w_k = exp(-k^2 / (2 sigma^2)) / sum`, `|k| <= 4 sigma`
//! (rounded), along the rows and then along the columns. Truncation removes 6e-5 of the kernel's mass. Beyond the edge,
//! the grid is continued by its mirror image, edge cell included (`d c b a | a b c d | d c b a`): constants stay
//! constant, the filtered grid keeps the mean of the original, and results are comparable to those of image libraries, which
//! do the same by default. Cost: `8 sigma` multiplications per cell; memory: one additional grid.

use crate::grid::Grid;
use rayon::prelude::*;

/// Half width of the kernel in standard deviations.
const REACH_SIGMAS: f64 = 4.0;

/// Gaussian low-pass with a standard deviation of `sigma_px` cells along both axes. Every cell within the kernel's reach of a cell
/// without data becomes NaN. If `sigma_px` is not positive and finite, the grid is returned unchanged; below 1/8 of a cell, the kernel is a
/// single cell. Time and memory grow with `sigma_px`, so callers must keep it below the size of the grid.
///
/// ```
/// use sastrugi_numeric::filters::gaussian_low_pass;
/// use sastrugi_numeric::{Geometry, Grid, sums};
///
/// let mut spike = Grid::filled(Geometry::square(9, 9, 1.0), 0.0);
/// spike.values[4 * 9 + 4] = 1.0;
/// let smooth = gaussian_low_pass(&spike, 1.0);
/// // The spike is lower and wider, the same to the west and to the south, and the mean is preserved.
/// assert!(smooth.at(4, 4) < 0.2 && smooth.at(4, 3) > 0.05);
/// assert_eq!(smooth.at(4, 3), smooth.at(5, 4));
/// assert!((sums::sum(&smooth.values) - 1.0).abs() < 1e-12);
/// ```
pub fn gaussian_low_pass(grid: &Grid, sigma_px: f64) -> Grid {
    if !(sigma_px > 0.0 && sigma_px.is_finite()) {
        return grid.clone();
    }
    let weights = gaussian_weights(sigma_px);
    let along_rows = filter_rows(grid, &weights);
    filter_cols(&along_rows, &weights)
}

/// Weights at distances 0, 1, 2, ... cells from the centre.
fn gaussian_weights(sigma_px: f64) -> Vec<f64> {
    let reach = (REACH_SIGMAS * sigma_px + 0.5) as usize;
    let bell = |k: usize| libm::exp(-0.5 * (k as f64 / sigma_px) * (k as f64 / sigma_px));
    let bells: Vec<f64> = (0..=reach).map(bell).collect();
    let sum = bells[0] + 2.0 * bells[1..].iter().sum::<f64>();
    bells.iter().map(|b| b / sum).collect()
}

/// Maps `index` on a line of `len` cells, continued indefinitely by mirror images, to a cell of the line.
fn mirrored(index: isize, len: usize) -> usize {
    let place = index.rem_euclid(2 * len as isize) as usize;
    place.min(2 * len - 1 - place)
}

fn filter_rows(grid: &Grid, weights: &[f64]) -> Grid {
    let (cols, reach) = (grid.cols(), weights.len() - 1);
    let source: Vec<usize> = (0..cols + 2 * reach).map(|k| mirrored(k as isize - reach as isize, cols)).collect();
    let mut values = vec![0.0; grid.values.len()];
    values.par_chunks_mut(cols).zip(grid.values.par_chunks(cols)).for_each_init(
        || vec![0.0; source.len()],
        |padded, (out, row)| {
            padded.iter_mut().zip(&source).for_each(|(p, &s)| *p = row[s]);
            convolve(out, weights, |k| (&padded[reach - k..], &padded[reach + k..]));
        },
    );
    Grid { geometry: grid.geometry, values }
}

fn filter_cols(grid: &Grid, weights: &[f64]) -> Grid {
    let mut values = vec![0.0; grid.values.len()];
    let line = |row: isize| grid.row(mirrored(row, grid.rows()));
    values.par_chunks_mut(grid.cols()).enumerate().for_each(|(r, out)| {
        convolve(out, weights, |k| (line(r as isize - k as isize), line(r as isize + k as isize)));
    });
    Grid { geometry: grid.geometry, values }
}

/// `out = w_0 centre + sum_k w_k (before_k + after_k)`, where `pair(k)` are the lines `k` cells before and after.
fn convolve<'a>(out: &mut [f64], weights: &[f64], pair: impl Fn(usize) -> (&'a [f64], &'a [f64])) {
    out.iter_mut().zip(pair(0).0).for_each(|(o, v)| *o = weights[0] * v);
    for (k, weight) in weights.iter().enumerate().skip(1) {
        let (before, after) = pair(k);
        out.iter_mut().zip(before).zip(after).for_each(|((o, b), a)| *o += weight * (b + a));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Geometry;
    use crate::streams::Streams;
    use crate::sums;

    fn noise(rows: usize, cols: usize) -> Grid {
        let mut s = Streams::for_seed(3, "filters-test").stream("noise");
        Grid::new(Geometry::square(rows, cols, 1.0), (0..rows * cols).map(|_| s.normal()).collect())
    }

    /// The definition: a double sum over the kernel, with the edge mirrored explicitly.
    fn direct(grid: &Grid, sigma: f64, row: usize, col: usize) -> f64 {
        let reach = (4.0 * sigma + 0.5) as isize;
        let mirror = |mut k: isize, n: isize| {
            while k < 0 || k >= n {
                k = if k < 0 { -1 - k } else { 2 * n - 1 - k };
            }
            k as usize
        };
        let (mut total, mut mass) = (0.0, 0.0);
        for dr in -reach..=reach {
            for dc in -reach..=reach {
                let weight = libm::exp(-((dr * dr + dc * dc) as f64) / (2.0 * sigma * sigma));
                let r = mirror(row as isize + dr, grid.rows() as isize);
                let c = mirror(col as isize + dc, grid.cols() as isize);
                total += weight * grid.at(r, c);
                mass += weight;
            }
        }
        total / mass
    }

    #[test]
    fn val_equals_the_double_sum() {
        for (rows, cols, sigma) in [(23, 31, 2.0), (5, 3, 4.0), (1, 9, 0.7), (12, 12, 0.1)] {
            let grid = noise(rows, cols);
            let filtered = gaussian_low_pass(&grid, sigma);
            for r in 0..rows {
                for c in 0..cols {
                    let error = (filtered.at(r, c) - direct(&grid, sigma, r, c)).abs();
                    assert!(error < 1e-13, "{rows}x{cols}, sigma {sigma}, at {r},{c}: {error}");
                }
            }
        }
    }

    /// An impulse far from the edge becomes the outer product of the weights, which are those of common image
    /// libraries (truncated at 4 sigma).
    #[test]
    fn val_an_impulse_becomes_the_kernel() {
        let mut grid = Grid::filled(Geometry::square(41, 41, 1.0), 0.0);
        grid.values[20 * 41 + 20] = 1.0;
        let filtered = gaussian_low_pass(&grid, 1.0);
        // 1 / (1 + 2 (e^-0.5 + e^-2 + e^-4.5 + e^-8))
        assert!((filtered.at(20, 20).sqrt() - 0.398_943_469_356_097_8).abs() < 1e-15);
        assert_eq!(filtered.at(20, 25), 0.0);
        // e^-8 along a row; e^-4.5 e^-2 in a row three above and a column two to the east.
        assert!((filtered.at(20, 24) / filtered.at(20, 20) / 3.354_626_279_025_118_5e-4 - 1.0).abs() < 1e-13);
        assert!((filtered.at(17, 22) / filtered.at(20, 20) / 1.503_439_192_977_572_4e-3 - 1.0).abs() < 1e-13);
    }

    #[test]
    fn prop_keeps_the_mean_and_constants() {
        let grid = noise(50, 37);
        let filtered = gaussian_low_pass(&grid, 3.0);
        assert!((sums::mean(&filtered.values) - sums::mean(&grid.values)).abs() < 1e-14);
        let flat = gaussian_low_pass(&Grid::filled(grid.geometry, 7.0), 5.0);
        assert!(flat.values.iter().all(|v| (v - 7.0).abs() < 1e-13));
    }

    #[test]
    fn prop_sigma_zero_is_the_identity() {
        let grid = noise(8, 9);
        assert_eq!(gaussian_low_pass(&grid, 0.0), grid);
        assert_eq!(gaussian_low_pass(&grid, 0.1), grid);
        for sigma_px in [-1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(gaussian_low_pass(&grid, sigma_px), grid);
        }
    }

    /// The kernel of sigma 1 reaches 4 cells, so a cell without data removes a square of 9 x 9 cells.
    #[test]
    fn val_no_data_spreads_as_far_as_the_kernel() {
        let g = Geometry { rows: 15, cols: 17, cell: [0.5, 0.25], origin: [3.0, -2.0] };
        let mut grid = Grid::filled(g, 1.0);
        grid.values[6 * 17 + 7] = f64::NAN;
        let filtered = gaussian_low_pass(&grid, 1.0);
        assert_eq!(filtered.geometry, g);
        for row in 0..15_usize {
            for col in 0..17_usize {
                let is_near = row.abs_diff(6) <= 4 && col.abs_diff(7) <= 4;
                assert_eq!(filtered.at(row, col).is_nan(), is_near, "{row} {col}");
            }
        }
    }
}
