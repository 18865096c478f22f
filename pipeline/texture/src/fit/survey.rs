//! Passes over a DEM: which cells are used, where residuals are trimmed, and the covariance of the rest.
//!
//! Rows are read in strips, three times: to find objects (with each strip's own robust scale, including two windows
//! around it), to find the threshold, and to accumulate pairs of residuals. Memory is thus bounded by one strip plus two bits per
//! cell. A strip has two million cells, or eight windows (four of them around it) or four of the largest lags times the width
//! if that is more, at about 40 bytes each: memory grows with the raster's width, not with its length. The buffers of a strip
//! are reused for the next. Residuals are not stored but recomputed on demand.

use super::block_places::block_places;
use super::heights::Heights;
use super::residual::{Part, WindowTally};
use super::{FitError, FitSettings, Mode};
use crate::bitmap::Bitmap;
use crate::covariance::masked::even_step;
use crate::covariance::partial::DetrendedCells;
use crate::covariance::{MaskedCovariance, PairSums};
use crate::objects;
use crate::sizes::Sizes;
use sastrugi_numeric::{Geometry, sums};
use sastrugi_roughness::background::{BoxWindow, background};
use sastrugi_statistics::normal;
use std::iter::repeat;
use std::ops::Range;

/// Cells of a strip.
pub const STRIP_CELLS: usize = 1 << 21;

/// A DEM after detrending, trimming and correlation.
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
    /// Residuals whose window is incomplete.
    partial: usize,
    /// Trimming threshold.
    pub trim: Trim,
    /// Residuals after trimming.
    pub kept: usize,
    /// Pair sums of the trimmed residual.
    pub covariance: MaskedCovariance,
    /// Sums of squares of the trimmed residual in each of [`block_places`].
    pub blocks: Vec<Squares>,
}

/// Squares of residuals.
#[derive(Clone, Copy, Debug, Default)]
pub struct Squares {
    /// Number of residuals.
    pub count: u64,
    /// Sum of their squares, m2.
    pub sum_m2: f64,
}

impl Squares {
    /// Adds the residuals of a part of a row, skipping NaN.
    fn add(&mut self, residual: &[f64]) {
        let (mut count, mut sums) = (0, [0.0; 4]);
        for four in residual.chunks(4) {
            for (sum, r) in sums.iter_mut().zip(four) {
                let here = !r.is_nan();
                count += u64::from(here);
                *sum += if here { r * r } else { 0.0 };
            }
        }
        self.count += count;
        self.sum_m2 += (sums[0] + sums[1]) + (sums[2] + sums[3]);
    }
}

/// Trimming threshold and statistics of the residuals before trimming.
#[derive(Clone, Copy, Debug)]
pub struct Trim {
    /// Centre of the interval kept, m; 0 except in `paper` mode.
    centre_m: f64,
    /// Largest distance from the centre, m.
    pub threshold_m: f64,
    /// Median absolute residual before trimming, m.
    pub median_size_m: f64,
    /// Root mean square residual before trimming, m.
    pub rms_m: f64,
    /// Mean of the residuals kept, subtracted in `paper` mode.
    offset_m: f64,
}

impl Trim {
    /// The symmetric threshold that a share of the residuals exceeds.
    pub fn of(sizes: &Sizes, settings: &FitSettings) -> Self {
        let threshold_m = sizes.exceeded_by(settings.trim());
        let (median_size_m, rms_m) = (sizes.exceeded_by(0.5), sizes.root_mean_square());
        Self { centre_m: 0.0, threshold_m, median_size_m, rms_m, offset_m: 0.0 }
    }

    /// Sets trimmed residuals to NaN.
    pub fn apply(&self, residual: &mut [f64]) {
        for r in residual {
            *r = if (*r - self.centre_m).abs() <= self.threshold_m { *r - self.offset_m } else { f64::NAN };
        }
    }
}

