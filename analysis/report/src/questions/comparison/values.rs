//! Values that are compared: for every metric and group, one number per terrain, or per block of paired terrains.

use crate::data::{Group, Mission};
use crate::questions::clusters::{Pairing, block};
use sastrugi_numeric::sums;
use sastrugi_schemas::study::Statistic;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

/// A metric that is compared.
pub struct Metric<'a> {
    /// Name on the page.
    pub name: &'static str,
    /// Unit as set in text.
    pub unit: &'static str,
    /// Column, which also names its random streams.
    pub column: &'static str,
    /// Its groups, in their order.
    pub groups: Vec<Values<'a>>,
}

/// Values of a group.
pub struct Values<'a> {
    /// Label of the group, with the run where there are several.
    pub name: &'a str,
    /// Label alone.
    pub label: &'a str,
    /// Id of the run.
    pub run: Option<&'a str>,
    /// Values of the missions on each terrain.
    pub terrains: BTreeMap<&'a str, Vec<f64>>,
    /// Values in each cluster with the pair of each: a terrain, or a block where groups share draws.
    clusters: BTreeMap<&'a str, Vec<(&'a str, f64)>>,
    /// Pairs of all missions, whether they have a value or not; empty if no groups share pairs.
    pairs: Rc<BTreeSet<&'a str>>,
    /// Mean of each cluster's missions.
    pub means: BTreeMap<&'a str, f64>,
}

impl<'a> Values<'a> {
    /// Pairs with a value in a cluster.
    fn pairs_in(&self, cluster: &str) -> BTreeSet<&'a str> {
        self.clusters.get(cluster).into_iter().flatten().map(|v| v.0).collect()
    }

    /// Means alone, in the order of the clusters.
    pub fn numbers(&self) -> Vec<f64> {
        self.means.values().copied().collect()
    }
}

/// Metrics that every report compares.
const METRICS: [Statistic; 5] = [
    Statistic::Success,
    Statistic::RmsVerticalAccelerationMS2,
    Statistic::RmsPitchRateDegS,
    Statistic::RmsRollRateDegS,
    Statistic::TimeS,
];

/// Success, then the metrics of the successful missions.
pub fn metrics<'a>(groups: &'a [Group<'a, Mission>], pairing: &Pairing<'a>) -> Vec<Metric<'a>> {
    let pairs = pairs(groups, pairing);
    METRICS.into_iter().map(|statistic| metric_of(statistic, groups, pairing, &pairs)).collect()
}

/// One metric of all groups.
pub fn metric<'a>(statistic: Statistic, groups: &'a [Group<'a, Mission>], pairing: &Pairing<'a>) -> Metric<'a> {
    metric_of(statistic, groups, pairing, &pairs(groups, pairing))
}

/// The same with the pairs of each group.
fn metric_of<'a>(
    statistic: Statistic,
    groups: &'a [Group<'a, Mission>],
    pairing: &Pairing<'a>,
    pairs: &[Rc<BTreeSet<&'a str>>],
) -> Metric<'a> {
    let (name, unit) = words(statistic);
    let of_group = |(g, pairs): (&'a Group<'a, Mission>, &Rc<BTreeSet<&'a str>>)| {
        values(g, pairing, Rc::clone(pairs), |m| m.of(statistic))
    };
    Metric { name, unit, column: statistic.column(), groups: groups.iter().zip(pairs).map(of_group).collect() }
}

/// Pairs of all missions of each group, shared by the metrics; empty if no groups share pairs.
fn pairs<'a>(groups: &'a [Group<'a, Mission>], pairing: &Pairing<'a>) -> Vec<Rc<BTreeSet<&'a str>>> {
    let of_group = |group: &'a Group<'a, Mission>| match pairing.is_common() {
        true => group.rows.iter().map(|m| m.pair_id.as_str()).collect(),
        false => BTreeSet::new(),
    };
    groups.iter().map(|group| Rc::new(of_group(group))).collect()
}

