//! Memory use of a fit.

use super::FitSettings;
use super::resampling::CELLS_MAX;
use super::survey::STRIP_CELLS;

/// Bytes per cell of a strip in progress: heights, intermediate rasters and, for narrow rasters, the transforms of their pairs.
const STRIP_CELL_BYTES: u64 = 100;
/// Bytes per cell of a replicate in progress: a surface on a torus of four times as many cells, its transforms, its residual.
const REPLICATE_CELL_BYTES: u64 = 300;
/// Bytes per cell of the part whose statistics are measured, on any number of threads: the logarithms of 20 bands in single precision, and the
/// filters and transforms of one or the covariance of their mean.
const STATISTICS_CELL_BYTES: u64 = 180;
/// Weights of partial windows, for two estimators: for each of up to 49 bins, 8 bytes per lag (one of each opposite pair) within
/// the largest lag plus two half windows (1.5 windows).
const WEIGHTS_BYTES: u64 = 2 * 49 * 8 * 9 / 2;
/// The same for the one estimator at twice the window, which has 33 bins.
const WIDE_WEIGHTS_BYTES: u64 = 4 * 33 * 8 * 9 / 2;
/// A covariance of one model on a torus six windows wide, for the weights of a search.
const MODEL_BYTES: u64 = 36 * 40;

impl FitSettings {
    /// Most bytes that a fit of `cells` cells needs on top of the heights, on `threads` threads. If the smaller side of a cell is
    /// unknown, the widest window that a fit allows is assumed. An estimate for planning.
    pub fn memory_bytes(&self, cells: u64, cell_m: Option<f64>, threads: u64) -> u64 {
        // No window is wider than a third of the raster.
        let widest = cells / 9;
        let window = cell_m.map_or(widest, |cell| square(self.outer_scale_m() / cell).min(widest));
        let width = (cells as f64).sqrt() as u64;
        // Rows of four windows, plus two windows above and below; the refits at twice the window use a part of the raster.
        let windows = 8 * width * (window as f64).sqrt() as u64;
        let strip = cells.min(STRIP_CELLS as u64 + windows).saturating_mul(STRIP_CELL_BYTES);
        let examined = cells.min(CELLS_MAX as u64 + 49 * window).saturating_mul(STRIP_CELL_BYTES);
        let replicate = cells.min(CELLS_MAX as u64 + 9 * window).saturating_mul(REPLICATE_CELL_BYTES);
        let at_work = threads.min(self.bootstrap() as u64);
        // Searches run side by side, with and without replicates. At twice the window a model is four times as large.
        let wide = if 36 * window <= cells { WIDE_WEIGHTS_BYTES + 5 * MODEL_BYTES } else { 0 };
        let models = window.saturating_mul(WEIGHTS_BYTES + (1 + threads) * MODEL_BYTES + wide);
        let statistics = if self.has_statistics() { STATISTICS_CELL_BYTES } else { 0 };
        let examined = examined.max(cells.min(CELLS_MAX as u64 + 49 * window).saturating_mul(statistics));
        (64 << 20) + cells / 4 + models + strip.max(examined).max(replicate.saturating_mul(at_work))
    }
}

fn square(side: f64) -> u64 {
    (side * side) as u64
}
