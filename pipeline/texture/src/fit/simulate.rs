//! Simulated measurements of surfaces with a given covariance, for Monte Carlo work: normal fields with random amplitudes, cut
//! from a torus at least twice as wide, so that neither periodicity nor fixed amplitudes reduce their scatter.
//!
//! A self-affine surface is replaced by a Matern one with a range of `outer_m`; a covariance that reaches across the torus is
//! synthesised from its spectral density ([`crate::covariance::density`]).

use crate::covariance::Covariance;
use crate::covariance::density::{self, TORUS_RANGES};
use crate::covariance::filtered::{Measurement, blur, torus_covariance};
use crate::synth::fft_ma::{Phase, random_column};
use sastrugi_numeric::Streams;
use sastrugi_numeric::fft::{RealFft2, smooth_length};

/// Size of a surface in cells, or `rows` transects of `cols` cells.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    pub rows: usize,
    pub cols: usize,
    /// True for transects, which are independent of each other.
    pub profiles: bool,
}

/// Surfaces, or sets of transects, of one shape.
pub struct Simulator {
    shape: Shape,
    fft: RealFft2,
    torus: [usize; 2],
    /// `sqrt(lambda M)` in the order of a half spectrum.
    amplitude: Vec<f64>,
}

impl Simulator {
    /// Simulator of surfaces of a covariance, as they would be measured.
    pub fn new(
        covariance: &Covariance,
        measurement: Measurement,
        shape: Shape,
        cell_m: [f64; 2],
        outer_m: f64,
    ) -> Self {
        let torus = match shape.profiles {
            true => {
                let enough = (TORUS_RANGES * covariance.stationary(outer_m).range_m() / cell_m[0]).min(CELLS_ALONG_MAX);
                [1, smooth_length((2 * shape.cols).max(enough as usize))]
            }
            false => [shape.rows, shape.cols].map(|n| smooth_length(2 * n)),
        };
        let fft = RealFft2::new(torus[0], torus[1]);
        let stationary = covariance.stationary(outer_m);
        let mut spectrum = match shape.profiles {
            true => fft.forward(&torus_covariance(torus, cell_m, &stationary)),
            false => density::spectrum(&stationary, torus, cell_m),
        };
        if measurement.inner_scale_m > 0.0 {
            blur(&mut spectrum, cell_m, measurement.inner_scale_m);
        }
        let noise = fft.forward(&torus_covariance(torus, cell_m, &measurement.noise.covariance()));
        let cells = (torus[0] * torus[1]) as f64;
        let power = spectrum.values.iter().zip(&noise.values).map(|(surface, noise)| (surface.re + noise.re).max(0.0));
        let amplitude = power.map(|p| (p * cells).sqrt()).collect();
        Self { shape, fft, torus, amplitude }
    }

    /// One surface, row-major, m.
    pub fn surface(&self, streams: &Streams) -> Vec<f64> {
        let Shape { rows, cols, profiles } = self.shape;
        if profiles {
            let profile = |k: usize| self.field(1, &streams.child(&format!("profile-{k}")));
            return (0..rows).flat_map(|k| profile(k).into_iter().take(cols)).collect();
        }
        let field = self.field(rows, streams);
        (0..rows).flat_map(|r| field[r * self.torus[1]..][..cols].iter().copied()).collect()
    }

    /// The first `wanted` rows of a field on the torus.
    fn field(&self, wanted: usize, streams: &Streams) -> Vec<f64> {
        let [rows, cols] = self.torus;
        self.fft.inverse_rows_of(wanted, |kx, column| {
            random_column(kx, cols, |ky| self.amplitude[kx * rows + ky], Phase::Gaussian, streams, column);
        })
    }
}

/// Most cells of the torus of a transect.
const CELLS_ALONG_MAX: f64 = 1e6;
