//! What a fit knows of a DEM: which cells count, where residuals are cut off, and the covariance of what is left.
//!
//! Rows are read in strips, three times: to find outliers (each strip judged by its own robust scale, with two windows
//! around it), to find the threshold, and to add up pairs of residuals. So memory is bounded by the strip and two bits per
//! cell: half a million cells, or eight windows (four of them around it) or four of the largest lags times the width where
//! that is more, at about 100 bytes each. It grows with the raster's width, not with its length. Background and residual of
//! any part are made again when they are asked for.

use super::heights::Heights;
use super::{FitError, FitSettings, Mode};
use crate::bitmap::Bitmap;
use crate::covariance::partial::DetrendedCells;
use crate::covariance::{MaskedCovariance, PairSums};
use crate::detrend::{BoxWindow, box_mean};
use crate::outliers;
use crate::sizes::Sizes;
use sastrugi_numeric::{Geometry, sums};
use sastrugi_statistics::normal;
use std::ops::Range;

/// Cells of a strip.
const STRIP_CELLS: usize = 1 << 19;

/// A DEM detrended, trimmed and correlated.
#[derive(Clone, Debug)]
pub struct Survey {
    geometry: Geometry,
    window: BoxWindow,
    /// Cells that entered the moving average.
    trusted: Bitmap,
    /// Cells with a residual, before trimming.
    used: Bitmap,
    /// Cells with data.
    pub measured: usize,
    /// Cells that entered the moving average.
    pub trusted_count: usize,
    /// Residuals before trimming.
    pub detrended: usize,
    /// How many of them have a window that is not complete.
    partial: usize,
    /// Where residuals are cut off.
    pub trim: Trim,
    /// Residuals after trimming.
    pub kept: usize,
    /// Pair sums of the trimmed residual.
    pub covariance: MaskedCovariance,
}

/// Where residuals are cut off.
#[derive(Clone, Copy, Debug)]
pub struct Trim {
    /// Middle of what is kept, m; 0 but in `paper` mode.
    centre_m: f64,
    /// Largest distance from the middle, m.
    pub threshold_m: f64,
    /// Median absolute residual before trimming, m.
    pub median_size_m: f64,
    /// Root mean square residual before trimming, m.
    pub rms_m: f64,
    /// Mean of what is kept, taken off in `paper` mode.
    offset_m: f64,
}

impl Trim {
    /// The symmetric threshold that a share of the residuals exceeds.
    pub fn of(sizes: &Sizes, settings: &FitSettings) -> Self {
        let threshold_m = sizes.exceeded_by(settings.trim());
        let (median_size_m, rms_m) = (sizes.exceeded_by(0.5), sizes.root_mean_square());
        Self { centre_m: 0.0, threshold_m, median_size_m, rms_m, offset_m: 0.0 }
    }

    /// Sets what is cut off to NaN.
    pub fn apply(&self, residual: &mut [f64]) {
        for r in residual {
            *r = if (*r - self.centre_m).abs() <= self.threshold_m { *r - self.offset_m } else { f64::NAN };
        }
    }
}

/// Background and residual of a part of a DEM.
pub struct Detrended {
    /// Moving average, m.
    pub background: Vec<f64>,
    /// Data in each cell's window.
    pub count: Vec<u32>,
    /// Height less background, m; NaN where a cell is not trusted or its window lacks data.
    pub residual: Vec<f64>,
}

impl Detrended {
    /// Of heights without outliers (NaN: no data), in rows of `cols`.
    pub fn of(heights: &[f64], cols: usize, settings: &FitSettings, window: BoxWindow) -> Self {
        let average = box_mean(heights, cols, window);
        let needed = settings.min_valid_share * window.area() as f64;
        let height_above = |k: usize| heights[k] - average.mean[k];
        let enough = |k: usize| f64::from(average.count[k]) > needed;
        let residual = (0..heights.len()).map(|k| if enough(k) { height_above(k) } else { f64::NAN }).collect();
        Self { background: average.mean, count: average.count, residual }
    }

    /// The part of rows of `cols` that starts at `row` and `col`.
    fn cropped(self, cols: usize, [row, col]: [usize; 2], [part_rows, part_cols]: [usize; 2]) -> Self {
        fn crop<T: Copy>(all: Vec<T>, cols: usize, at: [usize; 2], shape: [usize; 2]) -> Vec<T> {
            let row = |r: usize| (at[0] + r) * cols + at[1];
            (0..shape[0]).flat_map(|r| all[row(r)..row(r) + shape[1]].iter().copied()).collect()
        }
        let (at, shape) = ([row, col], [part_rows, part_cols]);
        Self {
            background: crop(self.background, cols, at, shape),
            count: crop(self.count, cols, at, shape),
            residual: crop(self.residual, cols, at, shape),
        }
    }
}

/// The readings of a DEM.
struct Reading<'a> {
    heights: &'a dyn Heights,
    settings: &'a FitSettings,
    geometry: Geometry,
    window: BoxWindow,
    /// Rows of a strip.
    step: usize,
}

