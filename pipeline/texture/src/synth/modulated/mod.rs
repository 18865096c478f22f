//! A normal field times a log-normal amplitude field, with the heights of the residual: roughness that comes in patches.
//!
//! `z = T(A G)`, `A = exp(s W - s^2)`: G a unit normal field with correlation r(h); W another, independent of it, with correlation
//! `rho(h) = exp(-(h / L)^2)`; T the monotone map from the distribution of `A G` to the quantiles of the residual. Then
//!
//! `C_z(h) = C_z(r(h), rho(h))`, without T simply `sigma^2 r(h) exp(-s^2 (1 - rho(h)))`
//!
//! (`transform.rs`). r is solved for at every lag, so that the covariance of z, with its anisotropy, is that of the residual. That is possible as long
//! as r is at most 1 and its spectrum is not negative: r is limited to 1, negative eigenvalues are set to 0 and the others scaled to unit variance.
//! [`Modulated::covariance_error`] is the largest difference that remains at any lag, from C_z at this r. It is largest on smooth ground whose waves
//! are longer than the patches.
//!
//! | parameter | unit, range | meaning |
//! |---|---|---|
//! | `log_variance`, s^2 | 0 to 2 | variance of ln A; 0 gives a normal field with the residual's heights |
//! | `range_m`, L | m | distance over which the correlation of ln A falls to 1/e: half width of a patch |
//!
//! The fit ([`measure`], derivation in `fit.rs`) takes s^2 and L from the covariance by lag of `ln |d|`, d the mixed differences of blocks of 2 x 2 cells:
//! `s^2 rho(h)` plus a known term for normal variables. Slopes do not affect d. The map T is undone by the quantiles that s^2 implies, so a skewed or
//! heavy-tailed T is not mistaken for patches. No moment above the second of a logarithm is used, because a flatness rests on a handful of increments. For
//! 40 fields of 256 x 256 cells with an exponential covariance of 6 cells, an independent program found this mean and standard deviation:
//!
//! | s^2 | L = 4 cells | 8 | 20 | L = 8; slope, holes, 5 % white noise, less a moving average of 48 cells |
//! |---|---|---|---|---|
//! | 0 | 0.003, 0.003 | 0.003, 0.004 | 0.003, 0.004 | 0.003, 0.001 |
//! | 0.1 | 0.098, 0.014 | 0.099, 0.013 | 0.100, 0.017 | 0.096, 0.011 |
//! | 0.3 | 0.302, 0.051 | 0.301, 0.045 | 0.308, 0.061 | 0.292, 0.040 |
//! | 0.8 | 0.840, 0.198 | 0.826, 0.197 | 0.857, 0.247 | 0.763, 0.143 |
//!
//! L within 8 %. With a heavy-tailed T, 0.3 and 0.8 are found as 0.304 and 0.856; with a Matern 3/2 covariance as 0.340 and 1.00, and worse on smoother
//! ground (`fit.rs`). White noise fills quiet places: noise of 20 % of the standard deviation turns 0.3 into 0.15, and the texture has the noise in
//! patches too. An L of 2 or 3 cells is found as 4.3 or 3.7. The stated standard error covers the spread within a third to a half, but not noise. s^2
//! is reduced until the covariance of a texture is within 10 % of the variance, and the variance of one-cell increments within 10 %.
//!
//! Source: Castaing, Gagne and Hopfinger 1990, Physica D 46, 177, doi:10.1016/0167-2789(90)90035-N (log-normal amplitudes, flatness by scale);
//! Mehler 1866. Departure: the monotone map outside the product.
//!
//! The flatness of increments, `F(l) = <d^4> / <d^2>^2`, is not fitted; without T it is known in closed form ([`flatness`]): `3 exp(4 s^2)` for one cell where L
//! is many cells, falling with lag as far as L.
//!
//! Patches are isotropic in metres, whatever the anisotropy of the site.
//!
//! Not identified: s^2 of smooth ground (`fit.rs`); L beyond 40 cells or a sixth of the site, where the search ends. One scale of patches is fitted, so
//! L is a compromise where patches contain patches. Not reached: a flatness far above that of the heights, since T cuts the tails of the product to
//! those of the heights. Flatness over 1, 2, 4, 8, 16 and 32 cells of the unseen half of three sites, of textures of the other half, and of T alone
//! (s^2 = 0):
//!
//! | site | s^2, L | unseen half | texture | T alone |
//! |---|---|---|---|---|
//! | gravel bar, 2 cm | 1.0 (error 0.6), 17 | 48, 24, 12, 7.9, 6.6, 4.9 | 26, 20, 13, 8.3, 5.1, 3.6 | 5.5, 5.3, 5.0, 4.5, 3.9, 3.5 |
//! | gullies, 50 cm | 0.10 (0.01), 24 | 131, 99, 55, 25, 14, 8.7 | 9.9, 9.4, 8.7, 7.6, 6.5, 5.6 | 8.7, 8.4, 7.8, 6.9, 5.9, 5.8 |
//! | volcanic cone, 1 m | 0.70 (0.34), 32 | 6.7, 6.7, 6.9, 7.5, 8.3, 6.4 | 19, 16, 13, 9.3, 6.6, 4.7 | 3.7, 3.7, 3.6, 3.5, 3.5, 3.6 |
//!
//! (Values are from an earlier version of the fit, which accepted any s^2.) The flatness is right where roughness comes in patches, and too low where it comes
//! from rims and steps on smooth ground. It is too high on the cone, where a nonlinear map may have been taken for patches, as on smooth ground. Not
//! reproduced either: third-order structure (the field looks the same with its axes reversed), ridges, and whatever else needs aligned phases: use
//! `wavelet_statistics`.
//!
//! Cost: for 1024 x 1024 cells some 1.7 times FFT-MA's: one forward and three inverse half transforms, an exponential and two table look-ups
//! per cell (an estimate), and a third look-up for the error of the covariance; once per texture some 60 ms of tables. Memory: 44 bytes per torus
//! cell. The fit: about five rounds of two masked covariances with lags of up to 40 cells.

