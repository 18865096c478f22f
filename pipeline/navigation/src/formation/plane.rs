//! Horizontal vectors, x east and y north, m.

use std::f64::consts::FRAC_1_SQRT_2;

#[cfg(test)]
mod tests;

/// A point, a displacement or a direction.
pub type Vector = [f64; 2];

pub fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1]]
}

pub fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1]]
}

pub fn scale(a: Vector, factor: f64) -> Vector {
    [a[0] * factor, a[1] * factor]
}

pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

pub fn distance(a: Vector, b: Vector) -> f64 {
    length(sub(a, b))
}

/// The direction of a displacement; `None` if its length is 0 or not finite.
pub fn direction(a: Vector) -> Option<Vector> {
    let length_m = length(a);
    (length_m > 0.0 && length_m.is_finite()).then(|| scale(a, 1.0 / length_m))
}

/// A direction rotated by 90 degrees to the right.
pub fn to_the_right(a: Vector) -> Vector {
    [a[1], -a[0]]
}

/// A direction rotated to the left by eighths of a turn; negative to the right.
pub fn turned(a: Vector, eighths: i32) -> Vector {
    const H: f64 = FRAC_1_SQRT_2;
    let (cos, sin) = match eighths.rem_euclid(8) {
        0 => (1.0, 0.0),
        1 => (H, H),
        2 => (0.0, 1.0),
        3 => (-H, H),
        4 => (-1.0, 0.0),
        5 => (-H, -H),
        6 => (0.0, -1.0),
        _ => (H, -H),
    };
    [cos * a[0] - sin * a[1], sin * a[0] + cos * a[1]]
}

/// Least distance from the origin of a point that starts at `offset` and moves in a straight line by `motion`.
pub fn closest_approach(offset: Vector, motion: Vector) -> f64 {
    let square = dot(motion, motion);
    let share = if square > 0.0 { (-dot(offset, motion) / square).clamp(0.0, 1.0) } else { 0.0 };
    length(add(offset, scale(motion, share)))
}