/// Reads a DEM in strips.
struct Reading<'a> {
    heights: &'a dyn Heights,
    settings: &'a FitSettings,
    geometry: Geometry,
    window: BoxWindow,
    /// Rows of a strip.
    step: usize,
}

/// Buffers for one part of the DEM, reused for the next.
#[derive(Default)]
struct Strip {
    /// Heights of the part and of the windows around its cells, m; NaN where not trusted.
    heights: Vec<f64>,
    /// Residuals of the part, m.
    residual: Vec<f64>,
}

impl Survey {
    /// Surveys a DEM: objects, threshold and covariance.
    pub fn new(
        heights: &dyn Heights,
        settings: &FitSettings,
        window: BoxWindow,
        max_lag: [usize; 2],
    ) -> Result<Self, FitError> {
        let geometry = heights.geometry();
        let most = (STRIP_CELLS / geometry.cols).max(4 * window.cells()[0].max(max_lag[0]));
        // Transects are independent of each other.
        let step = if heights.are_profiles() { 1 } else { even_step(geometry.rows, most, max_lag[0]) };
        let reading = Reading { heights, settings, geometry, window, step };
        let (trusted, measured, lowest_m) = reading.trusted()?;
        let (used, partial, trim) = reading.threshold(&trusted, measured, lowest_m)?;
        let places = block_places(&geometry, window, heights.are_profiles());
        let mut blocks = vec![Squares::default(); places.len()];
        let (covariance, kept) = reading.pairs(&trusted, &trim, max_lag, |row, residual| {
            for ([_, cols], block) in places.iter().zip(&mut blocks).filter(|([rows, _], _)| rows.contains(&row)) {
                block.add(&residual[cols.clone()]);
            }
        })?;
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
            blocks,
        })
    }

    /// The cells as the detrending filter used them.
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

    /// Residuals of a part, before trimming, m; NaN where a cell is not trusted or its window lacks data.
    pub fn residual(
        &self,
        heights: &dyn Heights,
        settings: &FitSettings,
        rows: Range<usize>,
        cols: Range<usize>,
    ) -> Result<Vec<f64>, FitError> {
        let mut part = Strip::default();
        self.reading(heights, settings).residual(&self.trusted, rows, cols, &mut part)?;
        Ok(part.residual)
    }

    /// The background of the complete DEM, m; NaN where the window has no data.
    pub fn background(&self, heights: &dyn Heights, settings: &FitSettings) -> Result<Vec<f64>, FitError> {
        let Geometry { rows, cols, .. } = self.geometry;
        let mut trusted = Vec::new();
        self.reading(heights, settings).read_trusted(&self.trusted, 0..rows, 0..cols, &mut trusted)?;
        Ok(background(&trusted, cols, self.window, settings.at_partial()).height_m)
    }

    fn reading<'a>(&self, heights: &'a dyn Heights, settings: &'a FitSettings) -> Reading<'a> {
        Reading { heights, settings, geometry: self.geometry, window: self.window, step: 1 }
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

    /// Rows or columns extended by `by` on both sides, within 0 to `end`.
    fn widened(&self, span: &Range<usize>, by: usize, end: usize) -> Range<usize> {
        span.start.saturating_sub(by)..(span.end + by).min(end)
    }

    /// Reads the heights of a part into `part`, NaN where there is no data.
    fn read(&self, rows: Range<usize>, cols: Range<usize>, part: &mut Vec<f64>) -> Result<(), FitError> {
        self.heights.read(rows, cols, part).map_err(FitError::Unreadable)?;
        part.iter_mut().for_each(|z| *z = if z.is_finite() { *z } else { f64::NAN });
        Ok(())
    }

    /// Cells that enter the moving average, the number of cells with data, and the lowest height.
    fn trusted(&self) -> Result<(Bitmap, usize, f64), FitError> {
        let Geometry { rows, cols, .. } = self.geometry;
        let mut trusted = Bitmap::with_capacity(self.geometry.len());
        let (mut measured, mut lowest_m) = (0, f64::INFINITY);
        let margin = if self.heights.are_profiles() { 0 } else { 2 * self.window.cells()[0] };
        let mut heights = Vec::new();
        for strip in self.strips() {
            let wide = self.widened(&strip, margin, rows);
            self.read(wide.clone(), 0..cols, &mut heights)?;
            let object = match self.settings.find_objects() {
                true => objects::find(&heights, cols, self.window),
                false => Vec::new(),
            };
            let own = (strip.start - wide.start) * cols..(strip.end - wide.start) * cols;
            let found = object.get(own.clone()).unwrap_or_default().iter().copied().chain(repeat(false));
            trusted.extend(heights[own.clone()].iter().zip(found).map(|(z, object)| !(z.is_nan() || object)));
            for z in &heights[own] {
                measured += usize::from(!z.is_nan());
                lowest_m = f64::min(lowest_m, *z);
            }
        }
        if measured == 0 {
            return Err(FitError::NoData { cells: self.geometry.len() });
        }
        Ok((trusted, measured, lowest_m))
    }

    /// Reads the heights of a part into `heights`, NaN where they are not trusted.
    fn read_trusted(
        &self,
        trusted: &Bitmap,
        rows: Range<usize>,
        cols: Range<usize>,
        heights: &mut Vec<f64>,
    ) -> Result<(), FitError> {
        self.read(rows.clone(), cols.clone(), heights)?;
        for (row, line) in rows.zip(heights.chunks_exact_mut(cols.len())) {
            let first = row * self.geometry.cols + cols.start;
            trusted.unset(first..first + line.len()).for_each(|k| line[k - first] = f64::NAN);
        }
        Ok(())
    }

    /// Computes the residuals of a part, before trimming.
    fn residual(
        &self,
        trusted: &Bitmap,
        rows: Range<usize>,
        cols: Range<usize>,
        Strip { heights, residual }: &mut Strip,
    ) -> Result<WindowTally, FitError> {
        let [half_rows, half_cols] = self.window.half;
        let wide_rows = self.widened(&rows, half_rows, self.geometry.rows);
        let wide_cols = self.widened(&cols, half_cols, self.geometry.cols);
        let at = [rows.start - wide_rows.start, cols.start - wide_cols.start];
        let width = wide_cols.len();
        self.read_trusted(trusted, wide_rows, wide_cols, heights)?;
        let part = Part { heights, cols: width, at, shape: [rows.len(), cols.len()] };
        Ok(part.residual(self.settings, self.window, residual))
    }

    /// Cells with a residual, how many of them have an incomplete window, and the trimming threshold.
    fn threshold(&self, trusted: &Bitmap, measured: usize, lowest_m: f64) -> Result<(Bitmap, usize, Trim), FitError> {
        let cols = self.geometry.cols;
        let mut used = Bitmap::with_capacity(self.geometry.len());
        let (mut sizes, mut moments) = (Sizes::new(), Moments::default());
        let (mut windows, mut at_work) = (WindowTally::default(), Strip::default());
        for strip in self.strips() {
            windows = windows.with(self.residual(trusted, strip, 0..cols, &mut at_work)?);
            let residual = &at_work.residual;
            sizes.add(residual);
            if self.settings.mode() == Mode::Paper {
                moments.add(residual);
            }
            used.extend(residual.iter().map(|r| !r.is_nan()));
        }
        if used.count() == 0 {
            let best_share = f64::from(windows.most) / self.window.area() as f64;
            return Err(FitError::NoWindow { needed_share: self.settings.min_valid_share, best_share });
        }
        // Rounding errors of the running sums are far below 1e-11 of the heights.
        if windows.largest_m <= 1e-11 * windows.highest_m {
            return Err(FitError::Constant { height_m: lowest_m, objects: measured - trusted.count() });
        }
        let trim = Trim::of(&sizes, self.settings);
        let trim = if self.settings.mode() == Mode::Paper { self.paper_trim(trusted, trim, &moments)? } else { trim };
        Ok((used, windows.partial, trim))
    }

    /// The normal threshold around the mean, `z(1 - level / 2)` standard deviations, and the mean of the residuals that it keeps.
    fn paper_trim(&self, trusted: &Bitmap, trim: Trim, all: &Moments) -> Result<Trim, FitError> {
        let threshold_m = normal::quantile(1.0 - 0.5 * self.settings.trim()) * all.variance().sqrt();
        let trim = Trim { centre_m: all.mean(), threshold_m, ..trim };
        let (mut kept, mut at_work) = (Moments::default(), Strip::default());
        for strip in self.strips() {
            self.residual(trusted, strip, 0..self.geometry.cols, &mut at_work)?;
            trim.apply(&mut at_work.residual);
            kept.add(&at_work.residual);
        }
        Ok(Trim { offset_m: kept.mean(), ..trim })
    }

    /// Pair sums of the trimmed residual and its number of cells; calls `see` once with each of its rows.
    fn pairs(
        &self,
        trusted: &Bitmap,
        trim: &Trim,
        max_lag: [usize; 2],
        mut see: impl FnMut(usize, &[f64]),
    ) -> Result<(MaskedCovariance, usize), FitError> {
        let Geometry { rows, cols, .. } = self.geometry;
        let max_lag = [max_lag[0].min(rows - 1), max_lag[1].min(cols - 1)];
        let mut sums = PairSums::new(self.step, cols, max_lag);
        let (mut kept, mut at_work) = (0, Strip::default());
        for strip in self.strips() {
            let below = strip.start..(strip.end + max_lag[0]).min(rows);
            self.residual(trusted, below, 0..cols, &mut at_work)?;
            let residual = &mut at_work.residual;
            trim.apply(residual);
            kept += residual[..strip.len() * cols].iter().filter(|r| !r.is_nan()).count();
            strip.zip(residual.chunks_exact(cols)).for_each(|(row, line)| see(row, line));
            sums.add(residual);
        }
        Ok((sums.finish(), kept))
    }
}

