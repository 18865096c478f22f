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
//! `p <= alpha` exactly where the interval of coverage `1 - 2 alpha` lies within the margins. Terrain means are near
//! enough to normal for a mean of ten or more; below that the t distribution is an assumption.

use crate::bootstrap::Interval;
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
}

impl MeanDifference {
    /// Of two independent groups; `None` when either has fewer than two values or neither varies.
    pub fn between(first: &[f64], second: &[f64]) -> Option<Self> {
        let parts = [first, second].map(squared_error);
        let total = parts[0] + parts[1];
        let per_freedom =
            parts[0] * parts[0] / (first.len() as f64 - 1.0) + parts[1] * parts[1] / (second.len() as f64 - 1.0);
        let freedom = total * total / per_freedom;
        let estimate = sums::mean(second) - sums::mean(first);
        Self { estimate, standard_error: total.sqrt(), freedom }.if_known()
    }

    /// Of paired groups, from the differences within blocks; `None` with fewer than two or when they are equal.
    pub fn of_pairs(differences: &[f64]) -> Option<Self> {
        let standard_error = squared_error(differences).sqrt();
        let estimate = sums::mean(differences);
        Self { estimate, standard_error, freedom: differences.len() as f64 - 1.0 }.if_known()
    }

    /// Interval of that coverage.
    pub fn interval(&self, level: f64) -> Interval {
        let reach = self.standard_error * student::quantile(0.5 * (1.0 + level), self.freedom);
        Interval { estimate: self.estimate, low: self.estimate - reach, high: self.estimate + reach, level }
    }

    /// Probability, at most, of a difference so well within the margin when the true one is not.
    pub fn equivalence_p(&self, margin: f64) -> f64 {
        let beyond = |distance: f64| student::cdf(-distance / self.standard_error, self.freedom);
        beyond(margin + self.estimate).max(beyond(margin - self.estimate))
    }

    /// The smallest margin within which the groups are equivalent at level `alpha`: the farther end of the interval of
    /// coverage `1 - 2 alpha`.
    pub fn smallest_margin(&self, alpha: f64) -> f64 {
        let i = self.interval(1.0 - 2.0 * alpha);
        i.low.abs().max(i.high.abs())
    }

    fn if_known(self) -> Option<Self> {
        (self.standard_error > 0.0 && self.freedom > 0.0 && self.estimate.is_finite()).then_some(self)
    }
}

/// Equivalence by inclusion: true when an interval (of coverage `1 - 2 alpha` for a claim at level alpha) lies within
/// the margins.
pub fn within(interval: &Interval, margin: f64) -> bool {
    -margin < interval.low && interval.high < margin
}

/// Squared standard error of a mean; NaN for fewer than two values.
fn squared_error(values: &[f64]) -> f64 {
    sums::variance(values) / (values.len() as f64 - 1.0)
}

#[cfg(test)]
mod tests;
