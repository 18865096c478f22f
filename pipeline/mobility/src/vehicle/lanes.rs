//! Points in groups of four, for vectors of four numbers ([`sastrugi_numeric::simd`]).
//!
//! Heights below contact points are independent of each other, so four are computed side by side. What follows from those that
//! touch is summed one point after the other, in their order: the result is bit for bit that of one point at a time.

use super::vector::Vec3;

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
