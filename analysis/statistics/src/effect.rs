//! How large a difference is: Hodges and Lehmann's shift and Cliff's delta, with intervals that draw terrains anew.
//!
//! ```text
//! shift          median of y_j - x_i over all pairs       J. Hodges and E. Lehmann, Annals of Mathematical Statistics 34, 1963
//! delta          #(y_j > x_i) - #(y_j < x_i), over all pairs, / n m          N. Cliff, Psychological Bulletin 114, 1993
//! paired shift   median of (d_i + d_j) / 2 over i <= j    (Walsh averages) of the differences d within blocks
//! paired delta   #(d_i > 0) - #(d_i < 0), / n
//! ```
//!
//! The shift has the unit of the values; delta is a pure number, 1 when every `y` is above every `x`. They are the
//! estimates that go with the rank-sum and the signed-rank test. Values are one per terrain, or differences one per
//! block. Cost: `O(n log n)` for sorting, and some 20 passes (60 with many ties) to find the median of the pairs
//! without listing them.

use crate::bootstrap::{Interval, redraw};
use sastrugi_numeric::Stream;

/// A difference between two groups, from the first to the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effect {
    /// Hodges and Lehmann's shift, in the unit of the values.
    pub shift: Interval,
    /// Cliff's delta, in -1..1.
    pub delta: Interval,
}

impl Effect {
    /// Of two independent groups; intervals redraw the terrains of each. `None` when either has fewer than two.
    pub fn between(first: &[f64], second: &[f64], replicates: usize, level: f64, stream: &mut Stream) -> Option<Self> {
        let of = |a: &[f64], b: &[f64]| (shift(a, b), delta(a, b));
        let redrawn = redraw(&[first.len(), second.len()], replicates, stream, |drawn| {
            of(&taken(first, &drawn[0]), &taken(second, &drawn[1]))
        });
        (first.len() > 1 && second.len() > 1).then(|| Self::from(of(first, second), &redrawn, level))?
    }

    /// Of paired groups, from the differences (second less first) within blocks; intervals redraw blocks. `None` with
    /// fewer than two blocks.
    pub fn of_pairs(differences: &[f64], replicates: usize, level: f64, stream: &mut Stream) -> Option<Self> {
        let of = |d: &[f64]| (paired_shift(d), paired_delta(d));
        let redrawn = redraw(&[differences.len()], replicates, stream, |drawn| of(&taken(differences, &drawn[0])));
        (differences.len() > 1).then(|| Self::from(of(differences), &redrawn, level))?
    }

    fn from(estimates: (f64, f64), redrawn: &[(f64, f64)], level: f64) -> Option<Self> {
        let (shifts, deltas): (Vec<f64>, Vec<f64>) = redrawn.iter().copied().unzip();
        let shift = Interval::percentile(estimates.0, &shifts, level)?;
        Some(Self { shift, delta: Interval::percentile(estimates.1, &deltas, level)? })
    }
}

/// Shift from the first group to the second; NaN when either is empty.
pub fn shift(first: &[f64], second: &[f64]) -> f64 {
    let (first, second) = (sorted(first), sorted(second));
    let ([Some(a), Some(b)], [Some(c), Some(d)]) = ([first.first(), first.last()], [second.first(), second.last()])
    else {
        return f64::NAN;
    };
    let count = |bound| at_most(&first, &second, bound);
    median(first.len() * second.len(), (c - b, d - a), count, |bound| neighbours(&first, &second, bound))
}

/// Delta from the first group to the second; NaN when either is empty.
pub fn delta(first: &[f64], second: &[f64]) -> f64 {
    let second = sorted(second);
    let above_less_below = |x: &f64| {
        let above = second.len() - second.partition_point(|y| y <= x);
        above as f64 - second.partition_point(|y| y < x) as f64
    };
    first.iter().map(above_less_below).sum::<f64>() / (first.len() * second.len()) as f64
}

/// Shift of paired groups; NaN for no differences.
pub fn paired_shift(differences: &[f64]) -> f64 {
    let ascending = sorted(differences);
    let negated: Vec<f64> = ascending.iter().rev().map(|d| -d).collect();
    let ([Some(low), Some(high)], n) = ([ascending.first(), ascending.last()], ascending.len()) else {
        return f64::NAN;
    };
    // Sums i <= j are half of all sums and half of the doubled differences.
    let sums_at_most =
        |bound: f64| (at_most(&negated, &ascending, bound) + ascending.partition_point(|d| d + d <= bound)) / 2;
    let beside = |bound| neighbours(&negated, &ascending, bound);
    0.5 * median(n * (n + 1) / 2, (low + low, high + high), sums_at_most, beside)
}

/// Delta of paired groups; NaN for no differences.
pub fn paired_delta(differences: &[f64]) -> f64 {
    let sign = |d: &f64| f64::from(i8::from(*d > 0.0) - i8::from(*d < 0.0));
    differences.iter().map(sign).sum::<f64>() / differences.len() as f64
}

fn taken(values: &[f64], drawn: &[usize]) -> Vec<f64> {
    drawn.iter().map(|&k| values[k]).collect()
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// Number of pairs with `second - first <= bound`, both ascending. Rounded differences keep their order, so one pass
/// will do.
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

/// The largest difference up to the bound and the smallest above it, infinite where there is none.
fn neighbours(first: &[f64], second: &[f64], bound: f64) -> (f64, f64) {
    let (mut below, mut above) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut reached = 0;
    for x in first {
        while reached < second.len() && second[reached] - x <= bound {
            reached += 1;
        }
        below = below.max(reached.checked_sub(1).map_or(below, |k| second[k] - x));
        above = above.min(second.get(reached).map_or(above, |y| y - x));
    }
    (below, above)
}

/// Median of `n` differences within `ends`. `at_most` counts those up to a bound. A bound that parts the lower half
/// from the rest is found by bisection, down to neighbouring numbers where ties leave none; the differences beside it
/// are the median.
fn median(n: usize, ends: (f64, f64), at_most: impl Fn(f64) -> usize, neighbours: impl Fn(f64) -> (f64, f64)) -> f64 {
    let half = n.div_ceil(2);
    let (mut low, mut bound) = (ends.0.next_down(), ends.1);
    loop {
        let middle = 0.5 * low + 0.5 * bound;
        if middle <= low || middle >= bound {
            break;
        }
        match at_most(middle) {
            count if count < half => low = middle,
            count => {
                bound = middle;
                if count == half {
                    break;
                }
            }
        }
    }
    let (below, above) = neighbours(bound);
    if n % 2 == 1 || at_most(below) > half { below } else { 0.5 * (below + above) }
}

#[cfg(test)]
mod tests;
