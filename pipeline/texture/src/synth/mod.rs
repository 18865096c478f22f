//! Synthetic texture: random fields with a given covariance. One folder per method.
//!
//! There are two families. A method of the first ([`Method`], and its [`Kernel`] once the fit is bound) synthesises one tile of a normal field
//! (bumps: nearly normal) with a covariance. What these have in common is implemented once, in [`Texture`]: size and cells, anisotropy,
//! height distribution, tiling, and the comparison of the method's mean covariance with the target. A method of the second repeats the
//! measured residual, or its statistics; see [`residual`].
//!
//! Drawing all cells from one multivariate normal distribution by Latin hypercube sampling (`lhsnorm` in Vecherin et al.
//! 2022, section 3.2) is not offered: it needs the same matrix as [`cholesky`], and stratifying each cell's values over
//! an ensemble does nothing for a single surface.

pub mod bumps;
pub mod cholesky;
pub mod conditional;
pub mod exemplar;
pub mod fft_ma;
pub mod gaussians;
pub mod marginal;
pub mod measured;
pub mod modulated;
pub mod quasi_wavelets;
pub mod quilting;
pub mod raised;
pub mod reach;
pub mod residual;
pub mod scoreboard;
pub mod statistics;
pub mod tile;
pub mod wavelet_statistics;

use crate::covariance::Covariance;
use marginal::Marginal;
use measured::Measured;
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_roughness::background::BoxWindow;
use sastrugi_schemas::fit::{CovarianceMap, FitFile};
use sastrugi_schemas::{ParameterError, counted};
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::sync::Arc;
use tile::Tile;

/// A method with checked parameters, before the fit is known.
pub trait Method: Send + Sync {
    /// Shape and cells of the texture; its south-west corner is the origin.
    fn geometry(&self) -> Geometry;

    /// The checked parameters with every default written out.
    fn parameters(&self) -> Value;

    /// Whether the texture repeats without seams.
    fn is_periodic(&self) -> bool;

    /// Cost of a texture, as far as it is known without the covariance.
    fn cost(&self) -> Cost;

    /// The same, with the most memory that any result of a fit may need.
    fn cost_of(&self, prospect: &Prospect) -> Cost;

    /// Refuses what [`Self::bind`] would refuse for such a fit, as far as it is known in advance.
    ///
    /// # Errors
    /// A measured covariance for a method that supports models only; cells that do not match the site's; missing statistics.
    fn check_prospect(&self, prospect: &Prospect) -> Result<(), ParameterError>;

    /// The texture that matches a fit; `measured` is the residual of the fit's DEM, for methods that copy from it.
    ///
    /// # Errors
    /// A fit without a covariance, or with one that the method cannot reproduce on this tile; missing statistics, a missing residual.
    fn bind(&self, fit: &FitFile, measured: Option<&Arc<Measured>>) -> Result<Box<dyn Synthesis>, ParameterError>;
}

/// What is known about a fit in advance, for planning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prospect {
    /// Side of a torus that is wide enough for any covariance the fit may find, m.
    pub torus_m: f64,
    /// Cells of the fitted surface, east-west and north-south, m.
    pub cell_m: Option<[f64; 2]>,
    /// Number of these cells.
    pub cells: Option<u64>,
    /// Window of the fit, east-west and north-south, m.
    pub window_m: [f64; 2],
    /// Whether the measured covariance is stored.
    pub is_measured: bool,
    /// Its largest lags, north-south and east-west, cells; 0 if it is not stored or its cells are unknown.
    pub max_lag: [usize; 2],
    /// Whether the statistics of the residual are stored.
    pub has_statistics: bool,
}

/// Cost of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Working memory, result included, bytes.
    pub memory_bytes: u64,
    /// Arithmetic operations, to a factor of about two.
    pub operations: f64,
}

/// A method bound to a fit, ready to generate fields.
pub trait Synthesis: Send + Sync {
    /// Shape and cells of the texture; its south-west corner is the origin.
    fn geometry(&self) -> Geometry;

    /// The checked parameters with every default written out.
    fn parameters(&self) -> Value;

    /// Cost of [`Self::generate`].
    fn cost(&self) -> Cost;

