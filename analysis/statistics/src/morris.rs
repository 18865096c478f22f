//! Screening of parameters by elementary effects (Morris method).
//!
//! Every parameter has `p` equally spaced levels; a *trajectory* of `k + 1` designs moves each of `k` parameters once, in random order, by
//! `p/2` levels up or down (M. Morris, Technometrics 33, 1991, 161-174: a step of `p / (2 (p - 1))` of the range with even `p`, so that all
//! levels are equally likely). The elementary effect of a parameter is the change of the output over the change of the parameter:
//!
//! ```text
//! d = (y(after) - y(before)) / (x(after) - x(before))
//! mu = mean d,   mu* = mean |d|,   sigma = standard deviation of d        over the trajectories
//! ```
//!
//! `mu*` ranks the parameters (F. Campolongo, J. Cariboni and A. Saltelli, Environmental Modelling & Software 22, 2007, 1509-1518: in `mu`
//! effects of opposite sign may cancel); `sigma` is high if an effect depends on the other parameters or is nonlinear.
//!
//! # Several worlds
//! The output is measured on `w` worlds, with the same trajectories on each. `d` of a trajectory is the mean of its effects over the worlds.
//! Worlds and trajectories are crossed, so that intervals resample both, independently and with replacement (the pigeonhole bootstrap: A. Owen,
//! Annals of Applied Statistics 1, 2007, 386-411, which does not understate the variance of a mean). Absolute values of noisy effects are
//! biased upwards, and so are their replicates: near its `noise` the interval of `mu*` is too high, and that of `mu` should be used.
//!
//! `noise` is the mean of `mu*` if the mean effect over all worlds were 0 and the worlds scattered as observed:
//! `sqrt(2/pi) s / sqrt(w)`, the mean absolute value of a normal variable, with `s` the standard deviation over the worlds, averaged over the
//! trajectories. With common random draws, a parameter without any influence has an effect of exactly 0, and noise 0 too.
//!
//! # Cost
//! `k + 1` outputs per trajectory and world; `k w r` operations per bootstrap replicate, for `r` trajectories.

use crate::bootstrap::{Interval, redraw};
use sastrugi_numeric::{Stream, sums};
use std::f64::consts::FRAC_2_PI;

/// Designs that differ in one parameter each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trajectory {
    /// Level of every parameter, from 0, for each of the `k + 1` designs.
    pub levels: Vec<Vec<u32>>,
    /// The parameter that changes from each design to the next.
    pub order: Vec<usize>,
}

impl Trajectory {
    /// Draws a trajectory; `levels` must be even and at least 2.
    pub fn draw(parameters: usize, levels: u32, stream: &mut Stream) -> Self {
        let half = (levels / 2).max(1);
        let mut ends = || {
            let low = stream.below(u64::from(half)) as u32;
            if stream.below(2) == 0 { [low, low + half] } else { [low + half, low] }
        };
        let ends: Vec<[u32; 2]> = (0..parameters).map(|_| ends()).collect();
        let mut order: Vec<usize> = (0..parameters).collect();
        // Shuffle by R. Fisher and F. Yates.
        for last in (1..parameters).rev() {
            order.swap(last, stream.below(last as u64 + 1) as usize);
        }
        let mut design: Vec<u32> = ends.iter().map(|[from, _]| *from).collect();
        let mut designs = vec![design.clone()];
        for &parameter in &order {
            design[parameter] = ends[parameter][1];
            designs.push(design.clone());
        }
        Self { levels: designs, order }
    }
}

/// Elementary effects of one trajectory, by parameter: `points` and `values` are the parameters and the output of each design, `order` the
/// parameter that changes to the next.
pub fn elementary_effects(points: &[Vec<f64>], order: &[usize], values: &[f64]) -> Vec<f64> {
    let mut effects = vec![f64::NAN; order.len()];
    for ((x, y), &k) in points.windows(2).zip(values.windows(2)).zip(order) {
        // Turns -0 into 0: no change is 0 whichever way the parameter moved.
        effects[k] = (y[1] - y[0]) / (x[1][k] - x[0][k]) + 0.0;
    }
    effects
}

/// Importance of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Importance {
    /// Mean effect.
    pub mu: f64,
    /// Its interval; `None` with fewer than two worlds or trajectories.
    pub mu_interval: Option<Interval>,
    /// Mean absolute effect.
    pub mu_star: f64,
    /// Its interval.
    pub mu_star_interval: Option<Interval>,
    /// Standard deviation of the effects over the trajectories; NaN with one.
    pub sigma: f64,
    /// Expected `mu_star` without any mean effect; NaN with one world.
    pub noise: f64,
}