mod fit;
mod transform;

pub use fit::{flatness, flatness_at, measure};

use super::residual::{ResidualKernel, ResidualParameters, Site};
use super::statistics::{lags, spectrum};
use super::tile::{self, Tile};
use super::{Cost, SynthesisError};
use crate::synth::fft_ma::{CovarianceOf, Phase, random_column, without_default};
use rayon::prelude::*;
use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2, smooth_length};
use sastrugi_numeric::{Streams, sums};
use sastrugi_schemas::statistics::{Modulation, Statistics};
use sastrugi_schemas::{Kind, ParameterError, counted, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::sync::Arc;
use transform::{Correlations, Transform, amplitude};

/// Name in the registry.
pub const NAME: &str = "modulated";

/// Largest variance of the logarithm of the amplitude.
pub const LOG_VARIANCE_MAX: f64 = 2.0;
/// Shortest range of the amplitude, cells: below it, neighbours would differ by more than the covariance allows.
pub const RANGE_CELLS_MIN: f64 = 1.5;
/// Range of the amplitude over the side of a torus, at most.
const RANGE_SHARE_MAX: f64 = 0.25;
/// Ranges of the amplitude that a torus is wider than a texture that is not periodic.
const MARGIN_RANGES: f64 = 3.0;
/// Longest range of the amplitude that a fit finds, in the longer side of a cell.
const RANGE_CELLS_FITTED: f64 = 40.0;
/// Largest error of the covariance, as a share of the variance, to which parameters may lead.
const ERROR_MAX: f64 = 0.1;
/// Largest variance of the one-cell increments of a texture, over the measured one.
const INCREMENT_RATIO_MAX: f64 = 1.1;
/// Error of the covariance, as a share of the variance, above which it is noted. Interpolation in the tables gives up to 1 %.
const COVARIANCE_NOTE: f64 = 0.02;
/// Standard error of a fitted log variance, as a share of it, above which it is noted.
const ERROR_NOTE: f64 = 0.25;
/// Log variance above which patches are visible.
const NOTED_MIN: f64 = 0.1;
/// Log variance below which patches of any width raise the flatness of increments by less than 5 %: a normal site has a few thousandths, with
/// any range.
const UNFELT: f64 = 0.01;
/// Bytes per torus cell at the peak.
const BYTES_PER_CELL: u64 = 44;
/// Square root of the smallest eigenvalue of W, relative to the largest, that is synthesised.
const NEGLIGIBLE: f64 = 1e-9;

/// Raw parameters of a modulated texture, without those of its tile.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ModulatedParameters {
    /// Whether the texture repeats without seams. Default true.
    pub periodic: bool,
    /// Variance of the logarithm of the amplitude, in [0, 2]; replaces the fit's.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::within(0.0, LOG_VARIANCE_MAX))]
    pub log_variance: Option<f64>,
    /// Distance over which the correlation of the logarithm of the amplitude falls to 1/e, m; replaces the fit's.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub range_m: Option<f64>,
    /// Base that the texture is for: with `surface`, for level or synthetic ground, it repeats the residual as it was measured; with `residual`, for a
    /// measured background, wavelengths near the fit's window are amplified, so that background and texture together have the covariance of the site.
    /// Default: `residual` on a measured DEM or the background of a fit, otherwise `surface`.
    #[schemars(transform = without_default)]
    pub covariance: CovarianceOf,
}

