//! Comparison with the paper's trials: does its one world lie in the prediction band for one further simulated world?

use super::sets::{Estimate, Set};
use super::worlds::{PRINTED, Quantity};
use crate::content::{Block, Numbers, TableBlock, count, number, text};
use crate::data::Data;
use crate::papers::jpl::{self, PublishedTrial, PublishedValue};
use crate::questions::clusters::LEVEL;
use crate::render::number as set_number;
use sastrugi_statistics::Interval;
use serde_json::Value;

/// A published value and ours.
struct Row<'a> {
    trial: String,
    quantity: Quantity,
    printed: PublishedValue,
    set: &'a Set<'a>,
    ours: Estimate,
    one_more: Option<Interval>,
}

impl Row<'_> {
    /// Whether the published value lies in the band of one world within its rounding; `None` without a band.
    fn inside(&self) -> Option<bool> {
        let (low, high) = (self.printed.value - self.printed.rounding, self.printed.value + self.printed.rounding);
        self.one_more.map(|band| high >= band.low && low <= band.high)
    }
}

/// Share of the ground under rocks on the worlds of a set, as set in the study; `None` if the study does not set it or worlds differ.
fn coverage(data: &Data, set: &Set) -> Option<f64> {
    let of_world = |terrain_id: &str| {
        let params: Value = serde_json::from_str(&data.terrain(terrain_id)?.params).ok()?;
        let processes = params.get("processes")?.as_array()?;
        let mut rocks = processes.iter().filter(|p| p.get("kind").and_then(Value::as_str) == Some("rocks"));
        rocks.next()?.get("coverage")?.as_f64()
    };
    let mut all = set.worlds.iter().map(|w| of_world(w.terrain_id));
    let first = all.next()??;
    all.all(|other| other == Some(first)).then_some(first)
}

/// The paper's trial that a set repeats.
pub fn trial(data: &Data, set: &Set) -> Option<PublishedTrial> {
    let (mut straight, first) = (set.rovers().map(|r| r.straight_m), set.rovers().next()?);
    let same = straight.all(|m| (m - first.straight_m).abs() <= 0.01 * first.straight_m);
    let trials = jpl::trials()?;
    let found = trials.of(&first.navigator, coverage(data, set)?, first.straight_m).filter(|_| same);
    found.cloned()
}

/// Text, warnings and a table; empty where no set repeats a trial of the paper.
pub fn blocks(data: &Data, sets: &[Set]) -> Vec<Block> {
    let known: Vec<(&Set, PublishedTrial)> = sets.iter().filter_map(|s| Some((s, trial(data, s)?))).collect();
    let rows: Vec<Row> = known.iter().flat_map(|(set, trial)| rows(set, trial)).collect();
    if rows.is_empty() {
        return Vec::new();
    }
    let title = jpl::trials().map_or_else(String::new, |t| t.title);
    let mut blocks = vec![Block::Heading("Published trials".into())];
    blocks.extend(verdict(&rows).map(Block::Result));
    blocks.extend(differences(&known).map(Block::Warning));
    blocks.push(Block::Text(format!(
        "The paper ({title}) drove its rovers on one world. Worlds differ, so its values are compared with those of one simulated world: the band holds the value of one \
         more world with {} % probability (Student's prediction interval of the worlds' logarithms). The interval of our own value is that of the mean over worlds, \
         which is narrower. The flight code was not available: agreement shows that such a rover behaves similarly, not that it is the same rover. Nothing was \
         tuned to these values.",
        set_number::fixed(100.0 * LEVEL, 0)
    )));
    blocks.push(Block::Table(table(&rows)));
    blocks
}

fn rows<'a>(set: &'a Set<'a>, trial: &PublishedTrial) -> Vec<Row<'a>> {
    let row = |printed: &PublishedValue| {
        let quantity = PRINTED.into_iter().find(|f| f.id == printed.figure)?;
        let (ours, one_more) = (quantity.pooled(set), quantity.one_more(set));
        Some(Row { trial: trial.name.clone(), quantity, printed: printed.clone(), set, ours, one_more })
    };
    trial.values.iter().filter_map(row).collect()
}

/// How many of the published values are inside, in a sentence; `None` without a band.
fn verdict(rows: &[Row]) -> Option<String> {
    let known: Vec<bool> = rows.iter().filter_map(Row::inside).collect();
    let inside = known.iter().filter(|i| **i).count();
    (!known.is_empty()).then(|| {
        format!(
            "{} of {} published values lie{} in the band of one simulated world.",
            if inside == 0 { "None".into() } else { set_number::count(inside) },
            set_number::count(known.len()),
            if inside < 2 { "s" } else { "" }
        )
    })
}

/// A warning where our worlds have other numbers of rovers than the paper's, and hence another scatter; `None` where none has.
fn differences(known: &[(&Set, PublishedTrial)]) -> Option<String> {
    let all: Vec<String> = known.iter().filter_map(|(set, trial)| difference(set, trial)).collect();
    (!all.is_empty()).then(|| {
        format!(
            "{} With fewer rovers, worlds scatter more and their extremes are less extreme, so this comparison is not a test.",
            all.join(" ")
        )
    })
}

/// How the numbers of rovers on the worlds of a set differ from the paper's; `None` if they do not.
fn difference(set: &Set, trial: &PublishedTrial) -> Option<String> {
    let other = set.worlds.iter().filter(|w| w.rovers.len() != trial.rovers).count();
    (other > 0).then(|| {
        format!(
            "{}: the paper has {} rovers on its world, but {}.",
            set.name,
            set_number::count(trial.rovers),
            match (other, set.worlds.len()) {
                (1, 1) => "our world has another number".to_owned(),
                (n, all) if n == all => format!("all {} of our worlds have other numbers", set_number::count(n)),
                (1, _) => "1 of our worlds has another number".to_owned(),
                (n, _) => format!("{} of our worlds have other numbers", set_number::count(n)),
            }
        )
    })
}

fn table(rows: &[Row]) -> TableBlock {
    let columns = [
        ("trial", ""),
        ("quantity", ""),
        ("unit", ""),
        ("paper", ""),
        ("ours", ""),
        ("low", ""),
        ("high", ""),
        ("one world, low", ""),
        ("one world, high", ""),
        ("paper is", ""),
        ("worlds", "1"),
        ("rovers", "1"),
        ("printed in", ""),
    ];
    let query = "select terrain_id, rover_id, \"group\", stage_id, variant, navigator, straight_m, distance_m, efficiency from \
                 'tables/rovers/*.parquet'";
    let mut numbers = Numbers::computed(query, &columns).with_mixed_units();
    for row in rows {
        let verdict = row.inside().map_or(set_number::ABSENT, |inside| if inside { "inside" } else { "outside" });
        let [low, high] = row.ours.ends();
        numbers.row([
            text(&row.trial),
            text(row.quantity.name),
            text(row.quantity.unit),
            number(row.printed.value),
            number(row.ours.value),
            number(low),
            number(high),
            number(row.one_more.map_or(f64::NAN, |b| b.low)),
            number(row.one_more.map_or(f64::NAN, |b| b.high)),
            text(verdict),
            count(row.set.worlds.len()),
            count(row.set.count()),
            text(&row.printed.origin),
        ]);
    }
    TableBlock { id: "rover-published".into(), caption: "Published rover trials and this release".into(), numbers }
}
