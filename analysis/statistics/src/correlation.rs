//! Correlation of paired values.

use sastrugi_numeric::sums;

/// Pearson's (1895) product-moment correlation of the pairs `(x[i], y[i])`; the longer slice is truncated. NaN for fewer than two
/// pairs or if one side is constant.
///
/// ```
/// use sastrugi_statistics::correlation::{pearson, spearman};
///
/// // A cube is not a straight line, but it keeps the order.
/// let (x, y) = ([1.0, 2.0, 3.0], [1.0, 8.0, 27.0]);
/// assert!(pearson(&x, &y) < 1.0);
/// assert_eq!(spearman(&x, &y), 1.0);
/// ```
pub fn pearson(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len().min(y.len());
    let (x, y) = (centred(&x[..n]), centred(&y[..n]));
    let dot = |a: &[f64], b: &[f64]| sums::sum(&a.iter().zip(b).map(|(p, q)| p * q).collect::<Vec<_>>());
    let r = dot(&x, &y) / (dot(&x, &x) * dot(&y, &y)).sqrt();
    if r.is_finite() { r.clamp(-1.0, 1.0) } else { f64::NAN }
}

/// Spearman's (1904) rank correlation: Pearson's correlation of the ranks, with mean ranks for ties.
///
/// ```
/// use sastrugi_statistics::correlation::{ranks, spearman};
///
/// assert_eq!(ranks(&[5.0, 2.0, 5.0, 9.0]), [2.5, 1.0, 2.5, 4.0]);
/// // Any rising curve has rank correlation 1.
/// assert!((spearman(&[1.0, 2.0, 3.0, 4.0], &[1.0, 8.0, 27.0, 64.0]) - 1.0).abs() < 1e-12);
/// ```
pub fn spearman(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len().min(y.len());
    pearson(&ranks(&x[..n]), &ranks(&y[..n]))
}

/// Ranks from 1; equal values get their mean rank.
pub fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for ties in order.chunk_by(|&a, &b| values[a] == values[b]) {
        let shared = first as f64 + 0.5 * (ties.len() + 1) as f64;
        ties.iter().for_each(|&k| ranks[k] = shared);
        first += ties.len();
    }
    ranks
}

fn centred(values: &[f64]) -> Vec<f64> {
    let mean = sums::mean(values);
    values.iter().map(|v| v - mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Anscombe (1973), first data set: r = 0.81642.
    #[test]
    fn val_anscombe() {
        let x = [10.0, 8.0, 13.0, 9.0, 11.0, 14.0, 6.0, 4.0, 12.0, 7.0, 5.0];
        let y = [8.04, 6.95, 7.58, 8.81, 8.33, 9.96, 7.24, 4.26, 10.84, 4.82, 5.68];
        assert!((pearson(&x, &y) - 0.816_42).abs() < 5e-6);
        assert!((spearman(&x, &y) - 0.818_18).abs() < 5e-6);
    }

    /// Against scipy 1.17.1, stats.pearsonr and stats.spearmanr (`tests/statistical/nested_tests.py`). Tolerance 1e-14.
    #[test]
    fn val_of_scipy() {
        let (x, y) = ([62.0, 71.5, 55.0, 80.0, 66.5], [58.0, 49.0, 71.5, 40.5, 55.0]);
        assert!((pearson(&x, &y) + 0.985_547_046_073_543_2).abs() < 1e-14);
        assert!((spearman(&x, &y) + 1.0).abs() < 1e-14);
    }

    #[test]
    fn val_ties_and_degenerate_samples() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0]), vec![3.5, 1.0, 3.5, 2.0]);
        assert!(pearson(&[1.0, 1.0], &[1.0, 2.0]).is_nan());
        assert!(pearson(&[], &[]).is_nan());
        assert_eq!(spearman(&[1.0, 2.0, 3.0], &[1.0, 8.0, 27.0]), 1.0);
        // The longer side is cut, whichever it is; one pair is too few.
        let (short, long) = ([0.0, 1.0, 2.0], [4.0, 2.0, 0.0, 99.0]);
        assert_eq!((pearson(&short, &long), spearman(&long, &short)), (-1.0, -1.0));
        assert!(pearson(&[1.0], &[2.0]).is_nan() && spearman(&[3.0, 3.0], &[1.0, 2.0]).is_nan());
    }
}