impl Default for ModulatedParameters {
    fn default() -> Self {
        Self { periodic: true, log_variance: None, range_m: None, covariance: CovarianceOf::Surface }
    }
}

impl ResidualParameters for ModulatedParameters {
    const NAME: &'static str = NAME;
    type Source = Statistics;
    type Kernel = Modulated;

    fn is_periodic(&self) -> bool {
        self.periodic
    }

    fn covariance(&self) -> CovarianceOf {
        self.covariance
    }

    fn check(&self) -> Result<(), ParameterError> {
        if let Some(log_variance) = self.log_variance {
            check_log_variance(log_variance)?;
        }
        self.range_m.map(|range_m| ParameterError::positive("range_m", range_m)).transpose().map(drop)
    }

    fn cost_of(&self, tile: &Tile, site: &Site) -> Cost {
        let ([dx, dy], shape) = (tile.geometry.cell, [tile.geometry.rows, tile.geometry.cols]);
        let range_m = self.range_m.unwrap_or(RANGE_CELLS_FITTED * dx.max(dy));
        cost(torus(site.reach, shape, [range_m / dy, range_m / dx], self.periodic), shape)
    }

    fn kernel(&self, tile: &Tile, statistics: &Arc<Statistics>) -> Result<Modulated, ParameterError> {
        Modulated::new(statistics, [tile.geometry.rows, tile.geometry.cols], self)
    }
}

impl ResidualKernel for Modulated {
    fn cost(&self) -> Cost {
        cost(self.torus, self.shape)
    }

    fn notes(&self) -> Vec<String> {
        let (share, error) = (self.clip_share, 100.0 * self.covariance_error());
        let off = format!(
            "the covariance of the texture differs from the measured one by up to {error:.1} % of the variance ({share:.1e} of the spectrum of the normal field \
             was negative and was set to 0)"
        );
        let is_off = share > 0.0 || self.covariance_error() > COVARIANCE_NOTE;
        self.doubts.iter().cloned().chain(is_off.then_some(off)).collect()
    }

    fn clip_share(&self) -> f64 {
        self.clip_share
    }

    fn make(&self, streams: &Streams) -> Result<(Vec<f64>, Vec<String>), SynthesisError> {
        let heights_m = Modulated::make(self, streams);
        match heights_m.iter().all(|z| z.is_finite()) {
            true => Ok((heights_m, Vec::new())),
            false => Err(SynthesisError::NotFinite { method: NAME }),
        }
    }
}

