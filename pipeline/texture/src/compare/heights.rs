//! The distribution of heights as a curve of standardised quantiles.

use sastrugi_numeric::sums;
use sastrugi_statistics::normal;

/// Quantiles of a curve, at probabilities `(k + 1/2) / 99`; the outermost 0.5 %, often single boulders, are ignored.
const QUANTILES: usize = 99;

/// Quantiles of residuals over the root mean square of these quantiles.
#[derive(Clone, Debug)]
pub struct HeightCurve {
    quantiles: Vec<f64>,
}

fn probability(k: usize) -> f64 {
    (k as f64 + 0.5) / QUANTILES as f64
}

impl HeightCurve {
    /// The curve of the residuals with data.
    pub fn of(residual: &[f64]) -> Self {
        let mut sorted = sums::finite(residual);
        sorted.sort_by(f64::total_cmp);
        Self::standardised((0..QUANTILES).map(|k| sums::quantile_sorted(&sorted, probability(k))).collect())
    }

    fn standardised(quantiles: Vec<f64>) -> Self {
        let squares: Vec<f64> = quantiles.iter().map(|q| q * q).collect();
        let scale = sums::mean(&squares).sqrt();
        Self { quantiles: quantiles.into_iter().map(|q| q / scale).collect() }
    }

    /// Root mean square distance of the quantiles.
    pub fn distance(&self, other: &Self) -> f64 {
        let squares: Vec<f64> = self.quantiles.iter().zip(&other.quantiles).map(|(a, b)| (a - b) * (a - b)).collect();
        sums::mean(&squares).sqrt()
    }

    /// The weighted mean of two curves; `share` is the weight of `self`.
    pub fn pooled(&self, other: &Self, share: f64) -> Self {
        let mean = |(a, b): (&f64, &f64)| share * a + (1.0 - share) * b;
        Self::standardised(self.quantiles.iter().zip(&other.quantiles).map(mean).collect())
    }

    /// The curve of a normal surface after transformation to another marginal: normal scores are mapped to that curve's quantiles,
    /// and extrapolated linearly beyond its ends. The map is increasing, so it maps quantiles to quantiles.
    pub fn with_marginal(&self, marginal: &Self) -> Self {
        let scores: Vec<f64> = (0..QUANTILES).map(|k| normal::quantile(probability(k))).collect();
        let norm = sums::mean(&scores.iter().map(|s| s * s).collect::<Vec<_>>()).sqrt();
        let scores: Vec<f64> = scores.into_iter().map(|s| s / norm).collect();
        let map = |v: f64| {
            let k = scores.partition_point(|s| *s < v).clamp(1, QUANTILES - 1);
            let slope = (marginal.quantiles[k] - marginal.quantiles[k - 1]) / (scores[k] - scores[k - 1]);
            marginal.quantiles[k - 1] + slope * (v - scores[k - 1])
        };
        Self::standardised(self.quantiles.iter().map(|&v| map(v)).collect())
    }

    /// Third moment of the curve: its skewness without the tails.
    pub fn skewness(&self) -> f64 {
        sums::mean(&self.quantiles.iter().map(|q| q * q * q).collect::<Vec<_>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(of: impl Fn(f64) -> f64) -> HeightCurve {
        HeightCurve::of(&(0..=10_000).map(|k| of((f64::from(k) + 0.5) / 10_001.0)).collect::<Vec<_>>())
    }

    /// The unit of the heights does not count, their sign does: a mirrored skewed distribution has the opposite skewness.
    #[test]
    fn prop_curves_have_no_unit() {
        let exponential = |u: f64| -libm::log(1.0 - u) - 1.0;
        let (own, scaled, mirrored) =
            (curve(exponential), curve(|u| 7.0 * exponential(u)), curve(|u| -exponential(1.0 - u)));
        assert!(own.distance(&scaled) < 1e-12);
        assert!(own.skewness() > 1.0 && (own.skewness() + mirrored.skewness()).abs() < 1e-9, "{}", own.skewness());
        assert!(own.distance(&mirrored) > 0.3);
        assert!(curve(normal::quantile).skewness().abs() < 1e-9);
        let squares: Vec<f64> = own.quantiles.iter().map(|q| q * q).collect();
        assert!((sums::mean(&squares) - 1.0).abs() < 1e-12);
        // No data is left out.
        let with_gaps = HeightCurve::of(&[f64::NAN, 1.0, -1.0, f64::INFINITY]);
        assert!(with_gaps.distance(&HeightCurve::of(&[-1.0, 1.0])) < 1e-15);
    }

    /// Curves have a mean square of 1, so that two of them are sqrt(2 - 2 r) apart, r the mean product of their quantiles. A uniform distribution
    /// is 0.2006 from a normal one (the same sums in Python); the distance is symmetric.
    #[test]
    fn val_distance_is_that_of_unit_vectors() {
        let (a, b) = (curve(normal::quantile), curve(|u| u - 0.5));
        let product = sums::mean(&a.quantiles.iter().zip(&b.quantiles).map(|(x, y)| x * y).collect::<Vec<_>>());
        assert!((a.distance(&b) - (2.0 - 2.0 * product).sqrt()).abs() < 1e-9);
        assert_eq!(a.distance(&b), b.distance(&a));
        assert!((a.distance(&b) - 0.200_603).abs() < 1e-5, "{}", a.distance(&b));
        assert!(a.pooled(&b, 1.0).distance(&a) < 1e-12 && a.pooled(&b, 0.0).distance(&b) < 1e-12);
    }

    /// A normal surface with another marginal has that marginal's curve.
    #[test]
    fn val_marginals_replace_normal_scores() {
        let normal = HeightCurve::standardised((0..QUANTILES).map(|k| normal::quantile(probability(k))).collect());
        let marginal = curve(|u| -libm::log(1.0 - u) - 1.0);
        assert!(normal.with_marginal(&marginal).distance(&marginal) < 1e-9);
        assert!(normal.with_marginal(&normal).distance(&normal) < 1e-9);
    }
}
