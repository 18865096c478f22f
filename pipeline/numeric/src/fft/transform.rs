//! One-dimensional complex transform of any length.

use super::stockham::Stockham;
use super::{Complex64, smooth_length};
use std::f64::consts::PI;
use std::sync::Arc;

/// A one-dimensional complex transform of a fixed length, in place.
///
/// ```
/// use sastrugi_numeric::fft::{Complex64, Transform};
///
/// let transform = Transform::new(4);
/// let [zero, one, i] = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)].map(|(re, im)| Complex64::new(re, im));
/// let mut data = [zero, one, zero, zero];
/// // Forward: exp(-2 pi i k / 4) for k = 0, 1, 2, 3.
/// transform.forward(&mut data, &mut transform.scratch());
/// let expected = [one, -i, -one, i];
/// assert!(data.iter().zip(&expected).all(|(a, b)| (a - b).norm() < 1e-15));
/// // The inverse is not divided by the number of points.
/// transform.inverse_unscaled(&mut data, &mut transform.scratch());
/// assert!((data[1] - one * 4.0).norm() < 1e-15);
/// ```
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
        assert!(len > 0, "a transform needs at least one point");
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

    /// Always false: a transform has at least one point.
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

/// Bluestein's chirp of a length and its spectrum.
pub(super) struct Chirp {
    /// `exp(-pi i k^2 / len)`.
    pub values: Vec<Complex64>,
    /// Transform of the conjugate chirp, wrapped to a smooth length and divided by that length.
    pub spectrum: Vec<Complex64>,
}

impl Chirp {
    pub fn new(len: usize) -> Self {
        let inner = Transform::new(smooth_length(2 * len - 1));
        let values: Vec<Complex64> = (0..len)
            .map(|k| {
                // Taking k^2 modulo 2 len keeps the phase small and therefore exact.
                let square = (k as u128 * k as u128 % (2 * len as u128)) as f64;
                let (sin, cos) = libm::sincos(-PI * square / len as f64);
                Complex64::new(cos, sin)
            })
            .collect();
        let mut spectrum = vec![Complex64::default(); inner.len()];
        for (k, c) in values.iter().enumerate() {
            spectrum[k] = c.conj();
            if k > 0 {
                spectrum[inner.len() - k] = c.conj();
            }
        }
        let mut scratch = inner.scratch();
        inner.forward(&mut spectrum, &mut scratch);
        let scale = 1.0 / inner.len() as f64;
        spectrum.iter_mut().for_each(|v| *v *= scale);
        Self { values, spectrum }
    }
}

/// Transform of any length as a convolution with a chirp.
struct Bluestein {
    inner: Transform,
    chirp: Chirp,
}

impl Bluestein {
    fn new(len: usize) -> Self {
        let chirp = Chirp::new(len);
        Self { inner: Transform::new(chirp.spectrum.len()), chirp }
    }

    fn scratch_len(&self) -> usize {
        self.inner.len() + self.inner.scratch().len()
    }

    fn forward(&self, run: &mut [Complex64], scratch: &mut [Complex64]) {
        let (work, inner_scratch) = scratch.split_at_mut(self.inner.len());
        work.fill(Complex64::default());
        for ((w, v), c) in work.iter_mut().zip(run.iter()).zip(&self.chirp.values) {
            *w = v * c;
        }
        self.inner.forward(work, inner_scratch);
        work.iter_mut().zip(&self.chirp.spectrum).for_each(|(w, s)| *w *= s);
        self.inner.inverse_unscaled(work, inner_scratch);
        for ((v, w), c) in run.iter_mut().zip(work.iter()).zip(&self.chirp.values) {
            *v = w * c;
        }
    }
}