impl ModulatedParameters {
    /// Refuses stated parameters with which a texture would not have the given covariance on its torus, m2, or the one-cell increments.
    fn check_effect(&self, made: &Modulated, covariance_m2: &[f64]) -> Result<(), ParameterError> {
        let stated = [("log_variance", self.log_variance), ("range_m", self.range_m)];
        let Some((key, value)) = stated.into_iter().find_map(|(key, value)| Some((key, value?))) else { return Ok(()) };
        let (error, ratio) = (made.covariance_error(), made.increment_ratio(covariance_m2));
        let effect = if error > ERROR_MAX {
            let [off, most] = [error, ERROR_MAX].map(|share| 100.0 * share);
            format!(
                "the covariance would differ from that of the site by up to {off:.0} % of the variance, above the limit of {most:.0} %"
            )
        } else if ratio > INCREMENT_RATIO_MAX {
            let [more, most] = [ratio, INCREMENT_RATIO_MAX].map(|ratio| 100.0 * (ratio - 1.0));
            format!(
                "increments over one cell would have {more:.0} % more variance than those of the site, above the limit of {most:.0} %"
            )
        } else {
            return Ok(());
        };
        let message = format!(
            "is {value}, with which {effect}: the amplitude varies too much, or over too short a range, for a site this smooth; reduce `log_variance` or \
             increase `range_m`"
        );
        Err(ParameterError::new(key, message))
    }
}

/// Notes on a fitted amplitude.
fn doubts(fitted: &Modulation) -> Vec<String> {
    let Modulation { log_variance, measured_log_variance: measured, log_variance_error: error, patches, .. } = *fitted;
    let lowered = format!(
        "the log variance of the amplitude was reduced from the measured {measured:.2} to {log_variance:.2}: on a site this smooth, a larger value would \
         change the covariance, or the variance of increments, by more than 10 %"
    );
    let patches = counted(format_args!("{patches:.0}"), "independent patch");
    let uncertain = match error > measured.max(NOTED_MIN) {
        true => format!(
            "the log variance of the amplitude is not identified ({measured:.2}, with a standard error of {error:.2}): the site has {patches}, \
             and on smooth ground a nonlinear map of the heights cannot be told from patches; set `log_variance` to override it"
        ),
        false => format!(
            "the log variance of the amplitude, {measured:.2}, has a standard error of {error:.2}: the site has {patches}; set \
             `log_variance` to override it"
        ),
    };
    let lowered = (log_variance < measured && measured > NOTED_MIN).then_some(lowered);
    let uncertain = (error > ERROR_NOTE * measured.max(NOTED_MIN)).then_some(uncertain);
    lowered.into_iter().chain(uncertain).collect()
}

fn check_log_variance(log_variance: f64) -> Result<(), ParameterError> {
    if (0.0..=LOG_VARIANCE_MAX).contains(&log_variance) {
        return Ok(());
    }
    let message = format!("is {log_variance}; it must lie in [0, {LOG_VARIANCE_MAX}]");
    Err(ParameterError::new("log_variance", message))
}

/// Registry entry.
pub fn kind() -> Kind {
    Kind {
        family: "texture",
        kind: NAME,
        summary: "normal field times a log-normal amplitude, with the residual's covariance and heights: intermittent roughness",
        source: "Castaing, Gagne and Hopfinger 1990; Mehler 1866",
        parameters: tile::schema_of_site::<ModulatedParameters>(),
    }
}

/// A modulated texture of a fit.
pub struct Modulated {
    shape: [usize; 2],
    /// Rows and columns of the torus.
    torus: [usize; 2],
    transform: Transform,
    log_variance: f64,
    /// Magnitudes `sqrt(lambda M)` of the modes of G, in the order of a half spectrum.
    magnitudes: Vec<f64>,
    /// Range of W along rows and columns, cells: `[down, across]`.
    range_cells: [f64; 2],
    clip_share: f64,
    covariance_error: f64,
    /// Notes on the fitted amplitude.
    doubts: Vec<String>,
}

