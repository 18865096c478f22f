//! Equivalence of two groups: that they differ by less than a margin, claimed with a level (D. Schuirmann, Journal of
//! Pharmacokinetics and Biopharmaceutics 15, 1987: two one-sided tests).
//!
//! Values are means over the missions of a terrain, or their differences within blocks of paired terrains. A test that
//! finds no difference shows none to be absent; this one turns it round: the null hypothesis is a difference of at
//! least the margin, either way. The margin is to be set before the data is seen.
//!
//! ```text
//! d = mean y - mean x,   s^2 = var x / n + var y / m        B. Welch, Biometrika 34, 1947, with F. Satterthwaite's degrees
//! d = mean of differences, s^2 = var d / n                  of freedom; n - 1 for pairs
//! p = max of P(t > (margin + d) / s), P(t > (margin - d) / s)
//! ```
//!
//! Where no value varies `s` is 0 and tells nothing; then `p = 2^-n`, that of a sign test against the margin, of the median.
//!
//! `p <= alpha` exactly where the interval of coverage `1 - 2 alpha` lies within the margins. Terrain means are near
//! enough to normal for a mean of ten or more; below that the t distribution is an assumption.

use crate::bootstrap::Interval;
use crate::permutation::EQUAL;
use crate::student;
use sastrugi_numeric::sums;

/// A difference of means with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanDifference {
    /// Second less first, in the unit of the values.
    pub estimate: f64,
    /// Standard error of the estimate.
    pub standard_error: f64,
    /// Degrees of freedom of the standard error.
    pub freedom: f64,
    /// Pairs, or terrains of the smaller group.
    pub values: usize,
}

impl MeanDifference {
    /// Of two independent groups; `None` when either has fewer than two values.
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

    /// Of paired groups, from the differences within blocks; `None` with fewer than two.
    pub fn of_pairs(differences: &[f64]) -> Option<Self> {
        let standard_error = squared_error(differences).sqrt();
        let estimate = sums::mean(differences);
        let values = differences.len();
        Self { estimate, standard_error, freedom: values as f64 - 1.0, values }.if_known()
    }

    /// False where no value varies: nothing then tells how far the estimate may be off.
    pub fn scatters(&self) -> bool {
        self.standard_error > 0.0
    }

    /// Interval of that coverage; its ends are NaN where nothing varies.
    pub fn interval(&self, level: f64) -> Interval {
        let error = if self.scatters() { self.standard_error } else { f64::NAN };
        let reach = error * student::quantile(0.5 * (1.0 + level), self.freedom);
        Interval { estimate: self.estimate, low: self.estimate - reach, high: self.estimate + reach, level }
    }

    /// Probability, at most, of a difference so well within the margin when the true one is not.
    pub fn equivalence_p(&self, margin: f64) -> f64 {
        self.above(-margin).max(self.above_mirrored(-margin))
    }

    /// Probability, at most, of a difference so far beyond the margin when the true one is not.
    pub fn beyond_p(&self, margin: f64) -> f64 {
        (2.0 * self.above(margin).min(self.above_mirrored(margin))).min(1.0)
    }

    /// The smallest margin within which the groups are equivalent at level `alpha`: the farther end of the interval of
    /// coverage `1 - 2 alpha`; NaN where nothing varies.
    pub fn smallest_margin(&self, alpha: f64) -> f64 {
        let i = self.interval(1.0 - 2.0 * alpha);
        i.low.abs().max(i.high.abs())
    }

    /// One-sided p against a true difference of at most `bound`. Where nothing varies that of a sign test: all values lie above.
    fn above(&self, bound: f64) -> f64 {
        match self.scatters() {
            true => student::cdf((bound - self.estimate) / self.standard_error, self.freedom),
            false if self.estimate > bound => libm::exp2(-(self.values as f64)),
            false => 1.0,
        }
    }

    /// The same of the first less the second.
    fn above_mirrored(&self, bound: f64) -> f64 {
        Self { estimate: -self.estimate, ..*self }.above(bound)
    }

    fn if_known(self) -> Option<Self> {
        (self.standard_error.is_finite() && self.freedom > 0.0 && self.estimate.is_finite()).then_some(self)
    }
}

/// Squared standard error of a mean, 0 where values differ by rounding alone; NaN for fewer than two values.
fn squared_error(values: &[f64]) -> f64 {
    let largest = values.iter().fold(0.0f64, |largest, v| largest.max(v.abs()));
    let variance = sums::variance(values);
    let rounding = EQUAL * largest;
    if variance <= rounding * rounding && values.len() > 1 { 0.0 } else { variance / (values.len() as f64 - 1.0) }
}

#[cfg(test)]
mod tests;
