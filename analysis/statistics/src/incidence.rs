//! Cumulative incidence with competing risks and censoring: the share that has ended by each cause up to a distance (or time).
//!
//! The estimator of O. Aalen and S. Johansen, An empirical transition matrix for non-homogeneous Markov chains based on
//! censored observations, Scandinavian Journal of Statistics 5 (1978). With `n(x)` at risk just before `x`,
//! `d_k(x)` of them ending by cause `k` at `x`, and `d(x)` the sum over `k`:
//!
//! ```text
//! S(x)   = product over x' <= x of 1 - d(x') / n(x')         (Kaplan and Meier, 1958)
//! F_k(x) = sum over x' <= x of S(x'-) d_k(x') / n(x')
//! ```
//!
//! so that `S + sum F_k = 1`. One minus the Kaplan-Meier curve of a single cause would treat subjects that ended by another cause as
//! still at risk, and is too high. At equal distances endings precede censorings. Endings at an unknown distance are left
//! out. Cost: one sort. For clustered subjects see [`clustered`].

pub mod clustered;

/// How one subject ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ending {
    /// Distance (or time) at which it ended.
    pub at: f64,
    /// Number of the cause; `None` if the subject was censored.
    pub cause: Option<usize>,
}

/// Cumulative incidence as step functions, continuous from the right.
#[derive(Clone, Debug, PartialEq)]
pub struct Incidence {
    /// Distances at which a curve steps, ascending.
    pub at: Vec<f64>,
    /// For each cause, its share at and after each step.
    pub shares: Vec<Vec<f64>>,
}

impl Incidence {
    /// Aalen-Johansen estimator for `causes` causes; an ending with a higher cause number is not reported but leaves the
    /// risk set like the others.
    ///
    /// ```
    /// use sastrugi_statistics::{Ending, Incidence};
    ///
    /// // Of four missions one is stuck at 10 m, one is stopped at 20 m for another reason, two arrive at 30 m.
    /// let missions = [(10.0, Some(1)), (20.0, None), (30.0, Some(0)), (30.0, Some(0))];
    /// let found = Incidence::of(&missions.map(|(at, cause)| Ending { at, cause }), 2);
    /// assert_eq!(found.share(1, 15.0), 0.25);
    /// // Of the 3/4 still under way at 20 m all arrive: the mission stopped there counts like the others.
    /// assert_eq!((found.share(0, 29.0), found.share(0, 30.0)), (0.0, 0.75));
    /// ```
    pub fn of(endings: &[Ending], causes: usize) -> Self {
        let mut sorted: Vec<Ending> = endings.iter().copied().filter(|e| e.at.is_finite()).collect();
        sorted.sort_by(|a, b| a.at.total_cmp(&b.at));
        Self::of_counted(sorted.into_iter().map(|ending| (ending, 1)), causes)
    }

    /// The same from endings sorted by their finite distances, each with its number of subjects; resampling
    /// keeps the order and needs no sorting.
    pub fn of_counted(sorted: impl IntoIterator<Item = (Ending, usize)>, causes: usize) -> Self {
        let sorted: Vec<(Ending, usize)> = sorted.into_iter().collect();
        let mut incidence = Self { at: Vec::new(), shares: vec![Vec::new(); causes] };
        steps(sorted.iter().copied(), causes, |at, reached| {
            incidence.at.push(at);
            incidence.shares.iter_mut().zip(reached).for_each(|(curve, share)| curve.push(*share));
        });
        incidence
    }

    /// [`Self::share`] of every cause at each of some ascending distances, shape (causes, distances), from the same endings as
    /// [`Self::of_counted`]. The curve between the distances is not kept, so that memory does not grow with the subjects.
    ///
    /// ```
    /// use sastrugi_statistics::{Ending, Incidence};
    ///
    /// let missions = [(10.0, Some(1)), (20.0, None), (30.0, Some(0)), (30.0, Some(0))];
    /// let sorted = missions.map(|(at, cause)| (Ending { at, cause }, 1));
    /// let shares = Incidence::shares_at(sorted.iter().copied(), 2, &[0.0, 10.0, 30.0]);
    /// assert_eq!(shares, [[0.0, 0.0, 0.75], [0.0, 0.25, 0.25]]);
    /// ```
    pub fn shares_at(
        sorted: impl Iterator<Item = (Ending, usize)> + Clone,
        causes: usize,
        distances: &[f64],
    ) -> Vec<Vec<f64>> {
        let mut shares = vec![vec![0.0; distances.len()]; causes];
        let (mut from, mut before) = (0, vec![0.0; causes]);
        let mut hold = |from: usize, to: usize, values: &[f64]| {
            shares.iter_mut().zip(values).for_each(|(curve, value)| curve[from..to].fill(*value));
        };
        steps(sorted, causes, |at, reached| {
            let to = from + distances[from..].iter().take_while(|distance| **distance < at).count();
            hold(from, to, &before);
            from = to;
            before.copy_from_slice(reached);
        });
        hold(from, distances.len(), &before);
        shares
    }

