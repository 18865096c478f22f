//! Surface roughness: gradients and roughness classes, height and slope statistics, band RMS, spectra, structure
//! function, areal parameters of ISO 25178, scaling exponents, ride-relevant roughness (RMS in a band of wavelengths, ISO
//! 8608, IRI), and aerodynamic roughness length by wind direction.
//!
//! Every function takes a DEM in metres, with NaN for no data, and documents how it treats such cells. Roughness classes
//! are the codes [`LOW`], [`SEMI`], [`HIGH`] and [`NO_CLASS`].
//!
//! Where to start, each time from a DEM:
//!
//! * Classes: [`moore_gradient`], then [`classify`] by [`ClassThresholds`], then [`close_disk`] and [`shares`].
//! * Scale by scale: [`band_rms`], [`power_spectrum`] and [`psd_slope`]; after [`level`], [`LagSums`] and [`structure_function`], and
//!   [`hurst()`].
//! * All areal parameters: [`areal_parameters`]; a row of the tables, with classes and spectrum: [`describe`].
//! * For vehicles: [`Ride`] (a [`WaveBand`], a [`Detrender`], ISO 8608, [`iri()`]).
//! * For textures against their sites: [`surface_statistics`] and [`copies()`].
//! * For wind: [`aerodynamic_roughness`].
//!
//! # Example
//!
//! Ground that is level in the west and a slope of 45 degrees in the east:
//!
//! ```
//! use sastrugi_numeric::{Geometry, Grid};
//! use sastrugi_roughness::{ClassThresholds, Shares, classify, close_disk, height_statistics, moore_gradient, shares};
//!
//! // 8 x 8 m in cells of half a metre; the slope begins at 4 m.
//! let geometry = Geometry::square(16, 16, 0.5);
//! let dem = Grid::new(geometry, (0..256).map(|k| (geometry.x(k % 16) - 4.0).max(0.0)).collect());
//! assert_eq!(height_statistics(&dem).relief_m, 3.75);
//!
//! // The gradient is 0 on 7 columns, 0.5 on the one west of the edge, and 1 on 8.
//! let classes = classify(&moore_gradient(&dem), &ClassThresholds::default());
//! let whole = Shares { low: 7.0 / 16.0, semi: 1.0 / 16.0, high: 8.0 / 16.0 };
//! assert_eq!(shares(&classes, 0.0), whole);
//!
//! // A closing fills gaps; there are none.
//! assert_eq!(close_disk(&classes, 0.5), classes);
//! ```

mod aerodynamic;
mod agreement;
mod areal;
pub mod background;
mod band;
mod classes;
mod closing;
mod copies;
mod detrend;
mod gradient;
mod heights;
mod hurst;
mod iri;
mod lags;
mod minkowski;
pub mod multifractality;
mod plane;
mod power_law;
mod profiles;
mod ride;
mod spectrum;
mod structure;
mod summary;
pub mod trace_moments;

pub use aerodynamic::{
    AerodynamicRoughness, ObstacleHeight, WindDirection, WindError, WindEstimate, WindMeasures, WindSettings,
    aerodynamic_roughness, lettau_z0_m, macdonald_displacement, macdonald_z0_m, munro_z0_m,
};
pub use agreement::{Scale, Statistic, surface_statistics, unfitted_statistics};
pub use areal::{ArealParameters, areal_parameters};
pub use background::odd_cells;
pub use band::band_rms;
pub use classes::{ClassThresholds, HIGH, LOW, NO_CLASS, SEMI, Shares, ThresholdError, classify, shares};
pub use closing::close_disk;
pub use copies::{COPY_SIDE, COPY_TOLERANCE, Copies, copies, repeats};
pub use detrend::{BandError, Detrended, Detrender, WaveBand};
pub use gradient::{moore_gradient, rms_slope, rms_slopes};
pub use heights::{HeightStatistics, HistogramBin, height_statistics, histogram};
pub use hurst::{Hurst, hurst};
pub use iri::{Iri, iri, iri_of_profile};
pub use lags::{LagSums, PairSum};
pub use minkowski::{Minkowski, minkowski};
pub use plane::level;
pub use power_law::{PowerLaw, iso_8608_class};
pub use profiles::{ProfileBin, profile_spectra};
pub use ride::Ride;
pub use spectrum::{SpectralMap, SpectrumBin, default_slope_band, power_spectrum, psd_slope};
pub use structure::{Autocorrelation, Direction, StructureBin, autocorrelation, lags_of, structure_function};
pub use summary::{DescribeSettings, Summary, describe, describe_classified};