/// The importance of every parameter. `effects` are those of [`elementary_effects`], by parameter, trajectory and world; all parameters
/// have the same trajectories and worlds, and share the bootstrap replicates.
///
/// ```
/// use sastrugi_numeric::Streams;
/// use sastrugi_statistics::morris::{Trajectory, elementary_effects, screen};
///
/// // Two parameters in 0..1, of which only the first matters: y = 3 x0.
/// let mut stream = Streams::for_seed(1, "example").stream("screening");
/// let mut effects = vec![Vec::new(); 2];
/// for _ in 0..4 {
///     let drawn = Trajectory::draw(2, 4, &mut stream);
///     let points: Vec<Vec<f64>> =
///         drawn.levels.iter().map(|levels| levels.iter().map(|l| f64::from(*l) / 3.0).collect()).collect();
///     let values: Vec<f64> = points.iter().map(|x| 3.0 * x[0]).collect();
///     let of = elementary_effects(&points, &drawn.order, &values);
///     // One world each.
///     effects.iter_mut().zip(of).for_each(|(all, d)| all.push(vec![d]));
/// }
/// let found = screen(&effects, 0, 0.95, &mut stream);
/// assert!((found[0].mu_star - 3.0).abs() < 1e-12);
/// assert_eq!(found[1].mu_star, 0.0);
/// ```
pub fn screen(effects: &[Vec<Vec<f64>>], replicates: usize, level: f64, stream: &mut Stream) -> Vec<Importance> {
    let trajectories = effects.first().map_or(0, Vec::len);
    let worlds = effects.first().and_then(|of| of.first()).map_or(0, Vec::len);
    let all = [(0..trajectories).collect(), (0..worlds).collect()];
    let crossed = trajectories > 1 && worlds > 1;
    let draws = if crossed { replicates } else { 0 };
    let means = redraw(&[trajectories, worlds], draws, stream, |drawn| {
        effects.iter().map(|of| Means::of(&averages(of, drawn))).collect::<Vec<_>>()
    });
    let interval = |k: usize, estimate: f64, of: fn(&Means) -> f64| {
        let values: Vec<f64> = means.iter().map(|m| of(&m[k])).collect();
        Interval::percentile(estimate, &values, level)
    };
    let one = |(k, of): (usize, &Vec<Vec<f64>>)| {
        let over_worlds = averages(of, &all);
        let Means { mu, mu_star } = Means::of(&over_worlds);
        Importance {
            mu,
            mu_interval: interval(k, mu, |m| m.mu),
            mu_star,
            mu_star_interval: interval(k, mu_star, |m| m.mu_star),
            sigma: deviation(&over_worlds),
            noise: noise(of),
        }
    };
    effects.iter().enumerate().map(one).collect()
}

/// Means over the trajectories.
struct Means {
    mu: f64,
    mu_star: f64,
}

impl Means {
    fn of(effects: &[f64]) -> Self {
        let absolute: Vec<f64> = effects.iter().map(|d| d.abs()).collect();
        Self { mu: sums::mean(effects), mu_star: sums::mean(&absolute) }
    }
}

/// Mean effect over the drawn worlds of each drawn trajectory; `drawn` are the indices of trajectories and of worlds.
fn averages(effects: &[Vec<f64>], drawn: &[Vec<usize>]) -> Vec<f64> {
    let [trajectories, worlds] = drawn else { return Vec::new() };
    let mut of_worlds = Vec::with_capacity(worlds.len());
    let mut average = |&t: &usize| {
        of_worlds.clear();
        of_worlds.extend(worlds.iter().map(|&w| effects[t][w]));
        sums::mean(&of_worlds)
    };
    trajectories.iter().map(&mut average).collect()
}

/// Sample standard deviation (n - 1); NaN for fewer than two values.
fn deviation(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    if n < 2.0 { f64::NAN } else { (sums::variance(values) * n / (n - 1.0)).sqrt() }
}

fn noise(effects: &[Vec<f64>]) -> f64 {
    let errors: Vec<f64> = effects.iter().map(|of| deviation(of) / (of.len() as f64).sqrt()).collect();
    FRAC_2_PI.sqrt() * sums::mean(&errors)
}

#[cfg(test)]
mod tests;
