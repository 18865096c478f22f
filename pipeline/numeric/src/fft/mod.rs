//! Fourier transforms whose bits do not depend on the CPU.
//!
//! Lengths 2^a 3^b 5^c are transformed by `stockham.rs` with `libm` twiddles, other lengths through Bluestein's chirp (1970)
//! on such a length. Forward transforms are unnormalised with
//! `exp(-2 pi i k n / N)`; inverse transforms divide by the number of points.
//!
//! Cost: a real 2-D transform is two complex half transforms and one blocked transposition; memory is twice the half
//! spectrum (`rows * (cols / 2 + 1)` complex numbers) while it runs.

mod stockham;

pub use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::Arc;
use stockham::Stockham;

/// Columns transposed together: four cache lines of complex numbers a row.
const TRANSPOSE_BLOCK: usize = 16;

/// True for 2^a 3^b 5^c.
pub fn is_smooth(mut n: usize) -> bool {
    for factor in [2, 3, 5] {
        while n > 1 && n.is_multiple_of(factor) {
            n /= factor;
        }
    }
    n == 1
}

/// The smallest 2^a 3^b 5^c that is at least `n`.
pub fn smooth_length(n: usize) -> usize {
    (n.max(1)..).find(|&m| is_smooth(m)).unwrap_or(n)
}

/// A one-dimensional complex transform of a fixed length, in place.
#[derive(Clone)]
pub struct Transform {
    len: usize,
    kind: Kind,
}

#[derive(Clone)]
enum Kind {
    Direct(Arc<Stockham>),
    Bluestein(Arc<Bluestein>),
}

impl Transform {
    /// A transform of `len` points.
    ///
    /// # Panics
    /// If `len` is 0.
    pub fn new(len: usize) -> Self {
        assert!(len > 0, "a transform needs points");
        let kind = match Stockham::new(len) {
            Some(direct) => Kind::Direct(Arc::new(direct)),
            None => Kind::Bluestein(Arc::new(Bluestein::new(len))),
        };
        Self { len, kind }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Never true: a transform has points.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Working memory that [`Self::forward`] and [`Self::inverse_unscaled`] need.
    pub fn scratch(&self) -> Vec<Complex64> {
        let len = match &self.kind {
            Kind::Direct(_) => self.len,
            Kind::Bluestein(b) => b.scratch_len(),
        };
        vec![Complex64::default(); len]
    }

    /// Forward transform of one or more consecutive runs of `len` points.
    pub fn forward(&self, data: &mut [Complex64], scratch: &mut [Complex64]) {
        match &self.kind {
            Kind::Direct(direct) => {
                data.chunks_exact_mut(self.len).for_each(|run| direct.process::<false>(run, scratch));
            }
            Kind::Bluestein(b) => data.chunks_exact_mut(self.len).for_each(|run| b.forward(run, scratch)),
        }
    }

    /// Inverse transform, not divided by `len`.
    pub fn inverse_unscaled(&self, data: &mut [Complex64], scratch: &mut [Complex64]) {
        match &self.kind {
            Kind::Direct(direct) => {
                data.chunks_exact_mut(self.len).for_each(|run| direct.process::<true>(run, scratch));
            }
            Kind::Bluestein(b) => {
                for run in data.chunks_exact_mut(self.len) {
                    run.iter_mut().for_each(|v| *v = v.conj());
                    b.forward(run, scratch);
                    run.iter_mut().for_each(|v| *v = v.conj());
                }
            }
        }
    }
}

/// Transform of any length as a convolution with a chirp.
struct Bluestein {
    inner: Transform,
    chirp: Vec<Complex64>,
    chirp_spectrum: Vec<Complex64>,
}

impl Bluestein {
    fn new(len: usize) -> Self {
        let inner = Transform::new(smooth_length(2 * len - 1));
        let chirp: Vec<Complex64> = (0..len)
            .map(|k| {
                // k^2 modulo 2 len keeps the phase small and therefore exact.
                let square = (k as u128 * k as u128 % (2 * len as u128)) as f64;
                let (sin, cos) = libm::sincos(-PI * square / len as f64);
                Complex64::new(cos, sin)
            })
            .collect();
        let mut spectrum = vec![Complex64::default(); inner.len()];
        for (k, c) in chirp.iter().enumerate() {
            spectrum[k] = c.conj();
            if k > 0 {
                spectrum[inner.len() - k] = c.conj();
            }
        }
        let mut scratch = inner.scratch();
        inner.forward(&mut spectrum, &mut scratch);
        let scale = 1.0 / inner.len() as f64;
        spectrum.iter_mut().for_each(|v| *v *= scale);
        Self { inner, chirp, chirp_spectrum: spectrum }
    }