    /// Share that has ended by `cause` up to `at`, in 0..1.
    pub fn share(&self, cause: usize, at: f64) -> f64 {
        let steps = self.at.partition_point(|x| *x <= at);
        steps.checked_sub(1).map_or(0.0, |last| self.shares[cause][last])
    }
}

/// Calls `step` at each distance at which subjects ended, ascending, with the share of every cause at and after it.
fn steps(sorted: impl Iterator<Item = (Ending, usize)> + Clone, causes: usize, mut step: impl FnMut(f64, &[f64])) {
    let mut at_risk: usize = sorted.clone().map(|(_, n)| n).sum();
    let (mut reached, mut under_way) = (vec![0.0; causes], 1.0);
    let mut own = vec![0; causes];
    let mut rest = sorted.filter(|(_, n)| *n > 0).peekable();
    while let Some(first) = rest.next() {
        let at = first.0.at;
        let (mut ended, mut all) = (0, 0);
        own.fill(0);
        let mut tie = Some(first);
        while let Some((ending, n)) = tie {
            all += n;
            if let Some(cause) = ending.cause {
                ended += n;
                own.get_mut(cause).into_iter().for_each(|own| *own += n);
            }
            tie = rest.next_if(|(ending, _)| ending.at == at);
        }
        if ended > 0 {
            for (share, own) in reached.iter_mut().zip(&own) {
                *share += under_way * *own as f64 / at_risk as f64;
            }
            under_way *= 1.0 - ended as f64 / at_risk as f64;
            step(at, &reached);
        }
        at_risk -= all;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn endings(distances: &[f64], causes: &[usize]) -> Vec<Ending> {
        let ending = |(&at, &cause): (&f64, &usize)| Ending { at, cause: cause.checked_sub(1) };
        distances.iter().zip(causes).map(ending).collect()
    }

    /// By hand, five subjects: cause 1 at 2, censored at 3, cause 2 at 3, cause 1 at 5, censored at 6. At risk 5, 4, 2: S = 4/5, then
    /// 3/5, then 3/10; F1 = 1/5, then 1/5 + 3/5 / 2 = 1/2; F2 = 4/5 / 4 = 1/5.
    #[test]
    fn val_by_hand() {
        let i = Incidence::of(&endings(&[3.0, 2.0, 6.0, 3.0, 5.0], &[0, 1, 0, 2, 1]), 2);
        assert_eq!(i.at, [2.0, 3.0, 5.0]);
        let expected = [[0.2, 0.2, 0.5], [0.0, 0.2, 0.2]];
        for (curve, expected) in i.shares.iter().zip(expected) {
            assert!(curve.iter().zip(expected).all(|(a, e)| (a - e).abs() < 1e-15), "{curve:?}");
        }
        assert_eq!((i.share(0, 1.9), i.share(0, 2.0), i.share(1, 99.0)), (0.0, 0.2, i.shares[1][2]));
    }

    /// Against scikit-survival 0.28.0 on 28 subjects with ties, three causes and censoring (lifelines 0.30.3 agrees to 1e-15);
    /// the program is `tests/statistical/aalen_johansen.py`. Tolerance 1e-14.
    #[test]
    fn val_of_an_independent_program() {
        let distances = [
            3.1, 3.1, 4.0, 5.2, 5.2, 5.2, 6.0, 7.7, 7.7, 9.3, 9.3, 11.0, 12.5, 12.5, 14.1, 16.0, 16.0, 18.8, 20.0,
            20.0, 21.5, 25.0, 28.0, 30.5, 35.0, 35.0, 35.0, 35.0,
        ];
        let causes = [1, 2, 0, 1, 1, 2, 3, 2, 0, 1, 3, 0, 2, 1, 1, 2, 2, 0, 1, 0, 3, 2, 0, 1, 0, 0, 0, 0];
        let i = Incidence::of(&endings(&distances, &causes), 3);
        for (at, shares) in [
            (5.2, [0.11, 0.07285714285714286, 0.0]),
            (9.3, [0.14909774436090226, 0.11, 0.0762406015037594]),
            (16.0, [0.23218045112781957, 0.23462406015037596, 0.0762406015037594]),
            (21.5, [0.2778759398496241, 0.23462406015037596, 0.12764802631578948]),
            (35.0, [0.3395648496240602, 0.28603148496240605, 0.12764802631578948]),
        ] {
            for (k, expected) in shares.into_iter().enumerate() {
                assert!((i.share(k, at) - expected).abs() < 1e-14, "cause {k} at {at}: {}", i.share(k, at));
            }
        }
    }

    proptest! {
        /// Without censoring before the end, the share is the plain proportion.
        #[test]
        fn prop_without_censoring_shares_are_counts(steps in proptest::collection::vec((0u8..40, 0usize..4), 1..60)) {
            let all: Vec<Ending> = steps
                .iter()
                .map(|&(at, cause)| match cause.checked_sub(1) {
                    None => Ending { at: 40.0, cause: None },
                    cause => Ending { at: f64::from(at), cause },
                })
                .collect();
            let i = Incidence::of(&all, 3);
            for x in 0..=40 {
                for k in 0..3 {
                    let count = all.iter().filter(|e| e.cause == Some(k) && e.at <= f64::from(x)).count();
                    prop_assert!((i.share(k, f64::from(x)) - count as f64 / all.len() as f64).abs() < 1e-12);
                }
            }
        }
    }

    /// By hand: one of two ends by a cause that is not asked for, which takes it out of the risk set: S = 1/2, then F = 1/2 x 1/1. Counted as
    /// censored it would give 1, ignored 1 as well.
    #[test]
    fn val_other_causes_leave_the_risk_set() {
        let i = Incidence::of(&[Ending { at: 2.0, cause: Some(0) }, Ending { at: 1.0, cause: Some(5) }], 1);
        assert_eq!((i.at.as_slice(), i.shares[0].as_slice()), ([1.0, 2.0].as_slice(), [0.0, 0.5].as_slice()));
    }

    /// A count of n is n subjects, a count of 0 none.
    #[test]
    fn prop_counts_are_repetitions() {
        let sorted = endings(&[1.0, 1.0, 2.0, 3.0, 3.0, 4.0], &[1, 0, 2, 1, 0, 2]);
        let counts = [2, 1, 3, 0, 2, 1];
        let counted = Incidence::of_counted(sorted.iter().copied().zip(counts), 2);
        let repeated = sorted.iter().zip(counts).flat_map(|(e, n)| vec![*e; n]).collect::<Vec<_>>();
        assert_eq!(counted, Incidence::of(&repeated, 2));
        // Nine subjects: 2 of 9, then S = 7/9 and 3 of 6.
        assert_eq!(counted.at, [1.0, 2.0, 4.0]);
        assert!((counted.share(0, 9.0) - 2.0 / 9.0).abs() < 1e-15);
        assert!((counted.share(1, 2.0) - 7.0 / 9.0 * 0.5).abs() < 1e-15);
    }

    /// The estimator as its formula reads, with every count from a pass over all subjects: the reference of the fast one.
    fn by_definition(endings: &[Ending], causes: usize) -> Incidence {
        let mut at: Vec<f64> = endings.iter().filter(|e| e.cause.is_some()).map(|e| e.at).collect();
        at.sort_by(f64::total_cmp);
        at.dedup();
        let count = |is: &dyn Fn(&Ending) -> bool| endings.iter().filter(|e| is(e)).count() as f64;
        let (mut survived, mut reached) = (1.0, vec![0.0; causes]);
        let mut shares = vec![Vec::new(); causes];
        for x in &at {
            let at_risk = count(&|e| e.at >= *x);
            for k in 0..causes {
                reached[k] += survived * count(&|e| e.at == *x && e.cause == Some(k)) / at_risk;
                shares[k].push(reached[k]);
            }
            survived *= 1.0 - count(&|e| e.at == *x && e.cause.is_some()) / at_risk;
        }
        Incidence { at, shares }
    }

    proptest! {
        /// The same bits as by definition, at every step and at any distances, also when subjects count several times or not at all.
        #[test]
        fn prop_one_pass_gives_the_definition(
            subjects in proptest::collection::vec((0u8..30, 0usize..5, 0usize..4), 0..80),
            mut distances in proptest::collection::vec(-1.0..32.0f64, 0..20),
        ) {
            let of = |&(at, cause, n): &(u8, usize, usize)| (Ending { at: f64::from(at), cause: cause.checked_sub(1) }, n);
            let mut counted: Vec<(Ending, usize)> = subjects.iter().map(of).collect();
            counted.sort_by(|a, b| a.0.at.total_cmp(&b.0.at));
            let repeated: Vec<Ending> = counted.iter().flat_map(|(e, n)| vec![*e; *n]).collect();
            let expected = by_definition(&repeated, 3);
            prop_assert_eq!(&Incidence::of_counted(counted.iter().copied(), 3), &expected);
            distances.extend([0.0, 7.0, 29.0]);
            distances.sort_by(f64::total_cmp);
            let shares = Incidence::shares_at(counted.iter().copied(), 3, &distances);
            for (k, curve) in shares.iter().enumerate() {
                let slow: Vec<f64> = distances.iter().map(|at| expected.share(k, *at)).collect();
                prop_assert_eq!(curve, &slow);
            }
        }
    }

    #[test]
    fn val_degenerate_samples() {
        assert_eq!(Incidence::of(&[], 2).share(1, 5.0), 0.0);
        let unknown = Incidence::of(&[Ending { at: f64::NAN, cause: Some(0) }], 1);
        assert_eq!((unknown.at.len(), unknown.share(0, 1.0)), (0, 0.0));
        let one = Incidence::of(&[Ending { at: 3.0, cause: Some(0) }], 1);
        assert_eq!(one.share(0, 3.0), 1.0);
    }
}