    /// Notes for the user: rounded sizes, coarse cells, a torus too small for the range.
    fn notes(&self) -> Vec<String>;

    /// Mean covariance of an ensemble of these textures and its target, at lags along rows, columns and diagonals: up to half the
    /// width of a periodic tile, or the full width of any other. A method whose mean covariance is unknown states only lags along rows,
    /// with NaN as what it achieves.
    fn covariance(&self) -> Vec<LagCovariance>;

    /// Target ratio of the range across the long axis to the range along it; NaN if the method has none.
    fn ratio(&self) -> f64;

    /// Whether the texture repeats without seams.
    fn is_periodic(&self) -> bool;

    /// One field from the named streams.
    ///
    /// # Errors
    /// See [`SynthesisError`].
    fn generate(&self, streams: &Streams) -> Result<TextureOutcome, SynthesisError>;
}

/// Covariance at a lag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LagCovariance {
    /// Lag, east and north, m.
    pub lag_m: [f64; 2],
    /// Target, m2.
    pub wanted_m2: f64,
    /// Mean of the method, m2.
    pub achieved_m2: f64,
}

impl LagCovariance {
    fn error_m2(&self) -> f64 {
        (self.achieved_m2 - self.wanted_m2).abs()
    }
}

/// A texture.
#[derive(Clone, Debug)]
pub struct TextureOutcome {
    /// Heights, m.
    pub grid: Grid,
    /// Largest absolute difference between the achieved and the target covariance over all lags of the torus (for inexact methods and
    /// given height distributions: over the lags of [`Synthesis::covariance`]), m2; NaN if unknown.
    pub covariance_error_max_m2: f64,
    /// Share of the spectrum that was negative and set to 0.
    pub clip_share: f64,
    /// Notes on this realisation.
    pub notes: Vec<String>,
}

/// A length for a message, m, rounded to hide computed digits.
fn to_micrometres(length_m: f64) -> f64 {
    (1e6 * length_m).round() / 1e6
}

