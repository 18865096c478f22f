//! Student's t distribution and the incomplete beta function, computed with `libm` only, so that results do not depend on the CPU
//! (why not `statrs`: see [`crate::normal`]).

/// Most terms of the continued fraction; it needs fewer than 200 for up to 1e4 degrees of freedom.
const TERMS_MAX: usize = 2000;

/// Probability below `t` with `freedom > 0` degrees of freedom, not necessarily an integer; NaN outside the domain.
///
/// ```
/// use sastrugi_statistics::student;
///
/// // With one degree of freedom it is Cauchy's distribution, whose quartiles are -1 and 1.
/// assert!((student::cdf(1.0, 1.0) - 0.75).abs() < 1e-14);
/// assert!((student::quantile(0.25, 1.0) + 1.0).abs() < 1e-12);
/// ```
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
/// Functions, 8.17.22), evaluated by W. Lentz's method (1976), after applying the symmetry 8.17.4 where that converges faster.
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
    // Lentz's method avoids zero denominators.
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

    /// Against scipy.stats.t.cdf and .ppf of scipy 1.17.1 (`tests/statistical/nested_tests.py`). Relative tolerance 1e-11.
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

    /// Closed forms (M. Abramowitz and I. Stegun, 1964, 26.7.3 and 26.7.4, for 2, 3 and 4 degrees of freedom) on both sides of 0.
    /// Tolerance 1e-12.
    #[test]
    fn val_closed_forms() {
        for k in -60..=60 {
            let t = 0.25 * f64::from(k);
            let r = t / 3f64.sqrt();
            let of_three = 0.5 + (r / (1.0 + r * r) + libm::atan(r)) / std::f64::consts::PI;
            let s = t / (4.0 + t * t).sqrt();
            for (freedom, expected) in
                [(2.0, 0.5 + 0.5 * t / (2.0 + t * t).sqrt()), (3.0, of_three), (4.0, 0.5 + 0.25 * s * (3.0 - s * s))]
            {
                assert!((cdf(t, freedom) - expected).abs() < 1e-12, "{t}, {freedom}: {} {expected}", cdf(t, freedom));
                assert!((cdf(t, freedom) + cdf(-t, freedom) - 1.0).abs() < 1e-15);
            }
        }
    }

    /// The quantile inverts the distribution. Tolerance 1e-12 of p.
    #[test]
    fn prop_quantile_inverts_the_distribution() {
        for freedom in [1.0, 2.5, 7.0, 38.6, 1000.0] {
            for p in [1e-6, 0.025, 0.3, 0.5, 0.8, 0.999] {
                assert!((cdf(quantile(p, freedom), freedom) - p).abs() < 1e-12, "{p} {freedom}");
            }
        }
    }

    /// `I_x(k, n - k + 1)` is the probability of at least `k` successes among `n`, summed here term by term; on both sides of the
    /// switch between the two fractions. `I_x(a, 1) = x^a`. Tolerance 1e-12.
    #[test]
    fn val_incomplete_beta_is_a_binomial_tail() {
        for n in [1, 2, 5, 12, 30] {
            for x in [0.01, 0.2, 0.5, 0.73, 0.99] {
                // Probability of j successes, from that of none.
                let mut term = (0..n).fold(1.0, |product, _| product * (1.0 - x));
                let terms: Vec<f64> = (0..=n)
                    .map(|j| {
                        let own = term;
                        term *= f64::from(n - j) / f64::from(j + 1) * x / (1.0 - x);
                        own
                    })
                    .collect();
                for k in 1..=n {
                    let tail: f64 = terms[k as usize..].iter().rev().sum();
                    let found = incomplete_beta(f64::from(k), f64::from(n - k + 1), x);
                    assert!((found - tail).abs() < 1e-12, "{k} of {n} at {x}: {found} {tail}");
                }
            }
        }
        assert!((incomplete_beta(2.5, 1.0, 0.49) - 0.168_07).abs() < 1e-12);
        assert_eq!((incomplete_beta(2.0, 3.0, 0.0), incomplete_beta(2.0, 3.0, 1.0)), (0.0, 1.0));
        assert!(incomplete_beta(0.0, 1.0, 0.5).is_nan() && incomplete_beta(1.0, 1.0, 1.1).is_nan());
    }

    #[test]
    fn val_limits() {
        assert_eq!((cdf(0.0, 3.0), quantile(0.5, 3.0).abs() < 1e-15), (0.5, true));
        assert_eq!((quantile(0.0, 3.0), quantile(1.0, 3.0)), (f64::NEG_INFINITY, f64::INFINITY));
        assert!(quantile(0.3, 0.0).is_nan() && quantile(2.0, 3.0).is_nan() && cdf(f64::NAN, 3.0).is_nan());
        // With one degree of freedom it is Cauchy's distribution, with many the normal one.
        assert!((cdf(1.0, 1.0) - 0.75).abs() < 1e-14);
        assert!((cdf(-1.5, 1e7) - crate::normal::cdf(-1.5)).abs() < 1e-7);
    }
}
