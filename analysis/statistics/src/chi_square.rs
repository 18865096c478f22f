//! The chi-square distribution with integer degrees of freedom, computed with `libm` only, so that results do not depend on the
//! CPU (why not `statrs`: see [`crate::normal`]).

/// Probability above `x >= 0` with `freedom >= 1` degrees of freedom (M. Abramowitz and I. Stegun, 1964, 26.4.4 and
/// 26.4.5, in the form of the recurrence 26.4.8); NaN outside the domain.
pub fn above(x: f64, freedom: usize) -> f64 {
    if !(x >= 0.0 && freedom > 0) {
        return f64::NAN;
    }
    let half = 0.5 * x;
    let (mut probability, mut k) = if freedom % 2 == 1 { (libm::erfc(half.sqrt()), 1) } else { (libm::exp(-half), 2) };
    while k < freedom {
        let order = 0.5 * k as f64;
        if half > 0.0 {
            probability += libm::exp(order * libm::log(half) - half - libm::lgamma(order + 1.0));
        }
        k += 2;
    }
    probability
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The midpoint rule on the density as an independent reference, `x^(k/2 - 1) exp(-x/2) / (2^(k/2) Gamma(k/2))`. The rule is off by
    /// `step^2 / 24` times the slopes at the ends, at most 1e-8; tolerance 1e-6.
    #[test]
    fn val_integral_of_the_density() {
        for freedom in 4..=9 {
            let half = 0.5 * freedom as f64;
            let factor = libm::exp2(-half) / libm::tgamma(half);
            let density = |x: f64| factor * libm::exp((half - 1.0) * libm::log(x) - 0.5 * x);
            for from in [0.5, 4.0, 11.0] {
                let step = 1e-3;
                let tail: f64 = (0..120_000).map(|k| density(from + (f64::from(k) + 0.5) * step) * step).sum();
                assert!((above(from, freedom) - tail).abs() < 1e-6, "{from}, {freedom}: {tail}");
            }
        }
    }

    /// Against scipy.stats.chi2.sf of scipy 1.17.1 (`tests/statistical/nested_tests.py`). Relative tolerance 1e-12.
    #[test]
    fn val_of_scipy() {
        for (x, freedom, p) in [
            (3.84, 1, 0.050_043_521_248_705_19),
            (0.02, 1, 0.887_537_083_981_715),
            (5.99, 2, 0.050_036_627_086_586_29),
            (7.0, 3, 0.071_897_772_496_465_09),
            (30.0, 4, 4.894_437_128_029_217e-6),
            (0.5, 7, 0.999_446_481_390_424_9),
            (120.0, 10, 5.060_046_065_842_555e-21),
        ] {
            assert!((above(x, freedom) / p - 1.0).abs() < 1e-12, "{x}, {freedom}: {}", above(x, freedom));
        }
        assert!(above(-1.0, 1).is_nan() && above(1.0, 0).is_nan() && above(f64::NAN, 2).is_nan());
        assert_eq!((above(0.0, 1), above(0.0, 4), above(f64::INFINITY, 2)), (1.0, 1.0, 0.0));
    }
}
