//! Logistic model of success with a random intercept per terrain.
//!
//! Missions on one terrain share its properties. With `x` the covariates of a mission, `b` their coefficients
//! (log odds), `s >= 0` the standard deviation between terrains on the same scale, and one `u` for
//! each terrain,
//!
//! ```text
//! P(success | u) = 1 / (1 + exp(-(x b + s u))),   u normal with mean 0 and variance 1
//! L(b, s) = product over terrains of  integral over u of  phi(u)  product over missions of  p^y (1 - p)^(1 - y)
//! ```
//!
//! (R. Stiratelli, N. Laird and J. Ware, Biometrics 40, 1984; A. Agresti, Categorical Data Analysis, 2013, section
//! 13.1.) Estimates maximise `L`. The coefficients compare missions on terrains of equal `u`; averaged over
//! terrains the odds differ less.
//!
//! The integral is computed around the mode of its integrand, as in adaptive Gauss-Hermite quadrature (J. Pinheiro and D.
//! Bates, Journal of Computational and Graphical Statistics 4, 1995), but by the trapezoidal rule, which for such functions
//! also converges geometrically (L. Trefethen and J. Weideman, SIAM Review 56, 2014) and needs no nodes: steps of
//! half the width of the mode, or half the distance to the logistic function's poles if that is less, out to where
//! the integrand has fallen by exp(-36). It is then accurate to about twelve digits. Newton's method uses the exact
//! information, by T. Louis's formula (Journal of the Royal Statistical Society B 44, 1982):
//!
//! ```text
//! score       = sum over terrains of E[z],   z = derivative of the joint log density, E over u given the outcomes
//! information = sum over terrains of E[-dz] - Var[z]
//! ```
//!
//! Standard errors come from the inverse information, intervals are Wald's, and tests are likelihood ratio tests (chi-square, S.
//! Wilks, 1938). These are asymptotic: with fewer than about ten terrains per group they are anticonservative.
//! Terrains that share their random draws are treated as independent, which makes the errors of differences too large
//! rather than too small. Cost: some 50 evaluations per mission row and step, about ten steps; memory proportional to
//! the rows.

use crate::chi_square;
use std::collections::BTreeMap;

/// Most Newton steps.
const STEPS_MAX: usize = 200;
/// Predicted gain of a step below which the fit has converged.
const GAIN_MIN: f64 = 1e-18;
/// Log odds beyond which a fit has diverged: data without failures (or successes) has no finite estimate.
const LOG_ODDS_MAX: f64 = 18.0;
/// The integration ends where the logarithm of the integrand has fallen by this much.
const FALL: f64 = 36.0;
/// Initial standard deviation between terrains, log odds.
const DEVIATION_START: f64 = 1.0;

/// Missions with equal covariates on one terrain.
#[derive(Clone, Debug, PartialEq)]
pub struct Missions {
    /// Covariates, including the intercept (1).
    pub covariates: Vec<f64>,
    /// Number of successful missions.
    pub successes: f64,
    /// Number of all missions.
    pub trials: f64,
}

/// A fitted model.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Coefficients, log odds.
    pub coefficients: Vec<f64>,
    /// Their standard errors.
    pub standard_errors: Vec<f64>,
    /// Covariance of the coefficients, row by row.
    pub covariance: Vec<Vec<f64>>,
    /// Standard deviation between terrains, log odds.
    pub deviation: f64,
    /// Its standard error; not finite if the deviation is 0.
    pub deviation_error: f64,
    /// Log likelihood, without binomial coefficients.
    pub log_likelihood: f64,
}

impl Fit {
    /// Fits the model to terrains with their missions. `None` if rows differ in their number of covariates,
    /// if there is no mission, or if no finite estimate exists because covariates determine each other or the
    /// outcome.
    ///
    /// ```
    /// use sastrugi_statistics::mixed_logistic::{Fit, Missions};
    ///
    /// // Ten terrains on which 15 of 20 missions succeed, and ten with 10 of 20: the terrains of a group do not scatter, so that the
    /// // coefficients are those of the plain logistic model, log odds ln 3 and a difference of -ln 3.
    /// let terrain = |group: f64, successes: f64| vec![Missions { covariates: vec![1.0, group], successes, trials: 20.0 }];
    /// let terrains: Vec<_> = (0..20).map(|k| if k < 10 { terrain(0.0, 15.0) } else { terrain(1.0, 10.0) }).collect();
    /// let fit = Fit::of(&terrains).unwrap();
    /// assert!((fit.coefficients[0] - 3f64.ln()).abs() < 1e-6 && (fit.coefficients[1] + 3f64.ln()).abs() < 1e-6);
    /// ```
    pub fn of(terrains: &[Vec<Missions>]) -> Option<Self> {
        let covariates = terrains.iter().flatten().next()?.covariates.len();
        let usable = |m: &Missions| m.covariates.len() == covariates && m.trials > 0.0;
        if !terrains.iter().flatten().all(usable) {
            return None;
        }
        let patterns = patterns(terrains);
        let mut at = vec![0.0; covariates];
        at.push(DEVIATION_START);
        let mut here = Likelihood::of(&patterns, &at);
        for _ in 0..STEPS_MAX {
            let (step, gain) = here.step()?;
            if gain < GAIN_MIN {
                break;
            }
            (at, here) = better(&patterns, &at, &here, &step)?;
            if terrains.iter().flatten().any(|m| dot(&m.covariates, &at).abs() > LOG_ODDS_MAX) {
                return None;
            }
        }
        let (_, gain) = here.step()?;
        if gain > 1e-8 {
            return None;
        }
        let inverse = inverse(&here.information)?;
        let error = |k: usize| inverse[k][k].sqrt();
        Some(Self {
            coefficients: at[..covariates].to_vec(),
            standard_errors: (0..covariates).map(error).collect(),
            covariance: inverse[..covariates].iter().map(|row| row[..covariates].to_vec()).collect(),
            deviation: at[covariates].abs(),
            deviation_error: error(covariates),
            log_likelihood: here.value,
        })
    }

