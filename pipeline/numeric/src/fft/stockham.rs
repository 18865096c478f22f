//! Complex transform of length 2^a 3^b 5^c: Stockham's self-sorting passes (Cochran et al., 1967) of radix 4, 2, 3 and 5.
//!
//! Why not `rustfft`: it takes its twiddle factors from the C library, whose sine and cosine differ in their last bits between CPUs
//! (observed for lengths 60, 2560, 8192 and many others), and so would every surface computed with such a transform. Here twiddles
//! come from `libm`, and the passes use only `+ - *`.
//!
//! With `n` points left, stride `s` and radix `r`, one pass computes for `p < n / r`, `q < s`, `k < r`
//!
//! ```text
//! y[q + s (r p + k)] = exp(-2 pi i p k / n) * sum over m < r of x[q + s (p + m n / r)] exp(-2 pi i m k / r)
//! ```
//!
//! This file processes one run at a time; `quads.rs` applies the same passes to four runs at a time.
//!
//! Cost: about `5 n log2 n` operations in `log4 n` passes between two buffers; tables of about `n` complex numbers.

use super::Complex64;
use super::butterflies::{Butterfly, Number, Radix};
use std::f64::consts::PI;

/// A planned transform.
pub struct Stockham {
    len: usize,
    passes: Vec<Pass>,
}

/// A pass of a plan.
pub struct Pass {
    pub radix: usize,
    pub stride: usize,
    /// [`turns`] of each `p`.
    pub twiddles: Vec<Complex64>,
}

/// `exp(-2 pi i turn / of)`.
fn twiddle(turn: usize, of: usize) -> Complex64 {
    let (sin, cos) = libm::sincos(-2.0 * PI * turn as f64 / of as f64);
    Complex64::new(cos, sin)
}

/// The radices of a length in the order of the passes; `None` unless the length is 2^a 3^b 5^c.
pub fn radices(len: usize) -> Option<Vec<usize>> {
    let (mut all, mut left) = (Vec::new(), len);
    for radix in [4, 2, 3, 5] {
        while left > 1 && left.is_multiple_of(radix) {
            all.push(radix);
            left /= radix;
        }
    }
    (left == 1).then_some(all)
}

/// The factors `exp(-2 pi i p k / n)` of a pass with `n = left` points left, for `k` in `1..radix`.
pub fn turns(radix: usize, left: usize, p: usize) -> impl Iterator<Item = Complex64> {
    (1..radix).map(move |k| twiddle(p * k, left))
}

impl Pass {
    pub fn new(radix: usize, stride: usize, left: usize) -> Self {
        let twiddles = (0..left / radix).flat_map(|p| turns(radix, left, p)).collect();
        Self { radix, stride, twiddles }
    }
}

impl Stockham {
    /// A transform of `len` = 2^a 3^b 5^c points; `None` for any other length.
    pub fn new(len: usize) -> Option<Self> {
        let (mut left, mut stride) = (len, 1);
        let passes = radices(len)?.into_iter().map(|radix| {
            let pass = Pass::new(radix, stride, left);
            (left, stride) = (left / radix, stride * radix);
            pass
        });
        Some(Self { len, passes: passes.collect() })
    }

    /// Transforms `data` (of the planned length) in place, unscaled; `other` has the same length and is overwritten.
    pub fn process<const INVERSE: bool>(&self, data: &mut [Complex64], other: &mut [Complex64]) {
        let (data, other) = (&mut data[..self.len], &mut other[..self.len]);
        let (mut from, mut to) = (&mut *data, &mut *other);
        for pass in &self.passes {
            match pass.radix {
                4 => run::<4, INVERSE>(pass, from, to),
                2 => run::<2, INVERSE>(pass, from, to),
                3 => run::<3, INVERSE>(pass, from, to),
                _ => run::<5, INVERSE>(pass, from, to),
            }
            std::mem::swap(&mut from, &mut to);
        }
        if self.passes.len() % 2 == 1 {
            to.copy_from_slice(from);
        }
    }
}

/// One pass.
#[inline(always)]
fn run<const R: usize, const INVERSE: bool>(pass: &Pass, from: &[Complex64], to: &mut [Complex64])
where
    Butterfly<R, INVERSE>: Radix<R>,
{
    let stride = pass.stride;
    let quarter = from.len() / R;
    let parts: [&[Complex64]; R] = std::array::from_fn(|m| &from[m * quarter..(m + 1) * quarter]);
    let twiddles = pass.twiddles.chunks_exact(R - 1);
    if stride == 1 {
        for (p, (out, turns)) in to.chunks_exact_mut(R).zip(twiddles).enumerate() {
            let values = Butterfly::<R, INVERSE>::apply(std::array::from_fn(|m| parts[m][p]));
            out[0] = values[0];
            for k in 1..R {
                out[k] = values[k].turned::<INVERSE>(turns[k - 1]);
            }
        }
        return;
    }
    for (p, (out, turns)) in to.chunks_exact_mut(R * stride).zip(twiddles).enumerate() {
        let inputs: [&[Complex64]; R] = std::array::from_fn(|m| &parts[m][p * stride..(p + 1) * stride]);
        let mut outputs = out.chunks_exact_mut(stride);
        let outputs: [&mut [Complex64]; R] = std::array::from_fn(|_| outputs.next().unwrap_or_default());
        for q in 0..stride {
            let values = Butterfly::<R, INVERSE>::apply(std::array::from_fn(|m| inputs[m][q]));
            outputs[0][q] = values[0];
            for k in 1..R {
                outputs[k][q] = values[k].turned::<INVERSE>(turns[k - 1]);
            }
        }
    }
}
