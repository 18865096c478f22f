//! Symmetric matrices of a few dozen rows: powers, and the map from one covariance to another.

/// Sweeps of the rotations; a matrix of this size is diagonal after eight.
const SWEEPS: usize = 16;
/// Smallest eigenvalue over the largest.
pub const FLOOR: f64 = 1e-9;

/// A symmetric matrix, row by row.
#[derive(Clone, Debug)]
pub struct Symmetric {
    /// Number of rows.
    pub size: usize,
    /// `size * size` values.
    pub values: Vec<f64>,
}

impl Symmetric {
    /// The matrix with `f` applied to its eigenvalues, those below [`FLOOR`] of the largest raised to it. By Jacobi's cyclic rotations, in a
    /// fixed order.
    pub fn with_eigenvalues(&self, f: impl Fn(f64) -> f64) -> Self {
        let n = self.size;
        let (eigenvalues, vectors) = self.eigen();
        let least = FLOOR * eigenvalues.iter().fold(0.0, |a, b| f64::max(a, *b));
        let scaled: Vec<f64> = eigenvalues.iter().map(|e| f(e.max(least))).collect();
        let entry =
            |i: usize, j: usize| (0..n).map(|k| vectors[i * n + k] * scaled[k] * vectors[j * n + k]).sum::<f64>();
        Self { size: n, values: (0..n * n).map(|at| entry(at / n, at % n)).collect() }
    }

    /// `self * other * self`.
    fn around(&self, other: &Self) -> Self {
        let values = product(&product(&self.values, &other.values, self.size), &self.values, self.size);
        Self { size: self.size, values }
    }

    /// The symmetric matrix A with `A own A = wanted`: of all linear maps between normal distributions of these covariances, the one that
    /// moves values least (Dowson and Landau 1982).
    pub fn map_between(own: &Self, wanted: &Self) -> Self {
        let root = wanted.with_eigenvalues(f64::sqrt);
        let inner = root.around(own).with_eigenvalues(|e| 1.0 / e.sqrt());
        root.around(&inner)
    }

    /// Eigenvalues, and eigenvectors as columns.
    fn eigen(&self) -> (Vec<f64>, Vec<f64>) {
        let n = self.size;
        let mut a = self.values.clone();
        let mut vectors: Vec<f64> = (0..n * n).map(|at| if at / n == at % n { 1.0 } else { 0.0 }).collect();
        for _ in 0..SWEEPS {
            for p in 0..n {
                for q in p + 1..n {
                    rotate(&mut a, &mut vectors, n, p, q);
                }
            }
        }
        ((0..n).map(|k| a[k * n + k]).collect(), vectors)
    }
}

fn product(a: &[f64], b: &[f64], n: usize) -> Vec<f64> {
    let entry = |i: usize, j: usize| (0..n).map(|k| a[i * n + k] * b[k * n + j]).sum::<f64>();
    (0..n * n).map(|at| entry(at / n, at % n)).collect()
}

/// Sets `a[p][q]` to 0 by a rotation (Golub and Van Loan 2013, section 8.5.2).
fn rotate(a: &mut [f64], vectors: &mut [f64], n: usize, p: usize, q: usize) {
    let off = a[p * n + q];
    if off == 0.0 {
        return;
    }
    let tau = (a[q * n + q] - a[p * n + p]) / (2.0 * off);
    let tangent = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
    let cos = 1.0 / (1.0 + tangent * tangent).sqrt();
    let sin = tangent * cos;
    let turn = |x: f64, y: f64| (cos * x - sin * y, sin * x + cos * y);
    for k in 0..n {
        (a[k * n + p], a[k * n + q]) = turn(a[k * n + p], a[k * n + q]);
    }
    for k in 0..n {
        (a[p * n + k], a[q * n + k]) = turn(a[p * n + k], a[q * n + k]);
    }
    for k in 0..n {
        (vectors[k * n + p], vectors[k * n + q]) = turn(vectors[k * n + p], vectors[k * n + q]);
    }
    (a[p * n + q], a[q * n + p]) = (0.0, 0.0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    /// `B B'` of normal numbers, with 1 added on the diagonal.
    fn covariance(n: usize, purpose: &str) -> Symmetric {
        let mut stream = Streams::for_seed(1, "symmetric-test").stream(purpose);
        let b: Vec<f64> = (0..n * n).map(|_| stream.normal()).collect();
        let entry = |i: usize, j: usize| (0..n).map(|k| b[i * n + k] * b[j * n + k]).sum::<f64>();
        let values = (0..n * n).map(|at| entry(at / n, at % n) + f64::from(at / n == at % n)).collect();
        Symmetric { size: n, values }
    }

    /// By hand: (2 1; 1 2) has eigenvalues 3 and 1, so that its square is (5 4; 4 5).
    #[test]
    fn val_powers_by_hand() {
        let found = Symmetric { size: 2, values: vec![2.0, 1.0, 1.0, 2.0] }.with_eigenvalues(|e| e * e).values;
        assert!(found.iter().zip([5.0, 4.0, 4.0, 5.0]).all(|(a, b)| (a - b).abs() < 1e-13), "{found:?}");
    }

    /// `A own A = wanted`, A symmetric; the map from a covariance to itself is the identity.
    #[test]
    fn prop_maps_between_covariances() {
        for n in [1, 4, 16, 24] {
            let (own, wanted) = (covariance(n, "own"), covariance(n, "wanted"));
            let map = Symmetric::map_between(&own, &wanted);
            let reached = map.around(&own);
            for (at, (found, expected)) in reached.values.iter().zip(&wanted.values).enumerate() {
                assert!((found - expected).abs() < 1e-8 * n as f64, "{n}: {found} {expected}");
                assert!((map.values[at] - map.values[at % n * n + at / n]).abs() < 1e-9);
            }
            let still = Symmetric::map_between(&own, &own);
            assert!((0..n * n).all(|at| (still.values[at] - f64::from(at / n == at % n)).abs() < 1e-7));
        }
    }

    /// A singular covariance is raised to the floor rather than divided by zero.
    #[test]
    fn val_singular_covariances_are_raised() {
        let flat = Symmetric { size: 2, values: vec![1.0, 1.0, 1.0, 1.0] };
        let found = flat.with_eigenvalues(|e| 1.0 / e);
        assert!(found.values.iter().all(|v| v.is_finite()));
    }
}
