//! Nonlinear least squares with a handful of parameters.

/// Largest number of steps.
const STEPS: usize = 60;
/// Relative fall of the sum of squares below which the search ends.
const TOLERANCE: f64 = 1e-12;
/// Step of the difference quotients: parameters are logarithms, so this is relative.
const DIFFERENCE: f64 = 1e-6;

/// End of a search.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// Parameters.
    pub at: Vec<f64>,
    /// Sum of squares there.
    pub value: f64,
    /// Steps taken.
    pub steps: usize,
}

/// Minimises the sum of squared `residuals(p)` by Levenberg (1944) and Marquardt (1963), with forward differences, from
/// `start`, inside `bounds` (steps are cut to them).
pub fn minimise(start: &[f64], bounds: &[(f64, f64)], residuals: impl Fn(&[f64]) -> Vec<f64>) -> Minimum {
    let squares = |r: &[f64]| r.iter().map(|v| v * v).sum::<f64>();
    let mut at = start.to_vec();
    let mut current = residuals(&at);
    let (mut damping, mut steps) = (1e-3, 0);
    while steps < STEPS {
        steps += 1;
        let (normal, gradient) = normal_equations(&at, &current, &residuals);
        let mut improved = None;
        while improved.is_none() && damping < 1e12 {
            let trial = damped_step(&at, bounds, &normal, &gradient, damping);
            let there = residuals(&trial);
            if squares(&there) < squares(&current) {
                improved = Some((trial, there));
                damping *= 0.1;
            } else {
                damping *= 10.0;
            }
        }
        let Some((trial, there)) = improved else { break };
        let fall = squares(&current) - squares(&there);
        (at, current) = (trial, there);
        if fall <= TOLERANCE * squares(&current) {
            break;
        }
    }
    Minimum { value: squares(&current), at, steps }
}

/// `J'J` of the residuals at a point, row-major: half the curvature of the sum of squares.
pub fn curvature(at: &[f64], residuals: impl Fn(&[f64]) -> Vec<f64>) -> Vec<f64> {
    let here = residuals(at);
    normal_equations(at, &here, residuals).0
}

/// `J'J` (row-major) and `J'r`.
fn normal_equations(at: &[f64], r: &[f64], residuals: impl Fn(&[f64]) -> Vec<f64>) -> (Vec<f64>, Vec<f64>) {
    let slope = |k: usize| -> Vec<f64> {
        let mut moved = at.to_vec();
        moved[k] += DIFFERENCE;
        residuals(&moved).iter().zip(r).map(|(a, b)| (a - b) / DIFFERENCE).collect()
    };
    let slopes: Vec<Vec<f64>> = (0..at.len()).map(slope).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let normal = slopes.iter().flat_map(|a| slopes.iter().map(move |b| dot(a, b))).collect();
    let gradient = slopes.iter().map(|a| dot(a, r)).collect();
    (normal, gradient)
}

fn damped_step(at: &[f64], bounds: &[(f64, f64)], normal: &[f64], gradient: &[f64], damping: f64) -> Vec<f64> {
    let n = at.len();
    let mut damped = normal.to_vec();
    (0..n).for_each(|k| damped[k * n + k] *= 1.0 + damping);
    let Some(factor) = Cholesky::new(&damped, n) else { return at.to_vec() };
    let step = factor.solve(gradient);
    (0..n).map(|k| (at[k] - step[k]).clamp(bounds[k].0, bounds[k].1)).collect()
}

/// Lower triangular factor L of a symmetric positive definite matrix `L L'`.
#[derive(Clone, Debug)]
pub struct Cholesky {
    n: usize,
    lower: Vec<f64>,
}

impl Cholesky {
    /// Factor of a row-major `n` by `n` matrix; `None` when it is not positive definite.
    pub fn new(matrix: &[f64], n: usize) -> Option<Self> {
        let mut lower = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| lower[i * n + k] * lower[j * n + k]).sum();
                let rest = matrix[i * n + j] - known;
                lower[i * n + j] = match i == j {
                    true if rest > 0.0 => rest.sqrt(),
                    true => return None,
                    false => rest / lower[j * n + j],
                };
            }
        }
        Some(Self { n, lower })
    }

    /// `L^-1 v`: values whose covariance was the matrix become independent with unit variance.
    pub fn whiten(&self, v: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut out = v.to_vec();
        for i in 0..n {
            let known: f64 = (0..i).map(|k| self.lower[i * n + k] * out[k]).sum();
            out[i] = (out[i] - known) / self.lower[i * n + i];
        }
        out
    }

    /// Solution of `L L' x = v`.
    pub fn solve(&self, v: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut out = self.whiten(v);
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| self.lower[k * n + i] * out[k]).sum();
            out[i] = (out[i] - known) / self.lower[i * n + i];
        }
        out
    }

    /// Logarithm of the determinant of `L L'`.
    pub fn log_determinant(&self) -> f64 {
        2.0 * (0..self.n).map(|k| libm::log(self.lower[k * (self.n + 1)])).sum::<f64>()
    }

    /// Inverse of `L L'`, row-major.
    pub fn inverse(&self) -> Vec<f64> {
        let unit = |k: usize| (0..self.n).map(|i| f64::from(u8::from(i == k))).collect::<Vec<f64>>();
        // Symmetric: columns are rows.
        (0..self.n).flat_map(|k| self.solve(&unit(k))).collect()
    }
}
