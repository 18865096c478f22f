//! Ground that can be generated window by window, at any zoom of its lattice, as a server needs it.

use crate::planetary::{Patch, Request, World};

/// Ground of which any window can be generated. Samples are pure functions of their lattice point and of the bound on features.
///
/// ```
/// use sastrugi_numeric::Streams;
/// use sastrugi_terrain::Windows;
/// use sastrugi_terrain::planetary::{Planetary, RawPlanetary, Request, Window};
/// use serde_json::json;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let processes = json!([{ "kind": "texture" }, { "kind": "rocks", "coverage": 0.1 }]);
/// let raw: RawPlanetary = serde_json::from_value(json!({ "basic_spacing_m": 0.01, "processes": processes }))?;
/// let world = Planetary::try_from(raw)?.world_of(&Streams::for_seed(1, "terrain"), |_| true)?;
/// assert!(world.has_rocks() && !world.has_albedo());
///
/// // A window, and the part of it that begins five columns farther east.
/// let window = Window { zoom: 0, west: 100, south: 7, cols: 12, rows: 3, centred: false };
/// let east = Window { west: 105, cols: 7, ..window };
/// let request = |window| Request { window, feature_min_m: 0.0, cancel: None };
/// let [whole, part] = [window, east].map(|window| Windows::patch_for(&world, &request(window)).unwrap());
/// assert_eq!(part.heights[..7], whole.heights[5..12]);
/// # Ok(())
/// # }
/// ```
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
