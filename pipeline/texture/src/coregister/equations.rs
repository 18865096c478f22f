//! Normal equations of a round of co-registration.

use crate::fit::least_squares::Cholesky;
use sastrugi_numeric::sums;

/// Number of unknowns: two offsets, raise, two tilts.
pub const UNKNOWNS: usize = 5;
/// Smallest eigenvalue of the normal equations with unit diagonal below which the unknowns count as dependent.
const DEPENDENT: f64 = 1e-9;

/// Sums over cells: `sum w z z'`, `sum w z b'` (row-major), `sum w z d`, and the sum of the derivatives of `w d` with respect to d.
#[derive(Clone, Debug)]
pub struct Equations(pub [f64; Self::LEN]);

impl Equations {
    const SQUARE: usize = UNKNOWNS * UNKNOWNS;
    pub const DERIVATIVES: usize = 2 * Self::SQUARE + UNKNOWNS;
    const LEN: usize = Self::DERIVATIVES + 1;
    pub const NONE: Self = Self([0.0; Self::LEN]);

    pub fn add(&mut self, z: &[f64; UNKNOWNS], b: &[f64; UNKNOWNS], weight: f64, difference: f64) {
        for i in 0..UNKNOWNS {
            for j in 0..UNKNOWNS {
                self.0[i * UNKNOWNS + j] += weight * z[i] * z[j];
                self.0[Self::SQUARE + i * UNKNOWNS + j] += weight * z[i] * b[j];
            }
            self.0[2 * Self::SQUARE + i] += weight * z[i] * difference;
        }
    }

    /// Sum in a fixed order.
    pub fn sum(all: &[Self]) -> Self {
        let mut total = Self::NONE;
        for (k, sum) in total.0.iter_mut().enumerate() {
            *sum = sums::sum(&all.iter().map(|e| e.0[k]).collect::<Vec<_>>());
        }
        total
    }

    /// `self` minus `others`.
    pub fn without(&self, others: &Self) -> Self {
        let mut rest = self.clone();
        rest.0.iter_mut().zip(&others.0).for_each(|(rest, other)| *rest -= other);
        rest
    }

    /// Sum of the weights.
    pub fn weight(&self) -> f64 {
        self.0[2 * (UNKNOWNS + 1)]
    }

    /// Sensitivity of the score to the unknowns relative to fixed weights: mean derivative of `w d` over mean w (Huber, 1981,
    /// section 7.6).
    pub fn slackening(&self) -> f64 {
        self.0[Self::DERIVATIVES] / self.weight()
    }

    fn square(&self, from: usize, first: usize) -> Vec<f64> {
        let rows = first..UNKNOWNS;
        rows.clone().flat_map(|i| rows.clone().map(move |j| self.0[from + i * UNKNOWNS + j])).collect()
    }

    fn score(&self, first: usize) -> &[f64] {
        &self.0[2 * Self::SQUARE + first..Self::DERIVATIVES]
    }

    /// Gauss-Newton step of the unknowns from `first` on; `None` if they are not identifiable.
    pub fn downhill(&self, first: usize) -> Option<Vec<f64>> {
        let n = UNKNOWNS - first;
        let normal = self.square(0, first);
        let mut scaled: Vec<f64> =
            (0..n * n).map(|k| normal[k] / (normal[k / n * (n + 1)] * normal[k % n * (n + 1)]).sqrt()).collect();
        (0..n).for_each(|k| scaled[k * (n + 1)] -= DEPENDENT);
        Cholesky::new(&scaled, n)?;
        Some(Cholesky::new(&normal, n)?.solve(self.score(first)))
    }

    /// Step of the unknowns from `first` on with the slopes of both DEMs; `None` if the matrix of their products is singular.
    pub fn straight(&self, first: usize) -> Option<Vec<f64>> {
        solve(self.square(Self::SQUARE, first), self.score(first).to_vec())
    }
}

/// Solution of `m x = v` by elimination with row pivoting; `None` if m is singular.
fn solve(mut m: Vec<f64>, mut v: Vec<f64>) -> Option<Vec<f64>> {
    let n = v.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| m[i * n + k].abs().total_cmp(&m[j * n + k].abs()))?;
        (0..n).for_each(|j| m.swap(k * n + j, pivot * n + j));
        v.swap(k, pivot);
        for i in k + 1..n {
            let factor = m[i * n + k] / m[k * n + k];
            (k..n).for_each(|j| m[i * n + j] -= factor * m[k * n + j]);
            v[i] -= factor * v[k];
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| m[k * n + j] * v[j]).sum();
        v[k] = (v[k] - known) / m[k * n + k];
    }
    v.iter().all(|x| x.is_finite()).then_some(v)
}
