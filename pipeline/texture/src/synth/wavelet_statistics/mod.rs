//! A field with the wavelet statistics of a residual: distributions of its differences, its covariance, and the joint statistics of the
//! magnitudes of its wavelets across octaves and directions.
//!
//! From a normal field on a torus, `rounds` times, in this order:
//! 1. magnitudes: each band of the field ([`Wavelets`]: octaves j, four directions) is a complex field u with logarithm
//!    `l = ln(|u| + floor)`. All l are mapped jointly and linearly to the measured means and covariance, `l' = mu_0 + A (l - mu)`, by the A that
//!    moves them least (`symmetric.rs`). The mean of all l' at a cell is given the measured covariance by lag, so that rough places are as large
//!    as on the site. Every band is multiplied by `exp(l' - l)`, at most [`GAIN_MAX`], its phase unchanged;
//! 2. covariance: each mode is multiplied by the root of the measured spectrum over the field's, both smoothed in the same way
//!    (`target.rs`), by a factor from 1/2 to 2; short waves by the spectra of the Laplacian ([`spectrum`]);
//! 3. differences: the distributions of increments (lags of 1, 2, 4 ... 64 cells along rows and columns, 1 along diagonals), of the Laplacian
//!    and of the heights are imposed by quantiles (`differences.rs`).
//!
//! [`FINISHING`] rounds of steps 2 and 3 follow. The number of rounds is fixed and all sums run in a fixed order.
//!
//! Source: Portilla and Simoncelli 2000, International Journal of Computer Vision 40, 49, doi:10.1023/A:1026553619983 (joint statistics, reached by
//! projections from noise); Heeger and Bergen 1995, SIGGRAPH, 229, doi:10.1145/218380.218446 (distributions); Dowson and Landau 1982, Journal of
//! Multivariate Analysis 12, 450, doi:10.1016/0047-259X(82)90077-X (the map of step 1). Departures:
//! * logarithms of magnitudes, which are nearly normal where magnitudes are not, mapped jointly over all octaves at once;
//! * the covariance at all stored lags instead of 7 x 7 in each octave;
//! * differences with their distributions, because moments up to the fourth do not hold the tails of rough ground (flatness of one-cell
//!   increments 30 to 350);
//! * no relative phase between octaves: the skewness of increments by direction, which it causes, is in their quantiles. Phase harmonics describe the
//!   phases as covariances (Zhang and Mallat 2021, Maximum entropy models from phase harmonic covariances, Applied and Computational Harmonic Analysis
//!   53, 199-230). Matching these takes gradient descent; a fixed number of projections does not reach them.
//!
//! Measured on halves of sites with a prototype of the same steps that is not part of this repository (`benches/measure_textures` judges the shipped
//! kernel); window 25 cells, four octaves, lags of differences to 8 cells. Values are the distance of the texture of one half from the other half and,
//! in brackets, the distance between the two halves; slopes and curvatures are relative. The last columns are the one-cell flatness (fitted half,
//! other half) and the largest error of the covariance up to 12 lags.
//!
//! | site | slope | curvature | flatness | third order | extrema | directions | one-cell flatness | covariance |
//! |---|---|---|---|---|---|---|---|---|
//! | otira gravel bar, 2 cm | 0.19 (0.19) | 0.19 (0.21) | 0.22 (0.31) | 0.77 (0.76) | 0.12 (0.07) | 0.14 (0.34) | 39 (46, 39) | 4.5 % |
//! | pozo blanca, 50 cm | 0.34 (0.33) | 0.17 (0.15) | 1.29 (1.08) | 3.15 (3.49) | 0.17 (0.18) | 0.60 (0.59) | 26 (32, 179) | 1.0 % |
//! | akl lidar, 320 x 320 | 0.13 (0.14) | 0.24 (0.22) | 0.29 (0.29) | 0.51 (0.55) | 0.19 (0.28) | 0.75 (0.88) | 8.6 (7.9, 7.0) | 2.9 % |
//! | avaAlr, 320 x 320 | 1.03 (1.04) | 1.36 (1.26) | 0.44 (0.45) | 0.83 (0.85) | 0.03 (0.09) | 0.25 (0.21) | 20 (22, 11) | 3.9 % |
//!
//! These are without the covariance of the mean logarithm. With it the first site is nearer (0.12, 0.11, 0.27, 0.55, 0.08, 0.11 after six
//! rounds), and the spread of the logarithm of the RMS slope between blocks of 64 cells is 0.35 instead of 0.15; the halves have
//! 0.44 and 0.36. A normal field on the first is at 0.57, 0.89, 1.81, 0.18, 0.53 and 0.07. Curvatures of the third were at 2.6 with distributions
//! and the covariance of heights alone, at 0.35 with joint logarithms of magnitudes (step 1) and at 0.23 with the spectra of the Laplacian
//! as well. All of this was measured with 0 in holes, before they were filled (`filling.rs`).
//!
//! Limits. Statistics are those of the whole residual: a site whose parts differ becomes a texture with patches of each, up to 128 cells wide.
//! Every realisation has nearly the same covariance and distributions, so realisations differ less than parts of a site do. Edges
//! longer than the coarsest wavelets, and shapes (a boulder's outline), are not reproduced. A torus of fewer cells than the residual
//! exaggerates the tails, because its extremes are those of the residual; textures that are not periodic are cut from one of at least
//! [`SIDE_MIN`] cells a side. A side of fewer than `4 * 2^octaves` cells, two waves of the coarsest octave, is refused.
//!
//! Cost: per round six half transforms, a logarithm and an exponential for each band and cell, and for each of some 16 differences a
//! sort: an estimated 40 s for 1024 x 1024 cells on one core. Memory: 172 bytes per torus cell with four octaves.

