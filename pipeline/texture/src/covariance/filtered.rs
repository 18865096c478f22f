//! What the moving average leaves of a covariance.
//!
//! The residual of cell i is `z(i) - sum of D_i(j) z(j)`, with weights `D_i = m / n(i)` over the window (module
//! [`crate::detrend`]). For a stationary field with covariance C its covariance, averaged over the cells used, is
//!
//! `C_f = IDFT[ DFT(C) A ]`, `A(k) = average over i of |1 - DFT(D_i)(k)|^2`,
//!
//! where D_i is taken relative to cell i. With every window complete this is `(1 - D)^2` with the response D of the box,
//! and exact at every lag. With partial windows (border, holes) it is exact at lag zero and, beyond, leaves out that two
//! cells a lag apart differ in their windows: a part of a part, below 0.1 % of the variance in the tests. Taking the
//! average of D before the square instead would leave out the spread of the windows, up to 1 % of the variance.
//!
//! The transforms are on a torus so large that no lag wraps. Complete windows are counted and partial ones sampled:
//! [`PARTIAL_WINDOWS`] of them, spread evenly.

use super::Covariance;
use super::bins::length_m;
use crate::detrend::BoxWindow;
use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2, smooth_length};

/// Partial windows averaged over.
const PARTIAL_WINDOWS: usize = 512;
/// Torus cells transformed for partial windows in all: fewer windows are sampled when the torus is large.
const PARTIAL_CELLS: usize = 1 << 24;

/// The raster's cells as the detrender saw them.
pub struct DetrendedCells<'a> {
    /// Data that entered the moving average; NaN where there was none. Row-major.
    pub values: &'a [f64],
    /// Number of columns.
    pub cols: usize,
    /// Data in each cell's window.
    pub count: &'a [u32],
    /// Cells whose residual is used.
    pub used: &'a [bool],
}

/// A torus on which covariances are brought through the detrender.
pub struct DetrendFilter {
    shape: [usize; 2],
    cell_m: [f64; 2],
    fft: RealFft2,
    /// A(k), in the order of a half spectrum.
    response: Vec<f64>,
}

/// A covariance (or any even function of the lag) on a torus.
pub struct LagField {
    shape: [usize; 2],
    values: Vec<f64>,
}

impl LagField {
    /// Value at a lag in cells.
    pub fn at(&self, lag: [isize; 2]) -> f64 {
        let [row, col] = [0, 1].map(|k| lag[k].rem_euclid(self.shape[k] as isize) as usize);
        self.values[row * self.shape[1] + col]
    }
}

impl DetrendFilter {
    /// The response for lags up to `max_lag` cells.
    pub fn new(cells: &DetrendedCells, window: BoxWindow, cell_m: [f64; 2], max_lag: [usize; 2]) -> Self {
        let width = window.cells();
        let shape = [0, 1].map(|k| smooth_length(2 * (max_lag[k] + width[k])));
        let fft = RealFft2::new(shape[0], shape[1]);
        let response = average_response(cells, window, shape, &fft);
        Self { shape, cell_m, fft, response }
    }

    /// Covariance of the residual of a field with covariance `model`.
    pub fn residual_covariance(&self, model: &Covariance) -> LagField {
        let mut spectrum = self.fft.forward(&torus_covariance(self.shape, self.cell_m, model));
        spectrum.values.iter_mut().zip(&self.response).for_each(|(s, a)| *s = Complex64::new(s.re * a, 0.0));
        LagField { shape: self.shape, values: self.fft.inverse(spectrum) }
    }

    /// `IDFT[DFT(field)^2]`: sum over u of `field(u) field(u + h)`.
    pub fn autocorrelation(&self, field: &LagField) -> LagField {
        let mut spectrum = self.fft.forward(&field.values);
        spectrum.values.iter_mut().for_each(|s| *s = Complex64::new(s.norm_sqr(), 0.0));
        LagField { shape: self.shape, values: self.fft.inverse(spectrum) }
    }
}

impl LagField {
    /// The field with `f` applied to every value.
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        Self { shape: self.shape, values: self.values.iter().map(|v| f(*v)).collect() }
    }
}

/// A covariance on a torus of `shape` cells, each lag taken the short way round.
fn torus_covariance(shape: [usize; 2], cell_m: [f64; 2], model: &Covariance) -> Vec<f64> {
    let short = |k: usize, n: usize| k.min(n - k) as isize;
    let [rows, cols] = shape;
    let mut field = vec![0.0; rows * cols];
    for row in 0..=rows / 2 {
        let half: Vec<f64> = (0..=cols / 2).map(|c| model.at(length_m([row as isize, c as isize], cell_m))).collect();
        for mirrored in [row, (rows - row) % rows] {
            let line = &mut field[mirrored * cols..(mirrored + 1) * cols];
            line.iter_mut().enumerate().for_each(|(c, v)| *v = half[short(c, cols) as usize]);
        }
    }
    field
}

