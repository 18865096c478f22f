//! Normal equations with three unknowns.

use crate::direction::Vector;

/// A symmetric 3 x 3 matrix: `[xx, xy, xz, yy, yz, zz]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Symmetric3(pub [f64; 6]);

impl Symmetric3 {
    /// A diagonal matrix.
    pub fn diagonal(d: Vector) -> Self {
        Self([d[0], 0.0, 0.0, d[1], 0.0, d[2]])
    }

    /// Adds `weight` times the outer product of a row with itself.
    #[inline]
    pub fn add(&mut self, row: Vector, weight: f64) {
        let [x, y, z] = row;
        let products = [x * x, x * y, x * z, y * y, y * z, z * z];
        self.0.iter_mut().zip(products).for_each(|(m, p)| *m += weight * p);
    }

    /// The matrix with its diagonal scaled by `1 + damping`.
    pub fn damped(mut self, damping: f64) -> Self {
        [0, 3, 5].into_iter().for_each(|k| self.0[k] *= 1.0 + damping);
        self
    }

    /// `D M D` for a diagonal matrix `D`.
    pub fn scaled(self, d: Vector) -> Self {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        Self([
            xx * d[0] * d[0],
            xy * d[0] * d[1],
            xz * d[0] * d[2],
            yy * d[1] * d[1],
            yz * d[1] * d[2],
            zz * d[2] * d[2],
        ])
    }

    /// Product with a vector.
    pub fn times(&self, v: Vector) -> Vector {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        [xx * v[0] + xy * v[1] + xz * v[2], xy * v[0] + yy * v[1] + yz * v[2], xz * v[0] + yz * v[1] + zz * v[2]]
    }

    /// Inverse by cofactors; `None` if the matrix is not positive definite.
    pub fn inverse(&self) -> Option<Self> {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        let (a, b, c) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let determinant = xx * a + xy * b + xz * c;
        let inverse = [a, b, c, xx * zz - xz * xz, xz * xy - xx * yz, xx * yy - xy * xy].map(|v| v / determinant);
        let positive = xx > 0.0 && inverse[5] > 0.0 && determinant > 0.0;
        (positive && inverse.iter().all(|v| v.is_finite())).then_some(Self(inverse))
    }

    /// Eigenvalues in ascending order, by the trigonometric formula for symmetric matrices (O. K. Smith, Eigenvalues of a symmetric 3 x 3
    /// matrix, Communications of the ACM 4, 1961).
    pub fn eigenvalues(&self) -> Vector {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        let mean = (xx + yy + zz) / 3.0;
        let [a, b, c] = [xx - mean, yy - mean, zz - mean];
        let spread = ((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0).sqrt();
        if spread.is_nan() || spread <= 1e-300 {
            return [mean; 3];
        }
        let determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
        let cosine = (0.5 * determinant / (spread * spread * spread)).clamp(-1.0, 1.0);
        let angle = libm::acos(cosine) / 3.0;
        let high = mean + 2.0 * spread * libm::cos(angle);
        let low = mean + 2.0 * spread * libm::cos(angle + 2.0 * std::f64::consts::PI / 3.0);
        [low, 3.0 * mean - high - low, high]
    }

    /// Square root of the ratio of the largest to the smallest eigenvalue: the condition number of the rows of which this is the normal matrix.
    pub fn condition(&self) -> f64 {
        let [low, _, high] = self.eigenvalues();
        if low > 0.0 { (high / low).sqrt() } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Symmetric3 {
        let mut m = Symmetric3::default();
        [[1.0, 2.0, -0.5], [0.3, -1.0, 4.0], [2.0, 0.1, 0.2]].into_iter().for_each(|row| m.add(row, 1.5));
        m
    }

    #[test]
    fn val_inverse_times_matrix_is_the_identity() {
        let (m, inverse) = (sample(), sample().inverse().unwrap());
        for k in 0..3 {
            let mut unit = [0.0; 3];
            unit[k] = 1.0;
            let back = inverse.times(m.times(unit));
            assert!((0..3).all(|j| (back[j] - unit[j]).abs() < 1e-13));
        }
        assert_eq!(Symmetric3::diagonal([1.0, 0.0, 1.0]).inverse(), None);
    }

    /// Sum, sum of products and product of the eigenvalues are the coefficients of the characteristic polynomial.
    #[test]
    fn val_eigenvalues_are_roots_of_the_polynomial() {
        let m = sample();
        let [xx, xy, xz, yy, yz, zz] = m.0;
        let [a, b, c] = m.eigenvalues();
        assert!(a <= b && b <= c);
        let minors = xx * yy + xx * zz + yy * zz - xy * xy - xz * xz - yz * yz;
        let determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
        for (got, want) in [(a + b + c, xx + yy + zz), (a * b + a * c + b * c, minors), (a * b * c, determinant)] {
            assert!((got / want - 1.0).abs() < 1e-12, "{got} {want}");
        }
        assert_eq!(Symmetric3::diagonal([2.0, 2.0, 2.0]).eigenvalues(), [2.0; 3]);
        assert!((Symmetric3::diagonal([1.0, 100.0, 25.0]).condition() - 10.0).abs() < 1e-9);
    }
}