/// Why a texture cannot be synthesised.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SynthesisError {
    /// The covariance is not positive definite on the torus.
    #[error(
        "the covariance is not positive definite on a tile of {width} m x {height} m: {clip_share:.1e} of its spectrum \
         is negative, more than {limit:.0e}; make the tile at least {needed} m wide and high, or set periodic = false",
        width = to_micrometres(*.width_m),
        height = to_micrometres(*.height_m),
        needed = to_micrometres(*.needed_m)
    )]
    NegativeSpectrum {
        /// East-west size of the torus, m.
        width_m: f64,
        /// North-south size of the torus, m.
        height_m: f64,
        /// Negative share of the spectrum.
        clip_share: f64,
        /// Largest share that is accepted and set to 0.
        limit: f64,
        /// A sufficient size, m.
        needed_m: f64,
    },
    /// The covariance is not positive definite on any torus tried for a texture that does not repeat.
    #[error(
        "the covariance is not positive definite on a torus of {} m x {} m, the largest tried for this texture of {} m x {} m: \
         {clip_share:.1e} of its spectrum is negative, more than {limit:.0e}; use larger cells, or turn the long axis to the grid's \
         (`azimuth_deg` = 0 or 90)",
        to_micrometres(.torus_m[0]), to_micrometres(.torus_m[1]), to_micrometres(.size_m[0]), to_micrometres(.size_m[1])
    )]
    NoTorus {
        /// Size of the texture, east-west and north-south, m.
        size_m: [f64; 2],
        /// Size of the largest torus tried, m.
        torus_m: [f64; 2],
        /// Negative share of the spectrum there.
        clip_share: f64,
        /// Largest share that is accepted and set to 0.
        limit: f64,
    },
    /// A method that copies cells needs those of the site.
    #[error(
        "`{method}` copies cells of the site, which are {} m x {} m, but those of the texture are {} m x {} m; set `cell_m` to the site's, \
         or resample the DEM",
        to_micrometres(.site_m[0]), to_micrometres(.site_m[1]), to_micrometres(.tile_m[0]), to_micrometres(.tile_m[1])
    )]
    OtherCells {
        /// Name of the method.
        method: &'static str,
        /// Cells of the site, east-west and north-south, m.
        site_m: [f64; 2],
        /// Cells of the texture, m.
        tile_m: [f64; 2],
    },
    /// The site has no data.
    #[error(
        "the measured residual has no cell with data for `{method}` to copy; check the mask and the outer scale of the fit"
    )]
    NoResidual {
        /// Name of the method.
        method: &'static str,
    },
    /// Heights that overflow.
    #[error("heights from `{method}` are not finite: the statistics in the fit file are damaged; fit the DEM again")]
    NotFinite {
        /// Name of the method.
        method: &'static str,
    },
    /// Too little of the site is free of gaps.
    #[error(
        "the measured residual has {} of {side} m x {side} m without gaps, and `{method}` needs at least {least} to choose from; \
         give a larger DEM or one with fewer gaps, or set `find_objects = false` if the objects are part of the texture",
        counted(.places, "place"),
        side = to_micrometres(*.side_m)
    )]
    FewPlaces {
        /// Name of the method.
        method: &'static str,
        /// Places without gaps.
        places: usize,
        /// Fewest that are accepted.
        least: usize,
        /// Side of a place, m.
        side_m: f64,
    },
    /// Patches do not fit on a periodic tile.
    #[error(
        "a patch of {patch} m is wider than half of the periodic tile, {limit} m; set a smaller `patch_m`, enlarge the tile, or set \
         periodic = false",
        patch = to_micrometres(*.patch_m),
        limit = to_micrometres(*.limit_m)
    )]
    PatchTooWide {
        /// Side of a patch, m.
        patch_m: f64,
        /// Half of the tile's shorter side, m.
        limit_m: f64,
    },
    /// The first cells of a direct sampling do not fit on a periodic tile.
    #[error(
        "first cells {spacing} m apart do not fit twice on the periodic tile, whose shorter side is {side} m; enlarge the tile, or set \
         periodic = false",
        spacing = to_micrometres(*.spacing_m),
        side = to_micrometres(*.side_m)
    )]
    SpacingTooWide {
        /// Spacing of the first cells, m.
        spacing_m: f64,
        /// Shorter side of the tile, m.
        side_m: f64,
    },
    /// Patches without room for an overlap.
    #[error(
        "`patch_m` is {patch}, too narrow to cut through its overlap; it must be at least {least} m",
        patch = to_micrometres(*.patch_m),
        least = to_micrometres(*.least_m)
    )]
    PatchTooNarrow {
        /// Side of a patch, m.
        patch_m: f64,
        /// Least side, m.
        least_m: f64,
    },
}

/// Parameters of a method, without those of its tile.
pub trait MethodParameters: DeserializeOwned + Serialize + JsonSchema + Clone + Send + Sync + 'static {
    /// Its name.
    const NAME: &'static str;
    /// The generator of tiles.
    type Kernel: Kernel + 'static;

    /// Whether the tile repeats without seams.
    fn is_periodic(&self) -> bool;

    /// Refuses parameters that are invalid whatever the covariance.
    ///
    /// # Errors
    /// Parameters out of range.
    fn check(&self, tile: &Tile) -> Result<(), ParameterError>;

    /// Refuses a covariance measured on cells of size `measured_m` if the method cannot reproduce it.
    ///
    /// # Errors
    /// A method that supports model covariances only; cells that are not whole multiples of the measured ones.
    fn check_measured(&self, _tile: &Tile, _measured_m: [f64; 2]) -> Result<(), ParameterError> {
        let message =
            format!("is `{}`; only `fft_ma` can synthesise textures with an empirical covariance", Self::NAME);
        Err(ParameterError::new("method", message))
    }

    /// Cost of a tile, as far as it is known without the covariance.
    fn cost(&self, tile: &Tile) -> Cost;

    /// The same, with the most memory that any result of a fit may need.
    fn cost_of(&self, tile: &Tile, _prospect: &Prospect) -> Cost {
        self.cost(tile)
    }

    /// The method for one tile of `wanted`, which is the covariance of `fitted` with the anisotropy of the tile.
    ///
    /// # Errors
    /// A covariance that the method cannot reproduce on this tile.
    fn kernel(&self, tile: &Tile, wanted: &Covariance, fitted: &Wanted) -> Result<Self::Kernel, ParameterError>;
}

