//! Ground of which any window can be made, at any zoom of its lattice: what a server asks for.

use crate::planetary::{Patch, Request, World};

/// Ground of which any window can be made. Samples are pure functions of their lattice point and of the bound on features.
pub trait Windows: Send + Sync {
    /// The samples that are asked for, made on this thread; `None` once they are no longer wanted. Heights are NaN where there is no ground.
    fn patch_for(&self, request: &Request<'_>) -> Option<Patch>;

    /// Rough time of [`Self::patch_for`] on one core, s.
    fn expected_seconds(&self, request: &Request<'_>) -> f64;

    /// Whether it has rocks.
    fn has_rocks(&self) -> bool;

    /// Share of the ground that rocks no wider than `diameter_m` cover where the wider ones do not, at a coverage by all.
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
