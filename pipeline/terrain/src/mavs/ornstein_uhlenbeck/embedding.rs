//! An isotropic field by circulant embedding.
//!
//! The torus is at least twice the surface and at least 8 correlation lengths larger. The covariance on it has the eigenvalues
//! `lambda = FFT(covariance)`. Modes with independent normal real and imaginary parts and mean square `M lambda` (M cells of the
//! torus) give a field with exactly that covariance. Truncating the covariance at half the torus can leave negative eigenvalues;
//! they are set to 0, and if their magnitudes exceed 1e-3 of the sum of all magnitudes it is an error.
//!
//! Each column frequency draws its modes from its own stream, so that they can be drawn in parallel.
//!
//! Cost: two normal deviates per mode and an inverse real transform of the torus.

use super::Covariance;
use crate::generator::TerrainError;
use crate::size::Size;
use sastrugi_numeric::fft::{Complex64, RealFft2, even_spectrum, smooth_length};
use sastrugi_numeric::{Geometry, Grid, Streams, sums};
use std::f64::consts::FRAC_1_SQRT_2;

/// Largest share of negative eigenvalues in the sum of all magnitudes.
const NEGATIVE_SHARE_MAX: f64 = 1e-3;
/// Correlation lengths by which the torus exceeds the surface.
const MARGIN_LENGTHS: f64 = 8.0;

/// Cells of the torus along an axis with `cells` cells.
fn torus_length(cells: usize, cell_m: f64, length_m: f64) -> usize {
    let margin = (MARGIN_LENGTHS * length_m / cell_m).ceil() as usize;
    smooth_length((2 * cells).max(cells + margin))
}

/// Cells of the torus.
pub fn torus_cells(size: &Size, length_m: f64) -> u64 {
    let along = |cells| torus_length(cells, size.cell_m, length_m) as u64;
    along(size.rows()).saturating_mul(along(size.cols()))
}

/// Peak memory of [`field`] without its result, bytes.
pub fn memory_bytes(size: &Size, length_m: f64) -> u64 {
    // A quarter of the eigenvalues, plus a half spectrum and the torus it is transformed to.
    18 * torus_cells(size, length_m)
}

/// The field.
///
/// # Errors
/// A covariance that cannot be embedded in the torus.
pub fn field(
    streams: &Streams,
    geometry: Geometry,
    rms_m: f64,
    length_m: f64,
    covariance: Covariance,
) -> Result<Grid, TerrainError> {
    let [rows, cols] = [geometry.rows, geometry.cols].map(|n| torus_length(n, geometry.cell[0], length_m));
    let eigenvalues = eigenvalues([rows, cols], rms_m, length_m / geometry.cell[0], covariance);
    let share = negative_share(&eigenvalues);
    if share > NEGATIVE_SHARE_MAX {
        return Err(TerrainError::Covariance { share });
    }
    let half_rows = rows / 2 + 1;
    let modes = streams.child("modes");
    let torus = RealFft2::new(rows, cols).inverse_of(|kx, column| {
        let mut stream = modes.stream(&kx.to_string());
        // In a column that is its own mirror image, only the Hermitian half of the draws takes effect.
        let gain = if kx == 0 || 2 * kx == cols { 1.0 } else { FRAC_1_SQRT_2 };
        for (ky, mode) in column.iter_mut().enumerate() {
            let eigenvalue = eigenvalues[kx * half_rows + ky.min(rows - ky)].max(0.0);
            let size = gain * (eigenvalue * (rows * cols) as f64).sqrt();
            *mode = Complex64::new(size * stream.normal(), size * stream.normal());
        }
    });
    let kept = torus.chunks_exact(cols).take(geometry.rows).flat_map(|row| &row[..geometry.cols]);
    Ok(Grid { geometry, values: kept.copied().collect() })
}

/// Eigenvalues of the covariance on the torus: a quarter of them, because the others repeat these.
fn eigenvalues([rows, cols]: [usize; 2], rms_m: f64, length_cells: f64, covariance: Covariance) -> Vec<f64> {
    even_spectrum([rows, cols], |row, line| {
        for (col, v) in line.iter_mut().enumerate() {
            let square = ((row * row + col * col) as f64) / (length_cells * length_cells);
            let decay = match covariance {
                Covariance::Exponential => square.sqrt(),
                Covariance::Gaussian => square,
            };
            *v = rms_m * rms_m * libm::exp(-decay);
        }
    })
}

/// Sum of the magnitudes of the negative eigenvalues over that of all.
fn negative_share(eigenvalues: &[f64]) -> f64 {
    let sizes = |kept: fn(f64) -> f64| sums::sum(&eigenvalues.iter().map(|v| kept(*v)).collect::<Vec<_>>());
    sizes(|v| (-v).max(0.0)) / sizes(f64::abs)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Over the whole torus the eigenvalues add up to cells times variance, and the first is the sum of the covariance.
    #[test]
    fn val_eigenvalues_add_up_to_the_variance() {
        let (rows, cols, variance_m2) = (40, 36, 0.0025);
        for covariance in [Covariance::Exponential, Covariance::Gaussian] {
            let found = eigenvalues([rows, cols], 0.05, 3.0, covariance);
            let half_rows = rows / 2 + 1;
            // A frequency and its mirror image share an eigenvalue.
            let count = |k: usize, n: usize| if k == 0 || 2 * k == n { 1.0 } else { 2.0 };
            let weighted = |(k, v): (usize, &f64)| count(k / half_rows, cols) * count(k % half_rows, rows) * v;
            let total: f64 = found.iter().enumerate().map(weighted).sum();
            assert!((total / (rows * cols) as f64 / variance_m2 - 1.0).abs() < 1e-10, "{covariance:?}: {total}");
            let at = |k: usize| {
                let [y, x] = [(k / cols, rows), (k % cols, cols)].map(|(i, n)| i.min(n - i) as f64 / 3.0);
                let square = x * x + y * y;
                variance_m2 * libm::exp(if covariance == Covariance::Gaussian { -square } else { -square.sqrt() })
            };
            let sum: f64 = (0..rows * cols).map(at).sum();
            assert!((found[0] / sum - 1.0).abs() < 1e-10, "{covariance:?}: {} {sum}", found[0]);
        }
    }

    /// The chosen torus leaves almost no negative eigenvalues; one that is too small for the covariance does.
    #[test]
    fn val_negative_eigenvalues() {
        for covariance in [Covariance::Exponential, Covariance::Gaussian] {
            for (cells, length) in [(30, 40.0), (100, 1.0), (64, 8.0)] {
                let n = torus_length(cells, 1.0, length);
                let share = negative_share(&eigenvalues([n, n], 0.05, length, covariance));
                assert!(share <= NEGATIVE_SHARE_MAX, "{covariance:?} {cells} {length}: {share}");
            }
        }
        assert!(negative_share(&eigenvalues([16, 16], 0.05, 20.0, Covariance::Gaussian)) > NEGATIVE_SHARE_MAX);
    }
}
