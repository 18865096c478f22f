//! Statistics of a measured residual, for the section `statistics` of a fit file.
//!
//! [`measure`] takes the residual (heights minus background, NaN where there is no data) and returns everything that the methods
//! [`super::modulated`] and [`super::wavelet_statistics`] need, so that the DEM itself need not be published with a fit. Each statistic is a
//! mean over cells, or pairs and groups of cells, that all have data.
//!
//! Cost: one masked covariance; for each octave of wavelets eight transforms; some 15 sorts; about ten masked covariances for the
//! modulation: a few seconds for 1024 x 1024 cells on one core. Memory: 180 bytes per cell, on any number of threads.

pub mod lags;
pub mod spectrum;
pub mod tails;

use super::{modulated, wavelet_statistics};
use sastrugi_numeric::{Grid, sums};
use sastrugi_schemas::counted;
use sastrugi_schemas::statistics::{Statistics, VERSION};

/// Fewest cells with data. The flatness of a smaller residual rests on a handful of increments.
pub const CELLS_MIN: usize = 4096;
/// Smallest largest lag, cells.
pub const LAG_MIN: usize = 4;
/// Fewest cells with data for each number that is stated: far from as many equations as unknowns.
pub const CELLS_PER_NUMBER: usize = 4;
/// Lags that are stated one by one, where all of them would be too many.
const SPARSE: [usize; 2] = [16, 8];

/// Why statistics cannot be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StatisticsError {
    /// Too little data.
    #[error("the residual has {} with data; its statistics need at least {CELLS_MIN}", counted(.cells, "cell"))]
    TooSmall {
        /// Cells with data.
        cells: usize,
    },
    /// More numbers than the residual should tell of itself.
    #[error(
        "the residual has {cells} cells with data; its statistics, {numbers} numbers, need {CELLS_PER_NUMBER} for each, {needed}: use a larger DEM",
        needed = cells_for(*.numbers)
    )]
    TooFewCells {
        /// Cells with data.
        cells: usize,
        /// Numbers that would be stated.
        numbers: usize,
    },
    /// No relief.
    #[error("the residual has the same height, {height_m} m, everywhere; there is no texture to measure")]
    Flat {
        /// That height, m.
        height_m: f64,
    },
    /// A window of few cells.
    #[error(
        "the largest lag of the covariance is {}; it must be at least {LAG_MIN}: use a wider window or smaller cells",
        counted(.lag, "cell")
    )]
    ShortLag {
        /// The smaller of the largest lags along rows and columns, cells.
        lag: usize,
    },
}

/// Measures the statistics of a residual; its covariance up to lags of `lag_max` cells, rows and columns (at most [`lags::LAG_MAX`]), which
/// should be 1.5 windows of the background.
///
/// # Errors
/// A residual with fewer than [`CELLS_MIN`] cells of data, or than [`CELLS_PER_NUMBER`] for each number stated, or without relief; a largest lag below
/// [`LAG_MIN`] cells.
pub fn measure(residual: &Grid, lag_max: [usize; 2]) -> Result<Statistics, StatisticsError> {
    let mut heights = sums::finite(&residual.values);
    if heights.len() < CELLS_MIN {
        return Err(StatisticsError::TooSmall { cells: heights.len() });
    }
    let reach = [lag_max[0].min(residual.rows() / 2), lag_max[1].min(residual.cols() / 2)];
    let lag = reach[0].min(reach[1]);
    if lag < LAG_MIN {
        return Err(StatisticsError::ShortLag { lag });
    }
    let probabilities = tails::probabilities();
    let cells = heights.len() as u64;
    let heights_m = tails::quantiles(&mut heights, &probabilities);
    let (lowest_m, highest_m) = (heights[0], heights[heights.len() - 1]);
    if lowest_m == highest_m {
        return Err(StatisticsError::Flat { height_m: lowest_m });
    }
    let mut statistics = Statistics {
        version: VERSION,
        cell_m: residual.geometry.cell,
        cells,
        heights_m,
        covariance: lags::measure(residual, reach),
        laplacian: lags::measure(&spectrum::laplacian(residual), reach.map(|lag| lag.min(spectrum::LAG_MAX))),
        wavelets: wavelet_statistics::measure(residual, &probabilities, lag),
        probabilities,
        ..Statistics::default()
    };
    sparse(&mut statistics)?;
    statistics.modulation = modulated::measure(residual, &statistics);
    Ok(statistics)
}

/// Cells that a site needs to state so many numbers.
fn cells_for(numbers: usize) -> usize {
    CELLS_PER_NUMBER * numbers
}

/// Leaves lags out until there are enough cells for each number.
fn sparse(statistics: &mut Statistics) -> Result<(), StatisticsError> {
    let cells = statistics.cells as usize;
    for dense in SPARSE {
        if cells_for(statistics.numbers()) <= cells {
            return Ok(());
        }
        statistics.covariance = lags::thinned(&statistics.covariance, dense);
        statistics.wavelets.patches = statistics.wavelets.patches.take().map(|patches| lags::thinned(&patches, dense));
    }
    match statistics.numbers() {
        numbers if cells_for(numbers) > cells => Err(StatisticsError::TooFewCells { cells, numbers }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
