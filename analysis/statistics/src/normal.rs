//! The standard normal distribution, computed with `libm` only, so that results do not depend on the CPU.
//!
//! Why not `statrs`: its functions call the C library (`f64::exp`, `f64::ln`), whose last bits change with the CPU and the
//! version of that library, and a report or a texture must be the same bytes everywhere. It serves as an oracle in tests, not
//! for anything that ends up in a file. The same holds for [`crate::student`] and [`crate::chi_square`].

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Density at `x`.
pub fn pdf(x: f64) -> f64 {
    libm::exp(-0.5 * x * x) / (2.0 * PI).sqrt()
}

/// Probability below `x`.
pub fn cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * FRAC_1_SQRT_2)
}

/// Probability of `|X| < x` for `x >= 0`.
pub fn central(x: f64) -> f64 {
    libm::erf(x * FRAC_1_SQRT_2)
}

/// The value with probability `p` below it; infinite at 0 and 1, NaN outside.
///
/// Start: Abramowitz and Stegun (1964), 26.2.23 (error below 4.5e-4); then Halley's method on the tail probability,
/// which triples the number of digits in each step.
///
/// ```
/// use sastrugi_statistics::normal;
///
/// // Half of a 95 % interval is 1.96 standard deviations, and the distribution is symmetric.
/// assert!((normal::quantile(0.975) - 1.959_964).abs() < 1e-6);
/// assert_eq!(normal::quantile(0.25), -normal::quantile(0.75));
/// assert!((normal::cdf(normal::quantile(0.1)) - 0.1).abs() < 1e-14);
/// ```
pub fn quantile(p: f64) -> f64 {
    if !(p > 0.0 && p < 1.0) {
        return match p {
            0.0 => f64::NEG_INFINITY,
            1.0 => f64::INFINITY,
            _ => f64::NAN,
        };
    }
    let tail = p.min(1.0 - p);
    let upper = (0..3).fold(tail_start(tail), |x, _| {
        let excess = (cdf(-x) - tail) / pdf(x);
        x + excess / (1.0 - 0.5 * x * excess)
    });
    if p < 0.5 { -upper } else { upper }
}

fn tail_start(tail: f64) -> f64 {
    let t = (-2.0 * libm::log(tail)).sqrt();
    let numerator = 2.515_517 + t * (0.802_853 + t * 0.010_328);
    t - numerator / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tables of the normal distribution to 15 digits (Wichura, 1988, AS 241, gives the first two and the last).
    #[test]
    fn val_quantiles() {
        for (p, x) in [
            (0.25, -0.674_489_750_196_081_7),
            (0.001, -3.090_232_306_167_813_5),
            (0.975, 1.959_963_984_540_054),
            (0.5, 0.0),
            (1e-20, -9.262_340_089_798_408),
        ] {
            assert!((quantile(p) - x).abs() <= 1e-14 * f64::max(1.0, x.abs()), "{p}: {}", quantile(p));
        }
        assert_eq!(quantile(0.0), f64::NEG_INFINITY);
        assert!(quantile(1.5).is_nan() && quantile(f64::NAN).is_nan());
    }

    #[test]
    fn prop_quantile_inverts_the_distribution() {
        for k in 1..400 {
            let p = f64::from(k) / 400.0;
            assert!((cdf(quantile(p)) - p).abs() < 1e-15);
        }
    }

    #[test]
    fn val_central_probability() {
        assert!((central(1.959_963_984_540_054) - 0.95).abs() < 1e-15);
        assert!((central(1.0) - 0.682_689_492_137_085_9).abs() < 1e-15);
        assert_eq!(central(0.0), 0.0);
    }

    /// Against mpmath at 30 digits, both tails. Relative tolerance 1e-13.
    #[test]
    fn val_of_mpmath() {
        for (x, p) in [
            (1.0, 0.841_344_746_068_542_9),
            (0.0, 0.5),
            (-3.0, 1.349_898_031_630_094_6e-3),
            (-10.0, 7.619_853_024_160_525e-24),
        ] {
            assert!((cdf(x) / p - 1.0).abs() < 1e-13, "{x}: {}", cdf(x));
        }
        for (x, density) in
            [(0.0, 0.398_942_280_401_432_7), (1.0, 0.241_970_724_519_143_34), (-3.0, 4.431_848_411_938_007e-3)]
        {
            assert!((pdf(x) / density - 1.0).abs() < 1e-13, "{x}: {}", pdf(x));
        }
        assert_eq!((quantile(1.0), quantile(0.75)), (f64::INFINITY, -quantile(0.25)));
        assert!(quantile(-0.1).is_nan());
    }
}
