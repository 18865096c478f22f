//! Effect sizes: Hodges and Lehmann's shift and Cliff's delta, with intervals that are valid even for few terrains.
//!
//! ```text
//! shift          median of y_j - x_i over all pairs       J. Hodges and E. Lehmann, Annals of Mathematical Statistics 34, 1963
//! delta          #(y_j > x_i) - #(y_j < x_i), over all pairs, / n m          N. Cliff, Psychological Bulletin 114, 1993
//! paired shift   median of (d_i + d_j) / 2 over i <= j    (Walsh averages) of the differences d within blocks
//! paired delta   #(d_i > 0) - #(d_i < 0), / n
//! ```
//!
//! The shift has the unit of the values; delta is dimensionless, 1 if every `y` is above every `x`. They are the
//! estimates that correspond to the rank-sum and the signed-rank test. Input is one value per terrain, or one difference per
//! block. Cost: `O(n log n)` for sorting, and some 20 passes (about 60 with many ties) to find one of the ordered pairs
//! without listing them.
//!
//! Intervals of the shift are the shifts that the rank test for values without ties does not reject (Hodges and Lehmann; M. Hollander,
//! D. Wolfe and E. Chicken, Nonparametric Statistical Methods, 2014, sections 3.3 and 4.3): from the `k`-th smallest to the `k`-th
//! largest difference, or unbounded if the values are too few to reject any shift. Ties make them wider. If the groups differ by a shift,
//! their coverage is at least the nominal level (that of the normal approximation for many values). If the groups also differ in scatter,
//! the coverage of these intervals and of those of delta is lower, above all if the smaller group scatters more. Intervals of delta are
//! R. Newcombe's (Statistics in Medicine 25, 2006, part 2, method 5):
//!
//! ```text
//! (t - t')^2 = z^2 t (1 - t) / (n m)  (1 + ((n + m) / 2 - 1) ((1 - t) / (2 - t) + t / (1 + t))),   t = (1 + delta) / 2
//! ```
//!
//! solved for `t` on both sides of its estimate `t'`; for pairs, those of a mean of signs, [`crate::proportion`]. Percentile bootstrap
//! intervals from few terrains have far lower coverage, and collapse to a point if all terrains agree in direction.

use crate::bootstrap::Interval;
use crate::rank_distribution::{rank_sum_below, signed_rank_below};
use crate::{normal, proportion};

/// Passes of a bisection after which ties are resolved.
const PASSES: usize = 50;

/// A difference between two groups, from the first to the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effect {
    /// Hodges and Lehmann's shift, in the unit of the values.
    pub shift: Interval,
    /// Cliff's delta, in -1..1.
    pub delta: Interval,
}

impl Effect {
    /// For two independent groups; `level` is the coverage of the intervals. `None` if either is empty.
    ///
    /// ```
    /// use sastrugi_statistics::Effect;
    ///
    /// // Differences of all pairs: 1, 2, 3, 3, 4, 5. Every value of the second group is higher.
    /// let effect = Effect::between(&[4.0, 5.0, 6.0], &[7.0, 9.0], 0.95).unwrap();
    /// assert_eq!((effect.shift.estimate, effect.delta.estimate), (3.0, 1.0));
    /// // Five values are too few to bound the shift with 95 %.
    /// assert_eq!(effect.shift.high, f64::INFINITY);
    /// ```
    pub fn between(first: &[f64], second: &[f64], level: f64) -> Option<Self> {
        let (first, second) = (sorted(first), sorted(second));
        let pairs = Pairs::between(&first, &second)?;
        let outside = rank_sum_below(first.len(), second.len(), 0.5 * (1.0 - level));
        Some(Self { shift: pairs.interval(outside, level), delta: delta_interval(&first, &second, level) })
    }

    /// For paired groups, from the differences (second minus first) within blocks. `None` without blocks.
    pub fn of_pairs(differences: &[f64], level: f64) -> Option<Self> {
        let (ascending, negated) = mirrored(differences);
        let outside = signed_rank_below(differences.len(), 0.5 * (1.0 - level));
        let sums = Pairs::within(&negated, &ascending)?.interval(outside, level);
        let half = |sum: f64| 0.5 * sum;
        let shift = Interval { estimate: half(sums.estimate), low: half(sums.low), high: half(sums.high), level };
        Some(Self { shift, delta: proportion::between_ends(&signs(differences), level)? })
    }
}

/// Shift from the first group to the second; NaN if either is empty.
pub fn shift(first: &[f64], second: &[f64]) -> f64 {
    let (first, second) = (sorted(first), sorted(second));
    Pairs::between(&first, &second).map_or(f64::NAN, |pairs| pairs.median())
}

/// Delta from the first group to the second; NaN if either is empty.
///
/// ```
/// use sastrugi_statistics::effect::{delta, shift};
///
/// let (first, second) = ([1.0, 2.0, 3.0], [2.0, 3.0, 4.0]);
/// // Of the nine pairs, six rise, one falls and two are equal.
/// assert!((delta(&first, &second) - 5.0 / 9.0).abs() < 1e-12);
/// assert_eq!(shift(&first, &second), 1.0);
/// ```
pub fn delta(first: &[f64], second: &[f64]) -> f64 {
    let second = sorted(second);
    let above_less_below = |x: &f64| {
        let above = second.len() - second.partition_point(|y| y <= x);
        above as f64 - second.partition_point(|y| y < x) as f64
    };
    first.iter().map(above_less_below).sum::<f64>() / (first.len() * second.len()) as f64
}

