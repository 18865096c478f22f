//! Sums in a fixed order, so that no thread count changes a bit.

/// Values summed one after another before the partial sums are joined in pairs.
const BLOCK: usize = 128;

/// Pairwise sum: the rounding error grows with log n, and the order depends on the length alone.
pub fn sum(values: &[f64]) -> f64 {
    if values.len() <= BLOCK {
        return values.iter().sum();
    }
    let half = values.len().div_ceil(2 * BLOCK) * BLOCK;
    sum(&values[..half]) + sum(&values[half..])
}

/// Arithmetic mean; NaN for no values.
pub fn mean(values: &[f64]) -> f64 {
    sum(values) / values.len() as f64
}

/// Mean of squared deviations from the mean (divided by n); NaN for no values.
pub fn variance(values: &[f64]) -> f64 {
    let centre = mean(values);
    let squares: Vec<f64> = values.iter().map(|v| (v - centre) * (v - centre)).collect();
    mean(&squares)
}

/// The values that are data (finite), in order.
pub fn finite(values: &[f64]) -> Vec<f64> {
    values.iter().copied().filter(|v| v.is_finite()).collect()
}

/// Quantile `q` in [0, 1] of sorted values by linear interpolation between order statistics
/// (type 7 of Hyndman and Fan, 1996); NaN for no values.
pub fn quantile_sorted(sorted: &[f64], q: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let position = q.clamp(0.0, 1.0) * last as f64;
    let low = position as usize;
    let high = (low + 1).min(last);
    sorted[low] + (sorted[high] - sorted[low]) * (position - low as f64)
}

/// Median of the values in any order, as [`quantile_sorted`] gives it; NaN for no values. Cost: two passes or so, no sorting.
pub fn median(values: &[f64]) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return f64::NAN };
    let mut parted = values.to_vec();
    let (_, low, above) = parted.select_nth_unstable_by(last / 2, f64::total_cmp);
    let low = *low;
    let high = if last % 2 == 0 { low } else { above.iter().copied().min_by(f64::total_cmp).unwrap_or(low) };
    quantile_sorted(&[low, high], if last % 2 == 0 { 0.0 } else { 0.5 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_pairwise_sum_is_accurate() {
        let values = vec![0.1; 1_000_003];
        assert!((sum(&values) - 100_000.3).abs() < 1e-9);
    }

    /// Of every length, with ties and signed zeros: the bits that sorting gives.
    #[test]
    fn prop_the_median_is_the_middle_quantile() {
        let values: Vec<f64> = (0..200u32).map(|k| f64::from(k.wrapping_mul(2_654_435_761) % 61) - 30.1).collect();
        let odd = [0.0, -0.0, 5e-324, -0.0, f64::MAX, -5e-324, 0.0];
        for values in [&values[..], &odd[..]] {
            for n in 1..=values.len() {
                let mut sorted = values[..n].to_vec();
                sorted.sort_by(f64::total_cmp);
                let (a, b) = (median(&values[..n]), quantile_sorted(&sorted, 0.5));
                assert_eq!(a.to_bits(), b.to_bits(), "{n}: {a} {b}");
            }
        }
    }

    #[test]
    fn val_quantiles() {
        let sorted = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(quantile_sorted(&sorted, 0.25), 1.75);
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert!(median(&[]).is_nan());
        assert_eq!(median(&[4.0, 1.0, 3.0, 2.0]), 2.5);
        assert_eq!(variance(&[1.0, 3.0]), 1.0);
    }
}
