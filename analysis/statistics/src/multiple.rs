//! Adjustment for multiple tests.

/// Holm's (1979) step-down adjustment: rejecting where `adjusted <= alpha`, the probability that any true hypothesis of
/// the family is rejected is at most alpha, however the tests depend on each other. NaN stays NaN and does not count as a test.
///
/// ```
/// use sastrugi_statistics::holm;
///
/// // The smallest of three p-values counts three times, the next twice; the order of the input is kept.
/// assert_eq!(holm(&[0.5, 0.125, 0.25]), [0.5, 0.375, 0.5]);
/// ```
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).filter(|&k| !p[k].is_nan()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut adjusted = vec![f64::NAN; p.len()];
    let mut largest = 0.0f64;
    for (rank, &k) in order.iter().enumerate() {
        largest = largest.max((p[k] * (order.len() - rank) as f64).min(1.0));
        adjusted[k] = largest;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: 4 x 0.01, 3 x 0.02, 2 x 0.03 (at least the value before it), 1 x 0.5.
    #[test]
    fn val_holm_by_hand() {
        let adjusted = holm(&[0.5, 0.01, f64::NAN, 0.03, 0.02]);
        let expected = [0.5, 0.04, f64::NAN, 0.06, 0.06];
        for (a, e) in adjusted.iter().zip(expected) {
            assert!((a - e).abs() < 1e-15 || a.is_nan() && e.is_nan(), "{adjusted:?}");
        }
        // statsmodels 0.15.0, multitest.multipletests, method "holm" (`tests/statistical/nested_tests.py`). Tolerance 1e-15.
        let adjusted = holm(&[0.5, 0.01, 0.03, 0.02, 0.0004, 0.02]);
        for (a, e) in adjusted.iter().zip([0.5, 0.05, 0.08, 0.08, 0.0024, 0.08]) {
            assert!((a - e).abs() < 1e-15, "{adjusted:?}");
        }
        assert_eq!(holm(&[0.9, 0.8]), vec![1.0, 1.0]);
        assert!(holm(&[]).is_empty());
    }
}
