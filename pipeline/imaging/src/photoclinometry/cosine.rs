//! Poisson's equation on a rectangle with closed borders, by the cosine transform.
//!
//! The cosine transform of a field is computed from the Fourier transform of the reordered field (even samples forwards, odd ones
//! backwards: J. Makhoul, A fast cosine transform in one and two dimensions, 1980, doi:10.1109/TASSP.1980.1163351), so one forward and
//! one inverse real transform solve the equation. The transforms are those of `numeric::fft`, with the same reproducibility.

use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2};
use std::f64::consts::PI;

/// Solver of `w_x D_x z + w_y D_y z + c z = f` for one shape, with positive second differences `D` that end at the borders.
pub struct CosinePoisson {
    rows: usize,
    cols: usize,
    fft: RealFft2,
    /// `exp(-i pi k / 2 N)`.
    row_turns: Vec<Complex64>,
    col_turns: Vec<Complex64>,
    /// Eigenvalues of the differences along columns and rows.
    row_values: Vec<f64>,
    col_values: Vec<f64>,
    shift: f64,
}

impl CosinePoisson {
    /// The weights along x and y include 1/m2; with a `shift` of 0 the mean of the solution is 0.
    pub fn new(rows: usize, cols: usize, [weight_x, weight_y]: [f64; 2], shift: f64) -> Self {
        let turns = |n: usize| -> Vec<Complex64> {
            (0..=n).map(|k| libm::sincos(-PI * k as f64 / (2 * n) as f64)).map(|(s, c)| Complex64::new(c, s)).collect()
        };
        let values = |n: usize, weight: f64| -> Vec<f64> {
            (0..=n).map(|k| libm::sin(0.5 * PI * k as f64 / n as f64)).map(|s| 4.0 * weight * s * s).collect()
        };
        Self {
            rows,
            cols,
            fft: RealFft2::new(rows, cols),
            row_turns: turns(rows),
            col_turns: turns(cols),
            row_values: values(rows, weight_y),
            col_values: values(cols, weight_x),
            shift,
        }
    }

    /// Solution for a right-hand side; without a shift, the zero-mean solution for the right-hand side minus its mean.
    ///
    /// ```
    /// use sastrugi_imaging::photoclinometry::CosinePoisson;
    ///
    /// // A constant has no differences: what remains of the equation is `shift z = f`.
    /// let z = CosinePoisson::new(4, 6, [1.0, 2.0], 0.5).solve(&[3.0; 24]);
    /// assert!(z.iter().all(|z| (z - 6.0).abs() < 1e-12));
    /// ```
    pub fn solve(&self, right: &[f64]) -> Vec<f64> {
        let spectrum = self.fft.forward(&self.reordered(right));
        let solved = self.fft.inverse_of(|kx, column| self.solve_column(&spectrum, kx, column));
        self.restored(&solved)
    }

    /// Divides the four cosine modes of two Fourier modes by their eigenvalues: modes `(ky, kx)`, `(rows - ky, kx)` and both with
    /// `cols - kx`.
    fn solve_column(&self, spectrum: &HalfSpectrum, kx: usize, column: &mut [Complex64]) {
        let rows = self.rows;
        let stored = &spectrum.values[kx * rows..(kx + 1) * rows];
        let turn_x = self.col_turns[kx];
        for (ky, out) in column.iter_mut().enumerate() {
            let (a, b) = (stored[ky], stored[(rows - ky) % rows].conj());
            let turn = self.row_turns[ky];
            let (first, second) = (turn_x * a, turn_x.conj() * b);
            let (plus, minus) = (turn * (first + second), turn * (first - second));
            let real = self.gain(ky, kx) * plus.re + self.gain(rows - ky, self.cols - kx) * minus.re;
            let imaginary = self.gain(rows - ky, kx) * plus.im + self.gain(ky, self.cols - kx) * minus.im;
            *out = (turn * turn_x).conj() * Complex64::new(0.5 * real, 0.5 * imaginary);
        }
    }

    /// Inverse of the eigenvalue of a cosine mode.
    #[inline]
    fn gain(&self, ky: usize, kx: usize) -> f64 {
        let value = self.row_values[ky] + self.col_values[kx] + self.shift;
        if value > 0.0 { 1.0 / value } else { 0.0 }
    }

    fn reordered(&self, field: &[f64]) -> Vec<f64> {
        let (rows, cols) = (self.rows, self.cols);
        let mut out = vec![0.0; rows * cols];
        for (r, line) in field.chunks(cols).enumerate() {
            let target = &mut out[place(r, rows) * cols..][..cols];
            line.iter().enumerate().for_each(|(c, v)| target[place(c, cols)] = *v);
        }
        out
    }

    fn restored(&self, field: &[f64]) -> Vec<f64> {
        let cols = self.cols;
        let mut out = vec![0.0; field.len()];
        for (r, line) in out.chunks_mut(cols).enumerate() {
            let source = &field[place(r, self.rows) * cols..][..cols];
            line.iter_mut().enumerate().for_each(|(c, v)| *v = source[place(c, cols)]);
        }
        out
    }
}

/// Position of sample `k` of `n` in the reordered line.
#[inline]
fn place(k: usize, n: usize) -> usize {
    if k.is_multiple_of(2) { k / 2 } else { n - 1 - k / 2 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    /// The left-hand side of the equation, by differences.
    fn applied(z: &[f64], rows: usize, cols: usize, weights: [f64; 2], shift: f64) -> Vec<f64> {
        let at = |r: usize, c: usize| z[r * cols + c];
        let one = |r: usize, c: usize| {
            let mut sum = shift * at(r, c);
            let mut edge = |other: f64, weight: f64| sum += weight * (at(r, c) - other);
            if r > 0 {
                edge(at(r - 1, c), weights[1]);
            }
            if r + 1 < rows {
                edge(at(r + 1, c), weights[1]);
            }
            if c > 0 {
                edge(at(r, c - 1), weights[0]);
            }
            if c + 1 < cols {
                edge(at(r, c + 1), weights[0]);
            }
            sum
        };
        (0..rows * cols).map(|k| one(k / cols, k % cols)).collect()
    }

    /// The solution satisfies the difference equation, for even and odd shapes, with and without a shift.
    #[test]
    fn val_the_solution_satisfies_the_differences() {
        for (rows, cols) in [(2, 2), (3, 2), (5, 8), (6, 7), (9, 9), (16, 12), (7, 30)] {
            for shift in [0.0, 0.37] {
                let mut stream = Streams::for_seed(4, "cosine-test").stream("field");
                let mut right: Vec<f64> = (0..rows * cols).map(|_| stream.normal()).collect();
                if shift == 0.0 {
                    let mean = sastrugi_numeric::sums::mean(&right);
                    right.iter_mut().for_each(|v| *v -= mean);
                }
                let weights = [0.8, 2.5];
                let z = CosinePoisson::new(rows, cols, weights, shift).solve(&right);
                let back = applied(&z, rows, cols, weights, shift);
                let worst = back.iter().zip(&right).map(|(a, b)| (a - b).abs()).max_by(f64::total_cmp).unwrap();
                assert!(worst < 1e-11, "{rows} x {cols}, shift {shift}: {worst}");
            }
        }
    }
}
