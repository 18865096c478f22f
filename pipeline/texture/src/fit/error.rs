//! What a fit refuses.

use sastrugi_schemas::ParameterError;

/// A DEM or parameters that cannot be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// A parameter is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// A part of the raster could not be read.
    #[error("{0}")]
    Unreadable(String),
    /// Fewer than two windows fit side by side.
    #[error("the DEM is {width_m} m x {height_m} m; a background needs at least two windows, {needed_m} m, each way")]
    DemTooSmall {
        /// East-west extent, m.
        width_m: f64,
        /// North-south extent, m.
        height_m: f64,
        /// Two windows, m.
        needed_m: f64,
    },
    /// The window is a large part of the DEM.
    #[error("the outer scale of {outer_scale_m} m is more than a third of the DEM; at most {largest_m} m fits")]
    OuterScaleTooLarge {
        /// Outer scale, m.
        outer_scale_m: f64,
        /// Largest that fits, m.
        largest_m: f64,
    },
    /// The window is hardly a window.
    #[error(
        "the outer scale of {outer_scale_m} m is less than three cells of {cell_m} m; at least {smallest_m} m is needed"
    )]
    OuterScaleTooSmall {
        /// Outer scale, m.
        outer_scale_m: f64,
        /// Larger cell size, m.
        cell_m: f64,
        /// Smallest possible, m.
        smallest_m: f64,
    },
    /// Nothing was measured.
    #[error("none of the DEM's {cells} cells has data")]
    NoData {
        /// Number of cells.
        cells: usize,
    },
    /// No variation to describe.
    #[error("the DEM is flat or a plane: no residual above rounding error")]
    Constant {
        /// A height of the DEM, m.
        height_m: f64,
    },
    /// Data is too scattered for the window.
    #[error(
        "no cell has data in more than {needed_share} of its window (the best has {best_share:.3}); lower min_valid_share"
    )]
    NoWindow {
        /// Share that was asked for.
        needed_share: f64,
        /// Largest share found.
        best_share: f64,
    },
    /// No correlation between neighbours.
    #[error(
        "the residual is white: the range of {range_m:.4} m is not above one cell of {cell_m} m, so there is no covariance to fit"
    )]
    White {
        /// Fitted range, m.
        range_m: f64,
        /// Larger cell size, m.
        cell_m: f64,
    },
    /// The model's covariance cannot be computed where the search ended.
    #[error("no {model} model could be fitted: heights, noise or ranges are too large or too small to compute with")]
    NoFit {
        /// Covariance model.
        model: String,
    },
    /// Too few distances.
    #[error("pairs of cells were found at {found} distances only; a fit needs at least {needed}")]
    TooFewLags {
        /// Bins with pairs.
        found: usize,
        /// Bins needed.
        needed: usize,
    },
}