impl Survey {
    /// Reads a DEM.
    pub fn new(
        heights: &dyn Heights,
        settings: &FitSettings,
        window: BoxWindow,
        max_lag: [usize; 2],
    ) -> Result<Self, FitError> {
        let geometry = heights.geometry();
        let least = 4 * window.cells()[0].max(max_lag[0]);
        // Transects do not know each other.
        let step = if heights.are_profiles() { 1 } else { (STRIP_CELLS / geometry.cols).max(least).min(geometry.rows) };
        let reading = Reading { heights, settings, geometry, window, step };
        let (trusted, measured, lowest_m) = reading.trusted()?;
        let (used, partial, trim) = reading.threshold(&trusted, lowest_m)?;
        let (covariance, kept) = reading.pairs(&trusted, &trim, max_lag)?;
        let (trusted_count, detrended) = (trusted.count(), used.count());
        Ok(Self {
            geometry,
            window,
            trusted,
            used,
            measured,
            trusted_count,
            detrended,
            partial,
            trim,
            kept,
            covariance,
        })
    }

    /// The cells as the detrender saw them.
    pub fn cells(&self) -> DetrendedCells<'_> {
        DetrendedCells {
            rows: self.geometry.rows,
            cols: self.geometry.cols,
            trusted: &self.trusted,
            used: &self.used,
            detrended: self.detrended,
            partial: self.partial,
        }
    }

    /// Background and residual of a part, before trimming.
    pub fn detrended(
        &self,
        heights: &dyn Heights,
        settings: &FitSettings,
        rows: Range<usize>,
        cols: Range<usize>,
    ) -> Result<Detrended, FitError> {
        let Self { geometry, window, .. } = *self;
        Reading { heights, settings, geometry, window, step: 1 }.detrended(&self.trusted, rows, cols)
    }

    /// Which cells of a part entered the moving average.
    pub fn trusted(&self, rows: Range<usize>, cols: Range<usize>) -> Vec<bool> {
        rows.flat_map(|r| cols.clone().map(move |c| r * self.geometry.cols + c)).map(|k| self.trusted.get(k)).collect()
    }

    /// Whether the cell with this number has a residual, before trimming.
    pub fn is_used(&self, cell: usize) -> bool {
        self.used.get(cell)
    }

    /// Number of residuals of a part, before trimming.
    pub fn used_count(&self, rows: Range<usize>, cols: Range<usize>) -> usize {
        rows.flat_map(|r| cols.clone().map(move |c| r * self.geometry.cols + c)).filter(|&k| self.used.get(k)).count()
    }
}

