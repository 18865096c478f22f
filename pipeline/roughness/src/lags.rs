//! Sums over all pairs of cells with data, at every lag up to a bound: the basis of structure function and autocorrelation.
//!
//! With z = 0 where there is no data, and the mask m,
//! `N(h) = sum of m(i) m(i + h)`, `P(h) = sum of z(i) z(i + h)`, `Q(h) = sum of [z^2(i) m(i + h) + m(i) z^2(i + h)]`
//! over all cells i, so that the mean squared increment is `D(h) = (Q - 2 P) / N` and the autocovariance `P / N`
//! (Marcotte, Computers & Geosciences 22 (1996) 1175). P, N and Q are correlations, computed by Fourier transforms of the
//! padded fields. Without holes N and Q need no transform: N is a product, Q comes from a table of cumulative sums.
//!
//! Rounding error: about 1e-14 of the sum of squares, so the error in D of a smooth surface is that share of its variance.
//!
//! Cost: 2 transforms of the padded grid (6 with holes); about 60 bytes per cell.

use rayon::prelude::*;
use sastrugi_numeric::Grid;
use sastrugi_numeric::fft::{Complex64, RealFft2, smooth_length};

/// Pair sums for lags `(drow, dcol)` with `|drow| <= max_lag[0]`, `|dcol| <= max_lag[1]`.
#[derive(Clone, Debug)]
pub struct LagSums {
    /// Largest lag in cells, north-south and east-west.
    pub max_lag: [usize; 2],
    /// Ordered by `drow` in `0..=max_lag[0]` (outer) and `dcol` in `-max_lag[1]..=max_lag[1]` (inner).
    sums: Vec<PairSum>,
}

/// Sums over the pairs of one lag.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PairSum {
    /// Number of pairs.
    pub pairs: f64,
    /// Sum of products.
    pub products: f64,
    /// Sum of the squares of both cells.
    pub squares: f64,
}

impl PairSum {
    /// Mean squared increment; NaN without pairs.
    pub fn increment(&self) -> f64 {
        let mean = (self.squares - 2.0 * self.products) / self.pairs;
        // Rounding on a flat surface may give a negative value.
        if mean < 0.0 { 0.0 } else { mean }
    }

    /// Mean product; NaN without pairs.
    pub fn covariance(&self) -> f64 {
        self.products / self.pairs
    }
}

impl LagSums {
    /// Pair sums of a surface centred on zero; `max_lag` is limited to the grid.
    ///
    /// ```
    /// use sastrugi_numeric::{Geometry, Grid};
    /// use sastrugi_roughness::LagSums;
    ///
    /// let board = Grid::new(Geometry::square(2, 2, 1.0), vec![1.0, -1.0, -1.0, 1.0]);
    /// let sums = LagSums::of(&board, [1, 1]);
    /// // Two pairs of neighbours from west to east, each of opposite heights; one pair along the diagonal, of equal heights.
    /// let (east, south_east) = (sums.at(0, 1), sums.at(1, 1));
    /// assert_eq!((east.pairs, south_east.pairs), (2.0, 1.0));
    /// assert!((east.covariance() + 1.0).abs() < 1e-12 && (east.increment() - 4.0).abs() < 1e-12);
    /// assert!(south_east.increment().abs() < 1e-12);
    /// ```
    pub fn of(dem: &Grid, max_lag: [usize; 2]) -> Self {
        let max_lag = [max_lag[0].min(dem.rows().saturating_sub(1)), max_lag[1].min(dem.cols().saturating_sub(1))];
        let padded = Padded::new(dem, max_lag);
        let sums = if dem.finite_count() == dem.values.len() { padded.full() } else { padded.with_holes() };
        Self { max_lag, sums }
    }

    /// Sums at a lag in cells; zero beyond the largest lag.
    pub fn at(&self, drow: isize, dcol: isize) -> PairSum {
        // Pairs are unordered, so only one of two opposite lags is stored.
        let (drow, dcol) = if drow < 0 { (-drow, -dcol) } else { (drow, dcol) };
        let [max_row, max_col] = self.max_lag.map(|l| l as isize);
        if drow > max_row || dcol.abs() > max_col {
            return PairSum::default();
        }
        self.sums[(drow * (2 * max_col + 1) + dcol + max_col) as usize]
    }

    /// One of each two opposite lags, with its sums, without lag zero.
    pub fn half(&self) -> impl Iterator<Item = ([isize; 2], &PairSum)> {
        let width = 2 * self.max_lag[1] + 1;
        let lag = move |k: usize| [(k / width) as isize, (k % width) as isize - self.max_lag[1] as isize];
        self.sums.iter().enumerate().map(move |(k, s)| (lag(k), s)).filter(|(l, _)| l[0] > 0 || l[1] > 0)
    }
}

