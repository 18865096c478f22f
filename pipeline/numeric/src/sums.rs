//! Sums in a fixed order, so that the number of threads changes no bit.

/// Number of values summed sequentially before partial sums are added in pairs.
const BLOCK: usize = 128;

/// Pairwise sum. The rounding error grows with log n, and the order depends only on the length.
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
///
/// ```
/// use sastrugi_numeric::sums::{finite, mean, variance};
///
/// let values = finite(&[1.0, f64::NAN, 3.0, 5.0]);
/// assert_eq!((mean(&values), variance(&values)), (3.0, 8.0 / 3.0));
/// assert!(mean(&[]).is_nan());
/// ```
pub fn variance(values: &[f64]) -> f64 {
    let centre = mean(values);
    let squares: Vec<f64> = values.iter().map(|v| (v - centre) * (v - centre)).collect();
    mean(&squares)
}

/// The finite values (those that are data), in order.
pub fn finite(values: &[f64]) -> Vec<f64> {
    values.iter().copied().filter(|v| v.is_finite()).collect()
}

/// Quantile `q` in [0, 1] of sorted values by linear interpolation between order statistics
/// (type 7 of Hyndman and Fan, 1996); NaN for no values.
///
/// ```
/// use sastrugi_numeric::sums::{median, quantile_sorted};
///
/// let sorted = [1.0, 2.0, 4.0, 8.0];
/// assert_eq!(quantile_sorted(&sorted, 0.0), 1.0);
/// assert_eq!(quantile_sorted(&sorted, 0.5), 3.0);
/// // The median needs no sorting.
/// assert_eq!(median(&[8.0, 1.0, 4.0, 2.0]), 3.0);
/// assert!(median(&[]).is_nan());
/// ```
pub fn quantile_sorted(sorted: &[f64], q: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let position = q.clamp(0.0, 1.0) * last as f64;
    let low = position as usize;
    let high = (low + 1).min(last);
    sorted[low] + (sorted[high] - sorted[low]) * (position - low as f64)
}

/// Median of values in any order, equal to that of [`quantile_sorted`]; NaN for no values. Cost: about two passes, no sorting.
pub fn median(values: &[f64]) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return f64::NAN };
    let mut partitioned = values.to_vec();
    let (_, low, above) = partitioned.select_nth_unstable_by(last / 2, f64::total_cmp);
    let low = *low;
    let high = if last % 2 == 0 { low } else { above.iter().copied().min_by(f64::total_cmp).unwrap_or(low) };
    quantile_sorted(&[low, high], if last % 2 == 0 { 0.0 } else { 0.5 })
}

/// Median of sorted values of which each counts a number of times, equal to [`median`] of the repeated values; NaN for none. Cost: two passes,
/// nothing is repeated.
///
/// ```
/// use sastrugi_numeric::sums::median_counted;
///
/// let sorted = [(1.0, 2), (2.0, 0), (4.0, 1), (8.0, 3)];
/// // Of 1, 1, 4, 8, 8, 8.
/// assert_eq!(median_counted(sorted.iter().copied()), 6.0);
/// ```
pub fn median_counted(sorted: impl Iterator<Item = (f64, usize)> + Clone) -> f64 {
    let Some(last) = sorted.clone().map(|(_, n)| n).sum::<usize>().checked_sub(1) else { return f64::NAN };
    let (mut rest, mut left) = (sorted, last / 2);
    // The value with `left` others before it, and how many of it follow.
    let Some((low, more)) = rest.find_map(|(value, n)| match left.checked_sub(n) {
        Some(others) => {
            left = others;
            None
        }
        None => Some((value, n - left - 1)),
    }) else {
        return f64::NAN;
    };
    let high = if more > 0 { low } else { rest.find(|(_, n)| *n > 0).map_or(low, |(value, _)| value) };
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

    /// For every length, with ties and signed zeros: the same bits as sorting.
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

    /// The same bits as of the repeated values, for counts of 0 to 3 and every length.
    #[test]
    fn prop_counts_are_repetitions() {
        let sorted: Vec<f64> = (0..60u32).map(|k| f64::from(k / 2) - 7.3).collect();
        for n in 0..=sorted.len() {
            for salt in 0..8u32 {
                let count = |k: u32| ((k + salt).wrapping_mul(2_654_435_761) >> 28) as usize % 4;
                let counted: Vec<(f64, usize)> = sorted[..n].iter().zip(0..).map(|(v, k)| (*v, count(k))).collect();
                let repeated: Vec<f64> = counted.iter().flat_map(|(v, n)| vec![*v; *n]).collect();
                let (a, b) = (median_counted(counted.iter().copied()), median(&repeated));
                assert_eq!(a.to_bits(), b.to_bits(), "{counted:?}: {a} {b}");
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

    /// A single 1 is lost beside 1e16, whose neighbours are 2 apart, but a block of ones is not: the sums show where blocks begin.
    #[test]
    fn val_sums_are_added_in_blocks_of_128() {
        for (ones, kept) in [(127, 0.0), (255, 128.0), (299, 172.0)] {
            let values: Vec<f64> = std::iter::once(1e16).chain(std::iter::repeat_n(1.0, ones)).collect();
            assert_eq!(sum(&values) - 1e16, kept, "{ones}");
        }
    }

    #[test]
    fn val_mean_and_variance() {
        assert_eq!(mean(&[1.0, 2.0, 6.0]), 3.0);
        // Deviations of -2, -1 and 3; the divisor is n, not n - 1.
        assert_eq!(variance(&[1.0, 2.0, 6.0]), 14.0 / 3.0);
        assert!(mean(&[]).is_nan() && variance(&[]).is_nan() && quantile_sorted(&[], 0.5).is_nan());
        assert_eq!(finite(&[1.0, f64::NAN, f64::INFINITY, -2.0, f64::NEG_INFINITY]), [1.0, -2.0]);
    }

    /// The ends are the extremes, also for shares beyond 0 and 1.
    #[test]
    fn val_quantiles_end_at_the_extremes() {
        let sorted = [1.0, 2.0, 4.0, 8.0];
        let expected = [(-1.0, 1.0), (0.0, 1.0), (0.5, 3.0), (0.9, 6.8), (1.0, 8.0), (2.0, 8.0)];
        for (share, value) in expected {
            assert!((quantile_sorted(&sorted, share) - value).abs() < 1e-14, "{share}");
        }
        assert_eq!(quantile_sorted(&[5.0], 0.7), 5.0);
    }
}
