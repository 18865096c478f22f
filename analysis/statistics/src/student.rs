//! Student's t distribution, from `libm` alone, so that its bits do not depend on the CPU.

/// Terms of the continued fraction at most; it needs fewer than 200 for up to 1e4 degrees of freedom.
const TERMS_MAX: usize = 2000;

/// Probability below `t` with `freedom > 0` degrees of freedom, which need not be whole; NaN outside.
pub fn cdf(t: f64, freedom: f64) -> f64 {
    let tail = 0.5 * incomplete_beta(0.5 * freedom, 0.5, freedom / (freedom + t * t));
    if t > 0.0 { 1.0 - tail } else { tail }
}

/// The value with probability `p` below it, by bisection; infinite at 0 and 1, NaN outside.
pub fn quantile(p: f64, freedom: f64) -> f64 {
    if !(p > 0.0 && p < 1.0 && freedom > 0.0) {
        return match p {
            0.0 => f64::NEG_INFINITY,
            1.0 => f64::INFINITY,
            _ => f64::NAN,
        };
    }
    let tail = p.min(1.0 - p);
    let mut high = 1.0;
    while cdf(-high, freedom) > tail && high < f64::MAX / 4.0 {
        high *= 2.0;
    }
    let mut low = 0.0;
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if cdf(-middle, freedom) > tail { low = middle } else { high = middle }
    }
    if p < 0.5 { -high } else { high }
}

/// Regularised incomplete beta function I_x(a, b) by its continued fraction (NIST Digital Library of Mathematical
/// Functions, 8.17.22), evaluated by W. Lentz's method (1976); the symmetry 8.17.4 takes it to where it converges fast.
pub(crate) fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if !(a > 0.0 && b > 0.0 && (0.0..=1.0).contains(&x)) {
        return f64::NAN;
    }
    if x == 0.0 || x == 1.0 {
        return x;
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(b, a, 1.0 - x);
    }
    let log_factor = a * libm::log(x) + b * libm::log1p(-x) + libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b);
    libm::exp(log_factor) / (a * fraction(a, b, x))
}

fn fraction(a: f64, b: f64, x: f64) -> f64 {
    // Lentz's method stays clear of zero denominators.
    let clear = |v: f64| if v.abs() < 1e-300 { 1e-300 } else { v };
    let (mut value, mut c, mut d) = (1.0, 1.0, 0.0);
    for k in 1..TERMS_MAX {
        let m = (k / 2) as f64;
        let term = if k % 2 == 0 {
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        } else {
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        };
        d = 1.0 / clear(1.0 + term * d);
        c = clear(1.0 + term / c);
        value *= c * d;
        if (c * d - 1.0).abs() < 1e-16 {
            break;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scipy.stats.t.cdf and .ppf of scipy 1.17.1 (`tests/statistical/nested_tests.py`). Relative tolerance 1e-11.
    #[test]
    fn val_of_scipy() {
        for (t, freedom, p) in [
            (-2.5, 1.0, 0.121_118_941_590_843_41),
            (-1.3, 2.5, 0.150_243_394_635_354_16),
            (0.7, 7.0, 0.746_741_223_902_2),
            (3.1, 38.6, 0.998_197_675_005_012_3),
            (-6.0, 1000.0, 1.377_684_586_688_737_6e-9),
            (-0.001, 4.0, 0.499_625_000_078_125),
            (-40.0, 3.0, 1.719_034_039_457_925_3e-5),
        ] {
            assert!((cdf(t, freedom) / p - 1.0).abs() < 1e-11, "{t}, {freedom}: {}", cdf(t, freedom));
        }
        for (p, freedom, t) in [
            (0.975, 1.0, 12.706_204_736_174_694),
            (0.95, 9.3, 1.826_403_427_771_456_5),
            (0.025, 38.0, -2.024_394_163_911_97),
            (0.6, 2.0, 0.288_675_134_594_812_8),
            (0.9999, 5.0, 9.677_566_300_882_814),
        ] {
            assert!((quantile(p, freedom) / t - 1.0).abs() < 1e-11, "{p}, {freedom}: {}", quantile(p, freedom));
        }
    }

    #[test]
    fn val_limits() {
        assert_eq!((cdf(0.0, 3.0), quantile(0.5, 3.0).abs() < 1e-15), (0.5, true));
        assert_eq!((quantile(0.0, 3.0), quantile(1.0, 3.0)), (f64::NEG_INFINITY, f64::INFINITY));
        assert!(quantile(0.3, 0.0).is_nan() && quantile(2.0, 3.0).is_nan() && cdf(f64::NAN, 3.0).is_nan());
        // One degree of freedom is Cauchy's distribution, many are the normal one.
        assert!((cdf(1.0, 1.0) - 0.75).abs() < 1e-14);
        assert!((cdf(-1.5, 1e7) - crate::normal::cdf(-1.5)).abs() < 1e-7);
    }
}
