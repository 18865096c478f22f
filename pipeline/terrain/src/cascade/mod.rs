//! A true multifractal: fractionally integrated log-normal cascade.
//!
//! # What
//! 1. A normal field with the spectral density (two-sided, over spatial frequency f in cycles/m)
//!    $$ S(f) = \frac{C_1}{\pi f^2}, \quad 1 / L \le f \le f_N , $$
//!    whose variance grows by `2 C1 ln(ratio)` between two scales of that ratio;
//! 2. the flux `e = exp(gamma - Var(gamma) / 2)`, with mean 1: a log-normal cascade continuous in scale, with moment scaling function
//!    $$ K(q) = C_1 (q^2 - q) ; $$
//! 3. its fractional integral of order H: each mode multiplied by `max(f, 1 / L)^-H`;
//! 4. heights: the integral less its mean, scaled to `rms_height_m`.
//!
//! Increments of the heights have the structure exponents `zeta(q) = q H - K(q)` (for the orders q whose moments converge over one
//! surface, about `q < 1 / sqrt(C1)`).
//!
//! C1 is the codimension of the mean flux (0: monofractal, no intermittency), H the exponent of the mean increment, L the outer scale
//! in m, `f_N` the Nyquist frequency.
//!
//! # Source
//! Schertzer and Lovejoy, J. Geophys. Res. 92 (1987) 9693: the fractionally integrated flux, here with Levy index 2. Gagnon, Lovejoy
//! and Schertzer, Nonlin. Processes Geophys. 13 (2006) 541, find C1 = 0.12 and H = 0.66 for the Earth's topography (with Levy index
//! 1.79); these are the defaults. The `multifractal` of Majhor and Bos is different: a product of layers that does not scale like a
//! cascade (`docs/papers/majhor.md`).
//!
//! # Map
//! `flux`: the flux on the same cells, from which K(q) can be checked (`sastrugi_roughness::trace_moments`).
//!
//! # Cost
//! The surface is cut from a periodic one that is wider by one outer scale: three transforms and four grids of that size.

mod params;
#[cfg(test)]
mod tests;

pub use params::{Cascade, RawCascade};

use crate::generator::{Generator, Input, Map, Terrain, TerrainError};
use sastrugi_numeric::fft::RealFft2;
use sastrugi_numeric::{Geometry, Grid, Streams, ops, sums};
use sastrugi_roughness::multifractality::scaling_exponents;
use serde_json::Value;
use std::f64::consts::PI;

/// Name in the registry.
pub const KIND: &str = "cascade";

/// Rough time per cell of the periodic surface, s.
const SECONDS_PER_CELL: f64 = 1.4e-7;

/// Name of the map of the flux.
const FLUX: &str = "flux";

/// Frequencies of the modes of the periodic surface.
#[derive(Clone, Copy)]
struct Modes {
    /// Its rows and columns.
    shape: [usize; 2],
    cell_m: f64,
    /// Lowest and highest frequency of the cascade, cycles/m.
    band: [f64; 2],
}

impl Modes {
    /// Frequency of the mode in stored column `kx` and row `ky`, cycles/m.
    fn frequency(&self, kx: usize, ky: usize) -> f64 {
        let [rows, cols] = self.shape;
        let y = ky.min(rows - ky) as f64 / (rows as f64 * self.cell_m);
        let x = kx as f64 / (cols as f64 * self.cell_m);
        (x * x + y * y).sqrt()
    }

    /// Variance of the cascade's generator in one mode of the full spectrum.
    fn variance(&self, codimension: f64, frequency: f64) -> f64 {
        let [low, high] = self.band;
        if frequency < low || frequency > high {
            return 0.0;
        }
        let per_mode = self.shape.iter().fold(1.0, |area, n| area / (*n as f64 * self.cell_m));
        codimension / (PI * frequency * frequency) * per_mode
    }
}

impl Cascade {
    fn modes(&self) -> Modes {
        let band = [1.0 / self.outer_scale_m, 0.5 / self.size.cell_m];
        Modes { shape: self.shape, cell_m: self.size.cell_m, band }
    }

