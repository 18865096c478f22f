//! Weierstrass-Mandelbrot surfaces.
//!
//! # What
//! $$ z(x, y) = A \sum_{m=1}^{M} \sum_{n=1}^{n_{max}} \gamma^{(D-3) n}
//!    \left[ \cos\varphi_{mn} - \cos\left( 2\pi \frac{\gamma^n}{L} u_m + \varphi_{mn} \right) \right], \quad
//!    A = L \left(\frac{G}{L}\right)^{D-2} \sqrt{\frac{\ln\gamma}{M}}, \quad
//!    u_m = x \cos\frac{\pi m}{M} + y \sin\frac{\pi m}{M} $$
//! with M ridge directions, frequency ratio gamma > 1, fractal dimension 2 < D < 3, sampling length L (m), elevation
//! scaling G (m), and phases phi uniform in 0 to `phase_max_rad`, drawn in order of n, so that truncating the sum does not
//! change the remaining phases.
//!
//! # Source
//! Majhor and Bos, Eq. 1 and 2, after Ausloos and Berman (1985).
//!
//! # Where we depart
//! * The paper writes `u_m` with `arctan(y / x)`, which is equivalent for x > 0, undefined at the origin, and mirrored for
//!   x < 0. The plane waves above need no case distinction.
//! * Phases cover 2 pi, not pi: see `docs/papers/majhor.md`.
//! * Waves above the grid's Nyquist frequency are left out unless `mode = "paper"` requests their aliases. Even then
//!   the sum ends where double-precision phases are rounding noise (n about 66 of the published 1009).
//!
//! # Cost
//! A surface is a constant minus a sum of `K = M n` plane waves on a regular grid. One non-uniform Fourier transform
//! (`plane_waves`) computes it at about the cost of one real transform of 1.5 times the grid, whatever K.

mod params;
mod plane_waves;
#[cfg(test)]
mod tests;

pub use params::{
    DEFAULT_CELL_M, DEFAULT_FREQUENCIES, DEFAULT_FREQUENCY_RATIO, DEFAULT_SAMPLING_LENGTH_M, DEFAULT_SIZE_PX, Mode,
    RawWeierstrassMandelbrot, WeierstrassMandelbrot,
};

use crate::generator::{Generator, Input, Terrain, TerrainError};
use plane_waves::PlaneWave;
use sastrugi_numeric::fft::Complex64;
use sastrugi_numeric::{Geometry, Grid, Streams, sums};
use serde_json::Value;
use std::f64::consts::PI;

/// Name in the registry.
pub const KIND: &str = "weierstrass_mandelbrot";

/// Rough time per cell for the transform, s.
const SECONDS_PER_CELL: f64 = 1e-7;
/// Rough time to spread one wave over the spectrum, s.
const SECONDS_PER_WAVE: f64 = 1e-6;

/// Relief below this share of the summed amplitudes is too close to the transform's error of 1e-12 of that sum.
const RELIEF_SHARE_MIN: f64 = 1e-7;

impl WeierstrassMandelbrot {
    /// Amplitude of the waves of frequency index `n`, m.
    fn amplitude_m(&self, n: u32) -> f64 {
        let p = &self.raw;
        let scale = p.sampling_length_m
            * libm::pow(p.elevation_scale_m / p.sampling_length_m, p.fractal_dimension - 2.0)
            * (libm::log(p.frequency_ratio) / f64::from(p.ridges)).sqrt();
        scale * libm::pow(p.frequency_ratio, (p.fractal_dimension - 3.0) * f64::from(n))
    }

    /// Sum of the amplitudes of all waves, m.
    fn amplitude_sum_m(&self) -> f64 {
        let amplitudes: Vec<f64> = (1..=self.frequencies).map(|n| self.amplitude_m(n)).collect();
        f64::from(self.raw.ridges) * sums::sum(&amplitudes)
    }

    /// One phase per wave, in order of n.
    fn phases(&self, streams: &Streams) -> Vec<f64> {
        let mut stream = streams.stream("phases");
        let count = self.frequencies as usize * self.raw.ridges as usize;
        (0..count).map(|_| stream.uniform_in(0.0, self.raw.phase_max_rad)).collect()
    }

    /// The waves of the sum for given phases (in order of n); the constant is added as a last wave of frequency 0.
    fn waves(&self, phases: &[f64]) -> Vec<PlaneWave> {
        let p = &self.raw;
        let directions: Vec<(f64, f64)> =
            (1..=p.ridges).map(|m| libm::sincos(PI * f64::from(m) / f64::from(p.ridges))).collect();
        let mut constant = 0.0;
        let mut waves = Vec::with_capacity(phases.len() + 1);
        for (n, row) in (1..=self.frequencies).zip(phases.chunks_exact(directions.len())) {
            let amplitude = self.amplitude_m(n);
            // Cycles per cell along the wave; integer cycles per cell are invisible on the grid.
            let cycles = libm::pow(p.frequency_ratio, f64::from(n)) * (p.cell_m / p.sampling_length_m);
            for (&(sin, cos), &phase) in directions.iter().zip(row) {
                let (phase_sin, phase_cos) = libm::sincos(phase);
                constant += amplitude * phase_cos;
                let coefficient = Complex64::new(phase_cos, phase_sin) * -amplitude;
                waves.push(PlaneWave::new([cycles * cos, cycles * sin], coefficient));
            }
        }
        waves.push(PlaneWave::new([0.0; 2], constant.into()));
        waves
    }

    /// The surface for given phases (in order of n), m.
    fn heights(&self, phases: &[f64]) -> Grid {
        plane_waves::sum_on_grid(&self.waves(phases), self.size.geometry())
    }

    /// The surface, m.
    ///
    /// # Errors
    /// Relief below rounding error.
    pub(crate) fn surface(&self, streams: &Streams) -> Result<Grid, TerrainError> {
        let heights = self.heights(&self.phases(streams));
        let relief_m = heights.range().map_or(0.0, |(low, high)| high - low);
        let amplitude_m = self.amplitude_sum_m();
        if relief_m > RELIEF_SHARE_MIN * amplitude_m {
            Ok(heights)
        } else {
            Err(TerrainError::NoRelief { relief_m, amplitude_m })
        }
    }
}

impl Generator for WeierstrassMandelbrot {
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
        let waves = u64::from(self.frequencies) * u64::from(self.raw.ridges) + 1;
        plane_waves::memory_bytes(&self.size.geometry(), waves)
    }

    fn seconds(&self) -> f64 {
        SECONDS_PER_CELL * self.size.cells() as f64
            + SECONDS_PER_WAVE * f64::from(self.frequencies) * f64::from(self.raw.ridges)
    }

    fn notes(&self) -> Vec<String> {
        let dropped = (self.raw.mode == Mode::Paper && self.frequencies < self.raw.frequencies).then(|| {
            let share = self.amplitude_m(self.frequencies + 1) / self.amplitude_m(1);
            format!(
                "frequencies above n = {} are left out: in double precision their phases are rounding noise (their amplitudes are \
                 at most {share:.1e} of the first wave's)",
                self.frequencies
            )
        });
        self.size.note().into_iter().chain(dropped).collect()
    }

    fn generate(&self, streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
        self.surface(streams).map(Terrain::from)
    }
}