mod bands;
mod differences;
mod filling;
mod measure;
mod symmetric;
mod target;

pub use measure::measure;

use super::fft_ma::{CovarianceOf, Phase, random_spectrum, without_default};
use super::residual::{ResidualKernel, ResidualParameters, Site};
use super::statistics::lags;
use super::statistics::spectrum::{self, Modes};
use super::tile::{self, CELLS_MAX, Tile};
use super::{Cost, SynthesisError};
use bands::{Band, Bands, ORIENTATIONS};
use differences::Matcher;
use rayon::prelude::*;
use sastrugi_numeric::fft::{RealFft2, smooth_length};
use sastrugi_numeric::{Streams, sums};
use sastrugi_schemas::statistics::{Statistics, Wavelets};
use sastrugi_schemas::{Kind, ParameterError, counted};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use symmetric::Symmetric;
use target::Target;

/// Name in the registry.
pub const NAME: &str = "wavelet_statistics";

/// Rounds after which slopes, curvatures and increments no longer come nearer.
const ROUNDS: u32 = 10;
/// Most rounds.
const ROUNDS_MAX: u32 = 200;
/// Rounds without magnitudes at the end.
pub const FINISHING: u32 = 2;
/// Smallest side of a torus that is not the texture itself, cells.
pub const SIDE_MIN: usize = 256;
/// Least side of a torus, in units of `2^octaves` cells: two wavelengths of the coarsest octave.
const WIDTHS: usize = 4;
/// Largest factor of a magnitude in one round.
pub const GAIN_MAX: f64 = 30.0;
/// Bytes per torus cell without the logarithms, and for those of one octave. Measured with four octaves, from 512 x 512 to 768 x 768 cells:
/// 172.5.
const BYTES_PER_CELL: [u64; 2] = [92, 20];

