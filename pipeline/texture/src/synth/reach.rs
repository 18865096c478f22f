//! How far a covariance reaches, and how wide a torus must therefore be.
//!
//! A covariance cut to a torus stays positive definite, or nearly so, when little of it is left half way round. How little
//! depends on its spectrum: one that falls slowly (a kink at lag zero) outweighs what the cut adds, a smooth one does not.
//! Measured for all models, Matern smoothness 0.05 to 4: with `exp(-8)` left, rough terms have a negative share below 1e-7
//! of the spectrum; with 1e-6 left, smooth ones stay below 6e-7.

use crate::covariance::{Covariance, Structure};

/// Share of a rough term's variance that may be left half way round the torus: an exponential has 8 ranges to go.
const ROUGH_LEVEL: f64 = 3.354_626_279_025_118e-4;
/// The same for a smooth term.
const SMOOTH_LEVEL: f64 = 1e-6;
/// A term is rough when it loses more than this over 1/1000 of its range.
const ROUGH_LOSS: f64 = 1e-4;

/// Distance along the long axis at which a term has fallen to `level` of its variance, m.
pub fn distance_m(term: &Structure, level: f64) -> f64 {
    let at = |ratio: f64| term.model.correlation(ratio, term.shape);
    let mut high = 1.0;
    while at(high) > level {
        high *= 2.0;
    }
    let mut low = 0.0;
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if at(middle) > level { low = middle } else { high = middle }
    }
    // Nine digits: an exponential at exp(-8) gives 8.
    (high * 1e9).round() / 1e9 * term.range_m
}

/// Distance along the long axis beyond which every term is below `level` of its variance, m.
pub fn reach_m(covariance: &Covariance, level: f64) -> f64 {
    covariance.structures.iter().map(|s| distance_m(s, level)).fold(0.0, f64::max)
}

/// Distance along the long axis at which the covariance has fallen to half its variance (without the nugget), m.
pub fn half_distance_m(covariance: &Covariance) -> f64 {
    let half = 0.5 * covariance.variance_m2();
    let (mut low, mut high) = (0.0, covariance.range_m());
    while covariance.at_distance(high) > half {
        high *= 2.0;
    }
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if covariance.at_distance(middle) > half { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Sides of a torus, east-west and north-south, on which the covariance is positive definite but for a share of 1e-6, m.
pub fn torus_m(covariance: &Covariance) -> [f64; 2] {
    let rough = |s: &Structure| 1.0 - s.model.correlation(1e-3, s.shape) > ROUGH_LOSS;
    let half = |s: &Structure| distance_m(s, if rough(s) { ROUGH_LEVEL } else { SMOOTH_LEVEL });
    let side_m = 2.0 * covariance.structures.iter().map(half).fold(0.0, f64::max);
    extent(covariance).map(|e| e * side_m)
}

/// Half widths, east-west and north-south, of the ellipse of all lags that the covariance sees at distance 1.
pub fn extent(covariance: &Covariance) -> [f64; 2] {
    if covariance.is_isotropic() {
        return [1.0; 2];
    }
    let (sin, cos) = libm::sincos(covariance.azimuth_deg.to_radians());
    let ratio = covariance.ratio;
    [(sin * sin + ratio * ratio * cos * cos).sqrt(), (cos * cos + ratio * ratio * sin * sin).sqrt()]
}
