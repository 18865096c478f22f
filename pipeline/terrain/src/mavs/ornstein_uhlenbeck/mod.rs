//! Kinds `mavs_gaussian` and `ornstein_uhlenbeck`: a Gaussian field with a correlation length (Algorithm 2).
//!
//! # What
//! A field with standard deviation s and correlation length a, over rolling ground `m_l P((x, y) / lambda_l)`:
//! * `separable`: covariance `s^2 exp(-(|dx| + |dy|) / a)`, exact on the cells, by first-order recursions along x, then along y
//!   (`chains.rs`). Correlations reach farthest along the axes.
//! * `isotropic`: covariance `s^2 exp(-d / a)` or `s^2 exp(-d^2 / a^2)`, by circulant embedding (`embedding.rs`).
//!
//! `mavs_gaussian` is always `separable`; with `compat = true` it is the published listing (`listing.rs`).
//!
//! # Source
//! Uhlenbeck and Ornstein, Phys. Rev. 36 (1930) 823; Dietrich and Newsam, SIAM J. Sci. Comput. 18 (1997) 1088, for the
//! embedding.
//!
//! # Tiles
//! These fields do not depend on world coordinates: two surfaces are independent samples wherever they lie, and tiles do not match.

mod chains;
mod embedding;
mod listing;
mod params;

pub use params::{Covariance, Gaussian, Mode, OrnsteinUhlenbeck, RawGaussian, RawOrnsteinUhlenbeck};

use super::frame::Frame;
use super::measure::{Made, Roughness, finish, memory_bytes};
use super::perlin::{self, Layer, Perlin};
use super::{MAVS_GAUSSIAN, ORNSTEIN_UHLENBECK};
use crate::generator::{Generator, Input, Terrain, TerrainError};
use sastrugi_numeric::{Geometry, Grid, Streams, ops};
use sastrugi_roughness::WaveBand;
use serde_json::Value;
use std::f64::consts::{FRAC_2_PI, PI};

/// Rolling ground under a field.
#[derive(Clone, Copy, Debug)]
struct Rolling {
    wavelength_m: f64,
    amplitude_m: f64,
}

impl Rolling {
    /// Adds the rolling ground of `layer`, unless its amplitude is 0.
    fn under(&self, field: Grid, frame: &Frame, layer: impl Fn(f64, f64) -> Layer) -> Grid {
        if self.amplitude_m == 0.0 {
            return field;
        }
        let ground = perlin::sum(&[layer(self.wavelength_m, self.amplitude_m)], frame);
        ops::add(&field, &ground)
    }

    fn expected_m2(&self, band: &WaveBand) -> f64 {
        let share = perlin::variance_between(band.frequencies().map(|f| f * self.wavelength_m));
        self.amplitude_m * self.amplitude_m * share
    }
}

/// Share of the variance, between two frequencies in cycles/m, of profiles with covariance `exp(-d / a)` sampled in cells: an
/// autoregression with ratio `r = exp(-cell / a)`, where waves above the Nyquist frequency are aliased below it.
fn exponential_share([low, high]: [f64; 2], length_m: f64, cell_m: f64) -> f64 {
    let r = libm::exp(-cell_m / length_m);
    let below = |f: f64| match f * cell_m < 0.5 {
        true => FRAC_2_PI * libm::atan((1.0 + r) / (1.0 - r) * libm::tan(PI * f * cell_m)),
        false => 1.0,
    };
    below(high) - below(low)
}

/// The same for `exp(-d^2 / a^2)`, which has almost no power at wavelengths as short as two cells.
fn gaussian_share([low, high]: [f64; 2], length_m: f64, _cell_m: f64) -> f64 {
    libm::erf(PI * high * length_m) - libm::erf(PI * low * length_m)
}

/// The terrain of a field over rolling ground.
fn finished(
    plain: Grid,
    expected_m2: impl Fn(&WaveBand) -> f64,
    roughness: Option<&Roughness>,
) -> Result<Terrain, TerrainError> {
    finish(Made { plain, scale: None, expected_m2 }, roughness)
}