impl Reading<'_> {
    fn strips(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let (rows, step) = (self.geometry.rows, self.step);
        (0..rows).step_by(step).map(move |top| top..(top + step).min(rows))
    }

    /// Rows or columns with as many more on both sides as there are.
    fn widened(&self, span: &Range<usize>, by: usize, end: usize) -> Range<usize> {
        span.start.saturating_sub(by)..(span.end + by).min(end)
    }

    fn part(&self, rows: Range<usize>, cols: Range<usize>) -> Result<Vec<f64>, FitError> {
        let mut part = self.heights.part(rows, cols).map_err(FitError::Unreadable)?;
        part.iter_mut().filter(|z| !z.is_finite()).for_each(|z| *z = f64::NAN);
        Ok(part)
    }

    /// Cells that enter the moving average, the number of cells with data, and the lowest height.
    fn trusted(&self) -> Result<(Bitmap, usize, f64), FitError> {
        let Geometry { rows, cols, .. } = self.geometry;
        let mut trusted = Bitmap::with_capacity(self.geometry.len());
        let (mut measured, mut lowest_m) = (0, f64::INFINITY);
        let margin = if self.heights.are_profiles() { 0 } else { 2 * self.window.cells()[0] };
        for strip in self.strips() {
            let wide = self.widened(&strip, margin, rows);
            let heights = self.part(wide.clone(), 0..cols)?;
            let outlier = match self.settings.find_outliers() {
                true => outliers::find(&heights, cols, self.window),
                false => Vec::new(),
            };
            let own = (strip.start - wide.start) * cols..(strip.end - wide.start) * cols;
            for (k, z) in heights[own.clone()].iter().enumerate() {
                measured += usize::from(!z.is_nan());
                lowest_m = f64::min(lowest_m, *z);
                trusted.push(!z.is_nan() && !outlier.get(own.start + k).copied().unwrap_or(false));
            }
        }
        if measured == 0 {
            return Err(FitError::NoData { cells: self.geometry.len() });
        }
        Ok((trusted, measured, lowest_m))
    }

    /// Background and residual of a part, before trimming.
    fn detrended(&self, trusted: &Bitmap, rows: Range<usize>, cols: Range<usize>) -> Result<Detrended, FitError> {
        let [half_rows, half_cols] = self.window.half;
        let wide_rows = self.widened(&rows, half_rows, self.geometry.rows);
        let wide_cols = self.widened(&cols, half_cols, self.geometry.cols);
        let mut heights = self.part(wide_rows.clone(), wide_cols.clone())?;
        for (row, line) in wide_rows.clone().zip(heights.chunks_exact_mut(wide_cols.len())) {
            let first = row * self.geometry.cols + wide_cols.start;
            line.iter_mut().enumerate().filter(|(k, _)| !trusted.get(first + k)).for_each(|(_, z)| *z = f64::NAN);
        }
        let wide = Detrended::of(&heights, wide_cols.len(), self.settings, self.window);
        let at = [rows.start - wide_rows.start, cols.start - wide_cols.start];
        Ok(wide.cropped(wide_cols.len(), at, [rows.len(), cols.len()]))
    }

    /// Cells with a residual, how many of them have a window that is not complete, and where residuals are cut off.
    fn threshold(&self, trusted: &Bitmap, lowest_m: f64) -> Result<(Bitmap, usize, Trim), FitError> {
        let cols = self.geometry.cols;
        let mut used = Bitmap::with_capacity(self.geometry.len());
        let (mut sizes, mut moments) = (Sizes::new(), Moments::default());
        let (mut partial, mut best, mut largest, mut height) = (0, 0, 0.0, 0.0);
        for strip in self.strips() {
            let Detrended { background, count, residual } = self.detrended(trusted, strip, 0..cols)?;
            sizes.add(&residual);
            if self.settings.mode() == Mode::Paper {
                moments.add(&residual);
            }
            for (k, r) in residual.iter().enumerate() {
                let here = !r.is_nan();
                used.push(here);
                best = best.max(count[k]);
                if here {
                    partial += usize::from((count[k] as usize) < self.window.area());
                    largest = f64::max(largest, r.abs());
                    height = f64::max(height, background[k].abs());
                }
            }
        }
        if used.count() == 0 {
            let best_share = f64::from(best) / self.window.area() as f64;
            return Err(FitError::NoWindow { needed_share: self.settings.min_valid_share, best_share });
        }
        // Rounding of the running sums is far below 1e-11 of the heights.
        if largest <= 1e-11 * height {
            return Err(FitError::Constant { height_m: lowest_m });
        }
        let trim = Trim::of(&sizes, self.settings);
        let trim = if self.settings.mode() == Mode::Paper { self.paper_trim(trusted, trim, &moments)? } else { trim };
        Ok((used, partial, trim))
    }

    /// The normal threshold about the mean, `z(1 - level / 2)` standard deviations, and the mean of what it keeps.
    fn paper_trim(&self, trusted: &Bitmap, trim: Trim, all: &Moments) -> Result<Trim, FitError> {
        let threshold_m = normal::quantile(1.0 - 0.5 * self.settings.trim()) * all.variance().sqrt();
        let trim = Trim { centre_m: all.mean(), threshold_m, ..trim };
        let mut kept = Moments::default();
        for strip in self.strips() {
            let mut residual = self.detrended(trusted, strip, 0..self.geometry.cols)?.residual;
            trim.apply(&mut residual);
            kept.add(&residual);
        }
        Ok(Trim { offset_m: kept.mean(), ..trim })
    }

    /// Pair sums of the trimmed residual, and the number of cells in it.
    fn pairs(&self, trusted: &Bitmap, trim: &Trim, max_lag: [usize; 2]) -> Result<(MaskedCovariance, usize), FitError> {
        let Geometry { rows, cols, .. } = self.geometry;
        let max_lag = [max_lag[0].min(rows - 1), max_lag[1].min(cols - 1)];
        let mut sums = PairSums::new(self.step, cols, max_lag);
        let mut kept = 0;
        for strip in self.strips() {
            let below = strip.start..(strip.end + max_lag[0]).min(rows);
            let mut residual = self.detrended(trusted, below, 0..cols)?.residual;
            trim.apply(&mut residual);
            kept += residual[..strip.len() * cols].iter().filter(|r| !r.is_nan()).count();
            sums.add(&residual);
        }
        Ok((sums.finish(), kept))
    }
}

/// Count, sum and sum of squares of values that come in parts.
#[derive(Default)]
struct Moments {
    count: f64,
    sums: [f64; 2],
}

impl Moments {
    fn add(&mut self, values: &[f64]) {
        let data = sums::finite(values);
        self.count += data.len() as f64;
        self.sums[0] += sums::sum(&data);
        self.sums[1] += sums::sum(&data.iter().map(|v| v * v).collect::<Vec<_>>());
    }

    fn mean(&self) -> f64 {
        self.sums[0] / self.count.max(1.0)
    }

    /// Residuals have a mean far below their standard deviation: nothing is lost by the difference.
    fn variance(&self) -> f64 {
        (self.sums[1] - self.sums[0] * self.mean()) / (self.count - 1.0).max(1.0)
    }
}
