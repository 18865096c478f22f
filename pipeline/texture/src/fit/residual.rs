//! Residual: height minus background.

use super::FitSettings;
use rayon::prelude::*;
use sastrugi_roughness::background::{BoxWindow, RunningBackground, band_rows};

/// A part of a raster of heights without objects.
pub struct Part<'a> {
    /// Heights of the raster, m; NaN where there is no data or the cell is not trusted.
    pub heights: &'a [f64],
    /// Length of the raster's rows.
    pub cols: usize,
    /// First row and column of the part.
    pub at: [usize; 2],
    /// Its rows and columns.
    pub shape: [usize; 2],
}

/// Extremes of residuals and their windows.
#[derive(Clone, Copy, Debug, Default)]
pub struct WindowTally {
    /// Residuals whose window is incomplete.
    pub partial: usize,
    /// Most data in any window.
    pub most: u32,
    /// Largest absolute residual, m.
    pub largest_m: f64,
    /// Largest absolute background of any cell with a residual, m.
    pub highest_m: f64,
}

impl WindowTally {
    /// Combines two parts.
    pub fn with(self, other: Self) -> Self {
        Self {
            partial: self.partial + other.partial,
            most: self.most.max(other.most),
            largest_m: self.largest_m.max(other.largest_m),
            highest_m: self.highest_m.max(other.highest_m),
        }
    }
}

/// The residuals of a raster of heights without objects (NaN: no data), in rows of `cols`, m.
pub fn residual(heights: &[f64], cols: usize, settings: &FitSettings, window: BoxWindow) -> Vec<f64> {
    let rows = heights.len().checked_div(cols).unwrap_or(0);
    let mut residual = Vec::new();
    Part { heights, cols, at: [0, 0], shape: [rows, cols] }.residual(settings, window, &mut residual);
    residual
}

impl Part<'_> {
    /// Writes the residuals of the part to `residual`, m: NaN where a cell has no data or no background, or its window lacks data.
    pub fn residual(&self, settings: &FitSettings, window: BoxWindow, residual: &mut Vec<f64>) -> WindowTally {
        let [rows, cols] = self.shape;
        residual.resize(rows * cols, 0.0);
        let band = band_rows(window);
        let bands = residual.par_chunks_mut((band * cols).max(1)).enumerate();
        let windows: Vec<WindowTally> =
            bands.map(|(k, band_of)| self.band(k * band, settings, window, band_of)).collect();
        windows.into_iter().fold(WindowTally::default(), WindowTally::with)
    }

    /// The rows of the part from `first` on.
    fn band(&self, first: usize, settings: &FitSettings, window: BoxWindow, residual: &mut [f64]) -> WindowTally {
        let needed = settings.min_valid_share * window.area() as f64;
        let ([row, col], [_, cols]) = (self.at, self.shape);
        let mut background =
            RunningBackground::from(self.heights, self.cols, window, settings.at_partial(), row + first);
        let (mut height_m, mut count) = (vec![0.0; self.cols], vec![0; self.cols]);
        let mut windows = WindowTally::default();
        for (r, line) in residual.chunks_exact_mut(cols).enumerate() {
            background.next_row(&mut height_m, &mut count);
            let heights = &self.heights[(row + first + r) * self.cols + col..];
            for (((out, &z), &m), &n) in line.iter_mut().zip(heights).zip(&height_m[col..]).zip(&count[col..]) {
                *out = if f64::from(n) > needed { z - m } else { f64::NAN };
                windows.most = windows.most.max(n);
                if !out.is_nan() {
                    windows.partial += usize::from((n as usize) < window.area());
                    windows.largest_m = windows.largest_m.max(out.abs());
                    windows.highest_m = windows.highest_m.max(m.abs());
                }
            }
        }
        windows
    }
}