impl Generator for OrnsteinUhlenbeck {
    fn kind(&self) -> &'static str {
        ORNSTEIN_UHLENBECK
    }

    fn geometry(&self) -> Geometry {
        self.frame.geometry()
    }

    fn parameters(&self) -> Value {
        serde_json::to_value(&self.raw).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        let torus = match self.raw.mode {
            Mode::Separable => 0,
            Mode::Isotropic => embedding::memory_bytes(&self.frame.size, self.raw.correlation_length_m),
        };
        memory_bytes(&self.frame, self.roughness.as_ref()) + torus
    }

    fn notes(&self) -> Vec<String> {
        self.frame.size.note().into_iter().collect()
    }

    fn generate(&self, streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
        let p = &self.raw;
        let geometry = self.geometry();
        let field = match p.mode {
            Mode::Separable => chains::field(streams, geometry, p.rms_m, p.correlation_length_m),
            Mode::Isotropic => embedding::field(streams, geometry, p.rms_m, p.correlation_length_m, p.covariance)?,
        };
        let layer = |wavelength, amplitude| Layer::draw(streams, "low", wavelength, amplitude);
        let plain = self.rolling().under(field, &self.frame, layer);
        let share = match p.covariance {
            Covariance::Exponential => exponential_share,
            Covariance::Gaussian => gaussian_share,
        };
        let expected_m2 = |band: &WaveBand| {
            let own = p.rms_m * p.rms_m * share(band.frequencies(), p.correlation_length_m, p.cell_m);
            own + self.rolling().expected_m2(band)
        };
        finished(plain, expected_m2, self.roughness.as_ref())
    }
}

impl Generator for Gaussian {
    fn kind(&self) -> &'static str {
        MAVS_GAUSSIAN
    }

    fn geometry(&self) -> Geometry {
        self.frame.geometry()
    }

    fn parameters(&self) -> Value {
        serde_json::to_value(&self.raw).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        memory_bytes(&self.frame, self.roughness.as_ref())
    }

    fn notes(&self) -> Vec<String> {
        let compat = self.raw.compat.then(|| {
            format!(
                "published listing with its defects: the correlation of neighbours is exp(-2 a^2) = {:.2e} instead of \
                 exp(-cell / a), and lower still from column to column; the south-west cell is 0; the lattice of the low \
                 layer starts in the corner of the surface",
                listing::ratio(self.raw.hi_len_m)
            )
        });
        let mut notes: Vec<String> = self.frame.size.note().into_iter().chain(compat).collect();
        notes.extend(self.replaced_cell_m.map(|cell| {
            format!("as in the published listing, the cell of {cell} m is replaced by {} m", self.frame.size.cell_m)
        }));
        notes
    }

    fn generate(&self, streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
        let (p, geometry) = (&self.raw, self.geometry());
        let plain = if p.compat {
            let field = listing::field(streams, geometry, p.hi_mag_m, p.hi_len_m);
            let noise = Perlin::draw(&mut streams.stream("lattice"));
            let layer = |wavelength, amplitude| Layer::of(&noise, wavelength, amplitude);
            self.rolling().under(field, &self.frame.at_origin(), layer)
        } else {
            let field = chains::field(streams, geometry, p.hi_mag_m, p.hi_len_m);
            let layer = |wavelength, amplitude| Layer::draw(streams, "low", wavelength, amplitude);
            self.rolling().under(field, &self.frame, layer)
        };
        let expected_m2 = |band: &WaveBand| {
            let own =
                p.hi_mag_m * p.hi_mag_m * exponential_share(band.frequencies(), p.hi_len_m, self.frame.size.cell_m);
            own + self.rolling().expected_m2(band)
        };
        finished(plain, expected_m2, self.roughness.as_ref())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Midpoint rule.
    fn integral([low, high]: [f64; 2], density: impl Fn(f64) -> f64) -> f64 {
        let step = (high - low) / 1e5;
        (0..100_000).map(|k| density(low + (f64::from(k) + 0.5) * step)).sum::<f64>() * step
    }

    /// The one-sided PSD of samples of `exp(-d / a)`, an autoregression, and that of `exp(-d^2 / a^2)`, integrated over bands.
    #[test]
    fn val_shares_are_integrals_of_the_spectra() {
        let (length_m, cell_m) = (0.7, 0.25);
        let r = libm::exp(-cell_m / length_m);
        let sampled = |f: f64| {
            let around = 1.0 - 2.0 * r * libm::cos(2.0 * PI * f * cell_m) + r * r;
            2.0 * cell_m * (1.0 - r * r) / around
        };
        let continuous = |f: f64| 2.0 * PI.sqrt() * length_m * libm::exp(-(PI * f * length_m) * (PI * f * length_m));
        for band in [[0.05, 0.4], [0.2, 1.9]] {
            assert!((exponential_share(band, length_m, cell_m) - integral(band, sampled)).abs() < 1e-8, "{band:?}");
            assert!((gaussian_share(band, length_m, cell_m) - integral(band, continuous)).abs() < 1e-8, "{band:?}");
        }
        // All variance lies below the Nyquist frequency, 2 cycles/m.
        assert_eq!(exponential_share([0.0, 2.0], length_m, cell_m), 1.0);
        assert_eq!(exponential_share([2.0, 9.0], length_m, cell_m), 0.0);
        assert!((gaussian_share([0.0, 9.0], length_m, cell_m) - 1.0).abs() < 1e-12);
    }
}