/// A generator of tiles.
pub trait Kernel: Send + Sync {
    /// Cost of a tile.
    fn cost(&self) -> Cost;

    /// Notes for the user.
    fn notes(&self) -> Vec<String>;

    /// The mean covariance, m2, at lags `[east, north]` up to half a periodic tile.
    fn achieved(&self) -> Box<dyn Fn([f64; 2]) -> f64 + '_>;

    /// False if the target is the covariance of [`Self::achieved`], not a model of the surface.
    fn aims_at_a_model(&self) -> bool {
        true
    }

    /// One tile.
    ///
    /// # Errors
    /// See [`SynthesisError`].
    fn make(&self, streams: &Streams) -> Result<Made, SynthesisError>;
}

/// One tile.
pub struct Made {
    /// Heights, row-major, m.
    pub heights_m: Vec<f64>,
    /// Largest error of the covariance over all lags, if the method knows it; otherwise that of [`Synthesis::covariance`] is used.
    pub covariance_error_max_m2: Option<f64>,
    /// Share of the spectrum that was negative and set to 0.
    pub clip_share: f64,
}

/// A length rounded to a micrometre, to remove rounding errors.
fn tidy(length_m: f64) -> f64 {
    (length_m * 1e6).round() / 1e6
}

/// The window of a fit's background, on cells of `cell_m`, both east-west and north-south, m.
///
/// # Errors
/// A fit without a window.
fn window_on(window_m: Option<[f64; 2]>, cell_m: [f64; 2]) -> Result<BoxWindow, ParameterError> {
    let [x_m, y_m] = window_m.ok_or_else(|| {
        let message = "is `residual`, but the fit file has no `window_m`, the background's window";
        ParameterError::new("covariance", message)
    })?;
    let [across, down] = [(x_m, cell_m[0]), (y_m, cell_m[1])].map(|(m, cell)| BoxWindow::nearest(m, [cell; 2]));
    Ok(BoxWindow { half: [down.half[0], across.half[1]] })
}

/// Model name of fits with a measured covariance.
pub const EMPIRICAL: &str = "empirical";

/// The target of a texture.
#[derive(Clone)]
pub struct Wanted {
    /// Covariance.
    pub covariance: Covariance,
    /// Measured heights at equally spaced probabilities from 0 to 1, m; empty if unknown.
    pub quantiles_m: Vec<f64>,
    /// Window of the background that the fit subtracted, east-west and north-south, m.
    pub window_m: Option<[f64; 2]>,
    /// Cells of the fit, east-west and north-south, m.
    pub cell_m: Option<[f64; 2]>,
    /// Measured covariance, which replaces the model's.
    pub map: Option<Box<CovarianceMap>>,
}

impl Wanted {
    /// The target from a fit file.
    ///
    /// # Errors
    /// An unknown model; a parameter that is missing, unknown or out of range.
    pub fn of_fit(fit: &FitFile) -> Result<Self, ParameterError> {
        if fit.model == EMPIRICAL && fit.map.is_none() {
            return Err(ParameterError::new("map", "is missing from the fit file, whose model is `empirical`"));
        }
        Ok(Self {
            quantiles_m: fit.height_quantiles_m.clone(),
            window_m: fit.window_m,
            cell_m: fit.cell_m,
            map: fit.map.clone().map(Box::new),
            ..Covariance::of_fit(fit)?.into()
        })
    }
}

/// Caveats of a fit that apply to textures from it.
pub fn fit_notes(fit: &FitFile) -> Vec<String> {
    let range_m = fit.parameters.get("range_m").copied().filter(|_| fit.range_at_bound());
    let bound = range_m.map(|range_m| {
        format!(
            "the fit did not identify the range: its search ended at {range_m:.4} m; the texture has the fit's increments at lags below the \
             fit's window, but its longer waves are an assumption"
        )
    });
    bound.into_iter().collect()
}

