//! Variance components of two nested random factors: between groups, between members of a group, and between repeats of a
//! member.
//!
//! Model: `y_ijk = mu + a_i + b_ij + e_ijk` for group `i` of `a` (a terrain), member `j` of its `b_i` (a mission), repeat `k` of
//! `n_ij` (a start), with independent effects of mean 0 and variances `A`, `B`, `E`. Estimators of the analysis of variance
//! (S. Searle, G. Casella and C. McCulloch, Variance Components, 1992: nested classification, unbalanced data), which equate
//! sums of squares with their expectations. With `n_i`, `N`, `b` the numbers of values in group `i` and in all, and of members:
//!
//! ```text
//! SS_E = sum (y_ijk - y_ij)^2         expectation (N - b) E
//! SS_B = sum n_ij (y_ij - y_i)^2      expectation (b - a) E + (N - k12) B
//! SS_A = sum n_i (y_i - y)^2          expectation (a - 1) E + (k12 - k3) B + (N - k1) A
//! k12 = sum n_ij^2 / n_i,   k1 = sum n_i^2 / N,   k3 = sum n_ij^2 / N
//! ```
//!
//! They are unbiased for any distribution, including outcomes that are 0 or 1, where `E` is the mean of
//! `p (1 - p)` over the members. Because they are unbiased, they can be negative if the true value is near 0. Cost: one pass.

/// Estimates of the three variances, in squared units of the values. Any may be negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Components {
    /// Between groups.
    pub group: f64,
    /// Between members of a group.
    pub member: f64,
    /// Between repeats of a member.
    pub repeat: f64,
}

/// Sums of one group, sufficient for the estimates, so that groups can be resampled without their values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Group {
    /// Values.
    count: f64,
    members: f64,
    sum: f64,
    /// Sum of squares of the values about their member's mean.
    within: f64,
    /// Sum over members of n (mean - group's mean)^2.
    between: f64,
    /// Sum over members of their squared counts.
    squared_counts: f64,
}

impl Group {
    /// A group from the values of each of its members; members without values are left out.
    pub fn of(members: &[Vec<f64>]) -> Self {
        let known: Vec<&Vec<f64>> = members.iter().filter(|m| !m.is_empty()).collect();
        let count: f64 = known.iter().map(|m| m.len() as f64).sum();
        let sum: f64 = known.iter().map(|m| m.iter().sum::<f64>()).sum();
        let mean_of = |m: &[f64]| m.iter().sum::<f64>() / m.len() as f64;
        let square = |v: f64| v * v;
        Self {
            count,
            members: known.len() as f64,
            sum,
            within: known.iter().map(|m| m.iter().map(|v| square(v - mean_of(m))).sum::<f64>()).sum(),
            between: known.iter().map(|m| m.len() as f64 * square(mean_of(m) - sum / count)).sum(),
            squared_counts: known.iter().map(|m| square(m.len() as f64)).sum(),
        }
    }
}

impl Components {
    /// Estimates from groups; `None` unless there are at least two groups, a group with two members, and a member with two repeats.
    ///
    /// ```
    /// use sastrugi_statistics::{Components, components::Group};
    ///
    /// // Two terrains with two missions of two starts each; starts do not scatter.
    /// let terrains = [[vec![1.0; 2], vec![3.0; 2]], [vec![11.0; 2], vec![13.0; 2]]].map(|missions| Group::of(&missions));
    /// let found = Components::of(&terrains).unwrap();
    /// // Missions have the variance 2. Terrains' means 2 and 12 have the variance 50, of which 2 / 2 comes from their missions.
    /// assert_eq!((found.group, found.member, found.repeat), (49.0, 2.0, 0.0));
    /// ```
    pub fn of(groups: &[Group]) -> Option<Self> {
        let known: Vec<&Group> = groups.iter().filter(|g| g.count > 0.0).collect();
        let total = |f: fn(&Group) -> f64| known.iter().map(|g| f(g)).sum::<f64>();
        let (n, a) = (total(|g| g.count), known.len() as f64);
        let (member, repeat) = Self::within_groups(groups)?;
        if a < 2.0 {
            return None;
        }
        let mean = total(|g| g.sum) / n;
        let k12 = total(|g| g.squared_counts / g.count);
        let k1 = total(|g| g.count * g.count) / n;
        let k3 = total(|g| g.squared_counts) / n;
        let between: f64 = known.iter().map(|g| g.count * (g.sum / g.count - mean) * (g.sum / g.count - mean)).sum();
        let group = (between - (a - 1.0) * repeat - (k12 - k3) * member) / (n - k1);
        Some(Self { group, member, repeat })
    }

