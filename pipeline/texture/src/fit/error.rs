//! Errors of a fit.

use crate::synth::statistics::StatisticsError;
use sastrugi_schemas::{ParameterError, counted};

/// Why a DEM cannot be fitted, or with which parameters.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// A parameter is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The statistics of the residual cannot be measured.
    #[error(transparent)]
    Statistics(#[from] StatisticsError),
    /// A part of the raster could not be read.
    #[error("{0}")]
    Unreadable(String),
    /// Fewer than two windows fit side by side.
    #[error(
        "the DEM is {} m x {} m, too small for an outer scale of {} m; choose at most a third of its extent",
        in_um(*width_m),
        in_um(*height_m),
        in_um(0.5 * needed_m)
    )]
    DemTooSmall {
        /// East-west extent, m.
        width_m: f64,
        /// North-south extent, m.
        height_m: f64,
        /// Two windows, m.
        needed_m: f64,
    },
    /// The window covers too large a part of the DEM.
    #[error("the outer scale of {outer_scale_m} m is more than a third of the DEM; it must be at most {largest_m} m")]
    OuterScaleTooLarge {
        /// Outer scale, m.
        outer_scale_m: f64,
        /// Largest that fits, m.
        largest_m: f64,
    },
    /// The window has too few cells.
    #[error(
        "the outer scale of {outer_scale_m} m is less than three cells of {cell_m} m; it must be at least {smallest_m} m"
    )]
    OuterScaleTooSmall {
        /// Outer scale, m.
        outer_scale_m: f64,
        /// Larger cell size, m.
        cell_m: f64,
        /// Smallest possible, m.
        smallest_m: f64,
    },
    /// No cell has data.
    #[error("none of the DEM's {cells} cells has data")]
    NoData {
        /// Number of cells.
        cells: usize,
    },
    /// No residual above rounding error.
    #[error("{}", constant(*.objects))]
    Constant {
        /// A height of the DEM, m.
        height_m: f64,
        /// Cells taken as objects and left out.
        objects: usize,
    },
    /// Data is too sparse for the window.
    #[error(
        "no cell has data in more than {needed_share} of its window (the best has {best_share:.3}); lower min_valid_share"
    )]
    NoWindow {
        /// Share required.
        needed_share: f64,
        /// Largest share found.
        best_share: f64,
    },
    /// No correlation between neighbours.
    #[error(
        "the residual is white noise: its range of {range_m:.4} m does not exceed one cell, {cell_m} m, so there is no covariance to fit"
    )]
    White {
        /// Fitted range, m.
        range_m: f64,
        /// Larger cell size, m.
        cell_m: f64,
    },
    /// The model's covariance is not finite where the search ended.
    #[error(
        "the {model} model could not be fitted: heights, noise or ranges are too large or too small to compute with"
    )]
    NoFit {
        /// Covariance model.
        model: String,
    },
    /// Too few lags.
    #[error("pairs of cells exist at only {}; a fit needs at least {needed}", counted(.found, "lag"))]
    TooFewLags {
        /// Bins with pairs.
        found: usize,
        /// Bins needed.
        needed: usize,
    },
}

/// What a DEM without residual is, apart from the cells taken as objects: the rim of a single step is one.
fn constant(objects: usize) -> String {
    const FLAT: &str = "the DEM is flat or a plane: its residual is below rounding error";
    if objects == 0 {
        return FLAT.to_owned();
    }
    format!(
        "apart from {} taken as objects, {FLAT}; to keep these cells, set find_objects = false",
        counted(objects, "cell")
    )
}

/// Length rounded to a micrometre, so that 96 cells of 0.1 m are 9.6 m.
fn in_um(length_m: f64) -> f64 {
    (1e6 * length_m).round() / 1e6
}
