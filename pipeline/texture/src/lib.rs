//! Texture of a measured surface, and synthetic texture that matches it.
//!
//! A DEM is split at an outer scale into a background (moving average) and a residual. The residual's covariance is
//! estimated from every pair of cells with data and a covariance model is fitted to it ([`mod@fit`]). Random fields with
//! that covariance are synthesised ([`synth`]) and added to base terrains ([`onto()`]).
//!
//! # Flow
//! 1. [`coregister::coregister`] subtracts one DEM from another where the texture is that of a difference (snow depth);
//!    [`noise::of_reference`] estimates the noise from a smooth part; [`synth::conditional::fill`] fills holes.
//! 2. [`fit()`] turns a DEM ([`Heights`]) into a fit file: model, parameters, intervals, verdict and warnings.
//! 3. [`prepare`], or [`prepare_from`] with the [`residual()`] of the site, binds a method and its parameters to a fit, real or stated; [`Synthesis::generate`] makes a texture.
//! 4. [`onto()`], or [`modulated_onto`] with a factor for each cell, adds the texture to a base.
//! 5. [`mod@compare`] tests whether two DEMs, two fits or two halves of a site have the same texture.
//!
//! ```
//! use sastrugi_numeric::{Geometry, Grid, Streams};
//! use sastrugi_schemas::fit::FitFile;
//! use sastrugi_texture::{FitParameters, FitSettings, fit, onto, prepare};
//! use serde_json::json;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A site of 16 m x 16 m to be measured: a surface with a standard deviation of 5 cm and a range of 0.2 m.
//! let parameters = [("sigma_m", 0.05), ("range_m", 0.2)].map(|(name, value)| (name.to_owned(), value)).into();
//! let truth = FitFile { model: "exponential".to_owned(), parameters, ..FitFile::default() };
//! let size = json!({ "size_px": [160, 160], "cell_m": 0.1, "phase": "gaussian", "periodic": false });
//! let site = prepare("fft_ma", &size, &truth)?.generate(&Streams::for_seed(1, "site"))?.grid;
//!
//! // The fit finds it again, within the scatter of one site.
//! let settings: FitSettings =
//!     FitParameters { outer_scale_m: 1.0, bootstrap: 0, ..FitParameters::default() }.try_into()?;
//! let found = fit(&site, &settings, &Streams::for_seed(1, "fit"))?.fit;
//! assert_eq!(found.model, "exponential");
//! assert!((found.parameters["sigma_m"] / 0.05 - 1.0).abs() < 0.2);
//! assert!((found.parameters["range_m"] / 0.2 - 1.0).abs() < 0.5);
//!
//! // A periodic tile with this texture, repeated over a larger base from its south-western corner.
//! let tile = prepare("fft_ma", &json!({ "size_px": [80, 80], "cell_m": 0.1 }), &found)?;
//! let texture = tile.generate(&Streams::for_seed(2, "texture"))?.grid;
//! let base = Grid::filled(Geometry::square(200, 100, 0.1), 1000.0);
//! let surface = onto(&base, &texture)?;
//! assert_eq!(surface.at(199, 0), 1000.0 + texture.at(79, 0));
//! assert_eq!(surface.at(119, 80), surface.at(199, 0));
//! # Ok(())
//! # }
//! ```
//!
//! Source: Vecherin, Meyer, Quinn, Letcher and Parker, Simulation of snow texture for autonomous vehicle numerical
//! modeling, GVSETS 2022; see `docs/papers/vecherin.md` for where we depart from it and why.
//!
//! Symbols used throughout: lag h = (rows south, columns east) in cells and rho = |h| in m; sigma and b, standard
//! deviation and range of the texture in m; covariance in m2, not semivariance; M, cells along a side of the torus on
//! which covariances are filtered or fields are synthesised.

mod bitmap;
pub mod compare;
pub mod coregister;
pub mod covariance;
pub mod fit;
pub mod noise;
pub mod objects;
mod onto;
pub mod registry;
pub mod shown;
mod sizes;
pub mod synth;

#[cfg(test)]
mod gstools_tests;

pub use fit::{FitError, FitOutcome, FitParameters, FitSettings, Heights, LocalMaps, Profiles, fit, residual};
pub use onto::{OntoError, SlopeFactors, amplitude, check_cells, modulated_onto, onto};
pub use registry::{check_keys, kinds, method, needs, prepare, prepare_from};
pub use synth::measured::Measured;
pub use synth::residual::Needs;
pub use synth::{Cost, Method, Prospect, Synthesis, SynthesisError, TextureOutcome, fit_notes};