impl Modulated {
    /// The texture of `shape` (rows, columns), in cells of the statistics.
    ///
    /// # Errors
    /// Statistics that are damaged; parameters out of range; a range of the amplitude shorter than 1.5 cells, or longer than a quarter of
    /// a periodic texture's shorter side (a fitted range is shortened to that where the amplitude hardly varies); a stated variance or range with
    /// which the covariance cannot be kept within 10 % of the variance, or one-cell increments not within 10 % of theirs; a residual that is flat.
    pub fn new(
        statistics: &Statistics,
        shape: [usize; 2],
        parameters: &ModulatedParameters,
    ) -> Result<Self, ParameterError> {
        statistics.check()?;
        parameters.check()?;
        let log_variance = parameters.log_variance.unwrap_or(statistics.modulation.log_variance);
        check_log_variance(log_variance)?;
        if statistics.heights_m.first() == statistics.heights_m.last() {
            return Err(ParameterError::new(
                "statistics.heights_m",
                "has only one distinct height; the texture would be flat",
            ));
        }
        let [dx, dy] = statistics.cell_m;
        let range_m = parameters.range_m.unwrap_or_else(|| {
            let fitted_m = statistics.modulation.range_m;
            match parameters.periodic && log_variance < UNFELT {
                // Just below the widest, which rounding might exceed.
                true => fitted_m.min((1.0 - 1e-9) * widest_m(shape, statistics.cell_m)),
                false => fitted_m,
            }
        });
        let range_cells = [range_m / dy, range_m / dx];
        let torus = torus(lags::reach(&statistics.covariance), shape, range_cells, parameters.periodic);
        check_range(range_m, range_cells, torus, statistics.cell_m)?;
        let variance_m2 = statistics.covariance.variance();
        let Statistics { probabilities, heights_m, cells, .. } = statistics;
        let transform = Transform::new(probabilities, heights_m, *cells, variance_m2, log_variance);
        let table = transform.normal_correlation();
        let covariance_m2 = spectrum::covariance_on_torus(statistics, torus);
        let made = Self::of_transform(&covariance_m2, [shape, torus], transform, &table, log_variance, range_cells);
        parameters.check_effect(&made, &covariance_m2)?;
        let doubts = parameters.log_variance.map_or_else(|| doubts(&statistics.modulation), |_| Vec::new());
        Ok(Self { doubts, ..made })
    }

    /// The texture with a covariance on the torus, m2.
    fn of_transform(
        covariance_m2: &[f64],
        [shape, torus]: [[usize; 2]; 2],
        transform: Transform,
        table: &Correlations,
        log_variance: f64,
        range_cells: [f64; 2],
    ) -> Self {
        let of_heights = transform.height_correlation();
        let (magnitudes, [clip_share, covariance_error]) =
            magnitudes(covariance_m2, torus, [table, &of_heights], range_cells);
        let doubts = Vec::new();
        Self { shape, torus, transform, log_variance, magnitudes, range_cells, clip_share, covariance_error, doubts }
    }

    /// Share of the spectrum of G that was negative and set to 0.
    pub fn clip_share(&self) -> f64 {
        self.clip_share
    }

    /// Largest error of the covariance at any lag, as a share of the variance.
    pub fn covariance_error(&self) -> f64 {
        self.covariance_error
    }

    /// Variance of the increments over one cell, over that of a covariance on the torus: the larger of southwards and eastwards.
    fn increment_ratio(&self, covariance_m2: &[f64]) -> f64 {
        let [rows, cols] = self.torus;
        let cells = (rows * cols) as f64;
        let half = HalfSpectrum { rows, cols, values: Vec::new() };
        let ratio = |axis: usize| {
            let (side, lag) = if axis == 0 { (rows, cols) } else { (cols, 1) };
            let mode = |k: usize| if axis == 0 { k % rows } else { k / rows };
            let part = |(k, magnitude): (usize, &f64)| {
                let wave = libm::cos(2.0 * PI * mode(k) as f64 / side as f64);
                half.multiplicity(k / rows) * magnitude * magnitude * wave
            };
            let r = sums::sum(&self.magnitudes.iter().enumerate().map(part).collect::<Vec<f64>>()) / (cells * cells);
            let rho = libm::exp(-1.0 / (self.range_cells[axis] * self.range_cells[axis]));
            self.transform.increment(r, rho) / (2.0 * (1.0 - covariance_m2[lag] / covariance_m2[0]))
        };
        ratio(0).max(ratio(1))
    }

