//! The distribution of heights as a curve of quantiles in units of its own standard deviation.

use sastrugi_numeric::sums;
use sastrugi_statistics::normal;

/// Quantiles of a curve, at probabilities `(k + 1/2) / 99`: the outermost 0.5 % belong to single boulders.
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
    /// The curve of the residuals that are data.
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

    /// The mean of two curves, the first with a share of the weight.
    pub fn pooled(&self, other: &Self, share: f64) -> Self {
        let mean = |(a, b): (&f64, &f64)| share * a + (1.0 - share) * b;
        Self::standardised(self.quantiles.iter().zip(&other.quantiles).map(mean).collect())
    }

    /// The curve of a normal surface brought to another marginal: normal scores to that curve's quantiles, beyond its ends
    /// with the slope there. A rising map takes quantiles to quantiles.
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