impl From<Covariance> for Wanted {
    fn from(covariance: Covariance) -> Self {
        Self { covariance, quantiles_m: Vec::new(), window_m: None, cell_m: None, map: None }
    }
}

/// The checked parameters of a method and its tile.
struct Checked<P> {
    tile: Tile,
    own: P,
}

/// Checks raw parameters: those of the tile and those of the method, `P`.
///
/// # Errors
/// Parameters that are unknown or out of range.
pub fn check<P: MethodParameters>(raw: &Value) -> Result<Box<dyn Method>, ParameterError> {
    let (of_tile, own) = tile::read::<P>(raw)?;
    let tile = Tile::check(of_tile, own.is_periodic())?;
    own.check(&tile)?;
    Ok(Box::new(Checked { tile, own }))
}

impl<P: MethodParameters> Method for Checked<P> {
    fn geometry(&self) -> Geometry {
        self.tile.whole()
    }

    fn parameters(&self) -> Value {
        self.tile.parameters_with(&self.own)
    }

    fn is_periodic(&self) -> bool {
        self.tile.periodic
    }

    fn cost(&self) -> Cost {
        self.tile.repeated_cost(self.own.cost(&self.tile))
    }

    fn cost_of(&self, prospect: &Prospect) -> Cost {
        self.tile.repeated_cost(self.own.cost_of(&self.tile, prospect))
    }

    fn check_prospect(&self, prospect: &Prospect) -> Result<(), ParameterError> {
        match prospect.cell_m.filter(|_| prospect.is_measured) {
            Some(measured_m) => self.own.check_measured(&self.tile, measured_m),
            None => Ok(()),
        }
    }

    fn bind(&self, fit: &FitFile, _: Option<&Arc<Measured>>) -> Result<Box<dyn Synthesis>, ParameterError> {
        let wanted = Wanted::of_fit(fit)?;
        if wanted.map.is_some() {
            // Missing cells are reported where they are needed.
            self.own.check_measured(&self.tile, wanted.cell_m.unwrap_or(self.tile.geometry.cell))?;
        }
        Ok(Box::new(Texture::new(&self.tile, &self.own, wanted)?))
    }
}

/// A method, with everything that is common to all methods.
pub struct Texture<K> {
    tile: Tile,
    parameters: Value,
    marginal: Option<Marginal>,
    wanted: Covariance,
    kernel: K,
    notes: Vec<String>,
}

/// Error of the covariance, as a share of the variance, above which it is noted.
const ERROR_NOTE: f64 = 1e-4;
/// Most lags along each direction of a comparison.
const LAGS_MAX: usize = 2048;

impl<K: Kernel> Texture<K> {
    /// The texture of checked parameters that matches `fitted`.
    ///
    /// # Errors
    /// A covariance or heights that the method cannot reproduce on this tile.
    pub fn new<P: MethodParameters<Kernel = K>>(tile: &Tile, own: &P, fitted: Wanted) -> Result<Self, ParameterError> {
        let mut notes = Vec::new();
        let wanted = tile.covariance(fitted.covariance.clone(), &mut notes);
        let kernel = own.kernel(tile, &wanted, &fitted)?;
        let variance_m2 = || match kernel.aims_at_a_model() {
            true => wanted.at_distance(0.0),
            false => kernel.achieved()([0.0; 2]),
        };
        let marginal = tile.marginal(&fitted.quantiles_m, variance_m2)?;
        notes.extend(kernel.notes());
        Ok(Self { tile: tile.clone(), parameters: tile.parameters_with(own), marginal, wanted, kernel, notes })
    }

    /// The texture with the target's height distribution, tiled.
    fn shaped(&self, heights_m: Vec<f64>) -> Grid {
        let tile = Grid::new(self.tile.geometry, heights_m);
        let shaped = match &self.marginal {
            None => tile,
            Some(marginal) => {
                let sigma_m = self.kernel.achieved()([0.0; 2]).sqrt();
                tile.map(|z| marginal.height_m(z / sigma_m))
            }
        };
        self.tile.repeated(shaped)
    }