    fn scratch_len(&self) -> usize {
        self.inner.len() + self.inner.scratch().len()
    }

    fn forward(&self, run: &mut [Complex64], scratch: &mut [Complex64]) {
        let (work, inner_scratch) = scratch.split_at_mut(self.inner.len());
        work.fill(Complex64::default());
        for ((w, v), c) in work.iter_mut().zip(run.iter()).zip(&self.chirp) {
            *w = v * c;
        }
        self.inner.forward(work, inner_scratch);
        work.iter_mut().zip(&self.chirp_spectrum).for_each(|(w, s)| *w *= s);
        self.inner.inverse_unscaled(work, inner_scratch);
        for ((v, w), c) in run.iter_mut().zip(work.iter()).zip(&self.chirp) {
            *v = w * c;
        }
    }
}

/// Real two-dimensional transform of a fixed shape.
#[derive(Clone)]
pub struct RealFft2 {
    rows: usize,
    cols: usize,
    along_row: Transform,
    along_col: Transform,
}

/// The non-negative column frequencies of a real field's transform, stored column frequency first:
/// the value at column frequency `kx` in `0..=cols / 2` and row frequency `ky` in `0..rows` is `values[kx * rows + ky]`.
#[derive(Clone, Debug)]
pub struct HalfSpectrum {
    /// Rows of the field.
    pub rows: usize,
    /// Columns of the field.
    pub cols: usize,
    /// `(cols / 2 + 1) * rows` values.
    pub values: Vec<Complex64>,
}

impl HalfSpectrum {
    /// Number of stored column frequencies.
    pub fn half_cols(&self) -> usize {
        self.cols / 2 + 1
    }

    /// How often the mode at column frequency `kx` stands in the full spectrum: 1 on the self-conjugate columns, else 2.
    pub fn multiplicity(&self, kx: usize) -> f64 {
        if kx == 0 || 2 * kx == self.cols { 1.0 } else { 2.0 }
    }
}

impl RealFft2 {
    /// A transform of fields of `rows` by `cols`.
    pub fn new(rows: usize, cols: usize) -> Self {
        Self { rows, cols, along_row: Transform::new(cols), along_col: Transform::new(rows) }
    }

    /// Transform of a row-major real field.
    ///
    /// # Panics
    /// If the field does not have `rows * cols` values.
    pub fn forward(&self, field: &[f64]) -> HalfSpectrum {
        assert_eq!(field.len(), self.rows * self.cols, "field of the transform's shape");
        let half = self.cols / 2 + 1;
        let mut by_row = vec![Complex64::default(); self.rows * half];
        by_row.par_chunks_mut(2 * half).zip(field.par_chunks(2 * self.cols)).for_each_init(
            || (vec![Complex64::default(); self.cols], self.along_row.scratch()),
            |(work, scratch), (out, rows)| self.forward_rows(rows, out, work, scratch),
        );
        let mut values = vec![Complex64::default(); self.rows * half];
        values.par_chunks_mut(TRANSPOSE_BLOCK * self.rows).enumerate().for_each_init(
            || self.along_col.scratch(),
            |scratch, (block, out)| {
                transpose_block(&by_row, half, block * TRANSPOSE_BLOCK, out, self.rows);
                self.along_col.forward(out, scratch);
            },
        );
        HalfSpectrum { rows: self.rows, cols: self.cols, values }
    }

