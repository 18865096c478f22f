//! What is compared: for every figure and group, one number per terrain, or per block of paired terrains.

use crate::data::Group;
use crate::questions::clusters::Pairing;
use crate::questions::missions::{METRICS, Metric};
use crate::questions::outcome::successful;
use sastrugi_numeric::sums;
use sastrugi_schemas::study::Statistic;
use sastrugi_schemas::tables::MissionRow;
use std::collections::BTreeMap;

/// A figure that is compared.
pub struct Figure<'a> {
    /// Words.
    pub name: &'static str,
    /// Unit as it is set in text.
    pub unit: &'static str,
    /// Name of its streams.
    pub column: &'static str,
    /// Its groups, in their order.
    pub groups: Vec<Values<'a>>,
}

/// Values of a group.
pub struct Values<'a> {
    /// Label of the group.
    pub name: &'a str,
    /// Values of the missions on each terrain.
    pub terrains: BTreeMap<&'a str, Vec<f64>>,
    /// Mean of each cluster's missions: of a terrain, or of a block where groups share draws.
    pub means: BTreeMap<&'a str, f64>,
}

impl Values<'_> {
    /// Means alone, in the order of the clusters.
    pub fn numbers(&self) -> Vec<f64> {
        self.means.values().copied().collect()
    }
}

/// Figures that hypotheses may be about, beside those that every report compares.
const EFFICIENCY: Metric =
    Metric { column: "efficiency", name: "straight distance over path length", unit: "", of: |m| m.efficiency };
const MAX_PITCH: Metric =
    Metric { column: "max_pitch_deg", name: "largest pitch", unit: "°", of: |m| m.max_pitch_deg };
const MAX_ROLL: Metric = Metric { column: "max_roll_deg", name: "largest roll", unit: "°", of: |m| m.max_roll_deg };

/// Success, then every figure of the successful missions.
pub fn figures<'a>(groups: &'a [Group<'a, MissionRow>], pairing: &Pairing<'a>) -> Vec<Figure<'a>> {
    let metrics = METRICS.iter().map(|metric| of_successful(metric, groups, pairing));
    std::iter::once(success(groups, pairing)).chain(metrics).collect()
}

/// The figure that a hypothesis is about.
pub fn figure<'a>(statistic: Statistic, groups: &'a [Group<'a, MissionRow>], pairing: &Pairing<'a>) -> Figure<'a> {
    let [acceleration, pitch_rate, roll_rate, time] = &METRICS;
    let metric = match statistic {
        Statistic::Success => return success(groups, pairing),
        Statistic::Efficiency => &EFFICIENCY,
        Statistic::TimeS => time,
        Statistic::RmsVerticalAccelerationMS2 => acceleration,
        Statistic::RmsPitchRateDegS => pitch_rate,
        Statistic::RmsRollRateDegS => roll_rate,
        Statistic::MaxPitchDeg => &MAX_PITCH,
        Statistic::MaxRollDeg => &MAX_ROLL,
    };
    of_successful(metric, groups, pairing)
}

fn success<'a>(groups: &'a [Group<'a, MissionRow>], pairing: &Pairing<'a>) -> Figure<'a> {
    let groups = groups.iter().map(|g| values(g, pairing, |m| if successful(m) { 100.0 } else { 0.0 })).collect();
    Figure { name: "success on a terrain", unit: "%", column: "success", groups }
}

fn of_successful<'a>(metric: &Metric, groups: &'a [Group<'a, MissionRow>], pairing: &Pairing<'a>) -> Figure<'a> {
    let value = |m: &MissionRow| if successful(m) { (metric.of)(m) } else { f64::NAN };
    let groups = groups.iter().map(|g| values(g, pairing, value)).collect();
    Figure { name: metric.name, unit: metric.unit, column: metric.column, groups }
}

fn values<'a>(
    group: &'a Group<'a, MissionRow>,
    pairing: &Pairing<'a>,
    value: impl Fn(&MissionRow) -> f64,
) -> Values<'a> {
    let (mut terrains, mut clusters) = (BTreeMap::<&str, Vec<f64>>::new(), BTreeMap::<&str, Vec<f64>>::new());
    for mission in &group.rows {
        let value = value(mission);
        if value.is_finite() {
            let terrain = mission.terrain_id.as_str();
            terrains.entry(terrain).or_default().push(value);
            clusters.entry(pairing.cluster(terrain)).or_default().push(value);
        }
    }
    let means = clusters.into_iter().map(|(name, values)| (name, sums::mean(&values))).collect();
    Values { name: &group.name, terrains, means }
}

/// The blocks that all these groups have, each with its number in every group.
pub fn common_blocks(groups: &[&Values]) -> Vec<Vec<f64>> {
    let Some((first, others)) = groups.split_first() else { return Vec::new() };
    let block = |(name, value): (&&str, &f64)| {
        let rest = others.iter().map(|g| g.means.get(*name).copied());
        std::iter::once(Some(*value)).chain(rest).collect::<Option<Vec<f64>>>()
    };
    first.means.iter().filter_map(block).collect()
}
