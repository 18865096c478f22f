//! How much of the residual a texture from the fit reproduces, after the measurement noise, which a texture does not have, is
//! subtracted from both.
//!
//! A texture is normal. Detrended like the DEM and trimmed at the same level, it has on average the covariance `v T(C / v; z)`:
//! C the model after the detrending filter, v its variance, z the normal threshold of the level, T the effect of trimming
//! ([`crate::covariance::trimmed`]). Comparison with the measured bins shows what the texture lacks, in total and in its increments,
//! `2 (C(0) - C(h))`. A residual with heavy tails has a threshold beyond z, so that even a model with the right covariance produces
//! textures that are too weak.

use super::case::Case;
use super::estimator::{Estimate, Estimator};
use crate::covariance::empirical;
use crate::covariance::filtered::{DetrendFilter, LagField};
use crate::covariance::trimmed::TrimmedNormal;
use sastrugi_schemas::fit::{Carried, CarriedOctave, CovarianceMap};
use sastrugi_statistics::normal;

/// What a texture from a model reproduces; `estimator` must be on rings.
pub fn by_model(estimator: &Estimator, estimate: &Estimate) -> Carried {
    let case = estimator.case;
    let variance_m2 = estimator.expectation.variance_m2(&estimate.covariance);
    let with_noise = estimator.expectation.mean(&estimate.covariance, threshold(case) * variance_m2.sqrt());
    let noise = estimator.expectation.filter.residual_noise();
    let noise_m2 = trimmed_noise(case, &noise, with_noise[0] / variance_m2);
    let binned: Vec<f64> = with_noise.iter().zip(&noise_m2).map(|(all, noise)| all - noise).collect();
    carried(case, &binned, variance_m2 - noise.at([0, 0]), &noise)
}

/// The measured covariance, extrapolated by a model, and what a texture from it reproduces.
pub fn by_map(case: &Case, estimate: &Estimate) -> (CovarianceMap, Carried) {
    let trimmed = TrimmedNormal::new(threshold(case));
    let sums = &case.survey.covariance;
    let filter = DetrendFilter::new(case.window, case.geometry.cell, sums.max_lag, case.settings.measurement());
    let noise = filter.residual_noise();
    let map = empirical::covariance_map(sums, &trimmed, &noise, estimate.form.name());
    let residual = empirical::Residual::of(&map, case.geometry.cell);
    let variance_m2 = residual.at([0, 0]);
    let binned = case.bins.average(|lag| variance_m2 * trimmed.covariance(residual.at(lag) / variance_m2));
    let carried = carried(case, &binned, variance_m2, &noise);
    (map, carried)
}

/// True if every share is a number: there is none of a residual that does not exceed its noise.
pub fn is_finite(carried: &Carried) -> bool {
    let Carried { rms_share, variance_share, untrimmed_rms_share, increments } = carried;
    let all = increments.iter().map(|octave| octave.share).chain([*rms_share, *variance_share, *untrimmed_rms_share]);
    all.into_iter().all(f64::is_finite)
}

/// The noise's covariance in the rings after trimming, which keeps about the same share `kept` of texture and noise.
fn trimmed_noise(case: &Case, noise: &LagField, kept: f64) -> Vec<f64> {
    case.bins.average(|lag| kept * noise.at(lag))
}

/// The trimming threshold of a standard normal variable.
fn threshold(case: &Case) -> f64 {
    normal::quantile(1.0 - 0.5 * case.settings.trim())
}

/// Compares the trimmed covariance of a texture in the rings with the measured one minus its noise.
fn carried(case: &Case, binned: &[f64], variance_m2: f64, noise: &LagField) -> Carried {
    let noise_m2 = trimmed_noise(case, noise, binned[0] / variance_m2);
    let measured: Vec<f64> = case.bins.covariance_m2.iter().zip(noise_m2).map(|(all, noise)| all - noise).collect();
    let variance_share = binned[0] / measured[0];
    let rms_m2 = case.survey.trim.rms_m * case.survey.trim.rms_m;
    Carried {
        rms_share: variance_share.sqrt(),
        variance_share,
        untrimmed_rms_share: (variance_m2 / (rms_m2 - noise.at([0, 0]))).sqrt(),
        increments: octaves(case, binned, &measured),
    }
}

fn octaves(case: &Case, binned: &[f64], measured: &[f64]) -> Vec<CarriedOctave> {
    let lags = &case.bins.lag_m;
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
