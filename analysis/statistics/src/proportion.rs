//! Means of values that are bounded, of few terrains: shares, signs and correlations within blocks.
//!
//! The interval is that of C. Clopper and E. Pearson (Biometrika 26, 1934) for a share, with the sum of the values in place of the
//! number of successes:
//!
//! ```text
//! low: I_low(x, n - x + 1) = tail,   high: I_high(x + 1, n - x) = 1 - tail,   x = sum of n values in 0..1
//! ```
//!
//! `I` is the regularised incomplete beta function, which needs no whole `x`. Of all distributions in 0..1 with one mean the one at the
//! ends alone scatters most (W. Hoeffding, Journal of the American Statistical Association 58, 1963), so that of other values the
//! interval is too wide rather than too short; and it does not shrink to a point where all values are 0 or all are 1, as redraws do.

use crate::bootstrap::Interval;
use crate::student::incomplete_beta;
use sastrugi_numeric::sums;

/// Mean of values in 0..1 with its interval; `None` for no values.
pub fn of_shares(values: &[f64], level: f64) -> Option<Interval> {
    let (n, x) = (values.len() as f64, sums::sum(values).clamp(0.0, values.len() as f64));
    let tail = 0.5 * (1.0 - level);
    let low = if x > 0.0 { beta_quantile(tail, x, n - x + 1.0) } else { 0.0 };
    let high = if x < n { beta_quantile(1.0 - tail, x + 1.0, n - x) } else { 1.0 };
    let estimate = x / n;
    estimate.is_finite().then(|| Interval { estimate, low: low.min(estimate), high: high.max(estimate), level })
}

/// Mean of values in -1..1 with its interval; `None` for no values.
pub fn between_ends(values: &[f64], level: f64) -> Option<Interval> {
    let shares: Vec<f64> = values.iter().map(|v| 0.5 * (1.0 + v)).collect();
    let of = of_shares(&shares, level)?;
    let back = |share: f64| 2.0 * share - 1.0;
    Some(Interval { estimate: back(of.estimate), low: back(of.low), high: back(of.high), level })
}

/// Where the beta distribution has probability `p` below it, by bisection.
fn beta_quantile(p: f64, a: f64, b: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if incomplete_beta(a, b, middle) < p { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    /// scipy 1.17.1, stats.beta.ppf (`tests/statistical/nested_tests.py`): 0, 3 and 10 of 10 and half counts. Tolerance 1e-12.
    #[test]
    fn val_of_scipy() {
        let of = |ones: usize, halves: usize| {
            let values: Vec<f64> = (0..10)
                .map(|k| {
                    if k < ones {
                        1.0
                    } else if k < ones + halves {
                        0.5
                    } else {
                        0.0
                    }
                })
                .collect();
            of_shares(&values, 0.95).unwrap()
        };
        for (i, low, high) in [
            (of(0, 0), 0.0, 0.308_497_107_818_760_7),
            (of(3, 0), 0.066_739_511_177_734_47, 0.652_452_850_059_997_3),
            (of(10, 0), 0.691_502_892_181_239_2, 1.0),
            (of(3, 1), 0.092_694_593_938_153_16, 0.696_320_514_399_511_7),
        ] {
            assert!((i.low - low).abs() < 1e-12 && (i.high - high).abs() < 1e-12, "{i:?}");
        }
        assert_eq!(of_shares(&[], 0.95), None);
        let signs = between_ends(&[1.0, 1.0, 1.0, -1.0], 0.95).unwrap();
        assert!(signs.estimate == 0.5 && signs.low > -0.7 && signs.high < 1.0, "{signs:?}");
    }

    /// Null: the interval holds the mean in 95 % of sets at least. Values at the ends, at three places and even in 0..1; 4 and 15 of
    /// them; 2000 sets each. Fewer than 1840 hits (92 %) of 2000 has a false-alarm probability below 1e-8 (binomial, p = 0.95).
    #[test]
    fn stat_coverage() {
        let mut s = Streams::for_seed(1, "proportion-test").stream("coverage");
        for n in [4, 15] {
            let mut hits = [0; 3];
            for _ in 0..2000 {
                let mut values = |of: &dyn Fn(f64) -> f64| (0..n).map(|_| of(s.uniform())).collect::<Vec<f64>>();
                let ends = values(&|u| f64::from(u8::from(u < 0.9)));
                let places = values(&|u| {
                    if u < 0.2 {
                        0.0
                    } else if u < 0.6 {
                        0.5
                    } else {
                        1.0
                    }
                });
                let even = values(&|u| u);
                let held =
                    [(ends, 0.9), (places, 0.6), (even, 0.5)].map(|(v, mean)| of_shares(&v, 0.95).unwrap().holds(mean));
                hits.iter_mut().zip(held).for_each(|(n, h)| *n += usize::from(h));
            }
            assert!(hits.iter().all(|h| *h >= 1840), "{hits:?} of 2000 with {n}");
        }
    }
}