    /// Variances between the members of a group and between the repeats of a member, from one or more groups; `None` unless a group
    /// has at least two members and a member two repeats.
    pub fn within_groups(groups: &[Group]) -> Option<(f64, f64)> {
        let known: Vec<&Group> = groups.iter().filter(|g| g.count > 0.0).collect();
        let total = |f: fn(&Group) -> f64| known.iter().map(|g| f(g)).sum::<f64>();
        let (n, b, a) = (total(|g| g.count), total(|g| g.members), known.len() as f64);
        if !(b > a && n > b) {
            return None;
        }
        let repeat = total(|g| g.within) / (n - b);
        let member = (total(|g| g.between) - (b - a) * repeat) / (n - total(|g| g.squared_counts / g.count));
        Some((member, repeat))
    }

    /// Shares of the total in 0..1, with negative estimates counted as 0: group, member, repeat. `None` if nothing varies.
    pub fn shares(&self) -> Option<[f64; 3]> {
        let parts = [self.group, self.member, self.repeat].map(|v| v.max(0.0));
        let total: f64 = parts.iter().sum();
        (total > 0.0).then(|| parts.map(|v| v / total))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Stream, Streams};

    fn components(groups: &[Vec<Vec<f64>>]) -> Option<Components> {
        Components::of(&groups.iter().map(|g| Group::of(g)).collect::<Vec<_>>())
    }

    /// Balanced data, two groups of two members with two repeats. By hand: means of members 1, 4 and 6, 9, of groups 2.5 and
    /// 7.5; MS_E = 14/4, MS_B = 18/2, MS_A = 50/1; E = MS_E, B = (MS_B - MS_E) / 2, A = (MS_A - MS_B) / 4.
    #[test]
    fn val_balanced_by_hand() {
        let groups = vec![vec![vec![0.0, 2.0], vec![3.0, 5.0]], vec![vec![5.0, 7.0], vec![7.0, 11.0]]];
        // Deviations within members: 1, 1, 1, 1, 1, 1, 2, 2.
        let within = 6.0 + 8.0;
        let (ms_e, ms_b, ms_a) = (within / 4.0, 18.0 / 2.0, 50.0);
        let c = components(&groups).unwrap();
        assert!((c.repeat - ms_e).abs() < 1e-12, "{c:?}");
        assert!((c.member - (ms_b - ms_e) / 2.0).abs() < 1e-12, "{c:?}");
        assert!((c.group - (ms_a - ms_b) / 4.0).abs() < 1e-12, "{c:?}");
    }

    /// statsmodels 0.15.0, MixedLM by restricted maximum likelihood (`tests/statistical/nested_tests.py`), which balanced data
    /// with positive estimates share with the analysis of variance. Relative tolerance 1e-5, that of its minimiser.
    #[test]
    fn val_balanced_of_statsmodels() {
        let groups: Vec<Vec<Vec<f64>>> = vec![
            vec![vec![3.0, 5.0, 4.5], vec![9.0, 7.5, 8.0], vec![6.0, 6.5, 4.0]],
            vec![vec![13.0, 14.5, 12.0], vec![10.0, 11.5, 11.0], vec![17.0, 16.0, 15.0]],
            vec![vec![8.0, 7.0, 9.5], vec![12.5, 11.0, 13.0], vec![9.0, 10.0, 8.5]],
            vec![vec![5.5, 4.0, 6.0], vec![2.0, 3.5, 1.0], vec![7.0, 8.0, 6.5]],
        ];
        let c = components(&groups).unwrap();
        for (ours, theirs) in [(c.group, 13.245_371_979), (c.member, 5.013_889_784_6), (c.repeat, 1.090_277_701_74)] {
            assert!((ours / theirs - 1.0).abs() < 1e-5, "{c:?}");
        }
    }

