//! Logistic model of success with a random intercept of the terrain.
//!
//! Missions on one terrain share what the terrain is like. With `x` the covariates of a mission, `b` their coefficients
//! (natural logarithms of odds), `s >= 0` the standard deviation between terrains on the same scale, and one `u` for
//! each terrain,
//!
//! ```text
//! P(success | u) = 1 / (1 + exp(-(x b + s u))),   u normal with mean 0 and variance 1
//! L(b, s) = product over terrains of  integral over u of  phi(u)  product over missions of  p^y (1 - p)^(1 - y)
//! ```
//!
//! (R. Stiratelli, N. Laird and J. Ware, Biometrics 40, 1984; A. Agresti, Categorical Data Analysis, 2013, section
//! 13.1.) Estimates maximise `L`. The coefficients compare missions on terrains of equal `u`; on the average over
//! terrains the odds differ less.
//!
//! The integral is taken about the mode of its integrand, as adaptive Gauss-Hermite quadrature does (J. Pinheiro and D.
//! Bates, Journal of Computational and Graphical Statistics 4, 1995), by the trapezoidal rule, which for such functions
//! converges geometrically as well (L. Trefethen and J. Weideman, SIAM Review 56, 2014) and needs no nodes: steps of
//! half the width of the mode, or half the distance to the logistic function's poles where that is less, out to where
//! the integrand has fallen by exp(-36). It is then exact to about twelve digits. Newton's method uses the exact
//! information, by T. Louis's formula (Journal of the Royal Statistical Society B 44, 1982):
//!
//! ```text
//! score       = sum over terrains of E[z],   z = derivative of the joint log density, E over u given the outcomes
//! information = sum over terrains of E[-dz] - Var[z]
//! ```
//!
//! Standard errors are those of the inverse information, intervals Wald's; tests compare likelihoods (chi-square, S.
//! Wilks, 1938). Both are for many terrains: with fewer than about ten a group they are too sure of themselves.
//! Terrains that share their random draws are taken as independent, which makes the errors of differences too large
//! rather than too small. Cost: some 50 evaluations per mission row and step, about ten steps; memory proportional to
//! the rows.

use crate::chi_square;
use std::collections::BTreeMap;

/// Newton steps at most.
const STEPS_MAX: usize = 200;
/// Where the gain that a step promises is below this, the maximum is reached.
const GAIN_MIN: f64 = 1e-18;
/// A logarithm of odds beyond which a fit has run away: data without failures (or successes) have no finite estimate.
const LOG_ODDS_MAX: f64 = 18.0;
/// The integrand is followed until it has fallen by this much, in logarithms.
const FALL: f64 = 36.0;
/// Deviation between terrains at the start, in logarithms of odds.
const DEVIATION_START: f64 = 1.0;

/// Missions of equal covariates on one terrain.
#[derive(Clone, Debug, PartialEq)]
pub struct Missions {
    /// Covariates, the intercept (1) among them.
    pub covariates: Vec<f64>,
    /// Successful missions.
    pub successes: f64,
    /// All missions.
    pub trials: f64,
}

/// A fitted model.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Coefficients, natural logarithms of odds.
    pub coefficients: Vec<f64>,
    /// Their standard errors.
    pub standard_errors: Vec<f64>,
    /// Covariance of the coefficients, row by row.
    pub covariance: Vec<Vec<f64>>,
    /// Standard deviation between terrains, logarithms of odds.
    pub deviation: f64,
    /// Its standard error; not finite where the deviation is 0.
    pub deviation_error: f64,
    /// Logarithm of the likelihood, without binomial coefficients.
    pub log_likelihood: f64,
}

impl Fit {
    /// The model of terrains with their missions. `None` when rows have other numbers of covariates than the first,
    /// when there is no mission, or when no finite estimate exists: covariates that determine each other or the
    /// outcome.
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

    /// Likelihood ratio test against a model that holds a part of the covariates: chi-square, degrees of freedom, p.
    pub fn against(&self, simpler: &Self) -> (f64, usize, f64) {
        let chi2 = (2.0 * (self.log_likelihood - simpler.log_likelihood)).max(0.0);
        let freedom = self.coefficients.len().saturating_sub(simpler.coefficients.len());
        (chi2, freedom, chi_square::above(chi2, freedom))
    }
}

/// Terrains with the same missions and outcomes: they add the same to the likelihood.
struct Pattern<'a> {
    missions: &'a [Missions],
    terrains: f64,
}

/// Every pattern once, in the order of its first terrain.
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

/// Logarithm of the likelihood with its derivatives for the coefficients and the deviation.
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
                let (residual, bend) = (m.successes - m.trials * p, weight * m.trials * p * (1.0 - p));
                let derivative = |k: usize| m.covariates.get(k).copied().unwrap_or(point.u);
                for i in 0..n {
                    score[i] += residual * derivative(i);
                    (0..n).for_each(|j| square[i][j] += bend * derivative(i) * derivative(j));
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

    /// Newton's step and twice the gain it promises; where the information is not positive definite it is raised until
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

/// The first of ever shorter steps that raises the likelihood; the same place where rounding alone is left.
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
    /// Logarithm of the integrand but for the constant of the normal density.
    log_density: f64,
    width: f64,
}

/// The integrand on even steps about its mode. Its logarithm bends by at least that of the normal density, so the
/// points are few.
fn points(terrain: &[Missions], fixed: &[f64], deviation: f64) -> Vec<Point> {
    let (mode, bend) = mode(terrain, fixed, deviation);
    let width = 0.5 * (1.0 / bend.sqrt()).min(1.0 / deviation.abs().max(1.0));
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

/// Where the integrand is largest, and its bend there: Newton's method on a concave function, each step at most 1.
fn mode(terrain: &[Missions], fixed: &[f64], deviation: f64) -> (f64, f64) {
    let mut u = 0.0;
    let mut bend = 1.0;
    for _ in 0..100 {
        let mut slope = -u;
        bend = 1.0;
        for (m, f) in terrain.iter().zip(fixed) {
            let p = probability(f + deviation * u);
            slope += deviation * (m.successes - m.trials * p);
            bend += deviation * deviation * m.trials * p * (1.0 - p);
        }
        let step = (slope / bend).clamp(-1.0, 1.0);
        u += step;
        if step.abs() < 1e-9 {
            break;
        }
    }
    (u, bend)
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

/// Lower triangle of a positive definite matrix; `None` when it is not.
fn cholesky(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let n = matrix.len();
    let mut lower = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let rest = matrix[i][j] - dot(&lower[i][..j], &lower[j][..j]);
            if i == j {
                // A pivot lost in rounding means columns that determine each other.
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
