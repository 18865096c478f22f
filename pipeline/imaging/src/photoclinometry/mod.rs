//! Heights, albedo and their uncertainty from three or more registered images (stereo-photoclinometry).
//!
//! A round computes, for every cell of the map,
//! 1. its brightness in every image, at the current heights ([`Observed`]);
//! 2. slopes and albedo by least squares, without shadowed pixels ([`cell`]);
//! 3. heights of all cells from the slopes, with stereo points, given points and a coarse DEM as soft constraints ([`integration`]); or along
//!    paths, as published ([`paths`]).
//!
//! Rounds repeat until the heights converge. Exposures and hazes may be estimated between rounds ([`calibration`]), and stereo points by
//! correlating predicted and observed windows ([`stereo`]). The uncertainty of slopes and albedo comes from the least squares, that of
//! heights from solutions for perturbed slopes ([`uncertainty`]). [`evaluation`] compares recovered and true surfaces.
//!
//! # Assumptions and limits
//! * Fewer than three images, or lights in one plane with the ground, are refused. Cells lit in fewer than three images get a prior and are marked
//!   (raster of lit images). If more than half of the cells are marked, nothing is recovered, unless `leaning_max` or a known albedo allows it.
//! * Tilt trades off against exposures, and relief against haze. Free exposures keep the mean plane of the start, or take it from constraints
//!   on heights, of which three points or more are needed. With exposures held, points move only the ground around them.
//! * The brightness model is single scattering on facets: no light from neighbouring facets, no opposition surge.
//!
//! Cost: per round and cell, about 4 least-squares steps over the images and 20 conjugate-gradient iterations. Memory: about
//! 350 bytes per cell and 20 per cell and image, in addition to the images.
//!
//! # Source
//! The paper in `docs/papers/jpl.md`, section 2.3. R. W. Gaskell et al., Characterizing and navigating small bodies with imaging data, 2008,
//! doi:10.1111/j.1945-5100.2008.tb00692.x, describes the method in more detail.

pub mod calibration;
pub mod cell;
mod cosine;
pub mod described;
pub mod evaluation;
pub mod integration;
mod normal;
mod observation;
pub mod params;
pub mod paths;
mod recover;
pub mod stereo;
pub mod uncertainty;

#[cfg(test)]
mod tests;

pub use cosine::CosinePoisson;
pub use integration::{Constraint, HeightPoint};
pub use observation::{Calibration, Image, Observed, Relief};
pub use params::{Integration, Settings, Stereo};
pub use recover::{Coarse, Known, RecoverError, Recovered, Round, check_lights, recover};
