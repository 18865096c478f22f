//! Sine and cosine of many angles, given in turns, with the same bits as one at a time.
//!
//! An angle of `u` turns is split exactly into `j` quarter turns and a remainder of at most an eighth of a turn. The sine and cosine of
//! the remainder come from the polynomials of FreeBSD's `k_sin.c` and `k_cos.c` (Sun Microsystems 1993, errors below 2^-58). The error of
//! the result is below 2e-16, less than that of a sine of the rounded product `2 pi u`. Only `+ - *` are used, so that the compiler can
//! vectorise the loop and the CPU changes no bit.

use crate::simd::Vectors;
use pulp::{Simd, WithSimd};
use std::f64::consts::FRAC_PI_2;

/// Sine and cosine of `2 pi turns`, for less than 2^49 turns in either direction.
#[inline(always)]
fn sincos(turns: f64) -> (f64, f64) {
    /// Adding this number leaves no fractional bits, and the last bits of the sum are those of the integer.
    const ROUND: f64 = 1.5 * (1u64 << 52) as f64;
    let quarters = 4.0 * turns;
    let rounded = quarters + ROUND;
    let angle = (quarters - (rounded - ROUND)) * FRAC_PI_2;
    let (sin, cos) = (sin_of_eighth(angle), cos_of_eighth(angle));
    let quarter = rounded.to_bits();
    let (first, second) = if quarter & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let sign = |quarter: u64| (quarter & 2) << 62;
    (f64::from_bits(first.to_bits() ^ sign(quarter)), f64::from_bits(second.to_bits() ^ sign(quarter.wrapping_add(1))))
}

/// Sine of an angle of at most pi / 4.
#[inline(always)]
fn sin_of_eighth(x: f64) -> f64 {
    const S: [f64; 6] = [
        -1.666_666_666_666_663_2e-1,
        8.333_333_333_322_49e-3,
        -1.984_126_982_985_795e-4,
        2.755_731_370_707_006_8e-6,
        -2.505_076_025_340_686_3e-8,
        1.589_690_995_211_55e-10,
    ];
    let z = x * x;
    x + z * x * (S[0] + z * (S[1] + z * (S[2] + z * (S[3] + z * (S[4] + z * S[5])))))
}

/// Cosine of an angle of at most pi / 4.
#[inline(always)]
fn cos_of_eighth(x: f64) -> f64 {
    const C: [f64; 6] = [
        4.166_666_666_666_66e-2,
        -1.388_888_888_887_411e-3,
        2.480_158_728_947_673e-5,
        -2.755_731_435_139_066_3e-7,
        2.087_572_321_298_175e-9,
        -1.135_964_755_778_819_5e-11,
    ];
    let z = x * x;
    let half = 0.5 * z;
    let most = 1.0 - half;
    // The rounding error of the subtraction is added back with the polynomial.
    most + ((1.0 - most - half) + z * z * (C[0] + z * (C[1] + z * (C[2] + z * (C[3] + z * (C[4] + z * C[5]))))))
}

/// Sine and cosine of `2 pi turns` for each value of `turns`.
///
/// ```
/// let turns = [0.0, 0.25, 0.5, -0.25, 0.125];
/// let (mut sin, mut cos) = ([0.0; 5], [0.0; 5]);
/// sastrugi_numeric::turns::sincos_each(&turns, &mut sin, &mut cos);
/// // Quarter turns are exact.
/// assert_eq!((&sin[..4], &cos[..4]), (&[0.0, 1.0, 0.0, -1.0][..], &[1.0, 0.0, -1.0, 0.0][..]));
/// assert!((sin[4] - 0.5_f64.sqrt()).abs() < 1e-15);
/// ```
///
/// # Panics
/// If the slices differ in length.
pub fn sincos_each(turns: &[f64], sin: &mut [f64], cos: &mut [f64]) {
    Vectors::best().run(Each { turns, sin, cos });
}

struct Each<'a> {
    turns: &'a [f64],
    sin: &'a mut [f64],
    cos: &'a mut [f64],
}

impl WithSimd for Each<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { turns, sin, cos } = self;
        assert_eq!((turns.len(), turns.len()), (sin.len(), cos.len()), "slices must have the same length");
        for k in 0..turns.len() {
            (sin[k], cos[k]) = sincos(turns[k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::streams::Streams;

    fn angles(n: usize) -> Vec<f64> {
        let mut angles = vec![0.0; n];
        Streams::for_seed(1, "turns-test").stream("angles").fill_uniform(&mut angles);
        angles
    }

    /// Independent reference: `libm` for the remainder from the nearest quarter turn, where its argument is rounded to 2^-54.
    #[test]
    fn val_equals_libm() {
        let edges = (0..=4096).map(|k| f64::from(k) / 4096.0);
        let beside = [0.125, 0.375, 0.625, 0.875].map(|u: f64| [u.next_down(), u.next_up()]);
        for u in angles(1_000_000).into_iter().chain(edges).chain(beside.into_iter().flatten()) {
            let quarter = (4.0 * u).round();
            let (s, c) = libm::sincos((4.0 * u - quarter) * FRAC_PI_2);
            let wanted = [(s, c), (c, -s), (-s, -c), (-c, s)][quarter as usize % 4];
            let (sin, cos) = sincos(u);
            assert!((sin - wanted.0).abs() <= 1.2e-16 && (cos - wanted.1).abs() <= 1.2e-16, "{u}: {sin} {cos}");
            assert!((sin * sin + cos * cos - 1.0).abs() < 5e-16, "{u}");
        }
    }

    #[test]
    fn val_quarters_are_exact() {
        let wanted = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)];
        for k in -8i32..8 {
            assert_eq!(sincos(0.25 * f64::from(k)), wanted[k.rem_euclid(4) as usize], "{k}");
        }
    }

    /// Wide vectors, those of the baseline, and one value at a time.
    #[test]
    fn prop_vectors_change_no_bit() {
        let turns = angles(10_007);
        let [mut sin, mut cos, mut sin_base, mut cos_base] = [(); 4].map(|()| vec![0.0; turns.len()]);
        sincos_each(&turns, &mut sin, &mut cos);
        Vectors::Baseline.run(Each { turns: &turns, sin: &mut sin_base, cos: &mut cos_base });
        for (k, u) in turns.iter().enumerate() {
            let (s, c) = sincos(*u);
            assert_eq!([sin[k], cos[k]].map(f64::to_bits), [s, c].map(f64::to_bits), "{u}");
            assert_eq!([sin_base[k], cos_base[k]].map(f64::to_bits), [s, c].map(f64::to_bits), "{u}");
        }
    }

    #[test]
    #[should_panic(expected = "slices must have the same length")]
    fn val_short_slices_are_refused() {
        sincos_each(&[0.0; 3], &mut [0.0; 3], &mut [0.0; 2]);
    }
}