    /// Field of a spectrum. Only the Hermitian part counts: what the stored columns 0 and `cols / 2` hold beyond it is
    /// dropped.
    pub fn inverse(&self, mut spectrum: HalfSpectrum) -> Vec<f64> {
        assert_eq!((spectrum.rows, spectrum.cols), (self.rows, self.cols), "spectrum of the transform's shape");
        let half = self.cols / 2 + 1;
        spectrum.values.par_chunks_mut(self.rows).for_each_init(
            || self.along_col.scratch(),
            |scratch, column| self.along_col.inverse_unscaled(column, scratch),
        );
        let mut by_row = vec![Complex64::default(); self.rows * half];
        by_row.par_chunks_mut(TRANSPOSE_BLOCK * half).enumerate().for_each(|(block, out)| {
            transpose_block(&spectrum.values, self.rows, block * TRANSPOSE_BLOCK, out, half);
        });
        drop(spectrum);
        let mut field = vec![0.0; self.rows * self.cols];
        field.par_chunks_mut(2 * self.cols).zip(by_row.par_chunks(2 * half)).for_each_init(
            || (vec![Complex64::default(); self.cols], self.along_row.scratch()),
            |(work, scratch), (out, rows)| self.inverse_rows(rows, out, work, scratch),
        );
        field
    }

    /// Two real rows share one complex transform; a last single row has a zero partner.
    fn forward_rows(&self, rows: &[f64], out: &mut [Complex64], work: &mut [Complex64], scratch: &mut [Complex64]) {
        let (cols, half) = (self.cols, self.cols / 2 + 1);
        let (first, second) = rows.split_at(cols);
        for (k, w) in work.iter_mut().enumerate() {
            *w = Complex64::new(first[k], second.get(k).copied().unwrap_or(0.0));
        }
        self.along_row.forward(work, scratch);
        let (out_first, out_second) = out.split_at_mut(half);
        for k in 0..half {
            let (a, b) = (work[k], work[(cols - k) % cols].conj());
            out_first[k] = (a + b) * 0.5;
            if !out_second.is_empty() {
                let d = (a - b) * 0.5;
                out_second[k] = Complex64::new(d.im, -d.re);
            }
        }
    }