/// Field of a real, even spectrum in the order of a half spectrum.
pub(super) fn inverse_real(fft: &RealFft2, [rows, cols]: [usize; 2], spectrum: &[f64]) -> Vec<f64> {
    let values = spectrum.iter().map(|&s| Complex64::new(s, 0.0)).collect();
    fft.inverse(HalfSpectrum { rows, cols, values })
}

/// A(k): the responses of complete and partial windows, weighted by the number of cells that have them.
fn average_response(cells: &DetrendedCells, window: BoxWindow, shape: [usize; 2], fft: &RealFft2) -> Vec<f64> {
    let area = window.area() as u32;
    let used = cells.used.iter().filter(|&&u| u).count();
    let partial = |k: &usize| cells.used[*k] && cells.count[*k] < area;
    let partial_count = (0..cells.used.len()).filter(partial).count();
    let samples = PARTIAL_WINDOWS.min((PARTIAL_CELLS / (shape[0] * shape[1])).max(16)).min(partial_count);
    let ranks = spread_ranks(samples, partial_count);
    let chosen = (0..cells.used.len()).filter(partial).enumerate();
    let mut wanted = ranks.iter().peekable();
    let sampled: Vec<usize> = chosen.filter(|(rank, _)| wanted.next_if_eq(&rank).is_some()).map(|(_, k)| k).collect();

    let complete_share = (used - partial_count) as f64 / used.max(1) as f64;
    let mut response = vec![0.0; shape[0] * (shape[1] / 2 + 1)];
    add_response(&complete_window(window, shape), complete_share, fft, &mut response);
    let share = (1.0 - complete_share) / sampled.len().max(1) as f64;
    for cell in sampled {
        add_response(&partial_window(cells, cell, window, shape), share, fft, &mut response);
    }
    response
}

/// `samples` distinct ranks of `count`, ascending, spread by the golden ratio so that they do not beat with the rows.
fn spread_ranks(samples: usize, count: usize) -> Vec<usize> {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let fraction = |s: usize| (s as f64 * GOLDEN) % 1.0;
    let mut ranks: Vec<usize> = (0..samples).map(|s| (fraction(s) * count as f64) as usize).collect();
    ranks.sort_unstable();
    ranks.dedup();
    ranks
}

/// Adds `share` times the power response of the kernel `1 - D` on the torus.
fn add_response(kernel: &[f64], share: f64, fft: &RealFft2, response: &mut [f64]) {
    let spectrum = fft.forward(kernel);
    response.iter_mut().zip(&spectrum.values).for_each(|(a, s)| *a += share * s.norm_sqr());
}

/// `1 - D` of a complete window.
fn complete_window(window: BoxWindow, shape: [usize; 2]) -> Vec<f64> {
    window_kernel(window, shape, window.area() as u32, |_| true)
}

/// `1 - D` of the window of `cell`.
fn partial_window(cells: &DetrendedCells, cell: usize, window: BoxWindow, shape: [usize; 2]) -> Vec<f64> {
    let (row, col) = ((cell / cells.cols) as isize, (cell % cells.cols) as isize);
    let rows = (cells.values.len() / cells.cols) as isize;
    window_kernel(window, shape, cells.count[cell], |[dr, dc]| {
        let (r, c) = (row + dr, col + dc);
        let inside = r >= 0 && c >= 0 && r < rows && c < cells.cols as isize;
        inside && !cells.values[r as usize * cells.cols + c as usize].is_nan()
    })
}

fn window_kernel(window: BoxWindow, shape: [usize; 2], count: u32, valid: impl Fn([isize; 2]) -> bool) -> Vec<f64> {
    let mut kernel = vec![0.0; shape[0] * shape[1]];
    let weight = -1.0 / f64::from(count.max(1));
    let [hr, hc] = window.half.map(|h| h as isize);
    for offset in (-hr..=hr).flat_map(|r| (-hc..=hc).map(move |c| [r, c])).filter(|&o| valid(o)) {
        let [row, col] = [0, 1].map(|k| offset[k].rem_euclid(shape[k] as isize) as usize);
        kernel[row * shape[1] + col] = weight;
    }
    kernel[0] += 1.0;
    kernel
}
