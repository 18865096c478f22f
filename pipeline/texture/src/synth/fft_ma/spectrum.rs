//! Spectrum of a covariance on a torus. It is real, as the covariance is even; if rows and columns of the torus are axes
//! of symmetry it is also even in each wavenumber, so that only a quarter of it is computed.

use super::{reach, sums};
use crate::covariance::Covariance;
use crate::covariance::filtered::torus_covariance;
use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2, even_spectrum};
use std::f64::consts::PI;

/// Share of its variance below which a term of the covariance is taken as zero, far below the rounding of a transform.
const NEGLIGIBLE: f64 = 1e-20;

/// The eigenvalues `lambda(kx, ky)` of a covariance on a torus, m2, for `kx <= cols / 2`.
#[derive(Clone)]
pub struct Spectrum {
    rows: usize,
    cols: usize,
    /// Row frequencies stored: `rows / 2 + 1` for an even spectrum, otherwise `rows`.
    stored: usize,
    /// `values[kx * stored + ky]`.
    values: Vec<f64>,
}

impl Spectrum {
    /// Spectrum of `covariance` on a torus of `[rows, cols]` cells of `cell_m = [east-west, north-south]`, each lag taken
    /// the shorter way around.
    pub fn of(covariance: &Covariance, [rows, cols]: [usize; 2], cell_m: [f64; 2]) -> Self {
        match stretches(covariance) {
            Some(stretch) => Self::even(covariance, [rows, cols], [cell_m[0] * stretch[0], cell_m[1] * stretch[1]]),
            None => {
                let half = RealFft2::new(rows, cols).forward(&torus_covariance([rows, cols], cell_m, covariance));
                Self { rows, cols, stored: rows, values: half.values.iter().map(|v| v.re).collect() }
            }
        }
    }

    /// A spectrum in the order of a half spectrum.
    pub fn of_values([rows, cols]: [usize; 2], values: Vec<f64>) -> Self {
        Self { rows, cols, stored: rows, values }
    }

    /// Spectrum of a covariance that is isotropic on cells stretched to these sides.
    fn even(covariance: &Covariance, [rows, cols]: [usize; 2], [dx, dy]: [f64; 2]) -> Self {
        // For square cells the root is of integers, so that cells at equal distance from the origin get identical values.
        let aspect = dy / dx;
        let reach = reach::reach_m(covariance, NEGLIGIBLE) / dx;
        let covariance = covariance.by_distance();
        let values = even_spectrum([rows, cols], |r, line| {
            let y = r as f64 * aspect;
            // Beyond the reach the root is NaN, which becomes 0 as an integer.
            let within = ((reach * reach - y * y).sqrt().ceil() as usize).min(line.len());
            let (near, far) = line.split_at_mut(within);
            for (c, v) in near.iter_mut().enumerate() {
                let x = c as f64;
                *v = covariance((x * x + y * y).sqrt() * dx);
            }
            far.fill(0.0);
        });
        Self { rows, cols, stored: rows / 2 + 1, values }
    }

    /// Eq. 10 of Vecherin et al. 2022 with its missing factor, `2 pi sigma^2 b^2 / (1 + b^2 k^2)^(3/2)`, at the wavenumbers
    /// of the torus and per cell: the spectrum of an isotropic exponential in unbounded continuous space.
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
        if self.values.iter().all(|v| *v >= 0.0) {
            return 0.0;
        }
        // Rounding errors of the transforms do not count as negative eigenvalues.
        let rounding = 1e-14 * self.values.iter().fold(0.0, |m, v| f64::max(m, v.abs()));
        self.weighted_sum(|v| if v < -rounding { -v } else { 0.0 })
    }

    /// Share of the spectrum that is negative.
    pub fn negative_share(&self) -> f64 {
        let negative = self.negative();
        if negative == 0.0 { 0.0 } else { negative / (self.total() + 2.0 * negative) }
    }

    /// The magnitudes `sqrt(lambda M)` of the modes of a field; 0 for negative eigenvalues.
    pub fn amplitudes(mut self) -> Self {
        let cells = (self.rows * self.cols) as f64;
        self.values.iter_mut().for_each(|v| *v = (v.max(0.0) * cells).sqrt());
        self
    }

    /// The corresponding covariance, row-major, m2.
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

/// Whether the axes of anisotropy are not those of the grid.
pub fn is_oblique(covariance: &Covariance) -> bool {
    stretches(covariance).is_none()
}

/// Factors for lags east-west and north-south that make the covariance isotropic, if its axes are those of the grid.
fn stretches(covariance: &Covariance) -> Option<[f64; 2]> {
    let across = 1.0 / covariance.ratio;
    match covariance.azimuth_deg {
        _ if covariance.is_isotropic() => Some([1.0, 1.0]),
        0.0 => Some([across, 1.0]),
        90.0 => Some([1.0, across]),
        _ => None,
    }
}