    /// The flux on the complete periodic surface; its expected mean is 1.
    fn flux(&self, transform: &RealFft2, streams: &Streams) -> Vec<f64> {
        let modes = self.modes();
        let [rows, cols] = self.shape;
        let mut stream = streams.stream("cascade");
        let noise: Vec<f64> = (0..rows * cols).map(|_| stream.normal()).collect();
        let mut spectrum = transform.forward(&noise);
        drop(noise);
        let mut total = Vec::with_capacity(spectrum.half_cols());
        for kx in 0..spectrum.half_cols() {
            let multiplicity = spectrum.multiplicity(kx);
            let column = &mut spectrum.values[kx * rows..(kx + 1) * rows];
            let mut variances = Vec::with_capacity(rows);
            for (ky, mode) in column.iter_mut().enumerate() {
                let variance = modes.variance(self.raw.codimension, modes.frequency(kx, ky));
                *mode *= (variance * (rows * cols) as f64).sqrt();
                variances.push(multiplicity * variance);
            }
            total.push(sums::sum(&variances));
        }
        let half_variance = 0.5 * sums::sum(&total);
        transform.inverse(spectrum).into_iter().map(|g| libm::exp(g - half_variance)).collect()
    }

    /// The fractional integral of the flux.
    fn integrated(&self, transform: &RealFft2, flux: &[f64]) -> Vec<f64> {
        let modes = self.modes();
        let rows = self.shape[0];
        let mut spectrum = transform.forward(flux);
        for (k, mode) in spectrum.values.iter_mut().enumerate() {
            let frequency = modes.frequency(k / rows, k % rows).max(modes.band[0]);
            *mode *= libm::pow(frequency, -self.raw.hurst_exponent);
        }
        transform.inverse(spectrum)
    }

    /// The requested part of the periodic surface.
    fn cut(&self, values: &[f64]) -> Grid {
        let cols = self.shape[1];
        let rows = values.chunks_exact(cols).take(self.size.rows());
        Grid::new(self.size.geometry(), rows.flat_map(|row| &row[..self.size.cols()]).copied().collect())
    }

    /// Expected `zeta(q)` of the heights.
    fn expected_zeta(&self, order: u32) -> f64 {
        let q = f64::from(order);
        q * self.raw.hurst_exponent - self.raw.codimension * (q * q - q)
    }

    /// A note on the structure exponents, if the surface is wide enough to estimate them.
    fn exponents_note(&self, heights: &Grid) -> Option<String> {
        let found = scaling_exponents(heights)?;
        let one = |e: &sastrugi_roughness::multifractality::ScalingExponent| {
            let (q, expected) = (e.order, self.expected_zeta(e.order));
            format!("zeta({q}) = {:.3} +- {:.3} (expected {expected:.3})", e.zeta, e.standard_error)
        };
        let first: Vec<String> = found.iter().take(2).map(one).collect();
        Some(format!("structure exponents of this surface: {}", first.join(", ")))
    }
}

impl Generator for Cascade {
    fn kind(&self) -> &'static str {
        KIND
    }

    fn geometry(&self) -> Geometry {
        self.size.geometry()
    }

    fn parameters(&self) -> Value {
        serde_json::to_value(&self.raw).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        32 * (self.shape[0] * self.shape[1]) as u64
    }

    fn seconds(&self) -> f64 {
        SECONDS_PER_CELL * (self.shape[0] * self.shape[1]) as f64
    }

    fn notes(&self) -> Vec<String> {
        self.size.note().into_iter().collect()
    }

    fn generate(&self, streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
        let transform = RealFft2::new(self.shape[0], self.shape[1]);
        let flux = self.flux(&transform, streams);
        let level = ops::without_mean(&self.cut(&self.integrated(&transform, &flux)));
        let rms = sums::variance(&level.values).sqrt();
        if !(rms.is_finite() && rms > 0.0) {
            return Err(TerrainError::Unrepresentable {
                part: "the cascade's heights",
                quantity: "their RMS",
                value: rms,
            });
        }
        let heights = level.map(|z| z * (self.raw.rms_height_m / rms));
        let notes = self.exponents_note(&heights).into_iter().collect();
        let maps = vec![Map { name: FLUX, values: self.cut(&flux) }];
        Ok(Terrain { heights, maps, lines: Vec::new(), notes })
    }
}
