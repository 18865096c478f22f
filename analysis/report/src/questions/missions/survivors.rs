//! The same missions in every group: metrics of the survivors alone are biased.

use super::METRICS;
use crate::content::{Block, Numbers, TableBlock, count, number, text};
use crate::data::{Data, Group, Mission};
use crate::questions::clusters::{LEVEL, block, median_interval, paired};
use crate::questions::outcome::successful;
use crate::questions::sql;
use crate::render::number as set;
use sastrugi_numeric::sums;
use std::collections::BTreeMap;

/// The table and its purpose; empty where groups share no pairs.
pub fn blocks(data: &Data, groups: &[Group<Mission>]) -> Vec<Block> {
    if groups.len() < 2 || !paired(groups) {
        return Vec::new();
    }
    let pairs = common(groups);
    let heading = Block::Heading("The same missions in every group".into());
    if pairs.is_empty() {
        let words = "No mission with the same start and goal in every group succeeded in all of them, so no changes between groups are given.";
        return vec![heading, Block::Text(words.into())];
    }
    let table = table(data, groups, &pairs);
    let all = if groups.len() == 2 { "both groups" } else { "all groups" };
    let common = set::counted(pairs.len(), "mission");
    vec![
        heading,
        Block::Text(format!(
            "{common} with the same start and goal in {all} succeeded in {all}. Medians over all successful missions \
             compare different missions, because in a harder group only the easier ones are left. The table gives the medians of \
             the common missions, and the median of their changes from one group to the next ({} % interval, resampling blocks of \
             paired terrains).",
            set::fixed(100.0 * LEVEL, 0)
        )),
        Block::Table(table),
    ]
}

/// Missions of every pair that succeeds in every group, in the order of the groups.
fn common<'a>(groups: &[Group<'a, Mission>]) -> Vec<(&'a str, Vec<&'a Mission>)> {
    let mut pairs: BTreeMap<&str, Vec<&Mission>> = BTreeMap::new();
    for (before, group) in groups.iter().enumerate() {
        for mission in group.rows.iter().filter(|m| successful(m)) {
            let members = pairs.entry(&mission.pair_id).or_default();
            // A second mission of the pair in one group would shift the order.
            if members.len() == before {
                members.push(mission);
            }
        }
    }
    pairs.into_iter().filter(|(_, members)| members.len() == groups.len()).collect()
}

fn table(data: &Data, groups: &[Group<Mission>], pairs: &[(&str, Vec<&Mission>)]) -> TableBlock {
    let columns = [
        ("metric", ""),
        ("unit", ""),
        ("group", ""),
        ("successful", ""),
        ("median", ""),
        ("in all groups", ""),
        ("their median", ""),
        ("change", ""),
        ("low", ""),
        ("high", ""),
    ];
    let mut numbers = Numbers::computed(sql::compared(data), &columns).with_mixed_units();
    for metric in &METRICS {
        for (g, group) in groups.iter().enumerate() {
            let all: Vec<f64> = group.rows.iter().filter(|m| successful(m)).map(|m| (metric.of)(m)).collect();
            let of =
                |k: usize| pairs.iter().map(move |p| (block(p.0), (metric.of)(p.1[k]))).filter(|v| v.1.is_finite());
            let here: Vec<(&str, f64)> = of(g).collect();
            let change = |before: usize| {
                let difference = |p: &(&'_ str, Vec<&Mission>)| (metric.of)(p.1[g]) - (metric.of)(p.1[before]);
                let values = pairs.iter().map(|p| (block(p.0), difference(p)));
                values.filter(|v| v.1.is_finite()).collect::<Vec<(&str, f64)>>()
            };
            let changes = g.checked_sub(1).map(change).unwrap_or_default();
            let figure = format!("paired {}", metric.column);
            let interval = median_interval(data, &group.name, &figure, &changes, LEVEL);
            let (low, high) = interval.map_or((f64::NAN, f64::NAN), |i| (i.low, i.high));
            numbers.row([
                text(metric.name),
                text(metric.unit),
                text(&group.name),
                count(all.len()),
                number(sums::median(&sums::finite(&all))),
                count(here.len()),
                number(sums::median(&here.iter().map(|v| v.1).collect::<Vec<_>>())),
                number(sums::median(&changes.iter().map(|c| c.1).collect::<Vec<_>>())),
                number(low),
                number(high),
            ]);
        }
    }
    TableBlock {
        id: "survivors".into(),
        caption: "All successful missions, and those that succeeded in every group".into(),
        numbers,
    }
}
