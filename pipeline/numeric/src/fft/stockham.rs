//! Complex transform of length 2^a 3^b 5^c: Stockham's self-sorting passes (Cochran et al., 1967) of radix 4, 2, 3 and 5.
//!
//! Own code for one reason: `rustfft` takes its twiddle factors from the C library, whose sine and cosine change their
//! last bits with the CPU (seen for lengths 60, 2560, 8192 and many others), and every surface that passed through such a
//! transform would change with them. Here twiddles come from `libm`, and the passes are plain `+ - *`.
//!
//! With `n` points left, stride `s` and radix `r`, one pass computes for `p < n / r`, `q < s`, `k < r`
//!
//! ```text
//! y[q + s (r p + k)] = exp(-2 pi i p k / n) * sum over m < r of x[q + s (p + m n / r)] exp(-2 pi i m k / r)
//! ```
//!
//! Cost: about `5 n log2 n` operations in `log4 n` passes between two buffers; tables of about `n` complex numbers.

use num_complex::Complex64;
use std::f64::consts::PI;

/// A planned transform.
pub struct Stockham {
    len: usize,
    passes: Vec<Pass>,
}

struct Pass {
    radix: usize,
    stride: usize,
    /// `exp(-2 pi i p k / n)` for `k` in `1..radix`, one such run for each `p`.
    twiddles: Vec<Complex64>,
}

impl Pass {
    fn new(radix: usize, stride: usize, left: usize) -> Self {
        let factor = |turn: usize| {
            let (sin, cos) = libm::sincos(-2.0 * PI * turn as f64 / left as f64);
            Complex64::new(cos, sin)
        };
        let twiddles = (0..left / radix).flat_map(|p| (1..radix).map(move |k| factor(p * k))).collect();
        Self { radix, stride, twiddles }
    }
}

impl Stockham {
    /// A transform of `len` = 2^a 3^b 5^c points; `None` for any other length.
    pub fn new(len: usize) -> Option<Self> {
        let mut passes = Vec::new();
        let (mut left, mut stride) = (len, 1);
        for radix in [4, 2, 3, 5] {
            while left > 1 && left.is_multiple_of(radix) {
                passes.push(Pass::new(radix, stride, left));
                left /= radix;
                stride *= radix;
            }
        }
        (left == 1).then_some(Self { len, passes })
    }

    /// Transforms `data` (of the planned length) in place, unscaled; `other` is as long and is overwritten.
    pub fn process<const INVERSE: bool>(&self, data: &mut [Complex64], other: &mut [Complex64]) {
        let (data, other) = (&mut data[..self.len], &mut other[..self.len]);
        let (mut from, mut to) = (&mut *data, &mut *other);
        for pass in &self.passes {
            match pass.radix {
                4 => run::<4, INVERSE>(pass, from, to, butterfly4::<INVERSE>),
                2 => run::<2, INVERSE>(pass, from, to, |[a, b]| [a + b, a - b]),
                3 => run::<3, INVERSE>(pass, from, to, butterfly3::<INVERSE>),
                _ => run::<5, INVERSE>(pass, from, to, butterfly5::<INVERSE>),
            }
            std::mem::swap(&mut from, &mut to);
        }
        if self.passes.len() % 2 == 1 {
            to.copy_from_slice(from);
        }
    }
}

/// One pass; `butterfly` is the transform of `R` points.
#[inline(always)]
fn run<const R: usize, const INVERSE: bool>(
    pass: &Pass,
    from: &[Complex64],
    to: &mut [Complex64],
    butterfly: impl Fn([Complex64; R]) -> [Complex64; R],
) {
    let stride = pass.stride;
    let quarter = from.len() / R;
    let parts: [&[Complex64]; R] = std::array::from_fn(|m| &from[m * quarter..(m + 1) * quarter]);
    let twiddles = pass.twiddles.chunks_exact(R - 1);
    if stride == 1 {
        for (p, (out, turns)) in to.chunks_exact_mut(R).zip(twiddles).enumerate() {
            let values = butterfly(std::array::from_fn(|m| parts[m][p]));
            out[0] = values[0];
            for k in 1..R {
                out[k] = turned::<INVERSE>(values[k], turns[k - 1]);
            }
        }
        return;
    }
    for (p, (out, turns)) in to.chunks_exact_mut(R * stride).zip(twiddles).enumerate() {
        let inputs: [&[Complex64]; R] = std::array::from_fn(|m| &parts[m][p * stride..(p + 1) * stride]);
        let mut outputs = out.chunks_exact_mut(stride);
        let outputs: [&mut [Complex64]; R] = std::array::from_fn(|_| outputs.next().unwrap_or_default());
        for q in 0..stride {
            let values = butterfly(std::array::from_fn(|m| inputs[m][q]));
            outputs[0][q] = values[0];
            for k in 1..R {
                outputs[k][q] = turned::<INVERSE>(values[k], turns[k - 1]);
            }
        }
    }
}

#[inline(always)]
fn turned<const INVERSE: bool>(value: Complex64, turn: Complex64) -> Complex64 {
    if INVERSE { value * turn.conj() } else { value * turn }
}

/// `-i v` forward, `i v` inverse.
#[inline(always)]
fn quarter_turn<const INVERSE: bool>(v: Complex64) -> Complex64 {
    if INVERSE { Complex64::new(-v.im, v.re) } else { Complex64::new(v.im, -v.re) }
}

#[inline(always)]
fn butterfly4<const INVERSE: bool>([a, b, c, d]: [Complex64; 4]) -> [Complex64; 4] {
    let (sum, difference) = (a + c, a - c);
    let (other_sum, turned) = (b + d, quarter_turn::<INVERSE>(b - d));
    [sum + other_sum, difference + turned, sum - other_sum, difference - turned]
}

#[inline(always)]
fn butterfly3<const INVERSE: bool>([a, b, c]: [Complex64; 3]) -> [Complex64; 3] {
    /// sin(2 pi / 3).
    const SIN: f64 = 0.866_025_403_784_438_6;
    let sum = b + c;
    let middle = a - sum * 0.5;
    let side = quarter_turn::<INVERSE>(b - c) * SIN;
    [a + sum, middle + side, middle - side]
}

#[inline(always)]
fn butterfly5<const INVERSE: bool>([a, b, c, d, e]: [Complex64; 5]) -> [Complex64; 5] {
    /// cos and sin of 2 pi / 5 and 4 pi / 5.
    const COS: [f64; 2] = [0.309_016_994_374_947_45, -0.809_016_994_374_947_5];
    const SIN: [f64; 2] = [0.951_056_516_295_153_5, 0.587_785_252_292_473_1];
    let (outer, inner) = (b + e, c + d);
    let (outer_side, inner_side) = (quarter_turn::<INVERSE>(b - e), quarter_turn::<INVERSE>(c - d));
    let first = a + outer * COS[0] + inner * COS[1];
    let second = a + outer * COS[1] + inner * COS[0];
    let first_side = outer_side * SIN[0] + inner_side * SIN[1];
    let second_side = outer_side * SIN[1] - inner_side * SIN[0];
    [a + outer + inner, first + first_side, second + second_side, second - second_side, first - first_side]
}