    /// Coefficients for unbalanced data against expectations computed term by term: the three sums of squares are quadratic forms
    /// y'Qy, whose expectation is the trace of Q times the covariance of y. Tolerance 1e-12.
    #[test]
    fn val_unbalanced_estimates_are_unbiased() {
        let shape: [&[usize]; 3] = [&[2, 3], &[1, 4, 2], &[5]];
        let cells: Vec<(usize, usize)> = shape
            .iter()
            .enumerate()
            .flat_map(|(i, g)| g.iter().enumerate().flat_map(move |(j, &n)| vec![(i, j); n]))
            .collect();
        // An estimate is y'Qy; Q from the estimates of unit vectors and of their pairs.
        let estimate = |y: &[f64]| {
            let mut values = y.iter().copied();
            let groups: Vec<Vec<Vec<f64>>> =
                shape.iter().map(|g| g.iter().map(|&n| values.by_ref().take(n).collect()).collect()).collect();
            let c = components(&groups).unwrap();
            [c.group, c.member, c.repeat]
        };
        let unit = |at: &[usize]| {
            let mut y = vec![0.0; cells.len()];
            at.iter().for_each(|&k| y[k] = 1.0);
            estimate(&y)
        };
        for (which, truth) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].into_iter().enumerate() {
            let mut expected = [0.0; 3];
            for (p, q) in (0..cells.len()).flat_map(|p| (0..cells.len()).map(move |q| (p, q))) {
                let covariance = match which {
                    0 => f64::from(cells[p].0 == cells[q].0),
                    1 => f64::from(cells[p] == cells[q]),
                    _ => f64::from(p == q),
                };
                if covariance == 0.0 {
                    continue;
                }
                let form = if p == q {
                    unit(&[p])
                } else {
                    let (both, one, two) = (unit(&[p, q]), unit(&[p]), unit(&[q]));
                    std::array::from_fn(|k| 0.5 * (both[k] - one[k] - two[k]))
                };
                expected.iter_mut().zip(form).for_each(|(e, f)| *e += f);
            }
            let close = expected.iter().zip(truth).all(|(e, t)| (e - t).abs() < 1e-12);
            assert!(close, "variance {which}: {expected:?}");
        }
    }

    #[test]
    fn val_degenerate_samples() {
        assert_eq!(components(&[]), None);
        assert_eq!(components(&[vec![vec![1.0, 2.0], vec![1.0]]]), None);
        assert_eq!(components(&[vec![vec![1.0, 2.0]], vec![vec![3.0, 1.0]]]), None);
        assert_eq!(components(&[vec![vec![1.0], vec![2.0]], vec![vec![3.0]]]), None);
        assert!(components(&[vec![vec![1.0, 2.0], vec![1.0], vec![]], vec![vec![3.0]], vec![]]).is_some());
        let flat = components(&[vec![vec![1.0; 2]; 2], vec![vec![1.0; 2]; 2]]).unwrap();
        assert_eq!(flat.shares(), None);
        let negative = Components { group: -1.0, member: 1.0, repeat: 3.0 };
        assert_eq!(negative.shares(), Some([0.0, 0.25, 0.75]));
    }

    /// One data set of outcomes 0 and 1: a terrain's mean probability is 0.3 or 0.7, a mission's 0.25 above or below it,
    /// each with probability 1/2, so that A = 0.04, B = 0.0625, and E = 0.25 - A - B = 0.1475.
    fn outcomes(terrains: usize, s: &mut Stream) -> Vec<Vec<Vec<f64>>> {
        let mut sign = |step: f64| if s.uniform() < 0.5 { -step } else { step };
        let mut probabilities = Vec::new();
        for _ in 0..terrains {
            let terrain = 0.5 + sign(0.2);
            probabilities.push((0..10).map(|_| terrain + sign(0.25)).collect::<Vec<f64>>());
        }
        let mut starts = |p: &f64| (0..6).map(|_| f64::from(u8::from(s.uniform() < *p))).collect();
        probabilities.iter().map(|t| t.iter().map(&mut starts).collect()).collect()
    }

    /// Null: the estimators are unbiased. 400 data sets of 20 terrains, 10 missions, 6 starts; the mean of each estimate over
    /// the sets lies within 5 standard errors (from the scatter of the sets) of the true value. False alarm 3 x 6e-7 = 2e-6
    /// (normal). Standard errors are 5e-4, 4e-4 and 5e-4, so that a bias of 6 % of any component is
    /// detected.
    #[test]
    fn stat_components_of_outcomes_are_recovered() {
        let mut s = Streams::for_seed(1, "components-test").stream("outcomes");
        let sets: Vec<[f64; 3]> = (0..400)
            .map(|_| {
                let c = components(&outcomes(20, &mut s)).unwrap();
                [c.group, c.member, c.repeat]
            })
            .collect();
        for (k, truth) in [0.04, 0.0625, 0.1475].into_iter().enumerate() {
            let values: Vec<f64> = sets.iter().map(|c| c[k]).collect();
            let mean = sastrugi_numeric::sums::mean(&values);
            let error = (sastrugi_numeric::sums::variance(&values) / 400.0).sqrt();
            assert!((mean - truth).abs() < 5.0 * error, "component {k}: {mean} +- {error}, truth {truth}");
        }
    }
}
