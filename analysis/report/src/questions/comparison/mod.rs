//! Do groups of missions differ? Tests whose unit is the terrain.

mod declared;
mod model;
mod planning;
pub(super) mod values;
pub(super) mod verdicts;

use super::Question;
use super::clusters::{LEVEL, Pairing};
use crate::ReportError;
use crate::content::Block;
use crate::data::{Data, Group, Mission};
use crate::render::number as set;
use sastrugi_schemas::counted;
use sastrugi_statistics::normal;
use std::collections::BTreeSet;
use values::Metric;

/// Registry entry.
pub const QUESTION: Question =
    Question { id: "comparison", name: "Comparison", title: "Do the groups differ?", answer };

/// Level of the tests.
pub const ALPHA: f64 = 0.05;
/// Terrains in a group below which the reader is warned.
const FEW: usize = 10;

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let groups = data.mission_groups();
    let pairing = Pairing::among(&groups);
    let mut blocks = declared::blocks(data, &groups, &pairing);
    if groups.len() > 1 {
        blocks.extend(exploratory(data, &groups, &pairing));
    }
    Ok(blocks)
}

const UNDECLARED: &str = "The study declared no hypothesis, so every comparison of groups is exploratory.";

/// All comparisons that no hypothesis of the study declares.
fn exploratory(data: &Data, groups: &[Group<Mission>], pairing: &Pairing) -> Vec<Block> {
    let mut blocks = vec![match data.study.hypotheses.is_empty() {
        true => Block::Result(UNDECLARED.into()),
        false => Block::Heading("Everything else is exploratory".into()),
    }];
    let metrics = values::metrics(groups, pairing);
    let verdicts = verdicts::verdicts(data, &metrics);
    if verdicts.iter().all(|v| v.test.is_none()) {
        blocks.push(Block::Warning(
            "The groups cannot be compared: there are too few terrains for a test. Missions are not a substitute, because \
             missions on one terrain are correlated."
                .into(),
        ));
        return blocks;
    }
    blocks.extend([
        Block::Text(verdicts::in_words(&verdicts)),
        Block::Text(introduction(data, groups, pairing)),
        Block::Text(refusal(groups, &metrics, pairing)),
        Block::Figures(verdicts::drawing(data, &metrics, &verdicts).into_iter().collect()),
        Block::Table(verdicts::table_of_pairs(data, &verdicts)),
        Block::Table(verdicts::table_of_trends(data, &verdicts)),
    ]);
    blocks.extend(model::blocks(data, groups, pairing));
    blocks.extend(planning::blocks(data, &metrics, pairing));
    blocks
}

fn introduction(data: &Data, groups: &[Group<Mission>], pairing: &Pairing) -> String {
    let registered = match data.study.hypotheses.len() {
        0 => "Without a declared hypothesis, p values are only indicative.",
        _ => "Exploratory: nothing below was declared before the run, so its p values are only indicative.",
    };
    let tests = if pairing.is_common() {
        "Groups that share missions (the same random draws, or the same missions of several vehicles) are compared within blocks \
         of terrains, using only pairs of missions that have the metric in all groups compared: signed-rank tests for pairs of \
         groups, shift and delta of the differences within blocks, and Page's test for trend; signs or labels are permuted within \
         blocks. Groups that share none are compared by rank-sum tests; the table says what was compared."
    } else {
        "Pairs of groups are compared by rank-sum tests; the trend is the rank correlation with the order of the groups. Terrain \
         labels are permuted."
    };
    let few = match few_terrains(groups) {
        Some(fewest) => format!(
            " The smallest group has {}: below about {FEW}, most differences go undetected, and intervals are wide or unbounded.",
            set::counted(fewest, "terrain")
        ),
        None => String::new(),
    };
    format!(
        "{registered} Every terrain counts once, with the mean over its missions (success: all missions; other metrics: successful \
         missions only). {tests} p is the share of all arrangements that are at least as extreme, or of about ten thousand random \
         ones where there are more; for 300 values or more, it comes from the normal distribution with the variance over all \
         arrangements, unless a value stands out. The shift is Hodges and Lehmann's; its {} % interval holds the shifts that the \
         test would not reject if there were no ties (ties make it too wide). Delta is Cliff's, with Newcombe's interval, or \
         Clopper and Pearson's for blocks; correlations have Bonett and Wright's interval, or Clopper and Pearson's for blocks. \
         Coverage is below nominal where the smaller group scatters more. At {} %, the groups are equivalent within any margin \
         above the one in the last column (two one-sided t tests of means); a margin is a claim only if it was set \
         beforehand.{few}",
        set::fixed(100.0 * LEVEL, 0),
        set::fixed(100.0 * ALPHA, 0),
    )
}

/// Number of terrains in the smallest group, if below [`FEW`].
fn few_terrains(groups: &[Group<Mission>]) -> Option<usize> {
    let terrains = |g: &Group<Mission>| g.rows.iter().map(|m| &m.terrain_id).collect::<BTreeSet<_>>().len();
    groups.iter().map(terrains).min().filter(|n| *n < FEW)
}

/// Why missions are not tested, with the false-alarm rate that such a test would have here.
fn refusal(groups: &[Group<Mission>], metrics: &[Metric], pairing: &Pairing) -> String {
    let missions: usize = groups.iter().map(|g| g.rows.len()).sum();
    let terrains: usize =
        groups.iter().map(|g| g.rows.iter().map(|m| &m.terrain_id).collect::<BTreeSet<_>>().len()).sum();
    let per_terrain = missions as f64 / terrains as f64;
    let words = "Tests that treat missions as independent are not reported: missions on one terrain are correlated.";
    // In differences of pairs the terrain's part cancels, as far as both groups share it.
    let scatter = planning::scatter(&metrics[0]).filter(|s| s.0 > 0.0 && !pairing.is_common());
    let Some((between, within)) = scatter else { return words.into() };
    let share = between / (between + within);
    let inflation = 1.0 + (per_terrain - 1.0) * share;
    let level = 2.0 * normal::cdf(normal::quantile(0.5 * ALPHA) / inflation.sqrt());
    format!(
        "{words} Here {} of the variance of success within groups lies between terrains. The {} missions per terrain therefore \
         count as {}, and a mission-level test at {} % would report a difference that does not exist in \
         about {} of cases.",
        set::percent(share, 0),
        set::plain(per_terrain, 3),
        counted(set::plain(per_terrain / inflation, 2), "independent mission"),
        set::fixed(100.0 * ALPHA, 0),
        set::percent(level, 0)
    )
}
