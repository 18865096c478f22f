//! Spectrum of a covariance on a torus: real, as the covariance is even, and where rows and columns of the torus are axes
//! of symmetry also even in each wavenumber, so that a quarter of it is computed.

use super::sums;
use crate::covariance::Covariance;
use crate::covariance::filtered::torus_covariance;
use rayon::prelude::*;
use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2, Transform};
use std::f64::consts::PI;

/// The eigenvalues `lambda(kx, ky)` of a covariance on a torus, m2, for `kx <= cols / 2`.
pub struct Spectrum {
    rows: usize,
    cols: usize,
    /// Row frequencies stored: `rows / 2 + 1` of an even spectrum, else `rows`.
    stored: usize,
    /// `values[kx * stored + ky]`.
    values: Vec<f64>,
}

impl Spectrum {
    /// Spectrum of `covariance` on a torus of `[rows, cols]` cells of `cell_m = [east-west, north-south]`, each lag taken
    /// the short way round.
    pub fn of(covariance: &Covariance, [rows, cols]: [usize; 2], cell_m: [f64; 2]) -> Self {
        match stretches(covariance) {
            Some(stretch) => Self::even(covariance, [rows, cols], [cell_m[0] * stretch[0], cell_m[1] * stretch[1]]),
            None => {
                let half = RealFft2::new(rows, cols).forward(&torus_covariance([rows, cols], cell_m, covariance));
                Self { rows, cols, stored: rows, values: half.values.iter().map(|v| v.re).collect() }
            }
        }
    }

    /// Of a covariance that is isotropic once cells have these sides.
    fn even(covariance: &Covariance, [rows, cols]: [usize; 2], [dx, dy]: [f64; 2]) -> Self {
        let (half_rows, half_cols) = (rows / 2 + 1, cols / 2 + 1);
        let mut by_row = vec![0.0; half_rows * half_cols];
        // Square cells: whole numbers under the root, so that cells as far from the origin have the same bits.
        let aspect = dy / dx;
        by_row.par_chunks_mut(half_cols).enumerate().for_each(|(r, line)| {
            let y = r as f64 * aspect;
            for (c, v) in line.iter_mut().enumerate() {
                let x = c as f64;
                *v = covariance.at_distance((x * x + y * y).sqrt() * dx);
            }
        });
        even_transforms(&mut by_row, cols);
        let mut values = transposed(&by_row, half_cols);
        drop(by_row);
        even_transforms(&mut values, rows);
        Self { rows, cols, stored: half_rows, values }
    }

    /// Eq. 10 of Vecherin et al. 2022 with its missing factor, `2 pi sigma^2 b^2 / (1 + b^2 k^2)^(3/2)`, at the wavenumbers
    /// of the torus and per cell: an isotropic exponential's spectrum as if space had no bounds and no grid.
    pub fn eq10(sigma_m: f64, range_m: f64, [rows, cols]: [usize; 2], cell_m: [f64; 2]) -> Self {
        let (half_rows, half_cols) = (rows / 2 + 1, cols / 2 + 1);
        let step = |n: usize, cell: f64| 2.0 * PI * range_m / (n as f64 * cell);
        let (step_x, step_y) = (step(cols, cell_m[0]), step(rows, cell_m[1]));
        let peak = 2.0 * PI * (sigma_m * range_m) * (sigma_m * range_m) / (cell_m[0] * cell_m[1]);
        let at = |kx: usize, ky: usize| {
            let (x, y) = (kx as f64 * step_x, ky as f64 * step_y);
            let q = 1.0 + x * x + y * y;
            peak / (q * q.sqrt())
        };
        let values = (0..half_cols).flat_map(|kx| (0..half_rows).map(move |ky| (kx, ky))).map(|(kx, ky)| at(kx, ky));
        Self { rows, cols, stored: half_rows, values: values.collect() }
    }

    /// The eigenvalue at column frequency `kx <= cols / 2` and row frequency `ky < rows`.
    pub fn at(&self, kx: usize, ky: usize) -> f64 {
        let ky = if self.stored < self.rows { ky.min(self.rows - ky) } else { ky };
        self.values[kx * self.stored + ky]
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

    /// Share of the spectrum that is negative.
    pub fn negative_share(&self) -> f64 {
        let negative = self.negative();
        negative / (self.total() + 2.0 * negative)
    }

    /// The covariance that belongs to it, row-major, m2.
    pub fn covariance(&self) -> Vec<f64> {
        let (rows, cols) = (self.rows, self.cols);
        let modes = (0..=cols / 2).flat_map(|kx| (0..rows).map(move |ky| (kx, ky)));
        let values = modes.map(|(kx, ky)| Complex64::new(self.at(kx, ky), 0.0)).collect();
        RealFft2::new(rows, cols).inverse(HalfSpectrum { rows, cols, values })
    }

    fn weighted_sum(&self, f: impl Fn(f64) -> f64) -> f64 {
        let twice = |k: usize, n: usize| if k == 0 || 2 * k == n { 1.0 } else { 2.0 };
        let of_row = |ky: usize| if self.stored < self.rows { twice(ky, self.rows) } else { 1.0 };
        let columns: Vec<f64> = self
            .values
            .chunks_exact(self.stored)
            .enumerate()
            .map(|(kx, column)| {
                let line: Vec<f64> = column.iter().enumerate().map(|(ky, &v)| of_row(ky) * f(v)).collect();
                twice(kx, self.cols) * sums::sum(&line)
            })
            .collect();
        sums::sum(&columns)
    }
}

/// Factors for lags east-west and north-south that make the covariance isotropic, where its axes are those of the grid.
fn stretches(covariance: &Covariance) -> Option<[f64; 2]> {
    let across = 1.0 / covariance.ratio;
    match covariance.azimuth_deg {
        _ if covariance.is_isotropic() => Some([1.0, 1.0]),
        0.0 => Some([across, 1.0]),
        90.0 => Some([1.0, across]),
        _ => None,
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
