//! Nonlinear least squares with a handful of parameters. Slopes along them are computed on several threads.

use rayon::prelude::*;

/// Largest number of steps.
const STEPS: usize = 60;
/// Relative decrease of the sum of squares below which a search ends.
const TOLERANCE: f64 = 1e-12;
/// The same if only the sum is needed, not the parameters.
const ROUGH_TOLERANCE: f64 = 1e-6;
/// A search ends when a step moves no parameter by more than this.
const STILL: f64 = 1e-10;
/// Step of the forward differences; parameters are logarithms, so it is relative.
const DIFFERENCE: f64 = 1e-6;

/// Result of a search.
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
pub fn minimise(start: &[f64], bounds: &[(f64, f64)], residuals: impl Fn(&[f64]) -> Vec<f64> + Sync) -> Minimum {
    search(start, bounds, TOLERANCE, residuals)
}

/// As [`minimise`], but only until the sum of squares is accurate to a millionth.
pub fn minimise_coarsely(
    start: &[f64],
    bounds: &[(f64, f64)],
    residuals: impl Fn(&[f64]) -> Vec<f64> + Sync,
) -> Minimum {
    search(start, bounds, ROUGH_TOLERANCE, residuals)
}

fn search(
    start: &[f64],
    bounds: &[(f64, f64)],
    tolerance: f64,
    residuals: impl Fn(&[f64]) -> Vec<f64> + Sync,
) -> Minimum {
    let squares = |r: &[f64]| dot(r, r);
    let mut at = start.to_vec();
    let mut current = residuals(&at);
    let (mut damping, mut steps) = (1e-3, 0);
    while steps < STEPS {
        steps += 1;
        let (normal, gradient) = normal_equations(&at, &current, &residuals);
        let mut improved = None;
        while improved.is_none() && damping < 1e12 {
            let trial = damped_step(&at, bounds, &normal, &gradient, damping);
            if at.iter().zip(&trial).all(|(a, t)| (a - t).abs() < STILL) {
                return Minimum { value: squares(&current), at, steps };
            }
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
        if fall <= tolerance * squares(&current) {
            break;
        }
    }
    Minimum { value: squares(&current), at, steps }
}

/// `J'J` of the residuals at a point, row-major: half the curvature of the sum of squares.
pub fn curvature(at: &[f64], residuals: impl Fn(&[f64]) -> Vec<f64> + Sync) -> Vec<f64> {
    let here = residuals(at);
    normal_equations(at, &here, residuals).0
}

/// `J'J` (row-major) and `J'r`.
fn normal_equations(at: &[f64], r: &[f64], residuals: impl Fn(&[f64]) -> Vec<f64> + Sync) -> (Vec<f64>, Vec<f64>) {
    let slopes = slopes(at, r, residuals);
    let normal = slopes.iter().flat_map(|a| slopes.iter().map(move |b| dot(a, b))).collect();
    let gradient = slopes.iter().map(|a| dot(a, r)).collect();
    (normal, gradient)
}

/// The columns of J at a point with the residuals `here`.
pub fn slopes(at: &[f64], here: &[f64], residuals: impl Fn(&[f64]) -> Vec<f64> + Sync) -> Vec<Vec<f64>> {
    let slope = |k: usize| -> Vec<f64> {
        let mut moved = at.to_vec();
        moved[k] += DIFFERENCE;
        residuals(&moved).iter().zip(here).map(|(a, b)| (a - b) / DIFFERENCE).collect()
    };
    (0..at.len()).into_par_iter().map(slope).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Most steps of a chord search.
const CHORD_STEPS: usize = 12;
/// A chord search ends when no parameter moves by more than this: first with the given slopes, then with slopes taken near the minimum.
const CHORD_CONVERGED: [f64; 2] = [1e-2, 1e-6];

/// Chord method: Gauss-Newton steps with a fixed Jacobian, for many similar problems, at one evaluation per step. If residuals
/// remain at the minimum, a Jacobian from elsewhere misses it slightly; so the Jacobian is evaluated once more near the minimum.
pub struct Chord {
    slopes: Vec<Vec<f64>>,
    normal: Cholesky,
}

impl Chord {
    /// From the columns of J; `None` if the parameters are not identifiable.
    pub fn new(slopes: Vec<Vec<f64>>) -> Option<Self> {
        let normal: Vec<f64> = slopes.iter().flat_map(|a| slopes.iter().map(move |b| dot(a, b))).collect();
        let normal = Cholesky::new(&normal, slopes.len())?;
        Some(Self { slopes, normal })
    }

    /// Minimises the sum of squared `residuals(p)` from `start`; `None` if that takes too many steps, does not decrease the sum, or
    /// leads to a bound.
    pub fn minimise(
        &self,
        start: &[f64],
        bounds: &[(f64, f64)],
        residuals: impl Fn(&[f64]) -> Vec<f64> + Sync,
    ) -> Option<Minimum> {
        let (near, here) = self.descend(start, residuals(start), bounds, CHORD_CONVERGED[0], &residuals)?;
        let own = Self::new(slopes(&near.at, &here, &residuals))?;
        own.descend(&near.at, here, bounds, CHORD_CONVERGED[1], &residuals).map(|(end, _)| end)
    }

    /// The minimum, and the residuals there, from a start with the residuals `here`.
    fn descend(
        &self,
        start: &[f64],
        mut here: Vec<f64>,
        bounds: &[(f64, f64)],
        converged: f64,
        residuals: impl Fn(&[f64]) -> Vec<f64> + Sync,
    ) -> Option<(Minimum, Vec<f64>)> {
        let mut at = start.to_vec();
        for steps in 1..=CHORD_STEPS {
            let gradient: Vec<f64> = self.slopes.iter().map(|s| dot(s, &here)).collect();
            let step = self.normal.solve(&gradient);
            let next: Vec<f64> = at.iter().zip(&step).map(|(a, s)| a - s).collect();
            if next.iter().zip(bounds).any(|(v, (low, high))| !(*low < *v && *v < *high)) {
                return None;
            }
            let there = residuals(&next);
            let moved = step.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
            let (before, value) = (dot(&here, &here), dot(&there, &there));
            if moved <= converged {
                return Some((Minimum { value, at: next, steps }, there));
            }
            if value > before {
                return None;
            }
            (at, here) = (next, there);
        }
        None
    }
}

/// The damped step within the bounds: a parameter that would leave them is set to its bound, and the step of the others is
/// recomputed with it held there.
fn damped_step(at: &[f64], bounds: &[(f64, f64)], normal: &[f64], gradient: &[f64], damping: f64) -> Vec<f64> {
    let n = at.len();
    let mut damped = normal.to_vec();
    (0..n).for_each(|k| damped[k * n + k] *= 1.0 + damping);
    let mut next = at.to_vec();
    let mut free: Vec<usize> = (0..n).collect();
    while !free.is_empty() {
        let held =
            |k: usize| (0..n).filter(|l| !free.contains(l)).map(|l| damped[k * n + l] * (next[l] - at[l])).sum::<f64>();
        let right: Vec<f64> = free.iter().map(|&k| gradient[k] + held(k)).collect();
        let matrix: Vec<f64> =
            free.iter().flat_map(|&k| free.iter().map(move |&l| (k, l))).map(|(k, l)| damped[k * n + l]).collect();
        let Some(factor) = Cholesky::new(&matrix, free.len()) else { return at.to_vec() };
        let step = factor.solve(&right);
        free.iter().zip(&step).for_each(|(&k, s)| next[k] = at[k] - s);
        let outside = |k: &usize| !(bounds[*k].0..=bounds[*k].1).contains(&next[*k]);
        let Some(&first) = free.iter().find(|k| outside(k)) else { break };
        next[first] = next[first].clamp(bounds[first].0, bounds[first].1);
        free.retain(|k| *k != first);
    }
    next
}

/// Lower triangular factor L of a symmetric positive definite matrix `L L'`.
#[derive(Clone, Debug)]
pub struct Cholesky {
    n: usize,
    lower: Vec<f64>,
}

impl Cholesky {
    /// Factor of a row-major `n` by `n` matrix; `None` if it is not positive definite.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Two coupled parameters, one of them at its bound: the other converges to the same value as on its own, in a few steps.
    #[test]
    fn val_a_bound_does_not_slow_the_search() {
        let data: Vec<f64> = (0..12).map(|k| 1.0 - 0.2 * f64::from(k) + 0.01 * f64::from(k % 3)).collect();
        let residuals = |p: &[f64]| -> Vec<f64> {
            let curve = |x: f64| libm::exp(p[0] + p[1]) * (1.0 - libm::exp(-p[1]) * x);
            data.iter().enumerate().map(|(k, d)| curve(0.1 * k as f64) - d).collect()
        };
        let open = minimise(&[0.0, 0.0], &[(-9.0, 9.0), (-9.0, 9.0)], residuals);
        assert!(open.at[1] < -0.6, "{open:?}");
        let found = minimise(&[0.0, 0.0], &[(-9.0, 9.0), (-0.3, 9.0)], residuals);
        let alone = minimise(&[0.0], &[(-9.0, 9.0)], |p| residuals(&[p[0], -0.3]));
        assert!(found.at[1] == -0.3 && (found.at[0] - alone.at[0]).abs() < 1e-9, "{found:?} {alone:?}");
        assert!(found.steps <= 10, "{found:?}");
    }

    /// By hand: [[4, 2], [2, 5]] = L L' with L = [[2, 0], [1, 2]]; determinant 16, inverse [[5, -2], [-2, 4]] / 16. A matrix with a
    /// negative eigenvalue has no factor.
    #[test]
    fn val_cholesky_by_hand() {
        let factor = Cholesky::new(&[4.0, 2.0, 2.0, 5.0], 2).unwrap();
        assert_eq!(factor.whiten(&[2.0, 5.0]), [1.0, 2.0]);
        assert_eq!(factor.solve(&[8.0, 12.0]), [1.0, 2.0]);
        assert!((factor.log_determinant() - libm::log(16.0)).abs() < 1e-15);
        let inverse = factor.inverse();
        assert!(inverse.iter().zip([5.0, -2.0, -2.0, 4.0]).all(|(a, b)| (16.0 * a - b).abs() < 1e-14), "{inverse:?}");
        assert!(Cholesky::new(&[1.0, 2.0, 2.0, 1.0], 2).is_none());
    }

    /// Linear residuals: the search ends at the solution of the normal equations, by hand (2, 2) with residuals 1, 1, 1 and -3, and J'J is
    /// their matrix: forward differences of a line are exact but for rounding.
    #[test]
    fn val_linear_problems_in_closed_form() {
        // Residuals a + b x - y at x = 0, 1, 2 and again 1 with y = 7: normal equations [[4, 4], [4, 6]] p = [16, 20].
        let points: [(f64, f64); 4] = [(0.0, 1.0), (1.0, 3.0), (2.0, 5.0), (1.0, 7.0)];
        let residuals = |p: &[f64]| -> Vec<f64> { points.iter().map(|(x, y)| p[0] + p[1] * x - y).collect() };
        let bounds = [(-50.0, 50.0); 2];
        for found in [minimise(&[9.0, -9.0], &bounds, residuals), minimise_coarsely(&[9.0, -9.0], &bounds, residuals)] {
            assert!((found.at[0] - 2.0).abs() < 1e-4 && (found.at[1] - 2.0).abs() < 1e-4, "{found:?}");
            assert!((found.value - 12.0).abs() < 1e-6, "{found:?}");
        }
        let curvature = curvature(&[0.0, 0.0], residuals);
        assert!(curvature.iter().zip([4.0, 4.0, 4.0, 6.0]).all(|(a, b)| (a - b).abs() < 1e-6), "{curvature:?}");
    }

    /// A nonlinear curve and data that does not lie on it: both searches end at the same minimum.
    #[test]
    fn val_chords_end_where_the_search_does() {
        let curve = |p: &[f64], x: f64| libm::exp(p[0]) * libm::exp(-x / libm::exp(p[1]));
        let data: Vec<f64> =
            (0..12).map(|k| curve(&[0.1, -0.2], 0.2 * f64::from(k)) + 0.05 * f64::from(k % 3)).collect();
        let residuals =
            |p: &[f64]| -> Vec<f64> { data.iter().enumerate().map(|(k, d)| curve(p, 0.2 * k as f64) - d).collect() };
        let bounds = [(-5.0, 5.0), (-5.0, 5.0)];
        let exact = minimise(&[0.0, 0.0], &bounds, residuals);
        let start = [exact.at[0] + 0.1, exact.at[1] - 0.1];
        let chord = Chord::new(slopes(&start, &residuals(&start), residuals)).unwrap();
        let near = chord.minimise(&start, &bounds, residuals).unwrap();
        for k in 0..2 {
            assert!((near.at[k] - exact.at[k]).abs() < 1e-4, "{:?} {:?}", near.at, exact.at);
        }
        assert!((near.value / exact.value - 1.0).abs() < 1e-6);
        let tight = [(start[0] - 0.01, start[0] + 0.01), (-5.0, 5.0)];
        assert!(chord.minimise(&start, &tight, residuals).is_none());
    }
}
