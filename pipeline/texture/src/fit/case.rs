//! A DEM detrended, trimmed and correlated: everything a fit is made of.

use super::residual::{Detrended, Trimmed};
use super::search::Coordinates;
use super::{FitError, FitSettings};
use crate::covariance::bins::Layout;
use crate::covariance::{Form, LagBins, MaskedCovariance, masked_covariance};
use crate::detrend::BoxWindow;
use sastrugi_numeric::{Geometry, Grid};

/// Fewest bins for two parameters.
const BINS_MIN: usize = 3;

/// A DEM detrended, trimmed and correlated.
pub struct Case<'a> {
    pub settings: &'a FitSettings,
    pub geometry: Geometry,
    pub window: BoxWindow,
    pub max_lag: [usize; 2],
    pub max_lag_m: f64,
    pub detrended: Detrended,
    pub trimmed: Trimmed,
    pub estimate: MaskedCovariance,
    /// Rings.
    pub bins: LagBins,
}

impl<'a> Case<'a> {
    /// Detrends, trims and correlates.
    pub fn new(dem: &Grid, settings: &'a FitSettings) -> Result<Self, FitError> {
        let window = settings.window(&dem.geometry)?;
        let detrended = Detrended::new(dem, settings, window)?;
        Self::of_detrended(detrended, dem.geometry, settings, window)
    }

    /// Trims and correlates.
    pub fn of_detrended(
        detrended: Detrended,
        geometry: Geometry,
        settings: &'a FitSettings,
        window: BoxWindow,
    ) -> Result<Self, FitError> {
        let trimmed = detrended.trimmed(settings);
        let max_lag_m = settings.max_lag_m(&geometry);
        let max_lag = [1, 0].map(|axis: usize| (max_lag_m / geometry.cell[axis] * (1.0 + 1e-9)) as usize);
        let estimate = masked_covariance(&trimmed.residual, geometry.cols, max_lag);
        let bins = LagBins::of(&estimate, geometry.cell, max_lag_m, Layout::ISOTROPIC);
        if bins.len() < BINS_MIN {
            return Err(FitError::TooFewLags { found: bins.len(), needed: BINS_MIN });
        }
        Ok(Self { settings, geometry, window, max_lag, max_lag_m, detrended, trimmed, estimate, bins })
    }

    /// The bins of another layout.
    pub fn bins_of(&self, layout: Layout) -> LagBins {
        LagBins::of(&self.estimate, self.geometry.cell, self.max_lag_m, layout)
    }

    /// Width of the window, m (the mean of both ways).
    pub fn window_m(&self) -> f64 {
        let [x, y] = self.window.size_m(self.geometry.cell);
        0.5 * (x + y)
    }

    /// Coordinates for a search over the parameters of a form.
    pub fn coordinates<'f>(&self, form: &'f Form) -> Coordinates<'f> {
        Coordinates {
            form,
            variance_m2: self.bins.covariance_m2[0],
            cell_m: self.geometry.cell[0].min(self.geometry.cell[1]),
            window_m: self.window_m(),
        }
    }
}