    /// A combination of coefficients and its standard error.
    pub fn contrast(&self, weights: &[f64]) -> (f64, f64) {
        let variance: f64 = weights.iter().zip(&self.covariance).map(|(w, row)| w * dot(row, weights)).sum();
        (dot(weights, &self.coefficients), variance.sqrt())
    }

    /// Likelihood ratio test against a model with a subset of the covariates: chi-square, degrees of freedom, p.
    pub fn against(&self, simpler: &Self) -> (f64, usize, f64) {
        let chi2 = (2.0 * (self.log_likelihood - simpler.log_likelihood)).max(0.0);
        let freedom = self.coefficients.len().saturating_sub(simpler.coefficients.len());
        (chi2, freedom, chi_square::above(chi2, freedom))
    }
}

/// Terrains with the same missions and outcomes, which contribute equally to the likelihood.
struct Pattern<'a> {
    missions: &'a [Missions],
    terrains: f64,
}

/// Every pattern once, in the order of first occurrence.
fn patterns(terrains: &[Vec<Missions>]) -> Vec<Pattern<'_>> {
    let mut places: BTreeMap<Vec<u64>, usize> = BTreeMap::new();
    let mut patterns: Vec<Pattern> = Vec::new();
    for missions in terrains.iter().filter(|t| !t.is_empty()) {
        let numbers = |m: &Missions| [&m.covariates[..], &[m.successes, m.trials]].concat();
        let key = missions.iter().flat_map(numbers).map(f64::to_bits).collect();
        let place = *places.entry(key).or_insert(patterns.len());
        match patterns.get_mut(place) {
            Some(pattern) => pattern.terrains += 1.0,
            None => patterns.push(Pattern { missions, terrains: 1.0 }),
        }
    }
    patterns
}

/// Log likelihood and its derivatives with respect to the coefficients and the deviation.
struct Likelihood {
    value: f64,
    score: Vec<f64>,
    information: Vec<Vec<f64>>,
}

impl Likelihood {
    fn of(patterns: &[Pattern], at: &[f64]) -> Self {
        let n = at.len();
        let mut all = Self { value: 0.0, score: vec![0.0; n], information: vec![vec![0.0; n]; n] };
        patterns.iter().for_each(|p| all.add(p, at));
        all
    }

    fn add(&mut self, &Pattern { missions: terrain, terrains }: &Pattern, at: &[f64]) {
        let n = at.len();
        let (coefficients, deviation) = (&at[..n - 1], at[n - 1]);
        let fixed: Vec<f64> = terrain.iter().map(|m| dot(&m.covariates, coefficients)).collect();
        let points = points(terrain, &fixed, deviation);
        let highest = points.iter().map(|p| p.log_density).fold(f64::NEG_INFINITY, f64::max);
        let mut total = 0.0;
        let (mut score, mut mean) = (vec![0.0; n], vec![0.0; n]);
        let mut square = vec![vec![0.0; n]; n];
        for point in &points {
            let weight = point.width * libm::exp(point.log_density - highest);
            total += weight;
            score.fill(0.0);
            for (m, f) in terrain.iter().zip(&fixed) {
                let p = probability(f + deviation * point.u);
                let (residual, curvature) = (m.successes - m.trials * p, weight * m.trials * p * (1.0 - p));
                let derivative = |k: usize| m.covariates.get(k).copied().unwrap_or(point.u);
                for i in 0..n {
                    score[i] += residual * derivative(i);
                    (0..n).for_each(|j| square[i][j] += curvature * derivative(i) * derivative(j));
                }
            }
            for i in 0..n {
                mean[i] += weight * score[i];
                (0..n).for_each(|j| square[i][j] -= weight * score[i] * score[j]);
            }
        }
        self.value += terrains * (highest + libm::log(total) - 0.5 * libm::log(2.0 * std::f64::consts::PI));
        for i in 0..n {
            self.score[i] += terrains * mean[i] / total;
            for j in 0..n {
                self.information[i][j] += terrains * (square[i][j] / total + mean[i] * mean[j] / (total * total));
            }
        }
    }

