//! Whether and by how much two groups of terrains differ: the test, the effect and the difference of means of the same numbers, as the
//! report and the comparison of releases give them.

use crate::effect::Effect;
use crate::equivalence::MeanDifference;
use crate::permutation::{self, Permutation};
use sastrugi_numeric::Stream;

/// Two groups beside each other, from the first to the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Rank-sum test, of pairs signed-rank test.
    pub test: Option<Permutation>,
    /// Shift and delta.
    pub effect: Option<Effect>,
    /// Of means, for equivalence.
    pub means: Option<MeanDifference>,
}

impl Difference {
    /// Of samples that were drawn apart: one value for each terrain. Intervals have that coverage.
    pub fn apart(first: &[f64], second: &[f64], level: f64, draws: usize, stream: &mut Stream) -> Self {
        let values = permutation::tied(&[first, second].concat());
        let (first, second) = values.split_at(first.len());
        Self {
            test: permutation::rank_sum(first, second, draws, stream),
            effect: Effect::between(first, second, level),
            means: MeanDifference::between(first, second),
        }
    }

    /// Of pairs: first and second of every block.
    pub fn of_pairs(pairs: impl IntoIterator<Item = [f64; 2]>, level: f64, draws: usize, stream: &mut Stream) -> Self {
        let differences = permutation::differences(pairs);
        Self {
            test: permutation::signed_rank(&differences, draws, stream),
            effect: Effect::of_pairs(&differences, level),
            means: MeanDifference::of_pairs(&differences),
        }
    }

    /// Which way it goes, by its sign: the shift, or delta where ties make a shift of 0. NaN where there is no effect.
    pub fn way(&self) -> f64 {
        let sign = |e: Effect| if e.shift.estimate == 0.0 { e.delta.estimate } else { e.shift.estimate };
        self.effect.map_or(f64::NAN, sign)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    /// Nine of 20 terrains fall, the others are equal: the median of all differences is 0, and the way is down.
    #[test]
    fn val_ties_leave_a_way() {
        let (first, second) = ([1.0; 20], [[0.5; 10], [1.0; 10]].concat());
        let mut s = Streams::for_seed(1, "difference-test").stream("ties");
        let d = Difference::apart(&first, &second[1..], 0.95, 999, &mut s);
        assert!(d.effect.unwrap().shift.estimate == 0.0 && d.way() < 0.0 && d.test.unwrap().p < 0.01, "{d:?}");
        let pairs = Difference::of_pairs(first.into_iter().zip(second).map(|(a, b)| [a, b]), 0.95, 999, &mut s);
        assert!(pairs.way() < 0.0 && pairs.means.unwrap().estimate == -0.25, "{pairs:?}");
    }
}
