//! Power of the terrain-level tests, by simulation: how many terrains and missions the next study needs.
//!
//! The mean over `m` missions of a terrain has variance `between + within / m` ([`crate::components`]
//! estimates both). More missions reduce only the second part, so that beyond some number only more terrains help.
//! Terrain means are drawn from normal distributions with that variance and the stated difference; each set is tested as in the report
//! (rank sum or signed rank against random arrangements, [`crate::permutation`]). The power is the share of sets
//! with `p <= alpha`; its standard error is at most 1.6 %. Success shares near 0 or 1 are less normal than assumed here.
//!
//! One set of random arrangements is used for all simulations of a cell, which does not change the level of each test.
//! Cost: simulations x arrangements x terrains.

use crate::permutation::{centred_ranks, labels_of, shuffle, signed_ranks};
use sastrugi_numeric::Stream;

/// Simulated studies of a cell.
pub const SIMULATIONS: usize = 1000;
/// Random arrangements of each test.
pub const ARRANGEMENTS: usize = 199;

/// The difference to detect and the scatter of the values, in the units of the values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Difference of the groups' means.
    pub difference: f64,
    /// Variance between terrains (for paired groups: of the differences between blocks).
    pub between: f64,
    /// Variance between missions of one terrain (for paired groups: of the differences within pairs of missions).
    pub within: f64,
}

impl Target {
    /// Power of the rank-sum test at level `alpha`, with `terrains` terrains in each of two groups and `missions` missions on each.
    pub fn of_groups(&self, terrains: usize, missions: usize, alpha: f64, stream: &mut Stream) -> f64 {
        let mut labels = labels_of(&[terrains, terrains]);
        let observed = weights(&labels);
        let arranged = |_| {
            shuffle(&mut labels, stream);
            weights(&labels)
        };
        let arrangements: Vec<Vec<f64>> = (0..ARRANGEMENTS).map(arranged).collect();
        let scatter = self.scatter(missions);
        let draw = || {
            centred_ranks(&observed.iter().map(|w| w * self.difference + scatter * stream.normal()).collect::<Vec<_>>())
        };
        share(alpha, &observed, &arrangements, draw)
    }

    /// Power of the signed-rank test at level `alpha`, with `blocks` blocks of paired terrains and `missions` missions on each terrain.
    pub fn of_pairs(&self, blocks: usize, missions: usize, alpha: f64, stream: &mut Stream) -> f64 {
        let mut signs = || (0..blocks).map(|_| if stream.below(2) == 0 { -1.0 } else { 1.0 }).collect();
        let arrangements: Vec<Vec<f64>> = (0..ARRANGEMENTS).map(|_| signs()).collect();
        let scatter = self.scatter(missions);
        let draw =
            || signed_ranks(&(0..blocks).map(|_| self.difference + scatter * stream.normal()).collect::<Vec<_>>());
        share(alpha, &vec![1.0; blocks], &arrangements, draw)
    }

    /// Standard deviation of a mean over missions; negative variance estimates count as zero.
    fn scatter(&self, missions: usize) -> f64 {
        (self.between.max(0.0) + self.within.max(0.0) / missions.max(1) as f64).sqrt()
    }
}

fn weights(labels: &[usize]) -> Vec<f64> {
    labels.iter().map(|l| *l as f64).collect()
}

/// Share of drawn sets of scores whose two-sided test has `p <= alpha`.
fn share(alpha: f64, observed: &[f64], arrangements: &[Vec<f64>], mut draw: impl FnMut() -> Vec<f64>) -> f64 {
    // Weights of one score in all arrangements are stored next to each other, so that the sums vectorise.
    let transposed: Vec<[f64; ARRANGEMENTS]> =
        (0..observed.len()).map(|k| std::array::from_fn(|a| arrangements[a][k])).collect();
    let mut found = 0;
    for _ in 0..SIMULATIONS {
        let scores = draw();
        let mut statistics = [0.0; ARRANGEMENTS];
        for (weights, score) in transposed.iter().zip(&scores) {
            statistics.iter_mut().zip(weights).for_each(|(t, w)| *t += w * score);
        }
        // Sums of multiples of one half are exact, so equal statistics compare equal.
        let least = observed.iter().zip(&scores).map(|(w, s)| w * s).sum::<f64>().abs();
        let large = 1 + statistics.iter().filter(|t| t.abs() >= least).count();
        found += usize::from(large as f64 <= alpha * (ARRANGEMENTS + 1) as f64);
    }
    found as f64 / SIMULATIONS as f64
}

#[cfg(test)]
mod tests;