/// Count, sum and sum of squares, accumulated part by part.
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

    /// Variance. The mean of residuals is far below their standard deviation, so the subtraction loses no accuracy.
    fn variance(&self) -> f64 {
        (self.sums[1] - self.sums[0] * self.mean()) / (self.count - 1.0).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand; NaN does not count, and parts add up.
    #[test]
    fn val_sums_of_parts() {
        let mut squares = Squares::default();
        squares.add(&[1.0, f64::NAN, -2.0, 3.0, 0.5]);
        squares.add(&[f64::NAN, 2.0]);
        assert_eq!((squares.count, squares.sum_m2), (5, 18.25));
        let mut moments = Moments::default();
        moments.add(&[1.0, f64::NAN, 2.0]);
        moments.add(&[4.0]);
        // Squares of deviations from 7/3 add up to 14/3; divided by n - 1.
        assert!((moments.mean() - 7.0 / 3.0).abs() < 1e-15 && (moments.variance() - 7.0 / 3.0).abs() < 1e-14);
        assert_eq!((Moments::default().mean(), Moments::default().variance()), (0.0, 0.0));
    }

    /// Cells up to the threshold are kept, with it; a centre and an offset shift what is kept and its values.
    #[test]
    fn val_trimming_by_hand() {
        let mut trim = Trim { centre_m: 0.0, threshold_m: 2.0, median_size_m: 1.0, rms_m: 1.0, offset_m: 0.0 };
        let residual = [-2.0, 2.0, 2.5, -2.5, f64::NAN, 0.0];
        let kept = |trim: &Trim| {
            let mut all = residual;
            trim.apply(&mut all);
            all.map(|r| if r.is_nan() { None } else { Some(r) })
        };
        assert_eq!(kept(&trim), [Some(-2.0), Some(2.0), None, None, None, Some(0.0)]);
        (trim.centre_m, trim.offset_m) = (0.5, 0.25);
        assert_eq!(kept(&trim), [None, Some(1.75), Some(2.25), None, None, Some(-0.25)]);
    }
}
