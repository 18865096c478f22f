//! Whether and by how much two groups of terrains differ: test, effect and difference of means from the same values, as used by the
//! report and the comparison of releases.

use crate::effect::Effect;
use crate::equivalence::MeanDifference;
use crate::permutation::{self, Permutation};
use sastrugi_numeric::Stream;

/// Comparison of two groups, from the first to the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Rank-sum test; for pairs, signed-rank test.
    pub test: Option<Permutation>,
    /// Shift and delta.
    pub effect: Option<Effect>,
    /// Difference of means, for equivalence.
    pub means: Option<MeanDifference>,
}

impl Difference {
    /// For independent samples, with one value per terrain. `level` is the coverage of the intervals.
    ///
    /// ```
    /// use sastrugi_numeric::Streams;
    /// use sastrugi_statistics::Difference;
    ///
    /// let mut stream = Streams::for_seed(1, "example").stream("arrangements");
    /// let smooth = [1.0, 2.0, 3.0, 4.0];
    /// let rough = smooth.map(|v| v + 10.0);
    /// let found = Difference::apart(&smooth, &rough, 0.95, 999, &mut stream);
    /// // All 70 arrangements of the labels were tried; the observed one and its mirror image are the most extreme.
    /// assert_eq!(found.test.unwrap().p, 2.0 / 70.0);
    /// let effect = found.effect.unwrap();
    /// assert_eq!((effect.shift.estimate, effect.delta.estimate), (10.0, 1.0));
    /// assert!(found.way() > 0.0);
    /// ```
    pub fn apart(first: &[f64], second: &[f64], level: f64, draws: usize, stream: &mut Stream) -> Self {
        let values = permutation::tied(&[first, second].concat());
        let (first, second) = values.split_at(first.len());
        Self {
            test: permutation::rank_sum(first, second, draws, stream),
            effect: Effect::between(first, second, level),
            means: MeanDifference::between(first, second),
        }
    }

    /// For paired samples: first and second value of every block.
    pub fn of_pairs(pairs: impl IntoIterator<Item = [f64; 2]>, level: f64, draws: usize, stream: &mut Stream) -> Self {
        let differences = permutation::differences(pairs);
        Self {
            test: permutation::signed_rank(&differences, draws, stream),
            effect: Effect::of_pairs(&differences, level),
            means: MeanDifference::of_pairs(&differences),
        }
    }

    /// Direction of the difference, by its sign: the shift, or delta if ties make the shift 0. NaN without an effect.
    pub fn way(&self) -> f64 {
        let sign = |e: Effect| if e.shift.estimate == 0.0 { e.delta.estimate } else { e.shift.estimate };
        self.effect.map_or(f64::NAN, sign)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    /// By hand: 1, 2, 3 and 4, 5, 6. Two of the 20 arrangements are as extreme; the shift is 3 and so is the difference of means. Pairs with
    /// differences 1, 2, 3: two of eight choices of signs, Walsh averages 1, 1.5, 2, 2, 2.5, 3, standard error sqrt(1 / 3).
    #[test]
    fn val_by_hand() {
        let mut s = Streams::for_seed(1, "difference-test").stream("hand");
        let (low, high) = ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]);
        for (first, second, way) in [(low, high, 1.0), (high, low, -1.0)] {
            let d = Difference::apart(&first, &second, 0.95, 999, &mut s);
            let (effect, means) = (d.effect.unwrap(), d.means.unwrap());
            assert_eq!((effect.shift.estimate, effect.delta.estimate, means.estimate), (3.0 * way, way, 3.0 * way));
            assert_eq!((d.test.unwrap().p, d.way()), (2.0 / 20.0, 3.0 * way));
        }
        let pairs = Difference::of_pairs([[1.0, 2.0], [2.0, 4.0], [3.0, 6.0]], 0.95, 999, &mut s);
        let (effect, means) = (pairs.effect.unwrap(), pairs.means.unwrap());
        assert_eq!((effect.shift.estimate, effect.delta.estimate, pairs.test.unwrap().p), (2.0, 1.0, 0.25));
        assert_eq!((means.estimate, means.values, pairs.way()), (2.0, 3, 2.0));
        assert!((means.standard_error - (1.0 / 3f64).sqrt()).abs() < 1e-15);
        let none = Difference::apart(&[], &[1.0], 0.95, 99, &mut s);
        assert!(none.test.is_none() && none.effect.is_none() && none.means.is_none() && none.way().is_nan());
    }

    /// Values that differ by rounding are tied in the test and in the effect alike.
    #[test]
    fn val_rounding_is_a_tie() {
        let mut s = Streams::for_seed(1, "difference-test").stream("rounding");
        let d = Difference::apart(&[0.3, 0.3, 0.3], &[0.1 + 0.2; 3], 0.95, 999, &mut s);
        assert_eq!((d.test.unwrap().p, d.effect.unwrap().delta.estimate, d.way()), (1.0, 0.0, 0.0));
    }

    /// Nine of 19 terrains are lower, the others equal: the median of all differences is 0, but the direction is down.
    #[test]
    fn val_ties_leave_a_direction() {
        let (first, second) = ([1.0; 20], [[0.5; 10], [1.0; 10]].concat());
        let mut s = Streams::for_seed(1, "difference-test").stream("ties");
        let d = Difference::apart(&first, &second[1..], 0.95, 999, &mut s);
        assert!(d.effect.unwrap().shift.estimate == 0.0 && d.way() < 0.0 && d.test.unwrap().p < 0.01, "{d:?}");
        let pairs = Difference::of_pairs(first.into_iter().zip(second).map(|(a, b)| [a, b]), 0.95, 999, &mut s);
        assert!(pairs.way() < 0.0 && pairs.means.unwrap().estimate == -0.25, "{pairs:?}");
    }
}
