//! Profile likelihood of the range: the generalised sum of squares with the range held fixed and all other parameters refitted.
//!
//! A range is inside the 95 % interval if its sum of squares exceeds the minimum by at most 3.84 (chi-squared, one degree of
//! freedom: Wilks, 1938), times the misfit per degree of freedom where that is above 1. Where the sum never rises that far,
//! the data does not bound the range and the interval is open.

use super::estimator::{Estimate, Estimator, Held};
use crate::covariance::form::Role;
use rayon::prelude::*;
use sastrugi_schemas::fit::Profile;

/// Rise of twice the log-likelihood that rules a parameter out at 95 %.
pub const LIKELIHOOD_RISE: f64 = 3.84;
/// Ranges of the profile, as multiples of the estimate.
const SHARES: [f64; 13] = [0.25, 0.35, 0.5, 0.6, 0.7, 0.85, 1.0, 1.2, 1.4, 1.7, 2.0, 3.0, 4.0];
/// Bisections of a bracket of a factor of two: the end is accurate to 1 %.
const HALVINGS: usize = 6;

/// Rise of the generalised sum of squares away from the fitted range, within the bounds of the search.
pub fn profile(estimator: &Estimator, estimate: &Estimate) -> Option<Profile> {
    let coordinate = estimate.coordinate(Role::Range(0))?;
    let coordinates = estimator.case.coordinates(&estimate.form);
    let (low, high) = coordinates.bounds()[coordinate];
    let mut places: Vec<f64> =
        SHARES.iter().map(|share| (estimate.at[coordinate] + libm::log(*share)).clamp(low, high)).collect();
    places.dedup();
    let held = places.par_iter().map(|at| estimator.held(estimate, coordinate, *at)).collect::<Option<Vec<Held>>>()?;
    Some(Profile {
        range_m: held.iter().map(|h| coordinates.decode(&h.at).structures[0].range_m).collect(),
        chi2_rise: held.iter().map(|h| h.rise).collect(),
    })
}

/// True if every sum of squares is a number.
pub fn is_finite(profile: &Profile) -> bool {
    profile.range_m.iter().chain(&profile.chi2_rise).all(|v| v.is_finite())
}

/// The fits at both ends of the range's interval, each `None` where it is open; `None` without a likelihood.
pub fn ends(estimator: &Estimator, estimate: &Estimate) -> Option<[Option<Held>; 2]> {
    let coordinate = estimate.coordinate(Role::Range(0))?;
    let limit = LIKELIHOOD_RISE * estimate.misfit_ratio()?.max(1.0);
    let (low, high) = estimator.case.coordinates(&estimate.form).bounds()[coordinate];
    let find = |bound: f64, step: f64| {
        end(&|at| estimator.held(estimate, coordinate, at), estimate.at[coordinate], bound, step, limit)
    };
    let (below, above) = rayon::join(|| find(low, -std::f64::consts::LN_2), || find(high, std::f64::consts::LN_2));
    Some([below, above])
}

/// Steps from `start` towards `bound` until the rise passes `limit`; returns the last fit inside.
fn end(held: &dyn Fn(f64) -> Option<Held>, start: f64, bound: f64, step: f64, limit: f64) -> Option<Held> {
    let (mut inside, mut outside) = (start, start);
    while outside != bound {
        outside = if step < 0.0 { (outside + step).max(bound) } else { (outside + step).min(bound) };
        if held(outside)?.rise > limit {
            for _ in 0..HALVINGS {
                let middle = 0.5 * (inside + outside);
                if held(middle)?.rise > limit { outside = middle } else { inside = middle }
            }
            return held(inside);
        }
        inside = outside;
    }
    None
}