/// A surface and the shape it is padded to.
struct Padded<'a> {
    dem: &'a Grid,
    max_lag: [usize; 2],
    fft: RealFft2,
    shape: [usize; 2],
}

impl<'a> Padded<'a> {
    fn new(dem: &'a Grid, max_lag: [usize; 2]) -> Self {
        let shape = [smooth_length(dem.rows() + max_lag[0]), smooth_length(dem.cols() + max_lag[1])];
        Self { dem, max_lag, fft: RealFft2::new(shape[0], shape[1]), shape }
    }

    /// `value(z)` for the cells with data, 0 elsewhere: the rows of the surface, padded to the width of the transform.
    fn field(&self, value: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut field = vec![0.0; self.dem.rows() * self.shape[1]];
        for (r, out) in field.chunks_exact_mut(self.shape[1]).enumerate() {
            let row = self.dem.row(r);
            out.iter_mut().zip(row).for_each(|(o, &z)| *o = if z.is_finite() { value(z) } else { 0.0 });
        }
        field
    }

    /// Transform of [`Self::field`].
    fn spectrum(&self, value: impl Fn(f64) -> f64) -> Vec<Complex64> {
        let mut field = self.field(value);
        field.resize(self.shape[0] * self.shape[1], 0.0);
        self.fft.forward(&field).values
    }

    /// Correlation at the stored lags, from its spectrum, which is real. Rows beyond the largest lag are not transformed.
    fn correlation(&self, spectrum: impl Fn(usize) -> f64 + Sync) -> Vec<f64> {
        let ([rows, cols], [max_row, max_col]) = (self.shape, self.max_lag);
        let field = self.fft.inverse_rows_of(max_row + 1, |kx, column| {
            column.iter_mut().enumerate().for_each(|(ky, v)| *v = Complex64::new(spectrum(kx * rows + ky), 0.0));
        });
        let mut lags = Vec::with_capacity((max_row + 1) * (2 * max_col + 1));
        for row in field.chunks_exact(cols) {
            // Lags to the west are stored at the end of the row.
            lags.extend_from_slice(&row[cols - max_col..]);
            lags.extend_from_slice(&row[..=max_col]);
        }
        lags
    }

    fn with_holes(&self) -> Vec<PairSum> {
        let heights = self.spectrum(|z| z);
        let products = self.correlation(|k| heights[k].norm_sqr());
        drop(heights);
        let (mask, squared) = (self.spectrum(|_| 1.0), self.spectrum(|z| z * z));
        let squares = self.correlation(|k| 2.0 * (squared[k].re * mask[k].re + squared[k].im * mask[k].im));
        drop(squared);
        let pairs = self.correlation(|k| mask[k].norm_sqr());
        let sum = |((pairs, products), squares): ((f64, f64), f64)| PairSum { pairs: pairs.round(), products, squares };
        pairs.into_iter().zip(products).zip(squares).map(sum).collect()
    }

    fn full(&self) -> Vec<PairSum> {
        // Zeros may differ in sign from those of the complete field; their squares do not.
        let heights = self.fft.forward_rows(&self.field(|z| z)).values;
        let products = self.correlation(|k| heights[k].norm_sqr());
        drop(heights);
        let table = CumulativeSquares::of(self.dem);
        let [rows, cols] = [self.dem.rows(), self.dem.cols()];
        let width = 2 * self.max_lag[1] + 1;
        let sum = |(k, &products): (usize, &f64)| {
            let (drow, dcol) = (k / width, (k % width).abs_diff(self.max_lag[1]));
            let (height, length) = (rows - drow, cols - dcol);
            // First columns of the rectangles covered by the first and the second cell of a pair: the lag points east or west.
            let (first, second) = if k % width >= self.max_lag[1] { (0, dcol) } else { (dcol, 0) };
            let squares = table.within([0, first], [height, length]) + table.within([drow, second], [height, length]);
            PairSum { pairs: height as f64 * length as f64, products, squares }
        };
        products.par_iter().enumerate().with_min_len(1 << 12).map(sum).collect()
    }
}

/// Cumulative table for sums of squares over rectangles.
struct CumulativeSquares {
    width: usize,
    sums: Vec<f64>,
}

impl CumulativeSquares {
    fn of(dem: &Grid) -> Self {
        let width = dem.cols() + 1;
        let mut sums = vec![0.0; (dem.rows() + 1) * width];
        for r in 0..dem.rows() {
            let (above, below) = sums[r * width..][..2 * width].split_at_mut(width);
            let mut along = 0.0;
            for (c, z) in dem.row(r).iter().enumerate() {
                along += z * z;
                below[c + 1] = above[c + 1] + along;
            }
        }
        Self { width, sums }
    }