/// Raw parameters of a texture by wavelet statistics, without those of its tile.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WaveletStatisticsParameters {
    /// Whether the texture repeats without seams. Default true.
    pub periodic: bool,
    /// Number of rounds, 1 to 200. Default 10.
    #[schemars(range(min = 1, max = ROUNDS_MAX))]
    pub rounds: u32,
    /// Base that the texture is for: with `surface`, for level or synthetic ground, it repeats the residual as it was measured; with `residual`, for a
    /// measured background, wavelengths near the fit's window are amplified, so that background and texture together have the covariance of the site.
    /// Default: `residual` on a measured DEM or the background of a fit, otherwise `surface`.
    #[schemars(transform = without_default)]
    pub covariance: CovarianceOf,
}

impl Default for WaveletStatisticsParameters {
    fn default() -> Self {
        Self { periodic: true, rounds: ROUNDS, covariance: CovarianceOf::Surface }
    }
}

impl ResidualParameters for WaveletStatisticsParameters {
    const NAME: &'static str = NAME;
    type Source = Statistics;
    type Kernel = WaveletTexture;

    fn is_periodic(&self) -> bool {
        self.periodic
    }

    fn covariance(&self) -> CovarianceOf {
        self.covariance
    }

    fn check(&self) -> Result<(), ParameterError> {
        if (1..=ROUNDS_MAX).contains(&self.rounds) {
            return Ok(());
        }
        Err(ParameterError::new("rounds", format!("is {}; it must lie in [1, {ROUNDS_MAX}]", self.rounds)))
    }

    fn cost_of(&self, tile: &Tile, site: &Site) -> Cost {
        self.cost([tile.geometry.rows, tile.geometry.cols], site.reach, measure::OCTAVES_MAX as u32)
    }

    fn kernel(&self, tile: &Tile, statistics: &Arc<Statistics>) -> Result<WaveletTexture, ParameterError> {
        let shape = [tile.geometry.rows, tile.geometry.cols];
        let torus = self.checked_torus(statistics, shape)?;
        Ok(WaveletTexture { statistics: statistics.clone(), shape, torus, parameters: self.clone() })
    }
}

/// A texture by wavelet statistics, bound to its statistics.
pub struct WaveletTexture {
    statistics: Arc<Statistics>,
    shape: [usize; 2],
    torus: [usize; 2],
    parameters: WaveletStatisticsParameters,
}

impl ResidualKernel for WaveletTexture {
    fn cost(&self) -> Cost {
        let reach = lags::reach(&self.statistics.covariance);
        self.parameters.cost(self.shape, reach, self.statistics.wavelets.octaves)
    }

    fn notes(&self) -> Vec<String> {
        let cells = (self.torus[0] * self.torus[1]) as u64;
        let note = format!(
            "the torus of {cells} cells is smaller than the site, {} cells with data, so rare heights and steps of the site are too frequent; \
             make the texture larger",
            self.statistics.cells
        );
        (cells < self.statistics.cells).then_some(note).into_iter().collect()
    }

    fn make(&self, streams: &Streams) -> Result<(Vec<f64>, Vec<String>), SynthesisError> {
        let heights_m = field(&self.statistics, [self.shape, self.torus], self.parameters.rounds, streams);
        Ok((heights_m.ok_or(SynthesisError::NotFinite { method: NAME })?, Vec::new()))
    }
}

impl WaveletStatisticsParameters {
    /// Rows and columns of the torus of a texture of `shape`, for a covariance with lags up to `reach` cells.
    fn torus(&self, shape: [usize; 2], reach: [usize; 2]) -> [usize; 2] {
        [0, 1].map(|axis| match self.periodic {
            true => shape[axis],
            false => smooth_length((shape[axis] + reach[axis]).max(SIDE_MIN)),
        })
    }

