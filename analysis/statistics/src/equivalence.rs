//! Equivalence of two groups: tests that they differ by less than a margin (D. Schuirmann, Journal of
//! Pharmacokinetics and Biopharmaceutics 15, 1987: two one-sided tests).
//!
//! Values are means over the missions of a terrain, or their differences within blocks of paired terrains. A test that
//! finds no difference does not show that there is none. This test reverses the hypotheses: the null hypothesis is a difference of at
//! least the margin, in either direction. The margin must be set before the data is seen.
//!
//! ```text
//! d = mean y - mean x,   s^2 = var x / n + var y / m        B. Welch, Biometrika 34, 1947, with F. Satterthwaite's degrees
//! d = mean of differences, s^2 = var d / n                  of freedom; n - 1 for pairs
//! p = max of P(t > (margin + d) / s), P(t > (margin - d) / s)
//! ```
//!
//! If no value varies, `s` is 0 and carries no information; then `p = 2^-n`, that of a sign test of the median against the margin.
//!
//! `p <= alpha` exactly if the interval of coverage `1 - 2 alpha` lies within the margins. With ten or more terrains their mean is
//! close enough to normal; with fewer, the t distribution is an assumption.

use crate::bootstrap::Interval;
use crate::permutation::EQUAL;
use crate::student;
use sastrugi_numeric::sums;

/// A difference of means with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanDifference {
    /// Second minus first, in the unit of the values.
    pub estimate: f64,
    /// Standard error of the estimate.
    pub standard_error: f64,
    /// Degrees of freedom of the standard error.
    pub freedom: f64,
    /// Number of pairs, or of terrains of the smaller group.
    pub values: usize,
}

impl MeanDifference {
    /// For two independent groups; `None` if either has fewer than two values.
    ///
    /// ```
    /// use sastrugi_statistics::MeanDifference;
    ///
    /// let (a, b) = ([10.0, 11.0, 12.0, 13.0], [10.5, 11.5, 12.5, 13.5]);
    /// let means = MeanDifference::between(&a, &b).unwrap();
    /// assert_eq!(means.estimate, 0.5);
    /// // Equivalent within a margin exactly if the 90 % interval lies within it.
    /// let margin = means.smallest_margin(0.05);
    /// assert!(means.equivalence_p(1.01 * margin) < 0.05 && means.equivalence_p(0.99 * margin) > 0.05);
    /// ```
    pub fn between(first: &[f64], second: &[f64]) -> Option<Self> {
        let parts = [first, second].map(squared_error);
        let total = parts[0] + parts[1];
        let per_freedom =
            parts[0] * parts[0] / (first.len() as f64 - 1.0) + parts[1] * parts[1] / (second.len() as f64 - 1.0);
        let freedom = if total > 0.0 { total * total / per_freedom } else { (first.len() + second.len()) as f64 - 2.0 };
        let estimate = sums::mean(second) - sums::mean(first);
        let values = first.len().min(second.len());
        Self { estimate, standard_error: total.sqrt(), freedom, values }.if_known()
    }

    /// For paired groups, from the differences within blocks; `None` with fewer than two.
    pub fn of_pairs(differences: &[f64]) -> Option<Self> {
        let standard_error = squared_error(differences).sqrt();
        let estimate = sums::mean(differences);
        let values = differences.len();
        Self { estimate, standard_error, freedom: values as f64 - 1.0, values }.if_known()
    }

    /// False if no value varies: the standard error then carries no information.
    pub fn scatters(&self) -> bool {
        self.standard_error > 0.0
    }

    /// Interval of coverage `level`; its ends are NaN if nothing varies.
    pub fn interval(&self, level: f64) -> Interval {
        let error = if self.scatters() { self.standard_error } else { f64::NAN };
        let reach = error * student::quantile(0.5 * (1.0 + level), self.freedom);
        Interval { estimate: self.estimate, low: self.estimate - reach, high: self.estimate + reach, level }
    }

    /// p-value of equivalence: upper bound on the probability of an estimate this far within the margin if the true difference is not
    /// within it.
    pub fn equivalence_p(&self, margin: f64) -> f64 {
        self.above(-margin).max(self.above_mirrored(-margin))
    }

    /// p-value of a difference beyond the margin: upper bound on the probability of an estimate this far beyond it if the true difference
    /// is within it.
    pub fn beyond_p(&self, margin: f64) -> f64 {
        (2.0 * self.above(margin).min(self.above_mirrored(margin))).min(1.0)
    }

    /// The smallest margin within which the groups are equivalent at level `alpha`: the end of the interval of
    /// coverage `1 - 2 alpha` that is farther from 0; NaN if nothing varies.
    pub fn smallest_margin(&self, alpha: f64) -> f64 {
        let i = self.interval(1.0 - 2.0 * alpha);
        i.low.abs().max(i.high.abs())
    }

    /// One-sided p against a true difference of at most `bound`. If nothing varies, that of a sign test in which all values lie above.
    fn above(&self, bound: f64) -> f64 {
        match self.scatters() {
            true => student::cdf((bound - self.estimate) / self.standard_error, self.freedom),
            false if self.estimate > bound => libm::exp2(-(self.values as f64)),
            false => 1.0,
        }
    }

    /// The same for the first minus the second.
    fn above_mirrored(&self, bound: f64) -> f64 {
        Self { estimate: -self.estimate, ..*self }.above(bound)
    }

    fn if_known(self) -> Option<Self> {
        (self.standard_error.is_finite() && self.freedom > 0.0 && self.estimate.is_finite()).then_some(self)
    }
}

/// Squared standard error of a mean, 0 if values differ only by rounding; NaN for fewer than two values.
fn squared_error(values: &[f64]) -> f64 {
    let largest = values.iter().fold(0.0f64, |largest, v| largest.max(v.abs()));
    let variance = sums::variance(values);
    let rounding = EQUAL * largest;
    if variance <= rounding * rounding && values.len() > 1 { 0.0 } else { variance / (values.len() as f64 - 1.0) }
}

#[cfg(test)]
mod tests;
