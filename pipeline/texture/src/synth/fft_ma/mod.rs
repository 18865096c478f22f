//! FFT moving average: a random field from the square root of its spectrum.
//!
//! `z = IDFT[ sqrt(lambda M) Q ]`, `lambda = DFT(C)` the spectrum of the covariance C on a torus of M cells, every lag
//! taken the short way round, and Q random with `Q(-k)` the conjugate of `Q(k)`:
//! * `phase = "unit"`: `Q = exp(i theta)`, theta uniform (\[P\], section 3.3). The covariance of the field on the torus,
//!   `1 / M * sum of z(i) z(i + h)`, is C(h) in every realisation.
//! * `phase = "gaussian"`: Q complex normal. The field is a normal one, and its covariance is C on average only.
//!
//! Source: \[P\] = Vecherin et al. 2022, Eqs. 11 and 12; Oliver 1995, Mathematical Geology 27, 939. Departures from \[P\]:
//! * the spectrum is the DFT of the covariance, not Eq. 10 sampled: Eq. 10 lacks a factor 2 pi under the paper's own
//!   Eqs. 8 and 11, and sampled at the wavenumbers of a grid it loses 2 to 10 % of the variance;
//! * the mean over the tile is not removed: the mode at k = 0 belongs to the covariance.
//!
//! A covariance cut to a torus may have negative eigenvalues (none found for an exponential on a side of 14 ranges or more; at 10 ranges 2e-6 on 400 cells, 2e-5 on 2000).
//! They are set to 0 when they are at most [`CLIP_SHARE_MAX`] of the spectrum; the largest error of the covariance is
//! then their sum over M (it is largest at lag 0), and is reported. Otherwise `periodic = true` is refused.
//!
//! `periodic = true`: the tile is the torus and repeats without seams. `periodic = false`: the field is cut from a torus
//! at least twice as wide (so that no lag within the crop goes the other way round) and ten ranges wide.
//!
//! Unit phases are exact on the whole torus only. Crops scatter like any sample, and the spread over an ensemble of
//! unit-phase tiles is too small: Monte Carlo work needs `gaussian`.
//!
//! Cost: a quarter of a complex transform for the spectrum, half of one for the field, a square root and a phase per
//! mode. Memory: 36 bytes per torus cell.

mod spectrum;

use super::{Synthesis, SynthesisError, TextureOutcome, cells_along};
use crate::covariance::Covariance;
use rayon::prelude::*;
use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2, smooth_length};
use sastrugi_numeric::{Geometry, Grid, Stream, Streams, sums};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::{Kind, ParameterError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Negative share of the spectrum that is set to 0; more is refused.
pub const CLIP_SHARE_MAX: f64 = 1e-6;
/// A torus this many ranges wide has a non-negative spectrum.
const TORUS_RANGES: f64 = 16.0;
/// A tile of fewer ranges is worth a note.
const TILE_RANGES_NOTE: f64 = 4.0;
/// Bytes per torus cell while a field is made.
const BYTES_PER_CELL: u64 = 36;

/// Random part of the spectrum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// Unit magnitude, uniform phase: the covariance is exact in every realisation of a tile.
    #[default]
    Unit,
    /// Complex normal: the covariance is exact on average.
    Gaussian,
}

/// Raw parameters of an FFT-MA texture.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FftMaParameters {
    /// Size of the texture, east-west and north-south, m. Default 20 x 20 (Vecherin et al. 2022, Figure 5).
    pub size_m: [f64; 2],
    /// Cell size, m. Default 0.1 (Vecherin et al. 2022, section 3.2).
    pub cell_m: f64,
    /// `unit` (default, Vecherin et al. 2022, section 3.3) or `gaussian`.
    pub phase: Phase,
    /// Whether the texture repeats without seams. Default true.
    pub periodic: bool,
}

impl Default for FftMaParameters {
    fn default() -> Self {
        Self { size_m: [20.0; 2], cell_m: 0.1, phase: Phase::Unit, periodic: true }
    }
}

