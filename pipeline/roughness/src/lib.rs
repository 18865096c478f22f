//! What a surface is like: gradients and roughness classes, heights and slopes, band roughness, spectrum, scaling
//! exponents.
//!
//! Every function takes a DEM in metres with NaN where there is no data, and says what it does with such cells.
//! Roughness classes are the codes [`LOW`], [`SEMI`], [`HIGH`] and [`NO_CLASS`].

mod agreement;
mod band;
mod classes;
mod closing;
mod gradient;
mod heights;
pub mod multifractality;
mod spectrum;
mod summary;

pub use agreement::{Statistic, unfitted_statistics};
pub use band::{band_rms, moving_average, odd_cells};
pub use classes::{ClassThresholds, HIGH, LOW, NO_CLASS, SEMI, Shares, ThresholdError, classify, shares};
pub use closing::close_disk;
pub use gradient::{moore_gradient, rms_slope};
pub use heights::{HeightStatistics, HistogramBin, height_statistics, histogram};
pub use spectrum::{SpectrumBin, power_spectrum, psd_slope};
pub use summary::{DescribeSettings, Summary, describe};