    /// The torus, for statistics that were read from a file.
    fn checked_torus(&self, statistics: &Statistics, shape: [usize; 2]) -> Result<[usize; 2], ParameterError> {
        if !statistics.wavelets.differences.iter().any(|d| matches!(d.stencil[..], [(0, 0, _)])) {
            let message = "has no distribution of heights; fit the DEM again with --statistics";
            return Err(ParameterError::new("statistics.wavelets.differences", message));
        }
        let torus = self.torus(shape, lags::reach(&statistics.covariance));
        let cells = torus[0] as f64 * torus[1] as f64;
        if cells > CELLS_MAX as f64 {
            let message =
                format!("needs a torus of {cells:.1e} cells; the limit is {CELLS_MAX}: make the texture smaller");
            return Err(ParameterError::new("size_px", message));
        }
        let octaves = statistics.wavelets.octaves;
        let least = WIDTHS << octaves.min(u32::BITS - 1);
        if let Some(side) = torus.into_iter().find(|side| *side < least) {
            let octaves = counted(octaves, "octave");
            let message = format!(
                "gives a periodic texture of {side} cells on a side, too few for the {octaves} of the fit's wavelets, which need {least}: make it \
                 larger, or set periodic = false"
            );
            return Err(ParameterError::new("size_px", message));
        }
        Ok(torus)
    }

    /// Cost of a texture of `shape` (rows, columns) with `octaves` and lags up to `reach` cells.
    pub fn cost(&self, shape: [usize; 2], reach: [usize; 2], octaves: u32) -> Cost {
        /// Operations for a mode's filter, a logarithm and an exponential, and for a difference with its sort.
        const PER_CELL: [f64; 2] = [150.0, 200.0];
        /// Differences.
        const DIFFERENCES: f64 = 16.0;
        let cells: u64 = self.torus(shape, reach).iter().map(|n| *n as u64).product();
        let bands = f64::from(ORIENTATIONS as u32 * octaves);
        let transforms = 2.5 * libm::log2(cells as f64) * (6.0 * bands + 8.0);
        let per_round = transforms + PER_CELL[0] * bands + PER_CELL[1] * DIFFERENCES;
        Cost {
            memory_bytes: cells * (BYTES_PER_CELL[0] + BYTES_PER_CELL[1] * u64::from(octaves)),
            operations: cells as f64 * f64::from(self.rounds + FINISHING) * per_round,
        }
    }
}

/// Registry entry.
pub fn kind() -> Kind {
    Kind {
        family: "texture",
        kind: NAME,
        summary: "field with the measured distributions of increments, covariance, and joint magnitudes of wavelets",
        source: "Portilla and Simoncelli 2000; Heeger and Bergen 1995",
        parameters: tile::schema_of_site::<WaveletStatisticsParameters>(),
    }
}

/// One texture of `shape` (rows, columns) in cells of the statistics: heights from the north-west, m. Draws from `start` below `streams`.
///
/// # Errors
/// Statistics that are damaged or lack the distribution of heights; parameters out of range; more than 2^28 cells of torus, or a periodic
/// texture too small for its octaves; heights that are not finite.
pub fn synthesise(
    statistics: &Statistics,
    shape: [usize; 2],
    parameters: &WaveletStatisticsParameters,
    streams: &Streams,
) -> Result<Vec<f64>, ParameterError> {
    statistics.check()?;
    parameters.check()?;
    let torus = parameters.checked_torus(statistics, shape)?;
    field(statistics, [shape, torus], parameters.rounds, streams).ok_or_else(|| {
        ParameterError::new(
            "statistics.wavelets",
            "give heights that are not finite: they are damaged; fit the DEM again with --statistics",
        )
    })
}

/// The part of a field on a torus that a texture of `shape` shows; `None` if its heights are not finite.
fn field(statistics: &Statistics, [shape, torus]: [[usize; 2]; 2], rounds: u32, streams: &Streams) -> Option<Vec<f64>> {
    let field = Rounds::new(statistics, torus).run(rounds, &streams.child("start"))?;
    if shape == torus {
        return Some(field);
    }
    let [rows, cols] = shape;
    Some(field.chunks_exact(torus[1]).take(rows).flat_map(|line| &line[..cols]).copied().collect())
}

/// The natural logarithm of the magnitude of a wavelet.
fn logarithm(real: f64, imaginary: f64, floor_m: f64) -> f64 {
    libm::log((real * real + imaginary * imaginary).sqrt() + floor_m)
}

