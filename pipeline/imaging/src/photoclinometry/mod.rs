//! Heights, albedo and their uncertainty from three or more registered images (stereo-photoclinometry).
//!
//! A round takes, for every cell of the map,
//! 1. its brightness in every image, at the heights known so far ([`Observed`]);
//! 2. slopes and albedo by least squares, shadowed pixels left out ([`cell`]);
//! 3. heights of all cells from the slopes, with stereo points, given points and a coarse DEM as soft constraints ([`integration`]); or along
//!    paths, as published ([`paths`]).
//!
//! Rounds go on until the heights rest. Exposures and hazes may be found on the way ([`calibration`]), stereo points by correlation of predicted and
//! observed windows ([`stereo`]). The uncertainty of slopes and albedo is that of the least squares, that of heights comes from solutions for
//! perturbed slopes ([`uncertainty`]). [`evaluation`] compares recovered and true surfaces.
//!
//! # What it stands on
//! * Fewer than three images, or lights in one plane with the ground, are refused; cells that fewer than three images show lit have a prior and are
//!   marked (raster of lit images). With more than half of the cells marked nothing is recovered, unless `leaning_max` or a known albedo says so.
//! * A tilt and the exposures trade off, as do relief and haze: free exposures keep the mean plane of the start, or take that of constraints on heights,
//!   three points or more. With exposures held, points move only the ground around them.
//! * Brightness is that of single scattering on facets: no light from neighbours, no opposition surge.
//!
//! Cost: per round and cell, about 4 steps of least squares over the images and 20 iterations of conjugate gradients. Memory: about
//! 350 bytes per cell and 20 per cell and image, beside the images.
//!
//! # Source
//! The paper in `docs/papers/jpl.md`, section 2.3. R. W. Gaskell et al., Characterizing and navigating small bodies with imaging data, 2008,
//! doi:10.1111/j.1945-5100.2008.tb00692.x, tells more of the method.

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