/// An FFT-MA texture with checked parameters.
pub struct FftMa {
    parameters: FftMaParameters,
    covariance: Covariance,
    tile: Geometry,
    /// Rows and columns of the torus.
    torus: [usize; 2],
    notes: Vec<String>,
}

/// Registry entry.
pub fn kind() -> Kind {
    Kind {
        family: "texture",
        kind: "fft_ma",
        summary: "random field from the square root of its spectrum; periodic, exact on the torus with unit phases",
        source: "Vecherin et al. 2022, Eqs. 11-12; Oliver 1995",
        parameters: schema_of::<FftMaParameters>(),
    }
}

/// The texture with raw parameters, matching `fit`.
///
/// # Errors
/// Parameters out of range; a fit file without a known model and its parameters.
pub fn prepare(parameters: &Value, fit: &FitFile) -> Result<Box<dyn Synthesis>, ParameterError> {
    let covariance = Covariance::of_fit(fit)?;
    Ok(Box::new(FftMa::new(read_parameters(parameters)?, covariance)?))
}

impl FftMa {
    /// The texture with raw parameters and a covariance.
    ///
    /// # Errors
    /// Parameters out of range.
    pub fn new(parameters: FftMaParameters, covariance: Covariance) -> Result<Self, ParameterError> {
        let cell_m = ParameterError::positive("cell_m", parameters.cell_m)?;
        let (cols, cut_x) = cells_along("size_m", parameters.size_m[0], cell_m)?;
        let (rows, cut_y) = cells_along("size_m", parameters.size_m[1], cell_m)?;
        let tile = Geometry::square(rows, cols, cell_m);
        let torus = [rows, cols].map(|n| match parameters.periodic {
            true => n,
            false => smooth_length((2 * n).max((TORUS_RANGES * covariance.range_m() / cell_m).ceil() as usize)),
        });
        let mut texture = Self { parameters, covariance, tile, torus, notes: Vec::new() };
        texture.notes = texture.remarks(cut_x || cut_y);
        Ok(texture)
    }

    fn remarks(&self, cut: bool) -> Vec<String> {
        let FftMaParameters { size_m, cell_m, phase, periodic } = &self.parameters;
        let b = self.covariance.range_m();
        let [width_m, height_m] = self.tile.size();
        let mut notes = Vec::new();
        if cut {
            notes.push(format!(
                "size {} m x {} m is no whole number of {cell_m} m cells; the texture is {width_m} m x {height_m} m",
                size_m[0], size_m[1]
            ));
        }
        if *cell_m > 0.5 * b {
            notes.push(format!(
                "the cell of {cell_m} m is more than half the range of {b} m: most of the texture is below it"
            ));
        }
        if *periodic && width_m.min(height_m) < TILE_RANGES_NOTE * b {
            notes.push(format!("the tile of {width_m} m x {height_m} m is less than four ranges of {b} m wide"));
        }
        if !periodic && *phase == Phase::Unit {
            notes.push("unit phases are exact on the whole torus; the covariance of this crop scatters".to_owned());
        }
        notes
    }

    /// Side of a tile with a non-negative spectrum, m.
    fn enough_m(&self) -> f64 {
        TORUS_RANGES * self.covariance.range_m()
    }
}

impl Synthesis for FftMa {
    fn geometry(&self) -> Geometry {
        self.tile
    }

