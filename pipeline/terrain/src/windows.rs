//! Ground that can be generated window by window, at any zoom of its lattice, as a server needs it.

use crate::planetary::{Patch, Request, World};

/// Ground of which any window can be generated. Samples are pure functions of their lattice point and of the bound on features.
pub trait Windows: Send + Sync {
    /// The requested samples, computed on this thread; `None` if the request was cancelled. Heights are NaN where there is no ground.
    fn patch_for(&self, request: &Request<'_>) -> Option<Patch>;

    /// Rough time of [`Self::patch_for`] on one core, s.
    fn expected_seconds(&self, request: &Request<'_>) -> f64;

    /// Whether it has rocks.
    fn has_rocks(&self) -> bool;

    /// Fraction of the ground that only rocks up to `diameter_m` wide cover, given the coverage by all rocks.
    fn rock_cover_below(&self, coverage: f64, diameter_m: f64) -> f64;

    /// Whether it has an albedo.
    fn has_albedo(&self) -> bool;
}

impl Windows for World {
    fn patch_for(&self, request: &Request<'_>) -> Option<Patch> {
        Self::patch_for(self, request)
    }

    fn expected_seconds(&self, request: &Request<'_>) -> f64 {
        Self::expected_seconds(self, request)
    }

    fn has_rocks(&self) -> bool {
        self.rocks.is_some()
    }

    fn rock_cover_below(&self, coverage: f64, diameter_m: f64) -> f64 {
        self.rocks.as_ref().map_or(0.0, |(rocks, _)| rocks.parameters().cover_below(coverage, diameter_m))
    }

    fn has_albedo(&self) -> bool {
        self.albedo.is_some()
    }
}