/// Newcombe's interval of delta.
fn delta_interval(first: &[f64], second: &[f64], level: f64) -> Interval {
    let (n, m) = (first.len() as f64, second.len() as f64);
    let estimate = delta(first, second);
    let above = 0.5 * (1.0 + estimate);
    let z = normal::quantile(0.5 * (1.0 + level));
    let excess = |t: f64| {
        let variance =
            t * (1.0 - t) / (n * m) * (1.0 + (0.5 * (n + m) - 1.0) * ((1.0 - t) / (2.0 - t) + t / (1.0 + t)));
        (t - above) * (t - above) - z * z * variance
    };
    // The only root lies between an end, where the variance is 0, and the estimate.
    let end = |end: f64| {
        let (mut outside, mut inside) = (end, above);
        for _ in 0..60 {
            let middle = 0.5 * (outside + inside);
            if excess(middle) > 0.0 { outside = middle } else { inside = middle }
        }
        2.0 * outside - 1.0
    };
    Interval { estimate, low: end(0.0).min(estimate), high: end(1.0).max(estimate), level }
}

/// Shift of paired groups; NaN without differences.
pub fn paired_shift(differences: &[f64]) -> f64 {
    let (ascending, negated) = mirrored(differences);
    Pairs::within(&negated, &ascending).map_or(f64::NAN, |sums| 0.5 * sums.median())
}

/// Delta of paired groups; NaN without differences.
pub fn paired_delta(differences: &[f64]) -> f64 {
    signs(differences).iter().sum::<f64>() / differences.len() as f64
}

fn signs(differences: &[f64]) -> Vec<f64> {
    differences.iter().map(|d| f64::from(i8::from(*d > 0.0) - i8::from(*d < 0.0))).collect()
}

/// Differences in ascending order, and with their signs reversed, also ascending.
fn mirrored(differences: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let ascending = sorted(differences);
    let negated = ascending.iter().rev().map(|d| -d).collect();
    (ascending, negated)
}

/// The ordered differences of all pairs of two ascending slices, without listing them; for a slice and its mirror image, the
/// sums of all its pairs `i <= j`.
struct Pairs<'a> {
    first: &'a [f64],
    second: &'a [f64],
    /// Whether these are sums over `i <= j`: half of all sums plus half of the doubled values.
    sums: bool,
    /// Smallest and largest.
    ends: (f64, f64),
}

impl<'a> Pairs<'a> {
    fn between(first: &'a [f64], second: &'a [f64]) -> Option<Self> {
        let ends = (second.first()? - first.last()?, second.last()? - first.first()?);
        Some(Self { first, second, sums: false, ends })
    }

    fn within(negated: &'a [f64], ascending: &'a [f64]) -> Option<Self> {
        Some(Self { sums: true, ..Self::between(negated, ascending)? })
    }

    fn len(&self) -> usize {
        let n = self.first.len();
        if self.sums { n * (n + 1) / 2 } else { n * self.second.len() }
    }

    fn at_most(&self, bound: f64) -> usize {
        let all = at_most(self.first, self.second, bound);
        if self.sums { (all + self.second.partition_point(|d| d + d <= bound)) / 2 } else { all }
    }

    /// The `k`-th smallest, from 1: bisection finds a bound between it and the next. With ties there is none; the bound is then
    /// moved to the next difference below until that is the `k`-th.
    fn nth(&self, k: usize) -> f64 {
        let (mut low, mut bound) = (self.ends.0.next_down(), self.ends.1);
        for pass in 0.. {
            if pass >= PASSES {
                bound = largest_up_to(self.first, self.second, bound);
                if self.at_most(bound.next_down()) < k {
                    break;
                }
            }
            let middle = 0.5 * low + 0.5 * bound;
            if middle <= low || middle >= bound {
                break;
            }
            match self.at_most(middle) {
                count if count < k => low = middle,
                count => {
                    bound = middle;
                    if count == k {
                        break;
                    }
                }
            }
        }
        largest_up_to(self.first, self.second, bound)
    }

    fn median(&self) -> f64 {
        let half = self.len().div_ceil(2);
        let below = self.nth(half);
        if self.len() % 2 == 1 || self.at_most(below) > half { below } else { 0.5 * (below + self.nth(half + 1)) }
    }

    /// The median, and the interval that excludes `outside` differences on either side; unbounded if that is 0.
    fn interval(&self, outside: usize, level: f64) -> Interval {
        let (low, high) = match outside {
            0 => (f64::NEG_INFINITY, f64::INFINITY),
            k => (self.nth(k), self.nth(self.len() + 1 - k)),
        };
        Interval { estimate: self.median(), low, high, level }
    }
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// Number of pairs with `second - first <= bound`, both ascending. Rounding preserves the order of differences, so one pass
/// is enough.
fn at_most(first: &[f64], second: &[f64], bound: f64) -> usize {
    let mut reached = 0;
    let of_one = |x: &f64| {
        while reached < second.len() && second[reached] - x <= bound {
            reached += 1;
        }
        reached
    };
    first.iter().map(of_one).sum()
}

/// The largest difference that does not exceed the bound.
fn largest_up_to(first: &[f64], second: &[f64], bound: f64) -> f64 {
    let mut reached = 0;
    let of_one = |x: &f64| {
        while reached < second.len() && second[reached] - x <= bound {
            reached += 1;
        }
        reached.checked_sub(1).map_or(f64::NEG_INFINITY, |k| second[k] - x)
    };
    first.iter().map(of_one).fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests;
