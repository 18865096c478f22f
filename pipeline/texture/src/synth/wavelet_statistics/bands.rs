//! Wavelets: octaves and orientations of a surface, from its spectrum.
//!
//! Band (j, k) is `F^-1[ R_j(|f|) a |cos(theta - pi k / 4)|^3 (1 + sign) F z ]`: a complex field whose real part holds the waves of octave j and direction k,
//! and whose imaginary part holds them a quarter of a wave later. `|f|` is the frequency over Nyquist's; `R_0` rises from 0 at 1/2 to 1 at 1 and stays there,
//! `R_j` is centred at `2^-j`; the squares of all bands and of the low-pass that is left add up to 1. Frequencies are per cell, so that on oblong cells bands
//! are oblong too. At Nyquist's frequency, which only even sizes have, filters of odd and of 45-degree directions are not Hermitian, and bands do not add up
//! to the field. Only changes of bands are added here, so the field loses nothing.
//!
//! Source: Simoncelli and Freeman 1995, doi:10.1109/ICIP.1995.537667; Portilla and Simoncelli 2000, International Journal of Computer Vision 40, 49,
//! doi:10.1023/A:1026553619983. Departure: full size at every octave, so that any size can be transformed and a shift of the surface shifts its
//! bands.

use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2};
use sastrugi_schemas::statistics::Wavelets;
use std::f64::consts::PI;

/// Directions of an octave.
pub const ORIENTATIONS: usize = Wavelets::ORIENTATIONS;

/// The filters of a torus.
pub struct Bands {
    fft: RealFft2,
    rows: usize,
    cols: usize,
    /// `R_j` of each octave, in the order of a half spectrum.
    rings: Vec<Vec<f64>>,
}

/// A band: its real and imaginary part.
pub struct Band {
    /// Waves.
    pub real: Vec<f64>,
    /// The same, a quarter of a wave later.
    pub imaginary: Vec<f64>,
}

impl Bands {
    /// Filters for fields of `[rows, cols]` cells.
    pub fn new([rows, cols]: [usize; 2], octaves: usize) -> Self {
        let mut rings = vec![vec![0.0; (cols / 2 + 1) * rows]; octaves];
        for at in 0..(cols / 2 + 1) * rows {
            let [x, y] = wave_vector(at, rows, cols);
            let mut left = 1.0;
            let octave_of = 0.5 * libm::log2((x * x + y * y).max(1e-30));
            for (j, ring) in rings.iter_mut().enumerate() {
                let place = (octave_of + j as f64 + 1.0).clamp(0.0, 1.0);
                let (above, below) = libm::sincos(0.5 * PI * place);
                ring[at] = left * above;
                left *= below;
            }
        }
        Self { fft: RealFft2::new(rows, cols), rows, cols, rings }
    }

    /// The transform of fields of this size.
    pub fn fft(&self) -> &RealFft2 {
        &self.fft
    }

    /// Number of bands.
    pub fn count(&self) -> usize {
        ORIENTATIONS * self.rings.len()
    }

    /// Even and odd part of the filter of a band at a mode.
    fn filter(&self, band: usize, at: usize) -> [f64; 2] {
        /// `sqrt(2 / 5)`: the squares of both parts of all orientations add up to the square of the ring.
        const SCALE: f64 = 0.632_455_532_033_675_9;
        /// Cosine and sine of 0, 45, 90 and 135 degrees.
        const AXES: [[f64; 2]; ORIENTATIONS] = {
            const H: f64 = std::f64::consts::FRAC_1_SQRT_2;
            [[1.0, 0.0], [H, H], [0.0, 1.0], [-H, H]]
        };
        let [x, y] = wave_vector(at, self.rows, self.cols);
        let [cos, sin] = AXES[band % ORIENTATIONS];
        let size = (x * x + y * y).sqrt();
        if size == 0.0 {
            return [0.0; 2];
        }
        let along = (x * cos + y * sin) / size;
        let odd = SCALE * self.rings[band / ORIENTATIONS][at] * along * along * along;
        [odd.abs(), odd]
    }

