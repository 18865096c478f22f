//! Slopes and albedo of one cell from its brightness in several images.
//!
//! Minimises, over the slopes `p`, `q` and the albedo `alpha`,
//!
//! $$ \sum_k \left( \frac{I_k - H_k - E_k\, \alpha\, S_k(p, q)}{\sigma_k} \right)^2 $$
//!
//! | symbol | meaning |
//! |---|---|
//! | `I_k`, `sigma_k` | brightness of the cell in image `k`, and its standard deviation |
//! | `E_k`, `H_k` | exposure and haze of the image |
//! | `S_k` | brightness of a facet of albedo 1 under the light and view of the image ([`Photometry::shade`]) |
//!
//! by Gauss-Newton steps with Levenberg-Marquardt damping (doi:10.1137/0111030), starting from the solution of the problem linearised about
//! level ground. A cell lit in too few images also has a prior: additional squared terms, given in [`Prior`].

use super::normal::Symmetric3;
use crate::direction::{Vector, dot};
use crate::photometry::Photometry;

/// Maximum number of steps for one cell.
const STEPS_MAX: usize = 60;
/// Steps end when slopes change by less than this.
const STEP_MIN: f64 = 1e-11;
/// Damping of the first step.
const DAMPING: f64 = 1e-4;
/// Damping above which the iteration gives up.
const DAMPING_MAX: f64 = 1e10;
/// Largest slope of the linear start.
const START_SLOPE_MAX: f64 = 1.5;

/// One lit image of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Brightness minus haze, divided by exposure.
    pub brightness: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// Unit vector to the light.
    pub light: Vector,
    /// Unit vector to the camera.
    pub view: Vector,
}

/// Prior of a cell's slopes and albedo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Expected albedo and its standard deviation.
    pub albedo: [f64; 2],
    /// Expected slopes.
    pub slopes: [f64; 2],
    /// Their standard deviation.
    pub slope_sigma: f64,
}

/// Slopes and albedo of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// `dz/dx`, `dz/dy`.
    pub slopes: [f64; 2],
    /// Albedo.
    pub albedo: f64,
    /// Covariance of `p`, `q` and albedo.
    pub covariance: Symmetric3,
    /// Sum of the squared residuals of the images.
    pub chi_square: f64,
    /// Condition number of the image equations for `p`, `q` and the logarithm of the albedo.
    pub condition: f64,
}

impl Fit {
    /// Multiple correlation of the albedo with both slopes, 0 to 1.
    pub fn albedo_slope_correlation(&self) -> f64 {
        let [pp, pq, pa, qq, qa, aa] = self.covariance.0;
        let determinant = pp * qq - pq * pq;
        let explained = (pa * pa * qq - 2.0 * pa * qa * pq + qa * qa * pp) / (determinant * aa);
        if explained.is_finite() { explained.clamp(0.0, 1.0).sqrt() } else { 0.0 }
    }
}

/// The problem of one cell.
pub struct Problem<'a> {
    /// Photometric function.
    pub photometry: &'a Photometry,
    /// Images in which the cell is lit.
    pub samples: &'a [Sample],
    /// Prior of a poorly lit cell.
    pub prior: Option<Prior>,
    /// The albedo if it is known and not estimated.
    pub fixed_albedo: Option<f64>,
}

/// A guess: `p`, `q`, albedo.
type Unknowns = [f64; 3];

