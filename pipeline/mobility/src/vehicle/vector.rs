//! Vectors and rotations in three dimensions, using only `+ - * /` and `sqrt`. A vector consists of numbers, or of numbers side by side.

use std::ops::{Add, Div, Mul, Sub};

/// A number, or several side by side ([`super::lanes::Four`]), on which every operation has the bits of the same operation on each.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The square root.
    fn sqrt(self) -> Self;

    /// One divided by it.
    fn recip(self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }

    #[inline(always)]
    fn recip(self) -> Self {
        1.0 / self
    }
}

/// A vector `[x, y, z]`.
pub(crate) type Vec3<T = f64> = [T; 3];

#[inline(always)]
pub(crate) fn add<T: Number>(a: Vec3<T>, b: Vec3<T>) -> Vec3<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn sub<T: Number>(a: Vec3<T>, b: Vec3<T>) -> Vec3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn scale<T: Number>(a: Vec3<T>, s: T) -> Vec3<T> {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// `a + s b`
#[inline(always)]
pub(crate) fn add_scaled<T: Number>(a: Vec3<T>, b: Vec3<T>, s: T) -> Vec3<T> {
    [a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s]
}

#[inline(always)]
pub(crate) fn dot<T: Number>(a: Vec3<T>, b: Vec3<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross<T: Number>(a: Vec3<T>, b: Vec3<T>) -> Vec3<T> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(crate) fn norm<T: Number>(a: Vec3<T>) -> T {
    dot(a, a).sqrt()
}

/// A quaternion `[x, y, z, w]`.
pub(crate) type Quaternion = [f64; 4];

/// The unit quaternion in the direction of `q`.
#[inline(always)]
pub(crate) fn normalised(q: Quaternion) -> Quaternion {
    let inverse = 1.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    q.map(|c| c * inverse)
}

/// `q` rotated by the rotation vector `turn` (in the frame described by `q`), to first order in `turn`.
#[inline(always)]
pub(crate) fn turned(q: Quaternion, turn: Vec3) -> Quaternion {
    let [x, y, z, w] = q;
    let [a, b, c] = scale(turn, 0.5);
    normalised([
        x + w * a + y * c - z * b,
        y + w * b + z * a - x * c,
        z + w * c + x * b - y * a,
        w - x * a - y * b - z * c,
    ])
}

/// Axes of a body in the map frame: the columns of its rotation matrix.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axes {
    /// Forward.
    pub x: Vec3,
    /// Left.
    pub y: Vec3,
    /// Up.
    pub z: Vec3,
}

impl Axes {
    #[inline(always)]
    pub(crate) fn of([x, y, z, w]: Quaternion) -> Self {
        Self {
            x: [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
            y: [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
            z: [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
        }
    }

    /// A body vector in the map frame.
    #[inline(always)]
    pub(crate) fn to_map(self, v: Vec3) -> Vec3 {
        add_scaled(add_scaled(scale(self.x, v[0]), self.y, v[1]), self.z, v[2])
    }

    /// A map vector in the body frame.
    #[inline(always)]
    pub(crate) fn to_body(self, v: Vec3) -> Vec3 {
        [dot(self.x, v), dot(self.y, v), dot(self.z, v)]
    }

    /// True when pitch or roll exceeds the angle with that sine and cosine (below 90 deg), or the body is upside down.
    #[inline(always)]
    pub(crate) fn are_tipped(&self, (sin_limit, cos_limit): (f64, f64)) -> bool {
        let (pitch_sin, roll_sin, roll_cos) = (self.x[2].abs(), self.y[2].abs(), self.z[2]);
        pitch_sin > sin_limit || roll_sin * cos_limit > roll_cos * sin_limit
    }

    /// The quaternion of a right-handed set of unit axes (Shepperd, 1978: the branch with the largest divisor).
    pub(crate) fn quaternion(self) -> Quaternion {
        let (x, y, z) = (self.x, self.y, self.z);
        let trace = x[0] + y[1] + z[2];
        let q = if trace >= x[0].max(y[1]).max(z[2]) {
            [y[2] - z[1], z[0] - x[2], x[1] - y[0], 1.0 + trace]
        } else if x[0] >= y[1] && x[0] >= z[2] {
            [1.0 + x[0] - y[1] - z[2], x[1] + y[0], z[0] + x[2], y[2] - z[1]]
        } else if y[1] >= z[2] {
            [x[1] + y[0], 1.0 - x[0] + y[1] - z[2], y[2] + z[1], z[0] - x[2]]
        } else {
            [z[0] + x[2], y[2] + z[1], 1.0 - x[0] - y[1] + z[2], x[1] - y[0]]
        };
        normalised(q)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Tolerance: a few rounding errors.
        #[test]
        fn prop_axes_and_quaternion_are_the_same_rotation(q in prop::array::uniform4(-1.0..1.0f64)) {
            prop_assume!(q.iter().map(|c| c * c).sum::<f64>() > 1e-3);
            let q = normalised(q);
            let axes = Axes::of(q);
            prop_assert!(norm(sub(cross(axes.x, axes.y), axes.z)) < 1e-14);
            let back = axes.quaternion();
            let same = (0..4).map(|i| q[i] * back[i]).sum::<f64>().abs();
            prop_assert!((same - 1.0).abs() < 1e-14);
            let v = [0.3, -1.2, 2.5];
            prop_assert!(norm(sub(axes.to_body(axes.to_map(v)), v)) < 1e-14);
        }
    }

    /// A rotation of 1e-4 rad about each axis moves the other two axes by 1e-4, to second order.
    #[test]
    fn val_rotations_follow_the_right_hand_rule() {
        let q = normalised([0.1, -0.2, 0.3, 0.8]);
        let axes = Axes::of(q);
        let turn = Axes::of(turned(q, [0.0, 0.0, 1e-4]));
        assert!(norm(sub(turn.x, add_scaled(axes.x, axes.y, 1e-4))) < 1e-8);
        let turn = Axes::of(turned(q, [1e-4, 0.0, 0.0]));
        assert!(norm(sub(turn.y, add_scaled(axes.y, axes.z, 1e-4))) < 1e-8);
        let turn = Axes::of(turned(q, [0.0, 1e-4, 0.0]));
        assert!(norm(sub(turn.z, add_scaled(axes.z, axes.x, 1e-4))) < 1e-8);
    }
}
