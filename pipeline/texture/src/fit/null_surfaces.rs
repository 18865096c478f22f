//! Surfaces with a given covariance on a case's own grid and mask, measured and detrended like the case: the null hypothesis of
//! every test.

use super::case::Case;
use super::residual::residual;
use super::simulate::{Shape, Simulator};
use super::survey::Trim;
use crate::covariance::Covariance;
use crate::sizes::Sizes;
use sastrugi_numeric::Streams;

/// Range of the stationary surface that replaces a self-affine one, windows.
const OUTER_WINDOWS: f64 = 8.0;

/// Generator of null surfaces on all or part of a case.
pub struct NullSurfaces<'a> {
    case: &'a Case<'a>,
    cols: usize,
    /// Cells that enter the moving average.
    trusted: Vec<bool>,
    simulator: Simulator,
}

/// One null surface.
pub struct NullSurface {
    /// Residual before trimming, m.
    pub residual: Vec<f64>,
    /// Its trimming threshold.
    pub trim: Trim,
}

impl<'a> NullSurfaces<'a> {
    /// Null surfaces of the given rows and columns; `trusted` marks the cells that enter the moving average.
    pub fn new(case: &'a Case<'a>, covariance: &Covariance, [rows, cols]: [usize; 2], trusted: Vec<bool>) -> Self {
        let shape = Shape { rows, cols, profiles: case.heights.are_profiles() };
        let outer_m = OUTER_WINDOWS * case.window_m();
        let simulator = Simulator::new(covariance, case.settings.measurement(), shape, case.geometry.cell, outer_m);
        Self { case, cols, trusted, simulator }
    }

    /// The surface drawn from these streams.
    pub fn one(&self, streams: &Streams) -> NullSurface {
        let mut surface = self.simulator.surface(streams);
        surface.iter_mut().zip(&self.trusted).filter(|(_, trusted)| !**trusted).for_each(|(z, _)| *z = f64::NAN);
        let residual = residual(&surface, self.cols, self.case.settings, self.case.window);
        let trim = Trim::of(&Sizes::of(&residual), self.case.settings);
        NullSurface { residual, trim }
    }
}

impl NullSurface {
    /// The residual after trimming.
    pub fn trimmed(mut self) -> Vec<f64> {
        self.trim.apply(&mut self.residual);
        self.residual
    }
}