impl Problem<'_> {
    /// The solution from a given start, or else from the linear start; `None` if the equations do not determine it.
    pub fn solve(&self, start: Option<Unknowns>) -> Option<Fit> {
        let mut at = start.or_else(|| self.linear_start())?;
        if let Some(albedo) = self.fixed_albedo {
            at[2] = albedo;
        }
        let mut cost = self.cost(at);
        let mut damping = DAMPING;
        for _ in 0..STEPS_MAX {
            let (normal, gradient) = self.normal_equations(at);
            let step = normal.damped(damping).inverse()?.times(gradient);
            let trial = [at[0] + step[0], at[1] + step[1], at[2] + step[2]];
            let trial_cost = if trial[2] > 0.0 { self.cost(trial) } else { f64::INFINITY };
            let small = step[0].abs().max(step[1].abs()).max((step[2] / at[2]).abs()) < STEP_MIN;
            if trial_cost <= cost {
                (at, cost, damping) = (trial, trial_cost, (damping * 0.1).max(1e-14));
            } else {
                damping *= 10.0;
            }
            if small || damping > DAMPING_MAX {
                break;
            }
        }
        self.finished(at)
    }

    fn finished(&self, at: Unknowns) -> Option<Fit> {
        let (normal, _) = self.normal_equations(at);
        let mut covariance = normal.inverse()?;
        if self.fixed_albedo.is_some() {
            covariance.0[5] = 0.0;
        }
        let fit = Fit {
            slopes: [at[0], at[1]],
            albedo: at[2],
            covariance,
            chi_square: self.misfit(at),
            condition: self.condition(at),
        };
        (at.iter().all(|v| v.is_finite()) && fit.chi_square.is_finite()).then_some(fit)
    }

    /// Squared residuals of the images.
    fn misfit(&self, [p, q, albedo]: Unknowns) -> f64 {
        self.samples
            .iter()
            .map(|s| {
                let residual = (s.brightness - albedo * self.photometry.of_slopes([p, q], s.light, s.view)) / s.sigma;
                residual * residual
            })
            .sum()
    }

    fn cost(&self, at: Unknowns) -> f64 {
        let prior = self.prior.map_or(0.0, |prior| {
            let [p, q] = [0, 1].map(|k| (at[k] - prior.slopes[k]) / prior.slope_sigma);
            let albedo = (at[2] - prior.albedo[0]) / prior.albedo[1];
            p * p + q * q + albedo * albedo
        });
        self.misfit(at) + prior
    }

    /// Normal matrix and right-hand side of a step.
    fn normal_equations(&self, at: Unknowns) -> (Symmetric3, Vector) {
        let (mut normal, mut gradient) = (Symmetric3::default(), [0.0; 3]);
        let mut add = |row: Vector, residual: f64| {
            normal.add(row, 1.0);
            (0..3).for_each(|k| gradient[k] += row[k] * residual);
        };
        for s in self.samples {
            let (row, value) = self.row(at, s);
            add(row.map(|v| v / s.sigma), (s.brightness - value) / s.sigma);
        }
        if let Some(prior) = self.prior {
            add([1.0 / prior.slope_sigma, 0.0, 0.0], (prior.slopes[0] - at[0]) / prior.slope_sigma);
            add([0.0, 1.0 / prior.slope_sigma, 0.0], (prior.slopes[1] - at[1]) / prior.slope_sigma);
            if self.fixed_albedo.is_none() {
                add([0.0, 0.0, 1.0 / prior.albedo[1]], (prior.albedo[0] - at[2]) / prior.albedo[1]);
            }
        }
        if self.fixed_albedo.is_some() {
            normal.0[5] = 1.0;
        }
        (normal, gradient)
    }

    /// Derivatives of a predicted brightness, and the brightness itself.
    #[inline]
    fn row(&self, [p, q, albedo]: Unknowns, sample: &Sample) -> (Vector, f64) {
        let shade = self.photometry.shade([p, q], sample.light, sample.view);
        let by_albedo = if self.fixed_albedo.is_some() { 0.0 } else { shade.value };
        ([albedo * shade.by_slope[0], albedo * shade.by_slope[1], by_albedo], albedo * shade.value)
    }

    fn condition(&self, at: Unknowns) -> f64 {
        let mut normal = Symmetric3::default();
        self.samples.iter().for_each(|s| normal.add(self.row(at, s).0.map(|v| v / s.sigma), 1.0));
        match self.fixed_albedo {
            // Two unknowns: the third eigenvalue is set between the other two.
            Some(_) => {
                let [xx, xy, _, yy, ..] = normal.0;
                Symmetric3([xx, xy, 0.0, yy, 0.0, 0.5 * (xx + yy)]).condition()
            }
            None => normal.scaled([1.0, 1.0, at[2]]).condition(),
        }
    }

    /// Linear start: near level ground, brightness is `alpha (S + S_p p + S_q q)`, linear in `alpha`, `alpha p`, `alpha q`.
    fn linear_start(&self) -> Option<Unknowns> {
        if let Some(prior) = self.prior {
            return Some([prior.slopes[0], prior.slopes[1], prior.albedo[0]]);
        }
        let level = |s: &Sample| self.photometry.shade([0.0; 2], s.light, s.view);
        let (mut normal, mut right) = (Symmetric3::default(), [0.0; 3]);
        let (mut products, mut squares) = (0.0, 0.0);
        for s in self.samples {
            let shade = level(s);
            let row = [shade.by_slope[0], shade.by_slope[1], shade.value].map(|v| v / s.sigma);
            normal.add(row, 1.0);
            (0..3).for_each(|k| right[k] += row[k] * s.brightness / s.sigma);
            products += shade.value * s.brightness / (s.sigma * s.sigma);
            squares += shade.value * shade.value / (s.sigma * s.sigma);
        }
        let flat = [0.0, 0.0, self.fixed_albedo.unwrap_or(products / squares)];
        let linear = normal.inverse().map(|inverse| inverse.times(right)).filter(|u| u[2] > 0.0).map(|[ap, aq, a]| {
            let steep = dot([ap / a, aq / a, 0.0], [ap / a, aq / a, 0.0]).sqrt();
            let shrink = (START_SLOPE_MAX / steep).min(1.0);
            [ap / a * shrink, aq / a * shrink, self.fixed_albedo.unwrap_or(a)]
        });
        let starts = [Some(flat), linear];
        starts.into_iter().flatten().filter(|u| u[2] > 0.0).min_by(|a, b| self.cost(*a).total_cmp(&self.cost(*b)))
    }
}