/// Name of a metric, and its unit as set in text.
pub const fn words(statistic: Statistic) -> (&'static str, &'static str) {
    match statistic {
        Statistic::Success => ("success on a terrain", "%"),
        Statistic::Efficiency => ("efficiency", ""),
        Statistic::TimeS => ("time to the goal", "s"),
        Statistic::RmsVerticalAccelerationMS2 => ("RMS vertical acceleration", "m/s²"),
        Statistic::RmsPitchRateDegS => ("RMS pitch rate", "°/s"),
        Statistic::RmsRollRateDegS => ("RMS roll rate", "°/s"),
        Statistic::MaxPitchDeg => ("largest pitch", "°"),
        Statistic::MaxRollDeg => ("largest roll", "°"),
    }
}

fn values<'a>(
    group: &'a Group<'a, Mission>,
    pairing: &Pairing<'a>,
    pairs: Rc<BTreeSet<&'a str>>,
    value: impl Fn(&Mission) -> f64,
) -> Values<'a> {
    let (mut terrains, mut clusters) = (BTreeMap::<&str, Vec<f64>>::new(), BTreeMap::<&str, Vec<(&str, f64)>>::new());
    for mission in &group.rows {
        let value = value(mission);
        if value.is_finite() {
            let terrain = mission.terrain_id.as_str();
            terrains.entry(terrain).or_default().push(value);
            // By the mission's own pair: several runs may use one terrain.
            let cluster = if pairing.is_common() { block(&mission.pair_id) } else { terrain };
            clusters.entry(cluster).or_default().push((&mission.pair_id, value));
        }
    }
    terrains.values_mut().for_each(Vec::shrink_to_fit);
    clusters.values_mut().for_each(Vec::shrink_to_fit);
    let mean = |values: &[(&str, f64)]| sums::mean(&values.iter().map(|v| v.1).collect::<Vec<_>>());
    let means = clusters.iter().map(|(name, values)| (*name, mean(values))).collect();
    let (name, label, run) = (&group.name, &group.label, group.run.as_deref());
    Values { name, label, run, terrains, clusters, pairs, means }
}

/// True when all these groups have pairs in common, whatever the outcome of their missions.
pub fn share_pairs(groups: &[&Values]) -> bool {
    let Some((first, others)) = groups.split_first() else { return false };
    first.pairs.iter().any(|pair| others.iter().all(|g| g.pairs.contains(pair)))
}

/// The clusters that all these groups have, each with its missions in every group. Where groups share pairs, only pairs with a value
/// in all groups are kept, in one order: means over the survivors of each group alone would compare different missions.
pub fn common_missions(groups: &[&Values]) -> Vec<Vec<Vec<f64>>> {
    let Some((first, others)) = groups.split_first() else { return Vec::new() };
    let paired = share_pairs(groups);
    let of = |name: &&str| {
        let pairs =
            others.iter().fold(first.pairs_in(name), |all, g| all.intersection(&g.pairs_in(name)).copied().collect());
        let missions = |g: &&Values| {
            let all = g.clusters.get(*name).into_iter().flatten();
            let mut counted: Vec<(&str, f64)> = all.copied().filter(|v| !paired || pairs.contains(v.0)).collect();
            counted.sort_by(|a, b| a.0.cmp(b.0));
            counted.into_iter().map(|v| v.1).collect::<Vec<_>>()
        };
        let missions: Vec<Vec<f64>> = groups.iter().map(missions).collect();
        missions.iter().all(|m| !m.is_empty()).then_some(missions)
    };
    first.clusters.keys().filter_map(of).collect()
}

/// The mean of each block's missions in every group.
pub fn means(blocks: &[Vec<Vec<f64>>]) -> Vec<Vec<f64>> {
    blocks.iter().map(|block| block.iter().map(|missions| sums::mean(missions)).collect()).collect()
}
