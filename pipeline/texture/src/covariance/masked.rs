//! Exact covariance of a raster with holes: every pair of cells with data, at every lag up to a bound.
//!
//! `C(h) = S(h) / N(h)`, `S(h) = sum of z(i) z(i + h)`, `N(h)` the number of pairs, over all i where both cells have
//! data. S and N are autocorrelations of the data (0 where there is none) and of the mask, hence two Fourier transforms
//! (Marcotte, 1996, Computers & Geosciences 22, 1175). No mean is subtracted; callers who need that do it beforehand.
//!
//! The raster is cut into strips of rows, and these into tiles, which overlap by the largest lag; the overlap of two neighbours is
//! counted twice and subtracted once. Memory is thus bounded by the tile, not by the raster: about 50 bytes per padded cell of a tile,
//! 65 MB for strips of 1024 rows and lags of 32 cells. Rounding: about 1e-15 of the zero-lag sum; pair counts are exact.

use sastrugi_numeric::fft::{Complex64, RealFft2, smooth_length};
use std::ops::Range;

/// Rows per strip, without the overlap; at least four times the largest lag.
const STRIP_ROWS: usize = 1024;
/// Columns per tile, without the overlap; at least four times the largest lag.
const TILE_COLS: usize = 1024;

/// Pair sums of a raster for lags `(drow, dcol)` with `|drow| <= max_lag[0]`, `|dcol| <= max_lag[1]`.
#[derive(Clone, Debug)]
pub struct MaskedCovariance {
    /// Largest lag in cells, north-south and east-west.
    pub max_lag: [usize; 2],
    /// Sum of products for `drow` in `0..=max_lag[0]` (outer) and `dcol` in `-max_lag[1]..=max_lag[1]` (inner).
    sums: Vec<f64>,
    /// Number of pairs, in the same order.
    pairs: Vec<u64>,
}

impl MaskedCovariance {
    /// Number of pairs and sum of their products at a lag in cells; `None` beyond the largest lag.
    pub fn at(&self, drow: isize, dcol: isize) -> Option<(u64, f64)> {
        // The estimate is even in the lag, so only one of two opposite lags is stored.
        let (drow, dcol) = if (drow, dcol) < (0, 0) { (-drow, -dcol) } else { (drow, dcol) };
        let [max_row, max_col] = self.max_lag.map(|l| l as isize);
        let stored = drow <= max_row && dcol.abs() <= max_col;
        let index = (drow * (2 * max_col + 1) + dcol + max_col) as usize;
        stored.then(|| (self.pairs[index], self.sums[index]))
    }

    /// Covariance at a lag in cells: the 2-D map. `None` beyond the largest lag or without pairs.
    pub fn covariance(&self, drow: isize, dcol: isize) -> Option<f64> {
        self.at(drow, dcol).filter(|(pairs, _)| *pairs > 0).map(|(pairs, sum)| sum / pairs as f64)
    }

    /// One lag of each pair of opposite ones: `(drow, dcol)` with `drow > 0`, or `drow = 0` and `dcol >= 0`.
    pub fn lags(&self) -> impl Iterator<Item = (isize, isize)> + use<> {
        let [max_row, max_col] = self.max_lag.map(|l| l as isize);
        (0..=max_row)
            .flat_map(move |drow| (-max_col..=max_col).map(move |dcol| (drow, dcol)))
            .filter(|&(r, c)| r > 0 || c >= 0)
    }
}

/// Pair sums of row-major `values` in rows of `cols`; NaN is no data. Lags are cut to the raster's size.
///
/// ```
/// use sastrugi_texture::covariance::masked_covariance;
///
/// // Two rows of three cells, one of them without data.
/// let estimate = masked_covariance(&[1.0, 2.0, f64::NAN, 3.0, 4.0, 5.0], 3, [1, 2]);
/// // Neighbours in a row: 1 x 2, 3 x 4, 4 x 5. Neighbours in a column: 1 x 3, 2 x 4.
/// let close = |lag: Option<(u64, f64)>, pairs: u64, sum: f64| lag.is_some_and(|l| l.0 == pairs && (l.1 - sum).abs() < 1e-12);
/// assert!(close(estimate.at(0, 1), 3, 34.0) && close(estimate.at(1, 0), 2, 11.0));
/// // The estimate is even, and ends at the largest lag.
/// assert_eq!(estimate.at(-1, 1), estimate.at(1, -1));
/// assert_eq!(estimate.at(2, 0), None);
/// ```
pub fn masked_covariance(values: &[f64], cols: usize, max_lag: [usize; 2]) -> MaskedCovariance {
    let rows = values.len().checked_div(cols).unwrap_or(0);
    let max_lag = [max_lag[0].min(rows.saturating_sub(1)), max_lag[1].min(cols.saturating_sub(1))];
    let step = even_step(rows, STRIP_ROWS.max(4 * max_lag[0]), max_lag[0]);
    let mut sums = PairSums::new(step, cols, max_lag);
    for first in (0..rows).step_by(step) {
        sums.add(&values[first * cols..(first + step + max_lag[0]).min(rows) * cols]);
    }
    sums.finish()
}

/// Length of the parts into which to cut `len` rows or columns for the least work: at most `most`, evenly cut and with little
/// padding.
pub(crate) fn even_step(len: usize, most: usize, max_lag: usize) -> usize {
    let fewest = len.div_ceil(most.max(1)).max(1);
    let step = |parts: usize| len.div_ceil(parts).max(1);
    let work = |&parts: &usize| parts * (smooth_length(step(parts) + 2 * max_lag) + smooth_length(2 * max_lag));
    step((fewest..=fewest + fewest / 2).min_by_key(work).unwrap_or(fewest))
}

