//! How far a covariance reaches, and the torus width that follows.
//!
//! A covariance truncated to a torus stays positive definite, or nearly so, if little of it is left half way around. How little
//! depends on its spectrum: one that falls slowly (a kink at lag zero) outweighs the effect of the truncation, a smooth one does not.
//! Measured for all models, Matern smoothness 0.05 to 4: with `exp(-8)` left, rough terms have a negative share below 1e-7
//! of the spectrum; with 1e-6 left, smooth ones stay below 6e-7.

use crate::covariance::{Covariance, Structure};

/// Share of a rough term's variance that may be left half way around the torus: 8 ranges of an exponential.
const ROUGH_LEVEL: f64 = 3.354_626_279_025_118e-4;
/// The same for a smooth term.
const SMOOTH_LEVEL: f64 = 1e-6;
/// A term is rough if its correlation falls by more than this over 1/1000 of its range.
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
    // Rounded to nine digits, so that an exponential at exp(-8) gives exactly 8.
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

/// Sides of a torus, east-west and north-south, m, on which the covariance is positive definite except for a share of 1e-6.
pub fn torus_m(covariance: &Covariance) -> [f64; 2] {
    let rough = |s: &Structure| 1.0 - s.model.correlation(1e-3, s.shape) > ROUGH_LOSS;
    let half = |s: &Structure| distance_m(s, if rough(s) { ROUGH_LEVEL } else { SMOOTH_LEVEL });
    let side_m = 2.0 * covariance.structures.iter().map(half).fold(0.0, f64::max);
    extent(covariance).map(|e| e * side_m)
}

/// Half widths, east-west and north-south, of the ellipse of all lags at an effective distance of 1.
pub fn extent(covariance: &Covariance) -> [f64; 2] {
    if covariance.is_isotropic() {
        return [1.0; 2];
    }
    let (sin, cos) = libm::sincos(covariance.azimuth_deg.to_radians());
    let ratio = covariance.ratio;
    [(sin * sin + ratio * ratio * cos * cos).sqrt(), (cos * cos + ratio * ratio * sin * sin).sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::{Form, model};

    fn plain(name: &str, range_m: f64) -> Covariance {
        Covariance::new(model(name).unwrap(), 0.3, range_m).unwrap()
    }

    fn stretched(ratio: f64, azimuth_deg: f64) -> Covariance {
        Covariance { ratio, azimuth_deg, ..plain("exponential", 2.0) }
    }

    /// In closed form: an exponential has fallen to exp(-8) at 8 ranges and to 1/2 at ln 2 ranges, a Gaussian to 1e-6 at sqrt(ln 1e6) and to
    /// 1/2 at sqrt(ln 2) ranges; a spherical one ends at its range.
    #[test]
    fn val_reach_in_closed_form() {
        let (exponential, gaussian) = (plain("exponential", 0.5), plain("gaussian", 0.5));
        assert_eq!(distance_m(&exponential.structures[0], ROUGH_LEVEL), 4.0);
        assert!((reach_m(&exponential, 1e-3) - 0.5 * libm::log(1e3)).abs() < 1e-9);
        assert!((reach_m(&gaussian, 1e-6) - 0.5 * libm::log(1e6).sqrt()).abs() < 1e-9);
        assert!((reach_m(&plain("spherical", 0.5), 1e-12) - 0.5).abs() < 1e-3);
        assert!((half_distance_m(&exponential) - 0.5 * std::f64::consts::LN_2).abs() < 1e-12);
        assert!((half_distance_m(&gaussian) - 0.5 * std::f64::consts::LN_2.sqrt()).abs() < 1e-12);
        // A nugget does not count, and the longest term decides.
        let values = [("sigma_m", 0.1), ("range_m", 0.2), ("sigma_2_m", 0.1), ("range_2_m", 1.5), ("nugget_m2", 0.4)];
        let sum = Form::parse("gaussian+exponential+nugget").unwrap();
        let sum = sum.covariance(&values.map(|(k, v)| (k.to_owned(), v)).into()).unwrap();
        assert!((reach_m(&sum, 1e-3) - 1.5 * libm::log(1e3)).abs() < 1e-8);
        let without = Covariance { nugget_m2: 0.0, ..sum.clone() };
        assert_eq!(half_distance_m(&sum), half_distance_m(&without));
    }

    /// A torus is 16 ranges of an exponential wide, and 2 sqrt(ln 1e6) of a Gaussian, whose spectrum falls faster.
    #[test]
    fn val_torus_widths() {
        assert_eq!(torus_m(&plain("exponential", 0.5)), [8.0, 8.0]);
        let [width, height] = torus_m(&plain("gaussian", 0.5));
        assert!((width - libm::log(1e6).sqrt()).abs() < 1e-8 && width == height, "{width}");
        // The long axis to the north, then to the east.
        assert_eq!((torus_m(&stretched(0.25, 0.0)), torus_m(&stretched(0.25, 90.0))[0]), ([8.0, 32.0], 32.0));
    }

    /// The ellipse's half widths: across and along the axis at 0 and 90 degrees, sqrt((1 + ratio^2) / 2) for both at 45 degrees.
    #[test]
    fn val_extent_of_the_ellipse() {
        assert_eq!(extent(&stretched(0.5, 0.0)), [0.5, 1.0]);
        let near = |found: [f64; 2], expected: [f64; 2]| (0..2).all(|k| (found[k] - expected[k]).abs() < 1e-12);
        assert!(near(extent(&stretched(0.5, 90.0)), [1.0, 0.5]));
        assert!(near(extent(&stretched(0.5, 45.0)), [0.625f64.sqrt(); 2]));
        assert_eq!(extent(&plain("gaussian", 3.0)), [1.0, 1.0]);
        // No lag on the ellipse extends further, and some lag reaches that far.
        let covariance = stretched(0.3, 25.0);
        let [x, y] = extent(&covariance);
        let on = (0..3600).map(|k| {
            let (sin, cos) = libm::sincos(f64::from(k) / 1800.0 * std::f64::consts::PI);
            let length = 1.0 / covariance.distance_m([sin, cos]);
            [length * sin, length * cos]
        });
        let most = on.fold([0.0f64; 2], |m, p| [m[0].max(p[0]), m[1].max(p[1])]);
        assert!((most[0] - x).abs() < 1e-4 && (most[1] - y).abs() < 1e-4, "{most:?} {x} {y}");
    }
}
