//! What a surface is like: gradients and roughness classes, heights and slopes, band roughness, spectra, structure
//! function, areal figures of ISO 25178, scaling exponents, what of it shakes a vehicle (RMS in a band of wavelengths, ISO
//! 8608, IRI), and its aerodynamic roughness length by wind direction.
//!
//! Every function takes a DEM in metres with NaN where there is no data, and says what it does with such cells.
//! Roughness classes are the codes [`LOW`], [`SEMI`], [`HIGH`] and [`NO_CLASS`].

mod aerodynamic;
mod agreement;
mod areal;
pub mod background;
mod band;
mod classes;
mod closing;
mod detrend;
mod gradient;
mod heights;
mod hurst;
mod iri;
mod lags;
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
pub use agreement::{Statistic, unfitted_statistics};
pub use areal::{ArealFigures, areal_figures};
pub use background::odd_cells;
pub use band::band_rms;
pub use classes::{ClassThresholds, HIGH, LOW, NO_CLASS, SEMI, Shares, ThresholdError, classify, shares};
pub use closing::close_disk;
pub use detrend::{BandError, Detrended, Detrender, WaveBand};
pub use gradient::{moore_gradient, rms_slope, rms_slopes};
pub use heights::{HeightStatistics, HistogramBin, height_statistics, histogram};
pub use hurst::{Hurst, hurst};
pub use iri::{Iri, iri, iri_of_profile};
pub use lags::{LagSums, PairSum};
pub use plane::level;
pub use power_law::{PowerLaw, iso_8608_class};
pub use profiles::{ProfileBin, profile_spectra};
pub use ride::Ride;
pub use spectrum::{SpectralMap, SpectrumBin, default_slope_band, power_spectrum, psd_slope};
pub use structure::{Autocorrelation, Direction, StructureBin, autocorrelation, lags_of, structure_function};
pub use summary::{DescribeSettings, Summary, describe};
