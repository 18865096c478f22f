//! Spectrum of an even covariance on a torus: real, and even in both wavenumbers, so a quarter of it is computed.

use super::sums;
use crate::covariance::Covariance;
use rayon::prelude::*;
use sastrugi_numeric::fft::{Complex64, Transform};

/// The eigenvalues `lambda(kx, ky)` of the covariance, m2, for `kx <= cols / 2` and `ky <= rows / 2`.
pub struct EvenSpectrum {
    rows: usize,
    cols: usize,
    /// `values[kx * (rows / 2 + 1) + ky]`.
    values: Vec<f64>,
}

impl EvenSpectrum {
    /// Spectrum of `covariance` on a torus of `[rows, cols]` square cells.
    pub fn of(covariance: &Covariance, [rows, cols]: [usize; 2], cell_m: f64) -> Self {
        let (half_rows, half_cols) = (rows / 2 + 1, cols / 2 + 1);
        let quarter = |r: usize, c: usize| covariance.at_distance(((r * r + c * c) as f64).sqrt() * cell_m);
        let mut by_row = vec![0.0; half_rows * half_cols];
        by_row.par_chunks_mut(half_cols).enumerate().for_each(|(r, line)| {
            line.iter_mut().enumerate().for_each(|(c, v)| *v = quarter(r, c));
        });
        even_transforms(&mut by_row, cols);
        let mut values = transposed(&by_row, half_cols);
        drop(by_row);
        even_transforms(&mut values, rows);
        Self { rows, cols, values }
    }

    /// The eigenvalue at column frequency `kx <= cols / 2` and row frequency `ky < rows`.
    pub fn at(&self, kx: usize, ky: usize) -> f64 {
        self.values[kx * (self.rows / 2 + 1) + ky.min(self.rows - ky)]
    }

    /// Sum of all eigenvalues (M times the variance).
    pub fn total(&self) -> f64 {
        self.weighted_sum(|v| v)
    }

    /// Sum of the absolute values of the negative eigenvalues.
    pub fn negative(&self) -> f64 {
        // Rounding of the transforms is no negative eigenvalue.
        let rounding = 1e-14 * self.values.iter().fold(0.0, |m, v| f64::max(m, v.abs()));
        self.weighted_sum(|v| if v < -rounding { -v } else { 0.0 })
    }

    fn weighted_sum(&self, f: impl Fn(f64) -> f64) -> f64 {
        let often = |k: usize, n: usize| if k == 0 || 2 * k == n { 1.0 } else { 2.0 };
        let columns: Vec<f64> = self
            .values
            .chunks_exact(self.rows / 2 + 1)
            .enumerate()
            .map(|(kx, column)| {
                let line: Vec<f64> = column.iter().enumerate().map(|(ky, &v)| often(ky, self.rows) * f(v)).collect();
                often(kx, self.cols) * sums::sum(&line)
            })
            .collect();
        sums::sum(&columns)
    }
}

/// Replaces each line (values 0 to `len / 2` of an even sequence of `len`) by its transform, which is real and even
/// too. Two lines share a complex transform: one is the real part, the other the imaginary.
fn even_transforms(lines: &mut [f64], len: usize) {
    let half = len / 2 + 1;
    let transform = Transform::new(len);
    lines.par_chunks_mut(2 * half).for_each_init(
        || (vec![Complex64::default(); len], transform.scratch()),
        |(work, scratch), pair| {
            let (first, second) = pair.split_at_mut(half);
            for k in 0..half {
                work[k] = Complex64::new(first[k], second.get(k).copied().unwrap_or(0.0));
                work[(len - k) % len] = work[k];
            }
            transform.forward(work, scratch);
            first.iter_mut().zip(work.iter()).for_each(|(v, w)| *v = w.re);
            second.iter_mut().zip(work.iter()).for_each(|(v, w)| *v = w.im);
        },
    );
}

/// Transpose of a row-major matrix with rows of `cols`.
fn transposed(matrix: &[f64], cols: usize) -> Vec<f64> {
    /// Columns moved together: four cache lines.
    const BLOCK: usize = 32;
    let rows = matrix.len() / cols;
    let mut out = vec![0.0; matrix.len()];
    out.par_chunks_mut(BLOCK * rows).enumerate().for_each(|(block, out)| {
        for (r, line) in matrix.chunks_exact(cols).enumerate() {
            let columns = &line[block * BLOCK..(block * BLOCK + out.len() / rows)];
            columns.iter().enumerate().for_each(|(k, v)| out[k * rows + r] = *v);
        }
    });
    out
}
