//! Transforms of 2 to 5 points, for single complex numbers or several side by side.
//!
//! Both use the same sums and products in the same order, so their bits are equal.

use super::Complex64;
use std::ops::{Add, Sub};

/// A complex number, or several that are processed together.
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> {
    /// Multiplied by a real number.
    fn scaled(self, by: f64) -> Self;

    /// Multiplied by `turn`, or by its conjugate in an inverse transform.
    fn turned<const INVERSE: bool>(self, turn: Complex64) -> Self;

    /// `self + t` and `self - t`, where `t` is `-i side`, or `i side` in an inverse transform.
    fn either_side<const INVERSE: bool>(self, side: Self) -> [Self; 2];
}

impl Number for Complex64 {
    #[inline(always)]
    fn scaled(self, by: f64) -> Self {
        self * by
    }

    #[inline(always)]
    fn turned<const INVERSE: bool>(self, turn: Self) -> Self {
        if INVERSE { self * turn.conj() } else { self * turn }
    }

    #[inline(always)]
    fn either_side<const INVERSE: bool>(self, side: Self) -> [Self; 2] {
        let right = Self::new(self.re + side.im, self.im - side.re);
        let left = Self::new(self.re - side.im, self.im + side.re);
        if INVERSE { [left, right] } else { [right, left] }
    }
}

/// The transform of `R` points.
pub struct Butterfly<const R: usize, const INVERSE: bool>;

/// A transform of `R` points. It is a trait because its method is certain to be inlined, whereas a closure could be compiled as a
/// separate function without wide vectors.
pub trait Radix<const R: usize> {
    fn apply<N: Number>(points: [N; R]) -> [N; R];
}

impl<const INVERSE: bool> Radix<1> for Butterfly<1, INVERSE> {
    #[inline(always)]
    fn apply<N: Number>(points: [N; 1]) -> [N; 1] {
        points
    }
}

impl<const INVERSE: bool> Radix<2> for Butterfly<2, INVERSE> {
    #[inline(always)]
    fn apply<N: Number>([a, b]: [N; 2]) -> [N; 2] {
        [a + b, a - b]
    }
}

impl<const INVERSE: bool> Radix<3> for Butterfly<3, INVERSE> {
    #[inline(always)]
    fn apply<N: Number>([a, b, c]: [N; 3]) -> [N; 3] {
        /// sin(2 pi / 3).
        const SIN: f64 = 0.866_025_403_784_438_6;
        let sum = b + c;
        let middle = a - sum.scaled(0.5);
        let [first, second] = middle.either_side::<INVERSE>((b - c).scaled(SIN));
        [a + sum, first, second]
    }
}

impl<const INVERSE: bool> Radix<4> for Butterfly<4, INVERSE> {
    #[inline(always)]
    fn apply<N: Number>([a, b, c, d]: [N; 4]) -> [N; 4] {
        let (sum, other_sum) = (a + c, b + d);
        let [first, third] = (a - c).either_side::<INVERSE>(b - d);
        [sum + other_sum, first, sum - other_sum, third]
    }
}

impl<const INVERSE: bool> Radix<5> for Butterfly<5, INVERSE> {
    #[inline(always)]
    fn apply<N: Number>([a, b, c, d, e]: [N; 5]) -> [N; 5] {
        /// cos and sin of 2 pi / 5 and 4 pi / 5.
        const COS: [f64; 2] = [0.309_016_994_374_947_45, -0.809_016_994_374_947_5];
        const SIN: [f64; 2] = [0.951_056_516_295_153_5, 0.587_785_252_292_473_1];
        let (outer, inner) = (b + e, c + d);
        let (outer_side, inner_side) = (b - e, c - d);
        let first = a + outer.scaled(COS[0]) + inner.scaled(COS[1]);
        let second = a + outer.scaled(COS[1]) + inner.scaled(COS[0]);
        let [first, fourth] = first.either_side::<INVERSE>(outer_side.scaled(SIN[0]) + inner_side.scaled(SIN[1]));
        let [second, third] = second.either_side::<INVERSE>(outer_side.scaled(SIN[1]) - inner_side.scaled(SIN[0]));
        [a + outer + inner, first, second, third, fourth]
    }
}
