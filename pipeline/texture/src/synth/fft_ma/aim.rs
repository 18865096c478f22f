//! Target covariances other than the model of the surface, and their spectra.

use super::spectrum::Spectrum;
use crate::covariance::Covariance;
use crate::covariance::empirical::{self, Composition, Purpose};
use crate::synth::{Wanted, tidy, window_on};
use sastrugi_numeric::Geometry;
use sastrugi_numeric::fft::HalfSpectrum;
use sastrugi_roughness::background::BoxWindow;
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::CovarianceMap;

/// Relative tolerance for one cell size being a whole multiple of another.
const MULTIPLE_TOLERANCE: f64 = 1e-6;

/// A target that is not just a covariance model.
#[derive(Clone)]
pub enum Aim {
    /// The part of the model that a background over the window lacks, on cells `times` finer (north-south and east-west) than the
    /// texture's.
    Residual { window: BoxWindow, times: [usize; 2] },
    /// A measured covariance, on the cells it was measured on, also `times` finer.
    Empirical { map: Box<CovarianceMap>, window: BoxWindow, purpose: Purpose, times: [usize; 2] },
}

impl Aim {
    /// The target for a fit and a purpose; `None` if it is the model of the surface.
    ///
    /// # Errors
    /// A fit without a window; cells that are not multiples of the measured ones.
    pub fn of(wanted: &Wanted, purpose: Purpose, cell_m: [f64; 2]) -> Result<Option<Self>, ParameterError> {
        let window_at = |cell_m: [f64; 2]| window_on(wanted.window_m, cell_m);
        let Some(map) = &wanted.map else {
            return match purpose {
                Purpose::Surface => Ok(None),
                Purpose::Residual => {
                    // A few coarse cells cannot represent the fit's window, so cells no larger than the fit's are used.
                    let fitted_m = wanted.cell_m.unwrap_or(cell_m);
                    let times = [1, 0].map(|k| (cell_m[k] / fitted_m[k] * (1.0 - MULTIPLE_TOLERANCE)).ceil().max(1.0));
                    let window = window_at([cell_m[0] / times[1], cell_m[1] / times[0]])?;
                    Ok(Some(Self::Residual { window, times: times.map(|t| t as usize) }))
                }
            };
        };
        empirical::check(map)?;
        let Some(measured_m) = wanted.cell_m else {
            return Err(ParameterError::new(
                "cell_m",
                "is missing from the fit file; an empirical covariance needs it",
            ));
        };
        let times = multiples(cell_m, measured_m)?;
        let needs_window = map.base != "surface" || purpose == Purpose::Residual;
        let window = if needs_window { window_at(measured_m)? } else { BoxWindow { half: [0, 0] } };
        Ok(Some(Self::Empirical { map: map.clone(), window, purpose, times }))
    }

    /// Number of computed cells per cell of the texture.
    pub fn oversampling(&self) -> usize {
        match self {
            Self::Residual { times, .. } | Self::Empirical { times, .. } => times[0] * times[1],
        }
    }