    fn parameters(&self) -> Value {
        // A plain struct of numbers and words always has a JSON form.
        serde_json::to_value(&self.parameters).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        BYTES_PER_CELL * self.torus[0] as u64 * self.torus[1] as u64 + 8 * self.tile.len() as u64
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn generate(&self, streams: &Streams) -> Result<TextureOutcome, SynthesisError> {
        let [rows, cols] = self.torus;
        let spectrum = spectrum::EvenSpectrum::of(&self.covariance, self.torus, self.parameters.cell_m);
        let negative = spectrum.negative();
        let clip_share = negative / (spectrum.total() + 2.0 * negative);
        if clip_share > CLIP_SHARE_MAX {
            let [width_m, height_m] = Geometry::square(rows, cols, self.parameters.cell_m).size();
            let (limit, needed_m) = (CLIP_SHARE_MAX, self.enough_m());
            return Err(SynthesisError::NegativeSpectrum { width_m, height_m, clip_share, limit, needed_m });
        }
        let cells = (rows * cols) as f64;
        let amplitude = |kx: usize, ky: usize| (spectrum.at(kx, ky).max(0.0) * cells).sqrt();
        let modes = random_spectrum(self.torus, amplitude, self.parameters.phase, streams);
        let field = RealFft2::new(rows, cols).inverse(modes);
        let torus = Grid::new(Geometry::square(rows, cols, self.parameters.cell_m), field);
        let grid = match self.parameters.periodic {
            true => torus,
            false => Grid { geometry: self.tile, ..torus.window(0, 0, self.tile.rows, self.tile.cols) },
        };
        let covariance_error_max_m2 = negative / (rows * cols) as f64;
        Ok(TextureOutcome { grid, covariance_error_max_m2, clip_share })
    }
}

/// Spectrum of a field on a torus of `[rows, cols]`: `amplitude(kx, ky) Q`, the amplitude being `sqrt(lambda M)`, on the
/// stored half. One stream for each column of modes.
pub(crate) fn random_spectrum(
    [rows, cols]: [usize; 2],
    amplitude: impl Fn(usize, usize) -> f64 + Sync,
    phase: Phase,
    streams: &Streams,
) -> HalfSpectrum {
    let mut half = HalfSpectrum { rows, cols, values: vec![Complex64::default(); (cols / 2 + 1) * rows] };
    half.values.par_chunks_mut(rows).enumerate().for_each(|(kx, column)| {
        let mut stream = streams.stream(&format!("modes-{kx}"));
        let amplitude = |ky: usize| amplitude(kx, ky);
        match kx == 0 || 2 * kx == cols {
            true => fill_conjugate_column(column, amplitude, phase, &mut stream),
            false => column.iter_mut().enumerate().for_each(|(ky, v)| *v = phase.draw(&mut stream) * amplitude(ky)),
        }
    });
    half
}

/// A column of the half spectrum that is its own mirror image: `Q(-ky)` is the conjugate of `Q(ky)`.
fn fill_conjugate_column(
    column: &mut [Complex64],
    amplitude: impl Fn(usize) -> f64,
    phase: Phase,
    stream: &mut Stream,
) {
    let rows = column.len();
    for ky in 0..=rows / 2 {
        let own = ky == 0 || 2 * ky == rows;
        let q = if own { Complex64::new(phase.draw_real(stream), 0.0) } else { phase.draw(stream) };
        column[ky] = q * amplitude(ky);
        column[(rows - ky) % rows] = column[ky].conj();
    }
}

impl Phase {
    /// Q of a mode that has a conjugate partner; mean square 1.
    fn draw(self, stream: &mut Stream) -> Complex64 {
        match self {
            Self::Unit => {
                let (sin, cos) = libm::sincos(2.0 * PI * stream.uniform());
                Complex64::new(cos, sin)
            }
            Self::Gaussian => Complex64::new(stream.normal(), stream.normal()) * FRAC_1_SQRT_2,
        }
    }

    /// Q of a mode that is its own conjugate; mean square 1.
    fn draw_real(self, stream: &mut Stream) -> f64 {
        match self {
            Self::Unit => 1.0 - 2.0 * (stream.bits() >> 63) as f64,
            Self::Gaussian => stream.normal(),
        }
    }
}

/// Covariance of a field on its torus, `1 / M * sum of z(i) z(i + h)` about zero, for every lag `h` (row-major, lag 0
/// first).
pub fn torus_covariance(field: &Grid) -> Vec<f64> {
    let fft = RealFft2::new(field.rows(), field.cols());
    let mut spectrum = fft.forward(&field.values);
    let cells = field.values.len() as f64;
    spectrum.values.iter_mut().for_each(|v| *v = Complex64::new(v.norm_sqr() / cells, 0.0));
    fft.inverse(spectrum)
}

#[cfg(test)]
mod tests;
