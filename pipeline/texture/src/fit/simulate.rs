//! Measured surfaces with a given covariance, for Monte Carlo work: normal fields cut from a torus at least twice as wide, so
//! that neither the torus nor fixed amplitudes make them more alike than surfaces are.
//!
//! A covariance that reaches across the torus is made from its spectral density, which no torus cuts (exponential and
//! Matern); a self-affine surface is replaced by a Matern one of a range of `outer_m` and made in the same way.

use crate::covariance::filtered::{Measurement, blur, torus_covariance};
use crate::covariance::models::matern;
use crate::covariance::{Covariance, Structure};
use crate::synth::fft_ma::{Phase, random_spectrum};
use rayon::prelude::*;
use sastrugi_numeric::Streams;
use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2, smooth_length};
use std::f64::consts::PI;

/// Cells of a surface, or transects of `cols` cells, `rows` of them.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    pub rows: usize,
    pub cols: usize,
    /// True for transects, which do not know each other.
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
    /// Surfaces of a covariance as they are measured.
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
        let mut spectrum = match smoothnesses(covariance) {
            Some(nu) if !shape.profiles && reaches_across(covariance, torus, cell_m) => {
                from_density(&covariance.stationary(outer_m), &nu, torus, cell_m)
            }
            _ => fft.forward(&torus_covariance(torus, cell_m, &covariance.stationary(outer_m))),
        };
        if measurement.inner_scale_m > 0.0 {
            blur(&mut spectrum, cell_m, measurement.inner_scale_m);
        }
        let noise_m2 = measurement.noise_sigma_m * measurement.noise_sigma_m;
        let cells = (torus[0] * torus[1]) as f64;
        let amplitude = spectrum.values.iter().map(|s| ((s.re + noise_m2).max(0.0) * cells).sqrt()).collect();
        Self { shape, fft, torus, amplitude }
    }

    /// One surface, row-major, m.
    pub fn surface(&self, streams: &Streams) -> Vec<f64> {
        let Shape { rows, cols, profiles } = self.shape;
        if profiles {
            let profile = |k: usize| self.field(&streams.child(&format!("profile-{k}")));
            return (0..rows).flat_map(|k| profile(k).into_iter().take(cols)).collect();
        }
        let field = self.field(streams);
        (0..rows).flat_map(|r| field[r * self.torus[1]..][..cols].iter().copied()).collect()
    }

    /// A field on the torus.
    fn field(&self, streams: &Streams) -> Vec<f64> {
        let rows = self.torus[0];
        let amplitude = |kx: usize, ky: usize| self.amplitude[kx * rows + ky];
        self.fft.inverse(random_spectrum(self.torus, amplitude, Phase::Gaussian, streams))
    }
}

/// Most cells of the torus of a transect.
const CELLS_ALONG_MAX: f64 = 1e6;
/// A torus this many ranges wide holds a covariance with a kink at lag zero.
const TORUS_RANGES: f64 = 16.0;

/// True when a covariance has not died away half way round the torus.
fn reaches_across(covariance: &Covariance, [rows, cols]: [usize; 2], cell_m: [f64; 2]) -> bool {
    let side_m = (rows as f64 * cell_m[1]).min(cols as f64 * cell_m[0]);
    !covariance.is_stationary() || TORUS_RANGES * covariance.range_m() > side_m
}

/// Smoothness of each term as a Matern one; `None` where a term is none.
fn smoothnesses(covariance: &Covariance) -> Option<Vec<f64>> {
    let of = |term: &Structure| match term.model.kind().kind {
        "exponential" => Some(0.5),
        "matern" | "self_affine" => Some(term.shape),
        _ => None,
    };
    covariance.structures.iter().map(of).collect()
}

/// Eigenvalues of a sum of Matern covariances of any range, in the order of a half spectrum.
fn from_density(
    covariance: &Covariance,
    smoothness: &[f64],
    [rows, cols]: [usize; 2],
    cell_m: [f64; 2],
) -> HalfSpectrum {
    let wave = |k: usize, n: usize, cell: f64| {
        let k = if 2 * k > n { k as f64 - n as f64 } else { k as f64 };
        2.0 * PI * k / (n as f64 * cell)
    };
    let (sin, cos) = libm::sincos(covariance.azimuth_deg.to_radians());
    let value = |k: usize| {
        // Rows run southwards.
        let wave = [wave(k / rows, cols, cell_m[0]), -wave(k % rows, rows, cell_m[1])];
        let terms = covariance.structures.iter().zip(smoothness).map(|(term, &nu)| {
            let eigenvalue = matern::eigenvalue(wave, term.range_m, nu, cell_m, [sin, cos], covariance.ratio);
            term.sigma_m * term.sigma_m * eigenvalue
        });
        Complex64::new(terms.sum::<f64>() + covariance.nugget_m2, 0.0)
    };
    let values = (0..rows * (cols / 2 + 1)).into_par_iter().map(value).collect();
    HalfSpectrum { rows, cols, values }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::Form;

    /// Both ways to a spectrum agree where both are good: a torus of 40 ranges, oblong cells, an axis across them. The
    /// tolerance is what the folding of far wavenumbers leaves: 0.3 % of the variance at an axis of 0.4.
    #[test]
    fn val_the_density_gives_the_covariance() {
        for model in ["exponential", "anisotropic:exponential", "anisotropic:matern+nugget"] {
            let form = Form::parse(model).unwrap();
            let all = [("sigma_m", 0.5), ("range_m", 0.3), ("smoothness", 0.8), ("nugget_m2", 0.01)];
            let axis = [("ratio", 0.4), ("azimuth_deg", 30.0)];
            let values = form.parameters().into_iter().map(|p| {
                let value = all.iter().chain(&axis).find(|(name, _)| *name == p.name).unwrap().1;
                (p.name, value)
            });
            let covariance = form.covariance(&values.collect()).unwrap();
            let (torus, cell_m) = ([240, 200], [0.06, 0.05]);
            let fft = RealFft2::new(torus[0], torus[1]);
            let spectrum = from_density(&covariance, &smoothnesses(&covariance).unwrap(), torus, cell_m);
            let field = fft.inverse(spectrum);
            let wanted = torus_covariance(torus, cell_m, &covariance);
            let worst = field.iter().zip(&wanted).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()));
            assert!(worst < 3e-3 * wanted[0], "{model}: {worst:e} of {}", wanted[0]);
        }
    }
}