    /// Sides, east-west and north-south, that a torus needs for the measured lags, m.
    pub fn torus_m(&self, cell_m: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Residual { window, times } => window.size_m(finer(cell_m, *times)).map(|side| 2.0 * side),
            Self::Empirical { map, times, .. } => {
                let fine_m = finer(cell_m, *times);
                [0, 1].map(|k| (2 * map.max_lag[1 - k] + 2) as f64 * fine_m[k])
            }
        }
    }

    /// Checks that a periodic tile is large enough for the measured lags.
    ///
    /// # Errors
    /// A tile that is too small.
    pub fn check_tile(&self, tile: &Geometry) -> Result<(), ParameterError> {
        let ([needed_x_m, needed_y_m], [x_m, y_m]) = (self.torus_m(tile.cell).map(tidy), tile.size().map(tidy));
        if matches!(self, Self::Residual { .. }) || (x_m >= needed_x_m && y_m >= needed_y_m) {
            return Ok(());
        }
        let message = format!(
            "is {x_m} x {y_m} m; a periodic tile of this measured covariance must be at least {needed_x_m} x {needed_y_m} m: enlarge it, \
             or set periodic = false"
        );
        Err(ParameterError::new("size_m", message))
    }

    /// The spectrum on a torus of the texture's cells.
    pub fn spectrum(&self, model: &Covariance, torus: [usize; 2], cell_m: [f64; 2]) -> (Spectrum, Composition) {
        match self {
            Self::Residual { window, times } => {
                let fine = [0, 1].map(|k| torus[k] * times[k]);
                let values = empirical::residual_spectrum(model, *window, fine, finer(cell_m, *times));
                let half = HalfSpectrum { rows: fine[0], cols: fine[1], values: Vec::new() };
                let none = Composition { values: Vec::new(), clip_share: 0.0, continued_share: 0.0 };
                (Spectrum::of_values(torus, folded(&half, values, *times)), none)
            }
            Self::Empirical { map, window, purpose, times } => {
                let fine = [0, 1].map(|k| torus[k] * times[k]);
                let mut made = empirical::spectrum(map, model, *window, *purpose, fine, finer(cell_m, *times));
                let half = HalfSpectrum { rows: fine[0], cols: fine[1], values: Vec::new() };
                let values = folded(&half, std::mem::take(&mut made.values), *times);
                (Spectrum::of_values(torus, values), made)
            }
        }
    }
}

/// How many cells, each no larger than the fit's, make up one cell of the texture, for the spectrum of a residual or of a measured
/// covariance.
pub fn finest(cell_m: [f64; 2], fitted_m: [f64; 2]) -> u64 {
    let times = |k: usize| (cell_m[k] / fitted_m[k] * (1.0 - MULTIPLE_TOLERANCE)).ceil().max(1.0) as u64;
    times(0).saturating_mul(times(1))
}

/// How many cells of a measured covariance make up one cell of a texture, north-south and east-west.
///
/// # Errors
/// Cells that are not whole multiples of the measured ones.
pub fn multiples(cell_m: [f64; 2], measured_m: [f64; 2]) -> Result<[usize; 2], ParameterError> {
    let ratio = [1, 0].map(|k| cell_m[k] / measured_m[k]);
    let times = ratio.map(|r| r.round().max(1.0));
    if [0, 1].iter().any(|&k| (ratio[k] / times[k] - 1.0).abs() > MULTIPLE_TOLERANCE) {
        let message = format!(
            "is {} x {} m; cells must be whole multiples of the measured covariance's, {} x {} m",
            cell_m[0], cell_m[1], measured_m[0], measured_m[1]
        );
        return Err(ParameterError::new("cell_m", message));
    }
    Ok(times.map(|t| t as usize))
}

/// Size of the cells of which `times` (north-south and east-west) make up one.
fn finer(cell_m: [f64; 2], times: [usize; 2]) -> [f64; 2] {
    [0, 1].map(|k| cell_m[k] / times[1 - k] as f64)
}

/// The spectrum of every `times[0]`-th row and `times[1]`-th column: the mean over the modes that alias onto each other.
fn folded(fine: &HalfSpectrum, values: Vec<f64>, times: [usize; 2]) -> Vec<f64> {
    if times == [1, 1] {
        return values;
    }
    let (rows, cols) = (fine.rows / times[0], fine.cols / times[1]);
    // Modes beyond the stored half equal the opposite ones.
    let at = |ky: usize, kx: usize| match 2 * kx > fine.cols {
        true => values[(fine.cols - kx) * fine.rows + (fine.rows - ky) % fine.rows],
        false => values[kx * fine.rows + ky],
    };
    let mean = |kx: usize, ky: usize| {
        let aliases = (0..times[0]).flat_map(|i| (0..times[1]).map(move |j| (ky + i * rows, kx + j * cols)));
        aliases.map(|(ky, kx)| at(ky, kx)).sum::<f64>() / (times[0] * times[1]) as f64
    };
    (0..=cols / 2).flat_map(|kx| (0..rows).map(move |ky| (kx, ky))).map(|(kx, ky)| mean(kx, ky)).collect()
}