    /// Newton's step and twice its predicted gain; if the information is not positive definite, its diagonal is raised until
    /// it is.
    fn step(&self) -> Option<(Vec<f64>, f64)> {
        let scale = (0..self.score.len()).map(|k| self.information[k][k].abs()).fold(1e-3, f64::max);
        let raised = |ridge: f64| {
            let mut matrix = self.information.clone();
            matrix.iter_mut().enumerate().for_each(|(k, row)| row[k] += ridge);
            let step = solved(&cholesky(&matrix)?, &self.score);
            let gain = dot(&step, &self.score);
            gain.is_finite().then_some((step, gain))
        };
        std::iter::once(0.0).chain((0..8).map(|k| scale * libm::exp10(f64::from(k - 5)))).find_map(raised)
    }
}

/// The first of successively halved steps that does not lower the likelihood by more than rounding.
fn better(patterns: &[Pattern], at: &[f64], here: &Likelihood, step: &[f64]) -> Option<(Vec<f64>, Likelihood)> {
    (0..40).find_map(|halvings| {
        let share = libm::exp2(-f64::from(halvings));
        let there: Vec<f64> = at.iter().zip(step).map(|(a, s)| a + share * s).collect();
        let value = Likelihood::of(patterns, &there);
        (value.value >= here.value - 1e-12 * here.value.abs()).then_some((there, value))
    })
}

/// A point of the integration over `u`.
struct Point {
    u: f64,
    /// Logarithm of the integrand without the constant of the normal density.
    log_density: f64,
    width: f64,
}

/// The integrand at even steps around its mode. Its logarithm is at least as curved as that of the normal density, so
/// few points are needed.
fn points(terrain: &[Missions], fixed: &[f64], deviation: f64) -> Vec<Point> {
    let (mode, curvature) = mode(terrain, fixed, deviation);
    let width = 0.5 * (1.0 / curvature.sqrt()).min(1.0 / deviation.abs().max(1.0));
    let at = |k: i32| {
        let u = mode + width * f64::from(k);
        Point { u, log_density: log_density(terrain, fixed, deviation, u), width }
    };
    let middle = at(0);
    let least = middle.log_density - FALL;
    let side = |sign: i32| (1..100_000).map(move |k| at(sign * k)).take_while(move |p| p.log_density > least);
    let sides: Vec<Point> = side(-1).chain(side(1)).collect();
    std::iter::once(middle).chain(sides).collect()
}

/// The mode of the integrand and its curvature there, by Newton's method on a concave function, with steps of at most 1.
fn mode(terrain: &[Missions], fixed: &[f64], deviation: f64) -> (f64, f64) {
    let mut u = 0.0;
    let mut curvature = 1.0;
    for _ in 0..100 {
        let mut slope = -u;
        curvature = 1.0;
        for (m, f) in terrain.iter().zip(fixed) {
            let p = probability(f + deviation * u);
            slope += deviation * (m.successes - m.trials * p);
            curvature += deviation * deviation * m.trials * p * (1.0 - p);
        }
        let step = (slope / curvature).clamp(-1.0, 1.0);
        u += step;
        if step.abs() < 1e-9 {
            break;
        }
    }
    (u, curvature)
}

fn log_density(terrain: &[Missions], fixed: &[f64], deviation: f64, u: f64) -> f64 {
    let of_row = |(m, f): (&Missions, &f64)| {
        let log_odds = f + deviation * u;
        m.successes * log_odds - m.trials * log_one_plus_exp(log_odds)
    };
    terrain.iter().zip(fixed).map(of_row).sum::<f64>() - 0.5 * u * u
}

fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-log_odds))
}

fn log_one_plus_exp(x: f64) -> f64 {
    x.max(0.0) + libm::log1p(libm::exp(-x.abs()))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Lower Cholesky factor of a positive definite matrix; `None` if it is not.
fn cholesky(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let n = matrix.len();
    let mut lower = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let rest = matrix[i][j] - dot(&lower[i][..j], &lower[j][..j]);
            if i == j {
                // A pivot lost to rounding means that columns are linearly dependent.
                lower[i][i] = (rest > 1e-12 * matrix[i][i]).then(|| rest.sqrt())?;
            } else {
                lower[i][j] = rest / lower[j][j];
            }
        }
    }
    Some(lower)
}

fn solved(lower: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let n = lower.len();
    let mut x = right.to_vec();
    for i in 0..n {
        x[i] = (x[i] - dot(&lower[i][..i], &x[..i])) / lower[i][i];
    }
    for i in (0..n).rev() {
        let above: f64 = (i + 1..n).map(|k| lower[k][i] * x[k]).sum();
        x[i] = (x[i] - above) / lower[i][i];
    }
    x
}

fn inverse(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let lower = cholesky(matrix)?;
    let unit = |k: usize| (0..matrix.len()).map(|i| f64::from(u8::from(i == k))).collect::<Vec<_>>();
    Some((0..matrix.len()).map(|k| solved(&lower, &unit(k))).collect())
}

#[cfg(test)]
mod tests;
