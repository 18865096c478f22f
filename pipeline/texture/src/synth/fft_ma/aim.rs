//! Target covariances other than the model of the surface, and their spectra.
//!
//! Such a spectrum is computed on cells no larger than the fit's ([`Lattice`]), once for each texture ([`Aimed`]).

use super::spectrum::Spectrum;
use crate::covariance::Covariance;
use crate::covariance::empirical::{self, Composition, Purpose};
use crate::synth::{Prospect, Wanted, tidy, window_on};
use sastrugi_numeric::Geometry;
use sastrugi_numeric::fft::HalfSpectrum;
use sastrugi_roughness::background::BoxWindow;
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::CovarianceMap;

/// Relative tolerance for one cell size being a whole multiple of another.
const MULTIPLE_TOLERANCE: f64 = 1e-6;

/// A target that is not just a covariance model.
pub enum Aim {
    /// The part of the model that a background over the window lacks, on cells `times` finer (north-south and east-west) than the
    /// texture's.
    Residual { window: BoxWindow, times: [usize; 2] },
    /// A measured covariance, on the cells it was measured on, also `times` finer.
    Empirical { map: Box<CovarianceMap>, window: BoxWindow, purpose: Purpose, times: [usize; 2] },
}

/// A target on its torus.
pub struct Aimed {
    /// The cells on which its spectrum was computed.
    pub lattice: Lattice,
    /// Its spectrum on a torus of the texture's cells.
    pub spectrum: Spectrum,
    /// Shares of a measured covariance.
    pub shares: Option<Shares>,
}

/// How the spectrum of a measured covariance is composed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    /// Share of the measured spectrum that was negative and set to 0.
    pub clipped: f64,
    /// Share of the variance that comes from the model.
    pub continued: f64,
}

/// The cells on which the spectrum of a target is computed. They are known before the fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lattice {
    /// How many make up one of the texture's, north-south and east-west.
    pub times: [usize; 2],
    /// How many a torus needs at least, north-south and east-west.
    least: [usize; 2],
}

impl Lattice {
    /// For the part of a model that a background over a window lacks.
    fn of_window(window: BoxWindow, times: [usize; 2]) -> Self {
        Self { times, least: window.cells().map(|width| 2 * width) }
    }

    /// For a covariance measured at lags of up to `max_lag` cells.
    fn of_lags(max_lag: [usize; 2], times: [usize; 2]) -> Self {
        Self { times, least: max_lag.map(|lag| lag.saturating_mul(2).saturating_add(2)) }
    }

    /// What is known before the fit about a texture with cells of `cell_m`; `None` if its target will be the model of the surface.
    pub fn planned(prospect: &Prospect, purpose: Purpose, cell_m: [f64; 2]) -> Option<Self> {
        let fitted_m = prospect.cell_m.unwrap_or(cell_m);
        if prospect.is_measured {
            // Cells that are not whole multiples are refused elsewhere.
            let times = multiples(cell_m, fitted_m).unwrap_or_else(|_| finest(cell_m, fitted_m));
            return Some(Self::of_lags(prospect.max_lag, times));
        }
        let of_window = || residual_window(Some(prospect.window_m), cell_m, fitted_m).ok();
        let (window, times) = (purpose == Purpose::Residual).then(of_window).flatten()?;
        Some(Self::of_window(window, times))
    }

    /// Number of cells per cell of the texture.
    pub fn oversampling(&self) -> f64 {
        self.times[0] as f64 * self.times[1] as f64
    }

    /// Sides, east-west and north-south, that a torus needs at least, m, for a texture with cells of `cell_m`.
    pub fn torus_m(&self, cell_m: [f64; 2]) -> [f64; 2] {
        let fine_m = finer(cell_m, self.times);
        [0, 1].map(|k| self.least[1 - k] as f64 * fine_m[k])
    }
}

impl Aim {
    /// The target for a fit and a purpose; `None` if it is the model of the surface.
    ///
    /// # Errors
    /// A fit without a window; cells that are not multiples of the measured ones.
    pub fn of(wanted: &Wanted, purpose: Purpose, cell_m: [f64; 2]) -> Result<Option<Self>, ParameterError> {
        let Some(map) = &wanted.map else {
            return match purpose {
                Purpose::Surface => Ok(None),
                Purpose::Residual => {
                    let fitted_m = wanted.cell_m.unwrap_or(cell_m);
                    let (window, times) = residual_window(wanted.window_m, cell_m, fitted_m)?;
                    Ok(Some(Self::Residual { window, times }))
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
        let window = if needs_window { window_on(wanted.window_m, measured_m)? } else { BoxWindow { half: [0, 0] } };
        Ok(Some(Self::Empirical { map: map.clone(), window, purpose, times }))
    }

    /// The cells on which its spectrum is computed.
    pub fn lattice(&self) -> Lattice {
        match self {
            Self::Residual { window, times } => Lattice::of_window(*window, *times),
            Self::Empirical { map, times, .. } => Lattice::of_lags(map.max_lag, *times),
        }
    }

    /// Checks that a periodic tile is large enough for the measured lags.
    ///
    /// # Errors
    /// A tile that is too small.
    pub fn check_tile(&self, tile: &Geometry) -> Result<(), ParameterError> {
        let needed_m = self.lattice().torus_m(tile.cell);
        let ([needed_x_m, needed_y_m], [x_m, y_m]) = (needed_m.map(tidy), tile.size().map(tidy));
        if matches!(self, Self::Residual { .. }) || (x_m >= needed_x_m && y_m >= needed_y_m) {
            return Ok(());
        }
        let message = format!(
            "is {x_m} x {y_m} m; a periodic tile of this measured covariance must be at least {needed_x_m} x {needed_y_m} m: enlarge it, \
             or set periodic = false"
        );
        Err(ParameterError::new("size_m", message))
    }

    /// The target on a torus of the texture's cells.
    pub fn on_torus(&self, model: &Covariance, torus: [usize; 2], cell_m: [f64; 2]) -> Aimed {
        let lattice = self.lattice();
        let times = lattice.times;
        let (fine, fine_m) = ([0, 1].map(|k| torus[k] * times[k]), finer(cell_m, times));
        let (values, shares) = match self {
            Self::Residual { window, .. } => (empirical::residual_spectrum(model, *window, fine, fine_m), None),
            Self::Empirical { map, window, purpose, .. } => {
                let Composition { values, clip_share, continued_share } =
                    empirical::spectrum(map, model, *window, *purpose, fine, fine_m);
                (values, Some(Shares { clipped: clip_share, continued: continued_share }))
            }
        };
        let half = HalfSpectrum { rows: fine[0], cols: fine[1], values: Vec::new() };
        Aimed { lattice, spectrum: Spectrum::of_values(torus, folded(&half, values, times)), shares }
    }
}

/// The window of the background on cells no larger than the fit's, and how many of these make up one cell of the texture: a few coarse cells
/// cannot represent it.
///
/// # Errors
/// A fit without a window.
fn residual_window(
    window_m: Option<[f64; 2]>,
    cell_m: [f64; 2],
    fitted_m: [f64; 2],
) -> Result<(BoxWindow, [usize; 2]), ParameterError> {
    let times = finest(cell_m, fitted_m);
    Ok((window_on(window_m, finer(cell_m, times))?, times))
}

/// How many cells, each no larger than the fit's, make up one cell of the texture, north-south and east-west.
fn finest(cell_m: [f64; 2], fitted_m: [f64; 2]) -> [usize; 2] {
    [1, 0].map(|k| (cell_m[k] / fitted_m[k] * (1.0 - MULTIPLE_TOLERANCE)).ceil().max(1.0) as usize)
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