/// What all rounds on a torus share.
struct Rounds<'a> {
    wavelets: &'a Wavelets,
    torus: [usize; 2],
    bands: Bands,
    matcher: Matcher<'a>,
    modes: Modes,
    /// Covariance of the heights and of the Laplacian.
    targets: [Target; 2],
    /// Covariance of the mean logarithm of all bands.
    patches: Option<Target>,
    /// Magnitudes `sqrt(lambda M)` of the modes of the first field.
    start: Vec<f64>,
}

impl<'a> Rounds<'a> {
    fn new(statistics: &'a Statistics, torus: [usize; 2]) -> Self {
        let wavelets = &statistics.wavelets;
        let bands = Bands::new(torus, wavelets.octaves as usize);
        let matcher = Matcher::new(&wavelets.differences, &statistics.probabilities, bands.fft(), torus);
        let modes = Modes::new(torus, statistics.cell_m);
        let cells = (torus[0] * torus[1]) as f64;
        let power = spectrum::of_residual(statistics, bands.fft(), torus, &modes);
        let start = power.into_iter().map(|v| (v * cells).sqrt()).collect();
        let target = |table| Target::new(table, bands.fft(), torus);
        let targets = [&statistics.covariance, &statistics.laplacian].map(target);
        let patches = wavelets.patches.as_ref().map(target);
        Self { wavelets, torus, bands, matcher, modes, targets, patches, start }
    }

    fn fft(&self) -> &RealFft2 {
        self.bands.fft()
    }

    /// The field after all rounds; `None` once its heights are not finite.
    fn run(&self, rounds: u32, streams: &Streams) -> Option<Vec<f64>> {
        let rows = self.torus[0];
        let start = random_spectrum(self.torus, |kx, ky| self.start[kx * rows + ky], Phase::Gaussian, streams);
        let mut field = self.fft().inverse(start);
        for round in 0..rounds + FINISHING {
            if round < rounds && self.wavelets.octaves > 0 {
                field = self.with_magnitudes(&field);
            }
            field = self.with_covariance(&field);
            if !field.iter().all(|z| z.is_finite()) {
                return None;
            }
            self.matcher.step(&mut field, self.fft());
        }
        field.iter().all(|z| z.is_finite()).then_some(field)
    }

    /// Step 1: the field with the measured means and covariance of the logarithms.
    fn with_magnitudes(&self, field: &[f64]) -> Vec<f64> {
        let floor_m = self.wavelets.floor_m;
        let mut spectrum = self.fft().forward(field);
        // Single precision is far finer than the statistics, and halves the memory.
        let logarithms: Vec<Vec<f32>> = (0..self.bands.count())
            .map(|k| {
                let Band { real, imaginary } = self.bands.band(&spectrum, k);
                let pairs = real.par_iter().zip(&imaginary).with_min_len(1 << 12);
                pairs.map(|(re, im)| logarithm(*re, *im, floor_m) as f32).collect()
            })
            .collect();
        let (mean, own) = moments(&logarithms, self.torus[1]);
        let wanted = Symmetric { size: own.size, values: self.wavelets.covariance_log.clone() };
        let map = Symmetric::map_between(&own, &wanted);
        let weight = |k: usize| (0..own.size).map(|row| map.values[row * own.size + k]).sum::<f64>() / own.size as f64;
        let weights: Vec<f64> = (0..own.size).map(weight).collect();
        let added = self.patches.as_ref().map(|patches| self.roughened(patches, &logarithms, &mean, &weights));
        let before = spectrum.clone();
        for k in 0..self.bands.count() {
            let mut band = self.bands.band(&before, k);
            let row = &map.values[k * own.size..(k + 1) * own.size];
            let change = |at: usize| {
                let moved: f64 =
                    row.iter().zip(&logarithms).zip(&mean).map(|((a, l), m)| a * (f64::from(l[at]) - m)).sum();
                let moved = moved + added.as_ref().map_or(0.0, |added| added[at]);
                let gain = libm::exp(self.wavelets.mean_log[k] + moved - f64::from(logarithms[k][at]));
                // `min` would take the limit for what is not a number.
                gain.clamp(0.0, GAIN_MAX) - 1.0
            };
            let parts = band.real.par_iter_mut().zip(&mut band.imaginary).enumerate().with_min_len(1 << 12);
            parts.for_each(|(at, (re, im))| {
                let factor = change(at);
                *re *= factor;
                *im *= factor;
            });
            self.bands.add(k, &band, &mut spectrum);
        }
        self.fft().inverse(spectrum)
    }

