//! Standard deviation of heights: the spread of solutions for perturbed slopes.
//!
//! Heights are a linear function of slopes and constraints. Each sample draws slopes from the covariance of every cell and heights of constraints from
//! theirs, and solves for what they add; the root mean square over `n` samples is within `1 / sqrt(2 n)` of the standard deviation (12 % for 32).
//! It holds whatever weights the integration takes. What it leaves out: errors that cells share (a wrong sun, exposure or law of brightness), and
//! what a cell's curvature hides. Constraints are taken as independent.

use super::integration::{Stop, System};
use rayon::prelude::*;
use sastrugi_numeric::{Counter, Streams, sums};

/// Standard deviation of every height, m; of heights less their mean where nothing constrains them.
pub fn height_sigma(system: &System, covariances: &[[f64; 6]], samples: usize, streams: &Streams) -> Vec<f64> {
    let root = Counter::new(&mut streams.stream("height-uncertainty"));
    let factors: Vec<[f64; 3]> = covariances.iter().map(|c| cholesky(c[0], c[1], c[3])).collect();
    let sigmas = system.constraint_sigmas();
    let mut squares = vec![0.0; covariances.len()];
    for sample in 0..samples {
        let draws = root.at(sample as i64);
        let slopes: Vec<[f64; 2]> =
            factors.par_iter().with_min_len(1024).enumerate().map(|(k, f)| perturbed(f, draws.at(k as i64))).collect();
        let constraints = draws.at(-1);
        let heights: Vec<f64> = sigmas.iter().enumerate().map(|(k, s)| s * constraints.at(k as i64).normal()).collect();
        let solved = system.solve(&system.right_side(&slopes, &heights), None, Stop::COARSE);
        squares.iter_mut().zip(&solved.heights_m).for_each(|(s, z)| *s += z * z);
    }
    squares.into_iter().map(|s| (s / samples as f64).sqrt()).collect()
}

/// Factor of a covariance of two, 0 where there is none.
fn cholesky(pp: f64, pq: f64, qq: f64) -> [f64; 3] {
    let first = pp.sqrt();
    let across = pq / first;
    let second = (qq - across * across).max(0.0).sqrt();
    let factor = [first, across, second];
    if factor.iter().all(|v| v.is_finite()) { factor } else { [0.0; 3] }
}

fn perturbed([first, across, second]: &[f64; 3], draws: Counter) -> [f64; 2] {
    let (a, b) = (draws.at(0).normal(), draws.at(1).normal());
    [first * a, across * a + second * b]
}

/// Share of errors within `factor` standard deviations.
pub fn coverage(errors: &[f64], sigmas: &[f64], factor: f64) -> f64 {
    let within: Vec<f64> = errors.iter().zip(sigmas).map(|(e, s)| f64::from(u8::from(e.abs() <= factor * s))).collect();
    sums::mean(&within)
}
