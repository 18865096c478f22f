//! Conformal p-value of one new value among values that are nested in terrains.
//!
//! If the value comes from one more terrain, with terrain and value drawn from the same distributions as the others, then
//!
//! ```text
//! p above = (1 + sum over terrains of the share of their values >= the new one) / (terrains + 1)
//! ```
//!
//! is below `a` with probability at most `a`, whatever the distributions (Y. Lee, R. Barber and R. Willett, Distribution-free inference
//! with hierarchical data, Journal of the Royal Statistical Society B, 2025); likewise for `p below`. The number of terrains matters, not
//! that of values on them: `p` is never below 1 / (terrains + 1).

use crate::bootstrap::Interval;
use crate::proportion;

/// Position of a value among those of the terrains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Share of the values below it, with its interval; terrains have equal weight and equal values count half.
    pub share_below: Interval,
    /// Probability of a value at least as high.
    pub p_above: f64,
    /// Probability of a value at least as low.
    pub p_below: f64,
    /// Terrains with values.
    pub terrains: usize,
}

impl Place {
    /// Position of a value among those of each terrain. `None` if no terrain has any, or the value is not finite.
    ///
    /// ```
    /// use sastrugi_statistics::Place;
    ///
    /// // Above everything on nineteen terrains, which is the most that nineteen terrains can show.
    /// let place = Place::of(5.0, &vec![vec![1.0, 2.0]; 19], 0.95).unwrap();
    /// assert_eq!((place.p_above, place.p_below, place.p()), (0.05, 1.0, 0.1));
    /// assert_eq!(place.p(), place.least_p());
    /// ```
    pub fn of(value: f64, terrains: &[Vec<f64>], level: f64) -> Option<Self> {
        let known: Vec<&Vec<f64>> = terrains.iter().filter(|t| !t.is_empty()).collect();
        let shares = |counts: &dyn Fn(f64) -> f64| -> Vec<f64> {
            let share = |t: &&Vec<f64>| t.iter().map(|v| counts(*v)).sum::<f64>() / t.len() as f64;
            known.iter().map(share).collect()
        };
        let one = |is: bool| f64::from(u8::from(is));
        let share_below = shares(&|v| 0.5 * (one(v < value) + one(v <= value)));
        let p = |shares: Vec<f64>| (1.0 + shares.iter().sum::<f64>()) / (known.len() as f64 + 1.0);
        let (p_above, p_below) = (p(shares(&|v| one(v >= value))), p(shares(&|v| one(v <= value))));
        let share_below = proportion::of_shares(&share_below, level).filter(|_| value.is_finite())?;
        Some(Self { share_below, p_above, p_below, terrains: known.len() })
    }

    /// Two-sided p-value: probability of a value at least as extreme.
    pub fn p(&self) -> f64 {
        (2.0 * self.p_above.min(self.p_below)).min(1.0)
    }

    /// The smallest p that any value could have.
    pub fn least_p(&self) -> f64 {
        2.0 / (self.terrains as f64 + 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    /// By hand: of the first terrain's values half are below and half equal, of the second's all are above.
    #[test]
    fn val_by_hand() {
        let place = Place::of(2.0, &[vec![1.0, 2.0], vec![], vec![3.0; 3]], 0.95).unwrap();
        assert_eq!((place.share_below.estimate, place.terrains), (0.375, 2));
        assert_eq!((place.p_above, place.p_below, place.p()), ((1.0 + 0.5 + 1.0) / 3.0, (1.0 + 1.0) / 3.0, 1.0));
        assert_eq!(Place::of(f64::NAN, &[vec![1.0]], 0.95), None);
        assert_eq!(Place::of(1.0, &[vec![]], 0.95), None);
    }

    /// Null: the value is drawn on one more terrain. Two-sided p at 5 %, 2000 sets each of 3, 20 and 60 terrains with 1 and 20 values, scatter
    /// between terrains 1, within 1. More than 151 of 2000 has a false-alarm probability of 4e-7 (binomial, p = 0.05). With 60 terrains of one
    /// value the test is exact except for its steps of 2 / 61: fewer than 57 hits has one of 7e-7. A rank among 20 x 20 values treated as
    /// independent would be wrong in 12 %.
    #[test]
    fn stat_level() {
        let mut s = Streams::for_seed(1, "conformal-test").stream("level");
        for (terrains, values) in [(3, 20), (20, 1), (20, 20), (60, 1), (60, 20)] {
            let mut found = 0;
            for _ in 0..2000 {
                let mut terrain = |n: usize| {
                    let centre = s.normal();
                    (0..n).map(|_| centre + s.normal()).collect::<Vec<_>>()
                };
                let new = terrain(1)[0];
                let all: Vec<Vec<f64>> = (0..terrains).map(|_| terrain(values)).collect();
                let place = Place::of(new, &all, 0.95).unwrap();
                assert!(place.p() >= place.least_p());
                found += usize::from(place.p() <= 0.05);
            }
            let least = if (terrains, values) == (60, 1) { 57 } else { 0 };
            assert!((least..=151).contains(&found), "{found} of 2000 with {terrains} x {values}");
        }
    }
}