    fn within(&self, [row, col]: [usize; 2], [rows, cols]: [usize; 2]) -> f64 {
        let at = |r: usize, c: usize| self.sums[r * self.width + c];
        (at(row + rows, col + cols) - at(row, col + cols)) - (at(row + rows, col) - at(row, col))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::fft::HalfSpectrum;
    use sastrugi_numeric::{Geometry, Streams};

    /// Reference: the definition, pair by pair.
    fn direct(dem: &Grid, drow: isize, dcol: isize) -> PairSum {
        let mut sum = PairSum::default();
        for r in 0..dem.rows() as isize {
            for c in 0..dem.cols() as isize {
                let (r2, c2) = (r + drow, c + dcol);
                if r2 < 0 || c2 < 0 || r2 >= dem.rows() as isize || c2 >= dem.cols() as isize {
                    continue;
                }
                let (a, b) = (dem.at(r as usize, c as usize), dem.at(r2 as usize, c2 as usize));
                if a.is_finite() && b.is_finite() {
                    sum.pairs += 1.0;
                    sum.products += a * b;
                    sum.squares += a * a + b * b;
                }
            }
        }
        sum
    }

    /// All pairs with and without holes, to 1e-12 of the sum of squares; pair counts exact.
    #[test]
    fn val_equals_the_pair_loop() {
        for (rows, cols, hole_share) in [(17, 23, 0.0), (17, 23, 0.3), (12, 9, 0.9), (1, 14, 0.0), (13, 1, 0.2)] {
            let mut s = Streams::for_seed(1, "lags-test").stream("noise");
            let mut value = || if s.uniform() < hole_share { f64::NAN } else { s.normal() };
            let dem = Grid::new(Geometry::square(rows, cols, 0.1), (0..rows * cols).map(|_| value()).collect());
            let sums = LagSums::of(&dem, [rows / 2, 40]);
            let scale = direct(&dem, 0, 0).squares;
            for drow in -(rows as isize / 2)..=rows as isize / 2 {
                for dcol in 1 - cols as isize..cols as isize {
                    let (fast, slow) = (sums.at(drow, dcol), direct(&dem, drow, dcol));
                    assert_eq!(fast.pairs, slow.pairs, "{drow} {dcol}");
                    assert!((fast.products - slow.products).abs() < 1e-12 * scale, "{drow} {dcol}");
                    assert!((fast.squares - slow.squares).abs() < 1e-12 * scale, "{drow} {dcol}");
                }
            }
        }
    }

    /// Products have the bits of complete transforms, also where a spectrum is zero: noise, a board of -1 and 1, a constant, and nothing.
    #[test]
    fn prop_rows_left_out_change_no_bit() {
        let mut s = Streams::for_seed(1, "lags-test").stream("rows");
        for (rows, cols) in [(17, 23), (40, 9), (1, 14), (13, 1), (64, 64)] {
            let noise: Vec<f64> = (0..rows * cols).map(|_| s.normal()).collect();
            let board = (0..rows * cols).map(|k| [1.0, -1.0][(k / cols + k % cols) % 2]).collect();
            for values in [noise, board, vec![0.5; rows * cols], vec![0.0; rows * cols]] {
                let dem = Grid::new(Geometry::square(rows, cols, 0.1), values);
                let padded = Padded::new(&dem, [rows / 2, cols / 2]);
                let ([height, width], [max_row, max_col]) = (padded.shape, padded.max_lag);
                let power = padded.spectrum(|z| z).into_iter().map(|v| Complex64::new(v.norm_sqr(), 0.0)).collect();
                let field = padded.fft.inverse(HalfSpectrum { rows: height, cols: width, values: power });
                let lags = (0..=max_row).flat_map(|r| (0..=2 * max_col).map(move |c| (r, c)));
                let expected = lags.map(|(r, c)| field[r * width + (c + width - max_col) % width].to_bits());
                let found = padded.full().into_iter().map(|sum| sum.products.to_bits());
                assert_eq!(found.collect::<Vec<_>>(), expected.collect::<Vec<_>>(), "{rows}x{cols}");
            }
        }
    }

    #[test]
    fn val_lags_beyond_the_grid_have_no_pairs() {
        let sums = LagSums::of(&Grid::filled(Geometry::square(4, 4, 1.0), 1.0), [2, 2]);
        assert_eq!(sums.at(3, 0), PairSum::default());
        assert_eq!(sums.at(0, 0).pairs, 16.0);
        assert!(sums.at(2, -2).increment() < 1e-14 && sums.at(9, 9).increment().is_nan());
        assert_eq!(sums.half().count(), 2 * 5 + 2);
    }
}