/// Pair sums of a raster that is supplied in strips.
pub struct PairSums {
    cols: usize,
    /// Rows and columns of a tile without its overlap; at least the largest lag, so that no pair lies in more than two tiles in
    /// either direction.
    step: [usize; 2],
    /// Sums over tiles, over their overlaps with the tiles below, with those to the east, and with both.
    tiles: TileSums,
    below: TileSums,
    east: TileSums,
    corner: TileSums,
}

impl PairSums {
    /// Sums for strips of `step` rows of `cols` cells; lags smaller than the raster and no larger than a strip.
    pub fn new(step: usize, cols: usize, max_lag: [usize; 2]) -> Self {
        let step = [step, even_step(cols, TILE_COLS.max(4 * max_lag[1]), max_lag[1])];
        let sums = |rows: usize, cols: usize| TileSums::new([rows, cols], max_lag);
        let [rows, wide] = [0, 1].map(|k| step[k] + max_lag[k]);
        let (tiles, below) = (sums(rows, wide), sums(max_lag[0], wide));
        let (east, corner) = (sums(rows, max_lag[1]), sums(max_lag[0], max_lag[1]));
        Self { cols, step, tiles, below, east, corner }
    }

    /// Adds the next strip: its rows, followed by up to the largest lag's number of rows from the next strip.
    pub fn add(&mut self, strip: &[f64]) {
        let (cols, [down, across]) = (self.cols, self.step);
        let below = strip.get(down * cols..).filter(|below| !below.is_empty());
        for first in (0..cols).step_by(across) {
            let wide = first..(first + across + self.tiles.max_lag[1]).min(cols);
            let shared = (first + across).min(cols)..wide.end;
            self.tiles.add(strip, cols, wide.clone());
            self.east.add(strip, cols, shared.clone());
            if let Some(below) = below {
                self.below.add(below, cols, wide);
                self.corner.add(below, cols, shared);
            }
        }
    }

    /// The sums of all strips.
    pub fn finish(self) -> MaskedCovariance {
        let max_lag = self.tiles.max_lag;
        let twice = self.below.finish().zip(self.east.finish());
        let once = self.tiles.finish().zip(self.corner.finish()).zip(twice);
        let one = |(((s, n), (s4, n4)), ((s2, n2), (s3, n3))): Four| (s + s4 - s2 - s3, n + n4 - n2 - n3);
        let (sums, pairs) = once.map(one).unzip();
        MaskedCovariance { max_lag, sums, pairs }
    }
}

/// Sums of products and numbers of pairs, of the four kinds of tiles.
type Four = (((f64, u64), (f64, u64)), ((f64, u64), (f64, u64)));

/// Power spectra of data and mask, accumulated over tiles of one padded shape.
struct TileSums {
    fft: RealFft2,
    shape: [usize; 2],
    max_lag: [usize; 2],
    /// Buffer for the current tile.
    padded: Vec<f64>,
    data_power: Vec<f64>,
    mask_power: Vec<f64>,
}

impl TileSums {
    /// Sums over tiles of at most `tile` rows and columns.
    fn new(tile: [usize; 2], max_lag: [usize; 2]) -> Self {
        let shape = [0, 1].map(|k| smooth_length(tile[k] + max_lag[k]));
        let half = shape[0] * (shape[1] / 2 + 1);
        let fft = RealFft2::new(shape[0], shape[1]);
        let padded = vec![0.0; shape[0] * shape[1]];
        Self { fft, shape, max_lag, padded, data_power: vec![0.0; half], mask_power: vec![0.0; half] }
    }

    /// Adds some columns of a strip with rows of `cols`.
    fn add(&mut self, strip: &[f64], cols: usize, part: Range<usize>) {
        if part.is_empty() {
            return;
        }
        self.pad(strip, cols, part.clone(), |v| if v.is_nan() { 0.0 } else { v });
        add_power(&mut self.data_power, &self.fft.forward(&self.padded).values);
        self.pad(strip, cols, part, |v| if v.is_nan() { 0.0 } else { 1.0 });
        add_power(&mut self.mask_power, &self.fft.forward(&self.padded).values);
    }

    /// Fills the buffer with `value` of each cell of a tile, and with zeros beyond.
    fn pad(&mut self, strip: &[f64], cols: usize, part: Range<usize>, value: impl Fn(f64) -> f64) {
        let filled = strip.len() / cols * self.shape[1];
        let (rows, beyond) = self.padded.split_at_mut(filled);
        for (out, row) in rows.chunks_exact_mut(self.shape[1]).zip(strip.chunks_exact(cols)) {
            let (cells, beyond) = out.split_at_mut(part.len());
            cells.iter_mut().zip(&row[part.clone()]).for_each(|(o, v)| *o = value(*v));
            beyond.fill(0.0);
        }
        beyond.fill(0.0);
    }

    /// Sum of products and number of pairs at each stored lag.
    fn finish(self) -> impl Iterator<Item = (f64, u64)> {
        let Self { fft, shape: [rows, cols], max_lag, data_power, mask_power, .. } = self;
        let sums = super::filtered::inverse_real(&fft, [rows, cols], &data_power, max_lag[0] + 1);
        let pairs = super::filtered::inverse_real(&fft, [rows, cols], &mask_power, max_lag[0] + 1);
        let [max_row, max_col] = max_lag.map(|l| l as isize);
        (0..=max_row).flat_map(move |r| (-max_col..=max_col).map(move |c| (r, c))).map(move |(r, c)| {
            let k = r as usize * cols + c.rem_euclid(cols as isize) as usize;
            (sums[k], pairs[k].round() as u64)
        })
    }
}

fn add_power(total: &mut [f64], spectrum: &[Complex64]) {
    total.iter_mut().zip(spectrum).for_each(|(t, s)| *t += s.norm_sqr());
}
