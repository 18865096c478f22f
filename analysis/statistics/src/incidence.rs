//! Cumulative incidence of competing endings: the share that has ended in each way up to a distance (or time), when some were
//! only watched for a part of the way.
//!
//! The estimator of O. Aalen and S. Johansen, An empirical transition matrix for non-homogeneous Markov chains based on
//! censored observations, Scandinavian Journal of Statistics 5 (1978). With `n(x)` still under way just before `x`,
//! `d_k(x)` of them ending in way `k` at `x`, and `d(x)` the sum over `k`:
//!
//! ```text
//! S(x)   = product over x' <= x of 1 - d(x') / n(x')         (Kaplan and Meier, 1958)
//! F_k(x) = sum over x' <= x of S(x'-) d_k(x') / n(x')
//! ```
//!
//! so that `S + sum F_k = 1`. One minus the Kaplan-Meier curve of a single way would count what ended otherwise as still able
//! to end so, and is too high. At equal distances endings come before censorings. Endings at an unknown distance are left
//! out. Cost: one sort. Subjects that come in clusters: [`clustered`].

pub mod clustered;

/// How one subject ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ending {
    /// Distance (or time) at which it ended.
    pub at: f64,
    /// Number of the way it ended; `None` when it was not watched further (censored).
    pub cause: Option<usize>,
}

/// Cumulative incidence as step functions, continuous from the right.
#[derive(Clone, Debug, PartialEq)]
pub struct Incidence {
    /// Distances at which a curve steps, ascending.
    pub at: Vec<f64>,
    /// For each way to end, its share at and after each step.
    pub shares: Vec<Vec<f64>>,
}

impl Incidence {
    /// Aalen-Johansen estimator for `causes` ways to end; an ending of a higher number counts as none of them but leaves the
    /// risk set as they do.
    pub fn of(endings: &[Ending], causes: usize) -> Self {
        let mut sorted: Vec<Ending> = endings.iter().copied().filter(|e| e.at.is_finite()).collect();
        sorted.sort_by(|a, b| a.at.total_cmp(&b.at));
        Self::of_counted(sorted.into_iter().map(|ending| (ending, 1)), causes)
    }

    /// The same of endings in the order of their finite distances, each with the number of subjects that ended so: redraws
    /// keep the order and need no sorting.
    pub fn of_counted(sorted: impl IntoIterator<Item = (Ending, usize)>, causes: usize) -> Self {
        let sorted: Vec<(Ending, usize)> = sorted.into_iter().filter(|(_, n)| *n > 0).collect();
        let count = |is: &dyn Fn(&Ending) -> bool, all: &[(Ending, usize)]| {
            all.iter().filter(|(e, _)| is(e)).map(|(_, n)| *n).sum::<usize>() as f64
        };
        let mut incidence = Self { at: Vec::new(), shares: vec![Vec::new(); causes] };
        let mut reached = vec![0.0; causes];
        let (mut at_risk, mut under_way) = (count(&|_| true, &sorted), 1.0);
        for ties in sorted.chunk_by(|a, b| a.0.at == b.0.at) {
            let ended = count(&|e| e.cause.is_some(), ties);
            for (k, share) in reached.iter_mut().enumerate() {
                let own = count(&|e| e.cause == Some(k), ties);
                *share += under_way * own / at_risk;
            }
            under_way *= 1.0 - ended / at_risk;
            at_risk -= count(&|_| true, ties);
            if ended > 0.0 {
                incidence.at.push(ties[0].0.at);
                incidence.shares.iter_mut().zip(&reached).for_each(|(curve, share)| curve.push(*share));
            }
        }
        incidence
    }

    /// Share that has ended in way `cause` up to `at`, in 0..1.
    pub fn share(&self, cause: usize, at: f64) -> f64 {
        let steps = self.at.partition_point(|x| *x <= at);
        steps.checked_sub(1).map_or(0.0, |last| self.shares[cause][last])
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

    /// By hand, five subjects: way 1 at 2, censored at 3, way 2 at 3, way 1 at 5, censored at 6. At risk 5, 4, 2: S = 4/5, then
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

    /// scikit-survival 0.28.0 on 28 subjects with ties, three ways to end and censoring (lifelines 0.30.3 agrees to 1e-15);
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
                assert!((i.share(k, at) - expected).abs() < 1e-14, "way {k} at {at}: {}", i.share(k, at));
            }
        }
    }

    proptest! {
        /// Without censoring before the end, the share is the plain count; what is under way makes up one with the shares.
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

    #[test]
    fn val_degenerate_samples() {
        assert_eq!(Incidence::of(&[], 2).share(1, 5.0), 0.0);
        let unknown = Incidence::of(&[Ending { at: f64::NAN, cause: Some(0) }], 1);
        assert_eq!((unknown.at.len(), unknown.share(0, 1.0)), (0, 0.0));
        let one = Incidence::of(&[Ending { at: 3.0, cause: Some(0) }], 1);
        assert_eq!(one.share(0, 3.0), 1.0);
    }
}
