//! The standard normal distribution, from `libm::erfc` alone, so that its bits do not depend on the CPU.

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
/// which triples the digits each time.
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
    }
}