    /// Lags along rows, columns and diagonals, in cells east and north.
    fn lags(&self) -> impl Iterator<Item = [f64; 2]> + use<K> {
        let g = self.tile.geometry;
        let last = |n: usize| if self.tile.periodic { n / 2 } else { n - 1 };
        let (across, down) = (last(g.cols), last(g.rows));
        let run = move |[x, y]: [f64; 2], count: usize| {
            (1..=count.min(LAGS_MAX)).map(move |k| [x * k as f64 * g.cell[0], y * k as f64 * g.cell[1]])
        };
        std::iter::once([0.0; 2])
            .chain(run([1.0, 0.0], across))
            .chain(run([0.0, 1.0], down))
            .chain(run([1.0, 1.0], across.min(down)))
            .chain(run([-1.0, 1.0], across.min(down)))
    }

    fn error_note(&self) -> Option<String> {
        // Then the target is what is achieved.
        if self.marginal.is_none() && !self.kernel.aims_at_a_model() {
            return None;
        }
        let lags = self.covariance();
        let worst = lags.iter().max_by(|a, b| a.error_m2().total_cmp(&b.error_m2()))?;
        let variance_m2 = lags[0].wanted_m2;
        let [east_m, north_m] = worst.lag_m.map(tidy);
        (worst.error_m2() > ERROR_NOTE * variance_m2).then(|| {
            let share = 100.0 * worst.error_m2() / variance_m2;
            let error_m2 = worst.error_m2();
            format!(
                "the covariance differs from the fit's by up to {error_m2:.2e} m2, {share:.2} % of the variance (at a lag of \
                 {east_m} m east, {north_m} m north)"
            )
        })
    }
}

impl<K: Kernel> Synthesis for Texture<K> {
    fn geometry(&self) -> Geometry {
        self.tile.whole()
    }

    fn parameters(&self) -> Value {
        self.parameters.clone()
    }

    fn cost(&self) -> Cost {
        /// Operations per cell for a distribution function.
        const MARGINAL: f64 = 60.0;
        let marginal = self.marginal.as_ref().map_or(0.0, |_| MARGINAL * self.tile.geometry.len() as f64);
        let Cost { memory_bytes, operations } = self.tile.repeated_cost(self.kernel.cost());
        Cost { memory_bytes, operations: operations + marginal }
    }

    fn notes(&self) -> Vec<String> {
        let marginal = self.marginal.as_ref().map(|m| {
            let (given_m2, fitted_m2) = (m.variance_m2, self.wanted.at_distance(0.0));
            format!(
                "the height distribution changes the covariance; its variance is {given_m2:.3e} m2, the fit's {fitted_m2:.3e} m2"
            )
        });
        self.notes.iter().cloned().chain(marginal).chain(self.error_note()).collect()
    }

    fn covariance(&self) -> Vec<LagCovariance> {
        let achieved = self.kernel.achieved();
        let variance_m2 = achieved([0.0; 2]);
        let transformed = |c: f64| self.marginal.as_ref().map_or(c, |m| m.covariance_m2(c / variance_m2));
        let model = self.kernel.aims_at_a_model();
        let wanted = |lag_m: [f64; 2]| if model { self.wanted.at(lag_m) } else { achieved(lag_m) };
        self.lags()
            .map(|lag_m| LagCovariance { lag_m, wanted_m2: wanted(lag_m), achieved_m2: transformed(achieved(lag_m)) })
            .collect()
    }

    fn ratio(&self) -> f64 {
        self.wanted.ratio
    }

    fn is_periodic(&self) -> bool {
        self.tile.periodic
    }

    fn generate(&self, streams: &Streams) -> Result<TextureOutcome, SynthesisError> {
        let Made { heights_m, covariance_error_max_m2, clip_share } = self.kernel.make(streams)?;
        let over_lags = || self.covariance().iter().map(LagCovariance::error_m2).fold(0.0, f64::max);
        let covariance_error_max_m2 = match &self.marginal {
            None => covariance_error_max_m2.unwrap_or_else(over_lags),
            Some(_) => over_lags(),
        };
        Ok(TextureOutcome { grid: self.shaped(heights_m), covariance_error_max_m2, clip_share, notes: Vec::new() })
    }
}