    /// What step 1 adds to the logarithms of all bands at a cell, so that rough places lie as they were measured; `weights` are those of the
    /// deviations from `mean` in the mean of the mapped logarithms.
    fn roughened(&self, patches: &Target, logarithms: &[Vec<f32>], mean: &[f64], weights: &[f64]) -> Vec<f64> {
        let at = |cell: usize| {
            let bands = logarithms.iter().zip(mean).zip(weights);
            bands.map(|((l, m), w)| w * (f64::from(l[cell]) - m)).sum::<f64>()
        };
        let cells = self.torus[0] * self.torus[1];
        let common: Vec<f64> = (0..cells).into_par_iter().with_min_len(1 << 12).map(at).collect();
        let mut spectrum = self.fft().forward(&common);
        let factors = patches.factors(&target::power(&spectrum), self.fft());
        spectrum.values.iter_mut().zip(&factors).for_each(|(v, factor)| *v *= factor - 1.0);
        self.fft().inverse(spectrum)
    }

    /// Step 2: the field with the measured covariances of heights and Laplacian at the stored lags.
    fn with_covariance(&self, field: &[f64]) -> Vec<f64> {
        let mut spectrum = self.fft().forward(field);
        let power = target::power(&spectrum);
        let curved: Vec<f64> = power.iter().zip(&self.modes.power).map(|(p, l)| p * l).collect();
        let [long, short] = [(0, &power), (1, &curved)].map(|(k, power)| self.targets[k].factors(power, self.fft()));
        spectrum.values.par_iter_mut().with_min_len(1 << 12).enumerate().for_each(|(k, v)| {
            *v *= match self.modes.share[k] {
                0.0 => long[k],
                1.0 => short[k],
                w => libm::exp((1.0 - w) * libm::log(long[k]) + w * libm::log(short[k])),
            };
        });
        self.fft().inverse(spectrum)
    }
}

/// Means and covariance of fields with rows of `cols`, summed row by row.
fn moments(fields: &[Vec<f32>], cols: usize) -> (Vec<f64>, Symmetric) {
    let count = fields.len();
    let rows = fields.first().map_or(0, |field| field.len() / cols);
    let line = |k: usize, row: usize| &fields[k][row * cols..(row + 1) * cols];
    let sum_of = |k: usize, row: usize| line(k, row).iter().map(|v| f64::from(*v)).sum::<f64>();
    let mean: Vec<f64> = (0..count).map(|k| mean_of_rows(rows, |row| sum_of(k, row)) / cols as f64).collect();
    let product = |a: usize, b: usize, row: usize| {
        let pairs = line(a, row).iter().zip(line(b, row));
        pairs.map(|(x, y)| (f64::from(*x) - mean[a]) * (f64::from(*y) - mean[b])).sum::<f64>()
    };
    let mut values = vec![0.0; count * count];
    for a in 0..count {
        for b in a..count {
            let value = mean_of_rows(rows, |row| product(a, b, row)) / cols as f64;
            (values[a * count + b], values[b * count + a]) = (value, value);
        }
    }
    (mean, Symmetric { size: count, values })
}

/// Mean over rows, added in a fixed order.
fn mean_of_rows(rows: usize, of_row: impl Fn(usize) -> f64 + Sync + Send) -> f64 {
    sums::mean(&(0..rows).into_par_iter().map(of_row).collect::<Vec<f64>>())
}

#[cfg(test)]
mod tests;
