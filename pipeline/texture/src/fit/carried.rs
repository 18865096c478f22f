//! What of the residual a texture from the fit has.
//!
//! A texture is normal. Detrended as the DEM was and trimmed at the same level, it has on average the covariance `v T(C / v; z)`:
//! C the model through the detrender, v its variance, z the normal threshold of the level, T what trimming does
//! ([`crate::covariance::trimmed`]). Compared with the measured bins this says what the texture lacks, in total and in its increments,
//! `2 (C(0) - C(h))`. A residual with heavy tails has a threshold beyond z, so that a model with the right covariance still makes
//! textures that are too weak.

use super::case::Case;
use super::estimator::{Estimate, Estimator};
use crate::covariance::empirical;
use crate::covariance::filtered::DetrendFilter;
use crate::covariance::trimmed::TrimmedNormal;
use sastrugi_schemas::fit::{Carried, CarriedOctave, CovarianceMap};
use sastrugi_statistics::normal;

/// What a texture from a model has; the estimator is one on rings.
pub fn by_model(estimator: &Estimator, estimate: &Estimate) -> Carried {
    let case = estimator.case;
    let variance_m2 = estimator.expectation.variance_m2(&estimate.covariance);
    let binned = estimator.expectation.mean(&estimate.covariance, threshold(case) * variance_m2.sqrt());
    carried(case, &binned, variance_m2)
}

/// The measured covariance, continued by a model, and what a texture from it has.
pub fn by_map(case: &Case, estimate: &Estimate) -> (CovarianceMap, Carried) {
    let trimmed = TrimmedNormal::new(threshold(case));
    let sums = &case.survey.covariance;
    let filter = DetrendFilter::new(case.window, case.geometry.cell, sums.max_lag, case.settings.measurement());
    let map = empirical::covariance_map(sums, &trimmed, &filter.residual_noise(), estimate.form.name());
    let residual = empirical::Residual::of(&map, case.geometry.cell);
    let variance_m2 = residual.at([0, 0]);
    let binned = case.bins.average(|lag| variance_m2 * trimmed.covariance(residual.at(lag) / variance_m2));
    let carried = carried(case, &binned, variance_m2);
    (map, carried)
}

/// Where the level of trimming cuts a unit normal.
fn threshold(case: &Case) -> f64 {
    normal::quantile(1.0 - 0.5 * case.settings.trim())
}

/// Trimmed covariance in the rings beside the measured one.
fn carried(case: &Case, binned: &[f64], variance_m2: f64) -> Carried {
    let measured = &case.bins.covariance_m2;
    let variance_share = binned[0] / measured[0];
    let rms_m = case.survey.trim.rms_m;
    Carried {
        rms_share: variance_share.sqrt(),
        variance_share,
        untrimmed_rms_share: variance_m2.sqrt() / rms_m,
        increments: octaves(case, binned),
    }
}

fn octaves(case: &Case, binned: &[f64]) -> Vec<CarriedOctave> {
    let (lags, measured) = (&case.bins.lag_m, &case.bins.covariance_m2);
    let mut octaves = Vec::new();
    let mut first = 1;
    while first < lags.len() {
        let from_m = lags[first];
        let end = first + lags[first..].iter().take_while(|lag| **lag < 2.0 * from_m).count();
        let increments = |c: &[f64]| c[first..end].iter().map(|own| c[0] - own).sum::<f64>();
        let share = increments(binned) / increments(measured);
        octaves.push(CarriedOctave { from_m, to_m: lags[end - 1], share });
        first = end;
    }
    octaves
}
