//! Directions from azimuth and elevation, and vector arithmetic.

/// A vector `[east, north, up]`.
pub type Vector = [f64; 3];

/// Unit vector towards an azimuth (clockwise from north, deg) and an elevation above the horizon (deg).
///
/// ```
/// use sastrugi_imaging::direction;
///
/// let [east, north, up] = direction(90.0, 30.0);
/// assert!((east - 0.75f64.sqrt()).abs() < 1e-15 && north.abs() < 1e-15 && (up - 0.5).abs() < 1e-15);
/// ```
pub fn direction(azimuth_deg: f64, elevation_deg: f64) -> Vector {
    let (azimuth, elevation) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
    let across = libm::cos(elevation);
    [libm::sin(azimuth) * across, libm::cos(azimuth) * across, libm::sin(elevation)]
}

/// Scalar product.
#[inline]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Difference.
pub fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a + t b`.
pub fn along(a: Vector, t: f64, b: Vector) -> Vector {
    [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]]
}

/// The unit vector in the direction of `a`, which must not be 0.
pub fn unit(a: Vector) -> Vector {
    let length = dot(a, a).sqrt();
    a.map(|v| v / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_azimuth_is_clockwise_from_north() {
        let near = |a: Vector, b: Vector| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-15);
        assert!(near(direction(0.0, 0.0), [0.0, 1.0, 0.0]));
        assert!(near(direction(90.0, 0.0), [1.0, 0.0, 0.0]));
        assert!(near(direction(123.0, 90.0), [0.0, 0.0, 1.0]));
        assert!(near(direction(270.0, 45.0), [-0.5f64.sqrt(), 0.0, 0.5f64.sqrt()]));
    }

    #[test]
    fn val_products_follow_the_right_hand_rule() {
        assert_eq!(cross([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
        assert_eq!(dot([1.0, 2.0, 3.0], [4.0, -5.0, 6.0]), 12.0);
        assert_eq!(unit([0.0, 3.0, 4.0]), [0.0, 0.6, 0.8]);
    }
}
