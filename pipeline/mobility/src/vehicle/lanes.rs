//! Points and wheels in groups of four, for vectors of four numbers ([`sastrugi_numeric::simd`]).
//!
//! Heights below contact points are independent of each other, so four are computed side by side. What follows from those that
//! touch is summed one point after the other, in their order: the result is bit for bit that of one point at a time. So are the contacts of
//! four wheels ([`Four`]).

use super::vector::{Number, Vec3};
use pulp::{Simd, cast};
use std::ops::{Add, Div, Mul, Sub};

/// Number of points side by side.
pub(crate) const LANES: usize = 4;

/// One to four points, coordinate by coordinate. Vacant lanes repeat the last point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quad {
    pub x: [f64; LANES],
    pub y: [f64; LANES],
    pub z: [f64; LANES],
    /// Number of points.
    pub len: usize,
}

impl Quad {
    /// The points in groups of four, in order; the last group may be smaller.
    pub(crate) fn of(points: &[Vec3]) -> impl Iterator<Item = Self> + '_ {
        points.chunks(LANES).map(|points| {
            let axis = |axis: usize| std::array::from_fn(|lane| points[lane.min(points.len() - 1)][axis]);
            Self { x: axis(0), y: axis(1), z: axis(2), len: points.len() }
        })
    }

    /// The points, in order.
    pub(crate) fn points(&self) -> impl Iterator<Item = Vec3> + '_ {
        (0..self.len).map(move |lane| [self.x[lane], self.y[lane], self.z[lane]])
    }
}

/// Four numbers with the operators of one.
#[derive(Clone, Copy)]
pub(crate) struct Four<S: Simd> {
    simd: S,
    numbers: S::f64s,
}

impl<S: Simd> Four<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, numbers: [f64; LANES]) -> Self {
        Self { simd, numbers: cast(numbers) }
    }

    /// The same number four times.
    #[inline(always)]
    pub(crate) fn repeated(simd: S, number: f64) -> Self {
        Self { simd, numbers: simd.splat_f64s(number) }
    }

    /// The numbers one by one.
    #[inline(always)]
    pub(crate) fn apart(self) -> [f64; LANES] {
        cast(self.numbers)
    }
}

/// Implements an operator of [`Four`].
macro_rules! operator {
    ($operator:ident, $method:ident, $of_four:ident) => {
        impl<S: Simd> $operator for Four<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self { simd: self.simd, numbers: self.simd.$of_four(self.numbers, other.numbers) }
            }
        }
    };
}

operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl<S: Simd> Number for Four<S> {
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self { simd: self.simd, numbers: self.simd.sqrt_f64s(self.numbers) }
    }

    #[inline(always)]
    fn recip(self) -> Self {
        Self::repeated(self.simd, 1.0) / self
    }
}

/// Four vectors side by side.
#[inline(always)]
pub(crate) fn beside<S: Simd>(simd: S, [a, b, c, d]: [Vec3; LANES]) -> Vec3<Four<S>> {
    [
        Four::new(simd, [a[0], b[0], c[0], d[0]]),
        Four::new(simd, [a[1], b[1], c[1], d[1]]),
        Four::new(simd, [a[2], b[2], c[2], d[2]]),
    ]
}

/// The same vector four times.
#[inline(always)]
pub(crate) fn repeated<S: Simd>(simd: S, [x, y, z]: Vec3) -> Vec3<Four<S>> {
    [Four::repeated(simd, x), Four::repeated(simd, y), Four::repeated(simd, z)]
}

/// Four vectors one by one.
#[inline(always)]
pub(crate) fn apart<S: Simd>([x, y, z]: Vec3<Four<S>>) -> [Vec3; LANES] {
    let (x, y, z) = (x.apart(), y.apart(), z.apart());
    [[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]], [x[3], y[3], z[3]]]
}

/// True if no point lies below the ground or over ground without data.
#[inline(always)]
pub(crate) fn all_clear(overlaps: &[f64; LANES]) -> bool {
    // Without short cuts: one branch for all four.
    (overlaps[0] <= 0.0) & (overlaps[1] <= 0.0) & (overlaps[2] <= 0.0) & (overlaps[3] <= 0.0)
}

/// True if any point lies over ground without data.
#[inline(always)]
pub(crate) fn any_unknown(overlaps: &[f64; LANES]) -> bool {
    overlaps[0].is_nan() | overlaps[1].is_nan() | overlaps[2].is_nan() | overlaps[3].is_nan()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_groups_hold_all_points_in_order() {
        let points: Vec<Vec3> = (0..13).map(|k| [f64::from(k), 0.5, -f64::from(k)]).collect();
        for count in 1..points.len() {
            let quads: Vec<Quad> = Quad::of(&points[..count]).collect();
            assert_eq!(quads.len(), count.div_ceil(LANES));
            let back: Vec<Vec3> = quads.iter().flat_map(Quad::points).collect();
            assert_eq!(back, points[..count]);
            let last = quads.last().unwrap();
            assert_eq!((last.x[LANES - 1], last.z[LANES - 1]), (points[count - 1][0], points[count - 1][2]));
        }
    }

    #[test]
    fn val_a_touching_or_unknown_point_is_not_clear() {
        assert!(all_clear(&[-1.0, 0.0, -0.0, f64::NEG_INFINITY]));
        for lane in 0..LANES {
            for overlap in [1e-300, f64::NAN] {
                let mut overlaps = [-1.0; LANES];
                overlaps[lane] = overlap;
                assert!(!all_clear(&overlaps), "{lane} {overlap}");
                assert_eq!(any_unknown(&overlaps), overlap.is_nan(), "{lane} {overlap}");
            }
        }
    }
}
