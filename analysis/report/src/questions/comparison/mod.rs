//! Whether groups of missions differ, by tests whose unit is the terrain.

mod declared;
mod model;
mod planning;
pub(super) mod values;
pub(super) mod verdicts;

use super::Question;
use super::clusters::{LEVEL, Pairing};
use crate::ReportError;
use crate::content::Block;
use crate::data::{Data, Group};
use crate::render::number as set;
use sastrugi_schemas::tables::MissionRow;
use sastrugi_statistics::normal;
use std::collections::BTreeSet;
use values::Figure;

/// Registry entry.
pub const QUESTION: Question =
    Question { id: "comparison", name: "Comparison", title: "Do the groups differ?", answer };

/// Level of the tests.
pub const ALPHA: f64 = 0.05;
/// Terrains in a group below which a reader is warned.
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

/// What came of the declared hypotheses; `None` where there is nothing to compare.
pub(super) fn claims(data: &Data) -> Option<String> {
    let groups = data.mission_groups();
    let none = "The study declared no hypothesis, so every comparison of groups is exploratory.";
    match (data.study.hypotheses.is_empty(), groups.len() > 1) {
        (false, _) => Some(declared::sentence(data, &groups, &Pairing::among(&groups))),
        (true, more) => more.then(|| none.to_owned()),
    }
}

/// Everything that no hypothesis of the study asked for.
fn exploratory(data: &Data, groups: &[Group<MissionRow>], pairing: &Pairing) -> Vec<Block> {
    let heading = |_| Block::Heading("Everything else is exploratory".into());
    let mut blocks: Vec<Block> = data.study.hypotheses.first().map(heading).into_iter().collect();
    let figures = values::figures(groups, pairing);
    let verdicts = verdicts::verdicts(data, &figures);
    if verdicts.iter().all(|v| v.test.is_none()) {
        blocks.push(Block::Warning(
            "Groups cannot be compared: there are too few terrains for a test. Missions are no substitute, because those on \
             one terrain resemble each other."
                .into(),
        ));
        return blocks;
    }
    blocks.extend([
        Block::Text(verdicts::in_words(&verdicts)),
        Block::Text(introduction(data, groups, pairing)),
        Block::Text(refusal(groups, &figures, pairing)),
        Block::Figures(verdicts::drawing(data, &figures, &verdicts).into_iter().collect()),
        Block::Table(verdicts::table_of_pairs(data, &verdicts)),
        Block::Table(verdicts::table_of_trends(data, &verdicts)),
    ]);
    blocks.extend(model::blocks(data, groups, pairing));
    blocks.extend(planning::blocks(data, &figures, pairing));
    blocks
}

fn introduction(data: &Data, groups: &[Group<MissionRow>], pairing: &Pairing) -> String {
    let registered = match data.study.hypotheses.len() {
        0 => "Exploratory: no hypothesis was registered before the run.",
        _ => "Exploratory: nothing below was declared before the run, and its p values count as hints.",
    };
    let tests = if pairing.is_common() {
        "Groups share their random draws, so terrains are compared within blocks, over the missions of pairs that have the figure in \
         all groups compared: signed-rank tests of pairs, shifts and deltas of differences within blocks, and Page's trend; signs or \
         labels are laid anew within blocks."
    } else {
        "Rank-sum tests of pairs, and the rank correlation with the order of the groups as trend; labels are laid anew over the \
         terrains."
    };
    let few = match few_terrains(groups) {
        Some(fewest) => format!(
            " The smallest group has {}: with fewer than about {FEW} most differences stay unfound, and intervals are wide or without \
             an end.",
            set::counted(fewest, "terrain")
        ),
        None => String::new(),
    };
    format!(
        "{registered} Every terrain counts once, by the mean of its missions \
         (success: of all; other figures: of the successful ones). {tests} p is the share of all arrangements, or where they are \
         more than about ten thousand of as many random ones, that are as extreme; from 300 values on that of the normal \
         distribution with the variance of all arrangements, where no value stands out. The shift is Hodges and Lehmann's, its {} % interval \
         the shifts that the test would not reject if there were no ties, which make it too wide; delta is Cliff's, with Newcombe's interval, \
         of pairs Clopper and Pearson's; correlations have Bonett and Wright's, of blocks Clopper and Pearson's. Intervals hold less often \
         where the smaller group scatters more. Groups are equivalent, at {} %, within any margin above the one in the last column (two one-sided t tests of means); a margin is \
         a claim only when it was set before.{few}",
        set::fixed(100.0 * LEVEL, 0),
        set::fixed(100.0 * ALPHA, 0),
    )
}

/// The fewest terrains of a group, where they are few.
fn few_terrains(groups: &[Group<MissionRow>]) -> Option<usize> {
    let terrains = |g: &Group<MissionRow>| g.rows.iter().map(|m| &m.terrain_id).collect::<BTreeSet<_>>().len();
    groups.iter().map(terrains).min().filter(|n| *n < FEW)
}

/// Why missions are not tested, with what that would do here.
fn refusal(groups: &[Group<MissionRow>], figures: &[Figure], pairing: &Pairing) -> String {
    let missions: usize = groups.iter().map(|g| g.rows.len()).sum();
    let terrains: usize =
        groups.iter().map(|g| g.rows.iter().map(|m| &m.terrain_id).collect::<BTreeSet<_>>().len()).sum();
    let per_terrain = missions as f64 / terrains as f64;
    let words = "Tests that take missions for independent are not given: missions on one terrain resemble each other.";
    // Of pairs the terrain's part cancels out of differences, as far as both groups share it.
    let scatter = planning::scatter(&figures[0]).filter(|s| s.0 > 0.0 && !pairing.is_common());
    let Some((between, within)) = scatter else { return words.into() };
    let share = between / (between + within);
    let inflation = 1.0 + (per_terrain - 1.0) * share;
    let level = 2.0 * normal::cdf(normal::quantile(0.5 * ALPHA) / inflation.sqrt());
    format!(
        "{words} Here {} of the variance of success within groups lies between terrains, so that {} missions a terrain tell \
         as much as {} independent ones, and a test of missions at {} % would find differences that are \
         not there in about {} of cases.",
        set::percent(share, 0),
        set::plain(per_terrain, 3),
        set::plain(per_terrain / inflation, 2),
        set::fixed(100.0 * ALPHA, 0),
        set::percent(level, 0)
    )
}
