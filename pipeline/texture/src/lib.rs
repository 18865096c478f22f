//! Texture of a measured surface, and synthetic texture that matches it.
//!
//! A DEM is split at an outer scale into a background (moving average) and a residual; the residual's covariance is
//! estimated from every pair of cells with data and a covariance model is fitted to it ([`mod@fit`]); random fields with
//! that covariance are made ([`synth`]) and laid onto base terrains ([`onto()`]).
//!
//! Source: Vecherin, Meyer, Quinn, Letcher and Parker, Simulation of snow texture for autonomous vehicle numerical
//! modeling, GVSETS 2022; see `docs/papers/vecherin.md` for where we depart from it and why.
//!
//! Symbols used throughout: lag h = (rows south, columns east) in cells and rho = |h| in m; sigma and b, standard
//! deviation and range of the texture in m; covariance in m2, not semivariance; M, cells along a side of the torus on
//! which covariances are filtered or fields are made.

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

pub use fit::{FitError, FitOutcome, FitParameters, FitSettings, Heights, LocalMaps, Profiles, fit};
pub use onto::{OntoError, SlopeFactors, amplitude, check_cells, modulated_onto, onto};
pub use registry::{kinds, method, prepare};
pub use synth::{Cost, Method, Prospect, Synthesis, SynthesisError, TextureOutcome, fit_notes};