    /// One texture, rows times columns heights from the north-west, m. Draws from `field` and `amplitude` below `streams`.
    pub fn make(&self, streams: &Streams) -> Vec<f64> {
        let [rows, cols] = self.torus;
        let fft = RealFft2::new(rows, cols);
        let of_field = streams.child("field");
        let mut field = fft.inverse_of(|kx, column| {
            random_column(kx, cols, |ky| self.magnitudes[kx * rows + ky], Phase::Gaussian, &of_field, column);
        });
        let [shown_rows, shown_cols] = self.shape;
        if self.log_variance > 0.0 {
            let logarithm = self.logarithm(&fft, &streams.child("amplitude"));
            field.par_chunks_mut(cols).zip(logarithm.par_chunks(cols)).for_each(|(line, ws)| {
                line.iter_mut().zip(ws).for_each(|(g, &w)| *g *= amplitude(self.log_variance, w));
            });
        }
        field.par_iter_mut().with_min_len(1 << 14).for_each(|y| *y = self.transform.height_m(*y));
        if self.shape == self.torus {
            return field;
        }
        field.chunks_exact(cols).take(shown_rows).flat_map(|line| &line[..shown_cols]).copied().collect()
    }

    /// The field W.
    fn logarithm(&self, fft: &RealFft2, streams: &Streams) -> Vec<f64> {
        let [rows, cols] = self.torus;
        let [down, across] = [0, 1].map(|axis| line_magnitudes(self.torus[axis], self.range_cells[axis]));
        fft.inverse_of(|kx, column| match across[kx] {
            // Most columns of a smooth field hold nothing.
            0.0 => column.fill(Complex64::default()),
            of_column => {
                random_column(kx, cols, |ky| of_column * down[ky.min(rows - ky)], Phase::Gaussian, streams, column)
            }
        })
    }
}

/// One texture: [`Modulated::new`], then [`Modulated::make`].
///
/// # Errors
/// As [`Modulated::new`].
pub fn synthesise(
    statistics: &Statistics,
    shape: [usize; 2],
    parameters: &ModulatedParameters,
    streams: &Streams,
) -> Result<Vec<f64>, ParameterError> {
    Ok(Modulated::new(statistics, shape, parameters)?.make(streams))
}

/// Cost of a texture of `shape` on a torus, with its spectrum.
fn cost(torus: [usize; 2], shape: [usize; 2]) -> Cost {
    /// Operations for phases, exponential and tables of a cell.
    const PER_CELL: f64 = 90.0;
    let [cells, shown] = [torus, shape].map(|[rows, cols]| (rows * cols) as u64);
    let operations = cells as f64 * (7.5 * libm::log2(cells as f64) + PER_CELL);
    Cost { memory_bytes: BYTES_PER_CELL * cells + 8 * shown, operations }
}

/// Rows and columns of the torus of a texture, for a covariance with lags up to `reach` cells.
fn torus(reach: [usize; 2], shape: [usize; 2], range_cells: [f64; 2], periodic: bool) -> [usize; 2] {
    let margin = |axis: usize| (MARGIN_RANGES * range_cells[axis]).min(1e6).max(reach[axis] as f64).ceil() as usize;
    [0, 1].map(|axis| if periodic { shape[axis] } else { smooth_length(shape[axis] + margin(axis)) })
}

fn check_range(range_m: f64, range_cells: [f64; 2], torus: [usize; 2], cell_m: [f64; 2]) -> Result<(), ParameterError> {
    let refuse = |message: String| Err(ParameterError::new("range_m", message));
    if torus[0] as f64 * torus[1] as f64 > tile::CELLS_MAX as f64 {
        let cells = torus[0] as f64 * torus[1] as f64;
        return refuse(format!(
            "is {range_m}, which needs a torus of {cells:.1e} cells; the limit is {}",
            tile::CELLS_MAX
        ));
    }
    if range_cells[0].min(range_cells[1]) < RANGE_CELLS_MIN {
        let needed_m = RANGE_CELLS_MIN * cell_m[0].max(cell_m[1]);
        return refuse(format!("is {range_m}; it must be at least {RANGE_CELLS_MIN} cells, {needed_m} m"));
    }
    if [0, 1].iter().any(|&axis| range_cells[axis] > RANGE_SHARE_MAX * torus[axis] as f64) {
        let most_m = widest_m(torus, cell_m);
        return refuse(format!("is {range_m}; a texture of this size holds patches of at most {most_m} m: enlarge it"));
    }
    Ok(())
}

