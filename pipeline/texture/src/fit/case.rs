//! A DEM after detrending, trimming and binning of its covariance: the input of a fit.

use super::heights::Heights;
use super::search::Coordinates;
use super::survey::Survey;
use super::{FitError, FitSettings};
use crate::covariance::bins::Layout;
use crate::covariance::empirical::REACH_WINDOWS;
use crate::covariance::filtered::DetrendFilter;
use crate::covariance::{Form, LagBins};
use sastrugi_numeric::Geometry;
use sastrugi_roughness::background::BoxWindow;
use sastrugi_schemas::ParameterError;
use std::ops::Range;

/// Correlation of neighbouring cells below which a residual may be white; an exponential with a range of one cell has 0.37.
const WHITE_CORRELATION: f64 = 0.5;
/// Fewest bins for two parameters.
const BINS_MIN: usize = 3;

/// A DEM after detrending, trimming and binning of its covariance.
pub struct Case<'a> {
    pub heights: &'a dyn Heights,
    pub settings: &'a FitSettings,
    pub geometry: Geometry,
    pub window: BoxWindow,
    pub max_lag: [usize; 2],
    pub max_lag_m: f64,
    pub survey: Survey,
    /// Rings.
    pub bins: LagBins,
}

/// Lags of up to `max_lag_m` on cells of `cell_m` (east-west and north-south), north-south and east-west, cells.
pub(super) fn lag_cells(max_lag_m: f64, cell_m: [f64; 2]) -> [usize; 2] {
    [1, 0].map(|axis| (max_lag_m / cell_m[axis] * (1.0 + 1e-9)) as usize)
}

/// Largest lags of a measured covariance, north-south and east-west, cells, for bins that end at `binned`.
pub(super) fn measured_lags(binned: [usize; 2], window: BoxWindow) -> [usize; 2] {
    [0, 1].map(|axis| binned[axis].max((REACH_WINDOWS * window.cells()[axis] as f64) as usize))
}

impl<'a> Case<'a> {
    /// Detrends, trims and bins the covariance.
    pub fn new(heights: &'a dyn Heights, settings: &'a FitSettings) -> Result<Self, FitError> {
        let (geometry, profiles) = (heights.geometry(), heights.are_profiles());
        if let Some(form) = settings.forms.iter().find(|f| profiles && f.is_anisotropic()) {
            let message =
                format!("is `{}`, but a transect has only one direction; use an isotropic model", form.name());
            return Err(ParameterError::new("model", message).into());
        }
        let window = settings.window(&geometry, profiles)?;
        let max_lag_m = settings.max_lag_m(&geometry, profiles)?;
        let [rows, cols] = lag_cells(max_lag_m, geometry.cell);
        let max_lag = [if profiles { 0 } else { rows }, cols];
        if settings.empirical && profiles {
            let message = "is `empirical`, which needs covariances in two directions, but a transect has only one";
            return Err(ParameterError::new("model", message).into());
        }
        // These lags stay below half of the DEM, which is at least three windows wide.
        let surveyed = if settings.empirical { measured_lags(max_lag, window) } else { max_lag };
        let survey = Survey::new(heights, settings, window, surveyed)?;
        let bins = LagBins::of(&survey.covariance, geometry.cell, max_lag_m, Layout::ISOTROPIC);
        if bins.len() < BINS_MIN {
            return Err(FitError::TooFewLags { found: bins.len(), needed: BINS_MIN });
        }
        let noise = DetrendFilter::new(window, geometry.cell, [0, 0], settings.measurement()).residual_noise();
        let (noise_m, residual_m) = (noise.at([0, 0]).sqrt(), bins.covariance_m2[0].sqrt());
        if noise_m >= residual_m {
            let message = format!(
                "and `correlated_noise_sigma_m` amount to {noise_m:.3e} m of noise in the residual, whose total standard deviation is \
                 only {residual_m:.3e} m; reduce them"
            );
            return Err(ParameterError::new("noise_sigma_m", message).into());
        }
        Ok(Self { heights, settings, geometry, window, max_lag, max_lag_m, survey, bins })
    }

    /// True if neighbouring cells of the residual are hardly correlated.
    pub fn is_white(&self) -> bool {
        let neighbours = [(0, 1), (1, 0)].into_iter().filter_map(|(r, c)| self.survey.covariance.covariance(r, c));
        neighbours.fold(f64::NEG_INFINITY, f64::max) < WHITE_CORRELATION * self.bins.covariance_m2[0]
    }

    /// The bins of another layout.
    pub fn bins_of(&self, layout: Layout) -> LagBins {
        LagBins::of(&self.survey.covariance, self.geometry.cell, self.max_lag_m, layout)
    }

    /// Residuals of a part, trimmed.
    pub fn trimmed(&self, rows: Range<usize>, cols: Range<usize>) -> Result<Vec<f64>, FitError> {
        let mut residual = self.survey.residual(self.heights, self.settings, rows, cols)?;
        self.survey.trim.apply(&mut residual);
        Ok(residual)
    }

    /// All residuals, before trimming.
    pub fn residual(&self) -> Result<Vec<f64>, FitError> {
        self.survey.residual(self.heights, self.settings, 0..self.geometry.rows, 0..self.geometry.cols)
    }

    /// Width of the window, m: mean of both directions; for transects, along them.
    pub fn window_m(&self) -> f64 {
        let [x, y] = self.window.size_m(self.geometry.cell);
        if self.heights.are_profiles() { x } else { 0.5 * (x + y) }
    }

    /// Search coordinates for the parameters of a form.
    pub fn coordinates<'f>(&self, form: &'f Form) -> Coordinates<'f> {
        Coordinates {
            form,
            variance_m2: self.bins.covariance_m2[0],
            cell_m: self.geometry.cell[0].min(self.geometry.cell[1]),
            window_m: self.window_m(),
        }
    }
}