    fn inverse_rows(&self, rows: &[Complex64], out: &mut [f64], work: &mut [Complex64], scratch: &mut [Complex64]) {
        let (cols, half) = (self.cols, self.cols / 2 + 1);
        let (first, second) = rows.split_at(half);
        let partner = |k: usize| second.get(k).copied().unwrap_or_default();
        for k in 0..half {
            let (mut a, mut b) = (first[k], partner(k));
            if k == 0 || 2 * k == cols {
                // Self-conjugate columns of a real field are real.
                (a.im, b.im) = (0.0, 0.0);
            }
            work[k] = Complex64::new(a.re - b.im, a.im + b.re);
            if k > 0 && 2 * k != cols {
                work[cols - k] = Complex64::new(a.re + b.im, b.re - a.im);
            }
        }
        self.along_row.inverse_unscaled(work, scratch);
        let scale = 1.0 / (self.rows * cols) as f64;
        let (out_first, out_second) = out.split_at_mut(cols);
        for (k, w) in work.iter().enumerate() {
            out_first[k] = w.re * scale;
            if let Some(v) = out_second.get_mut(k) {
                *v = w.im * scale;
            }
        }
    }
}

/// Columns `from..` of the row-major `source` (rows of `stride`) into `out`, each as a run of `len` values.
fn transpose_block(source: &[Complex64], stride: usize, from: usize, out: &mut [Complex64], len: usize) {
    let width = out.len() / len;
    for (row, line) in source.chunks_exact(stride).enumerate() {
        for (k, value) in line[from..from + width].iter().enumerate() {
            out[k * len + row] = *value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::streams::Streams;

    fn noise(n: usize, purpose: &str) -> Vec<f64> {
        let mut s = Streams::for_seed(1, "fft-test").stream(purpose);
        (0..n).map(|_| s.normal()).collect()
    }

    /// The definition, as a double sum.
    fn direct(field: &[f64], rows: usize, cols: usize, kx: usize, ky: usize) -> Complex64 {
        let mut total = Complex64::default();
        for r in 0..rows {
            for c in 0..cols {
                let turn = (r * ky) as f64 / rows as f64 + (c * kx) as f64 / cols as f64;
                let (sin, cos) = libm::sincos(-2.0 * PI * turn);
                total += Complex64::new(cos, sin) * field[r * cols + c];
            }
        }
        total
    }

    #[test]
    fn val_forward_equals_the_definition() {
        for (rows, cols) in [(1, 1), (2, 2), (5, 8), (6, 7), (7, 11), (9, 1), (1, 10)] {
            let field = noise(rows * cols, "field");
            let spectrum = RealFft2::new(rows, cols).forward(&field);
            for kx in 0..=cols / 2 {
                for ky in 0..rows {
                    let error = (spectrum.values[kx * rows + ky] - direct(&field, rows, cols, kx, ky)).norm();
                    assert!(error < 1e-11, "{rows}x{cols} at {kx},{ky}: {error}");
                }
            }
        }
    }

    #[test]
    fn prop_round_trip() {
        for (rows, cols) in [(1, 1), (33, 40), (17, 31), (64, 64), (35, 97), (128, 30)] {
            let field = noise(rows * cols, "field");
            let fft = RealFft2::new(rows, cols);
            let back = fft.inverse(fft.forward(&field));
            let worst = field.iter().zip(&back).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()));
            assert!(worst < 1e-12, "{rows}x{cols}: {worst}");
        }
    }

    #[test]
    fn val_smooth_lengths() {
        assert_eq!([1, 7, 11, 1009, 2048].map(smooth_length), [1, 8, 12, 1024, 2048]);
    }

    #[test]
    fn val_bluestein_matches_a_direct_sum() {
        let n = 1009;
        let t = Transform::new(n);
        let re = noise(n, "re");
        let mut data: Vec<Complex64> = re.iter().map(|&v| Complex64::new(v, 0.0)).collect();
        t.forward(&mut data, &mut t.scratch());
        for k in [0, 1, 500, 1008] {
            assert!((data[k] - direct(&re, 1, n, k, 0)).norm() < 1e-9);
        }
    }

    /// `rustfft` as an independent reference, on lengths of every mixture of radices.
    #[test]
    fn val_matches_rustfft() {
        for n in [2, 3, 4, 5, 6, 8, 15, 16, 30, 60, 81, 125, 128, 2560, 4320, 8192] {
            let (re, im) = (noise(n, "re"), noise(n, "im"));
            let input: Vec<Complex64> = re.iter().zip(&im).map(|(&a, &b)| Complex64::new(a, b)).collect();
            let transform = Transform::new(n);
            let mut scratch = transform.scratch();
            for inverse in [false, true] {
                let (mut ours, mut theirs) = (input.clone(), input.clone());
                let mut planner = rustfft::FftPlannerScalar::new();
                if inverse {
                    transform.inverse_unscaled(&mut ours, &mut scratch);
                    planner.plan_fft_inverse(n).process(&mut theirs);
                } else {
                    transform.forward(&mut ours, &mut scratch);
                    planner.plan_fft_forward(n).process(&mut theirs);
                }
                let worst = ours.iter().zip(&theirs).fold(0.0, |m, (a, b)| f64::max(m, (a - b).norm()));
                assert!(worst < 1e-15 * n as f64 + 1e-13, "{n}: {worst}");
            }
        }
    }

    /// Bits of transforms at lengths where twiddles from the C library change with the CPU.
    #[test]
    fn gold_bits_are_frozen() {
        let mut digest = 0u64;
        for n in [60, 1009, 2560, 8192] {
            let transform = Transform::new(n);
            let mut data: Vec<Complex64> = noise(n, "re").into_iter().map(|v| Complex64::new(v, 0.25)).collect();
            transform.forward(&mut data, &mut transform.scratch());
            for v in data {
                digest = (digest ^ v.re.to_bits()).wrapping_mul(0x0100_0000_01b3);
                digest = (digest ^ v.im.to_bits()).wrapping_mul(0x0100_0000_01b3);
            }
        }
        assert_eq!(digest, 7_467_512_922_136_635_467);
    }
}