/// Longest range of the amplitude that a torus holds, m.
fn widest_m([rows, cols]: [usize; 2], [dx, dy]: [f64; 2]) -> f64 {
    RANGE_SHARE_MAX * (rows as f64 * dy).min(cols as f64 * dx)
}

/// Magnitudes of the modes of G, the negative share of its spectrum, which is set to 0, and the largest error of the covariance of the heights, as a
/// share of their variance. The tables give the correlation of G by that of the heights, and that of the heights by that of G.
fn magnitudes(
    covariance_m2: &[f64],
    [rows, cols]: [usize; 2],
    [of_normal, of_heights]: [&Correlations; 2],
    range_cells: [f64; 2],
) -> (Vec<f64>, [f64; 2]) {
    let mut correlation = covariance_m2.to_vec();
    let variance_m2 = correlation[0];
    let [down, across] = [(rows, range_cells[0]), (cols, range_cells[1])].map(|(n, range)| line_correlation(n, range));
    correlation.par_chunks_mut(cols).enumerate().for_each(|(r, line)| {
        line.iter_mut().zip(&across).for_each(|(c, east)| *c = of_normal.at(*c / variance_m2, down[r] * east));
    });
    correlation[0] = 1.0;
    let fft = RealFft2::new(rows, cols);
    let mut half = fft.forward(&correlation);
    drop(correlation);
    let weight = |k: usize| half.multiplicity(k / rows);
    let part = |sign: f64| -> f64 {
        sums::sum(&half.values.iter().enumerate().map(|(k, v)| weight(k) * (sign * v.re).max(0.0)).collect::<Vec<_>>())
    };
    let (positive, negative) = (part(1.0), part(-1.0));
    // The part that is left is scaled to unit variance.
    let cells = (rows * cols) as f64;
    let scale = cells / positive;
    half.values.iter_mut().for_each(|v| *v = Complex64::new(v.re.max(0.0) * scale, 0.0));
    let magnitudes = half.values.iter().map(|v| (v.re * cells).sqrt()).collect();
    let made = fft.inverse(half);
    let lines = made.par_chunks(cols).zip(covariance_m2.par_chunks(cols)).enumerate();
    let errors: Vec<f64> = lines
        .map(|(r, (line, wanted))| {
            let found = line.iter().zip(&across).map(|(made, east)| of_heights.at(*made, down[r] * east));
            found.zip(wanted).map(|(c, wanted)| (c - wanted / variance_m2).abs()).fold(0.0, f64::max)
        })
        .collect();
    (magnitudes, [negative / (positive + negative), errors.into_iter().fold(0.0, f64::max)])
}

/// `exp(-(d / range)^2)` along a line of `n` cells, every distance the shorter way around.
fn line_correlation(n: usize, range: f64) -> Vec<f64> {
    let at = |k: usize| k.min(n - k) as f64 / range;
    (0..n).map(|k| libm::exp(-at(k) * at(k))).collect()
}

/// Magnitudes of the modes of a line of unit variance with that correlation, for frequencies 0 to `n / 2`; 0 where negligible.
fn line_magnitudes(n: usize, range: f64) -> Vec<f64> {
    let at = |k: usize| libm::exp(-0.5 * (PI * range * k as f64 / n as f64) * (PI * range * k as f64 / n as f64));
    let shape: Vec<f64> = (0..=n / 2).map(at).map(|v| if v < NEGLIGIBLE { 0.0 } else { v }).collect();
    let twice = |k: usize| if k == 0 || 2 * k == n { 1.0 } else { 2.0 };
    let total: f64 = shape.iter().enumerate().map(|(k, v)| twice(k) * v * v).sum();
    // The variance of a field is the sum of the squares of its magnitudes over n^2.
    shape.into_iter().map(|v| v * n as f64 / total.sqrt()).collect()
}

#[cfg(test)]
mod tests;