    /// A band of a field with the given spectrum.
    pub fn band(&self, spectrum: &HalfSpectrum, band: usize) -> Band {
        let rows = self.rows;
        let part = |odd: bool| {
            self.fft.inverse_of(|kx, column| {
                for (ky, out) in column.iter_mut().enumerate() {
                    let at = kx * rows + ky;
                    let (value, [even, skew]) = (spectrum.values[at], self.filter(band, at));
                    // Minus i times the odd part.
                    *out = if odd { Complex64::new(value.im * skew, -value.re * skew) } else { value * even };
                }
            })
        };
        Band { real: part(false), imaginary: part(true) }
    }

    /// Adds to a spectrum what a band contributes to its field.
    pub fn add(&self, band: usize, part: &Band, spectrum: &mut HalfSpectrum) {
        let [real, imaginary] = [&part.real, &part.imaginary].map(|field| self.fft.forward(field));
        for (at, out) in spectrum.values.iter_mut().enumerate() {
            let [even, odd] = self.filter(band, at);
            let late = imaginary.values[at];
            // Plus i times the odd part.
            *out += real.values[at] * even + Complex64::new(-late.im * odd, late.re * odd);
        }
    }
}

/// Wave vector of a mode, columns and rows, over Nyquist's frequency.
fn wave_vector(at: usize, rows: usize, cols: usize) -> [f64; 2] {
    let (kx, ky) = (at / rows, at % rows);
    let ky = if 2 * ky > rows { ky as f64 - rows as f64 } else { ky as f64 };
    [2.0 * kx as f64 / cols as f64, 2.0 * ky / rows as f64]
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    fn noise(n: usize) -> Vec<f64> {
        let mut stream = Streams::for_seed(1, "bands-test").stream("noise");
        (0..n).map(|_| stream.normal()).collect()
    }

    /// A wave of 4 cells along rows lies in octave 0 (its upper half) and 1, direction 0, with a constant magnitude.
    #[test]
    fn val_a_wave_has_a_constant_magnitude() {
        let (rows, cols) = (32, 64);
        let wave = |c: usize| libm::cos(2.0 * PI * c as f64 / 4.0);
        let field: Vec<f64> = (0..rows * cols).map(|k| wave(k % cols)).collect();
        let bands = Bands::new([rows, cols], 2);
        let spectrum = bands.fft().forward(&field);
        // Half of Nyquist's frequency: the lower edge of octave 0, the middle of octave 1's ring.
        let band = bands.band(&spectrum, ORIENTATIONS);
        for (k, (re, im)) in band.real.iter().zip(&band.imaginary).enumerate() {
            let (sin, cos) = libm::sincos(2.0 * PI * (k % cols) as f64 / 4.0);
            assert!(
                (re - 0.4f64.sqrt() * cos).abs() < 1e-12 && (im - 0.4f64.sqrt() * sin).abs() < 1e-12,
                "{k}: {re} {im}"
            );
        }
        let across = bands.band(&spectrum, ORIENTATIONS + 2);
        assert!(across.real.iter().chain(&across.imaginary).all(|v| v.abs() < 1e-12));
    }

    /// Bands put back together are the field without its low-pass; odd sizes have no Nyquist frequency, at which odd filters vanish.
    #[test]
    fn prop_bands_add_up_to_the_field() {
        for (rows, cols) in [(27, 45), (33, 25)] {
            let field = noise(rows * cols);
            let bands = Bands::new([rows, cols], 3);
            let spectrum = bands.fft().forward(&field);
            let mut sum =
                HalfSpectrum { values: vec![Complex64::default(); spectrum.values.len()], ..spectrum.clone() };
            (0..bands.count()).for_each(|k| bands.add(k, &bands.band(&spectrum, k), &mut sum));
            for (at, (found, own)) in sum.values.iter().zip(&spectrum.values).enumerate() {
                let low: f64 = 1.0 - bands.rings.iter().map(|ring| ring[at] * ring[at]).sum::<f64>();
                let expected = if at == 0 { Complex64::default() } else { *own * (1.0 - low) };
                assert!((found - expected).norm() < 1e-9, "{rows} x {cols}, {at}: {found} {expected}");
            }
        }
    }
}
