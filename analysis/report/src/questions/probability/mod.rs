//! Outcomes as probabilities: missions with several starts, and the components of the variance of their outcomes.

use super::Question;
use super::clusters::{LEVEL, REPLICATES, stream};
use super::outcome;
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, count, number, slug, text};
use crate::data::{Data, Group, Mission};
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot, RowLabel, Rows, WIDTH};
use crate::render::number as set;
use crate::render::svg::{Anchor, Paint, text_width};
use sastrugi_statistics::{Components, Interval, bootstrap, components};
use std::collections::BTreeMap;

/// Query for the rows from which everything here is computed.
const REPLICATES_QUERY: &str = "select * from 'tables/replicates/*.parquet'";

/// Registry entry.
pub const QUESTION: Question =
    Question { id: "probability", name: "Probability", title: "How certain are the outcomes?", answer };

/// Largest number of groups drawn.
const GROUPS_MAX: usize = 12;
/// Largest number of intervals of the histogram.
const BOXES_MAX: usize = 20;
const HEIGHT: f64 = 220.0;
/// Name and colour of each component.
const PARTS: [(&str, Paint); 3] = [
    ("terrain", Paint::Series(0)),
    ("mission on a terrain", Paint::Series(2)),
    ("start of a mission", Paint::Series(1)),
];

/// A mission with the outcomes of its starts, 1 for success.
struct Started<'a> {
    mission: &'a Mission,
    outcomes: Vec<f64>,
}

impl Started<'_> {
    fn probability(&self) -> f64 {
        self.outcomes.iter().sum::<f64>() / self.outcomes.len() as f64
    }
}

/// A group with its missions and the components of its variance.
struct Split<'a> {
    name: String,
    missions: Vec<Started<'a>>,
    components: Option<Components>,
    /// Shares of the three components, with intervals.
    shares: Option<[(f64, Option<Interval>); 3]>,
}

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let groups = groups(data);
    if groups.is_empty() {
        return Ok(Vec::new());
    }
    let drawn = &groups[..groups.len().min(GROUPS_MAX)];
    let mut blocks = vec![
        Block::Result(mixed(&groups)),
        Block::Text(introduction(&groups)),
        Block::Figures(drawn.iter().map(histogram).collect()),
    ];
    let known: Vec<&Split> = drawn.iter().filter(|g| g.shares.is_some()).collect();
    if !known.is_empty() {
        blocks.extend([
            Block::Heading("Where the scatter comes from".into()),
            Block::Text(WORDS.into()),
            Block::Figures(vec![stacked(&known)]),
        ]);
    }
    // Without a variance there is nothing to split; without components, the table would have none either.
    match groups.iter().any(|g| g.components.is_some()) {
        true => blocks.push(Block::Table(table(&groups))),
        false => blocks.push(Block::Text(NO_COMPONENTS.into())),
    }
    Ok(blocks)
}

const WORDS: &str = "The variance of an outcome (success 1, failure 0) split into terrains, missions on a terrain, and starts of \
a mission, by the estimators of the nested analysis of variance for unbalanced data (Searle, Casella and McCulloch, Variance \
Components, 1992): sums of squares between terrains, between missions, and within missions are set equal to their expectations. \
The component of the starts is the mean of p (1 − p) over missions with success probability p; no better description of terrain \
and line could predict it. Estimates of small components can be negative; they are shown as zero and marked in the table.";

const NO_COMPONENTS: &str = "The variance of the outcomes is not split into terrains, missions and starts: that takes several terrains with several \
missions each.";

/// Missions with several starts, and how many of them had more than one result.
fn mixed(groups: &[Split]) -> String {
    let missions: usize = groups.iter().map(|g| g.missions.len()).sum();
    let even = |m: &&Started| m.probability() > 0.0 && m.probability() < 1.0;
    let undecided = groups.iter().flat_map(|g| g.missions.iter().filter(even)).count();
    let mixed = match undecided {
        0 => "every mission had the same result from all of its starts".to_owned(),
        1 => "1 succeeded from some starts and failed from others, so its outcome is a probability, not a fact"
            .to_owned(),
        n => format!(
            "{} succeeded from some starts and failed from others, so their outcome is a probability, not a fact",
            set::count(n)
        ),
    };
    format!("Of {} with several starts, {mixed}.", set::counted(missions, "mission"))
}

fn introduction(groups: &[Split]) -> String {
    let starts: usize = groups.iter().flat_map(|g| g.missions.iter().map(|m| m.outcomes.len())).sum();
    let intervals = match groups.iter().filter_map(|g| g.shares).flatten().any(|share| share.1.is_some()) {
        true => format!(
            " Intervals have {} % coverage, from {REPLICATES} bootstrap samples of whole terrains.",
            set::fixed(100.0 * LEVEL, 0)
        ),
        false => String::new(),
    };
    format!(
        "The missions were driven from {} starts in all, the drawn one and slightly perturbed ones.{intervals}",
        set::count(starts)
    )
}

/// Missions with several starts, by group: those of the plain run, or of the first variant that has any.
fn groups(data: &Data) -> Vec<Split<'_>> {
    // Without starts, every variant would be examined.
    if data.replicates.is_empty() {
        return Vec::new();
    }
    let grouping = data.grouping();
    let variants = data.missions_by_variant().into_values().map(|missions| grouping.groups_of(missions));
    let runs = std::iter::once(data.mission_groups()).chain(variants);
    let mut splits = runs.map(|groups| groups.iter().filter_map(|g| split(data, g)).collect::<Vec<_>>());
    splits.find(|run| !run.is_empty()).unwrap_or_default()
}

/// Missions of a group with more than one start; `None` if it has none.
fn split<'a>(data: &Data, group: &Group<'a, Mission>) -> Option<Split<'a>> {
    let started = |mission: &&'a Mission| {
        let starts = data.starts_of(mission);
        let outcomes = starts.iter().map(|s| f64::from(u8::from(s.outcome == outcome::ALL[0].word))).collect();
        (starts.len() > 1).then_some(Started { mission, outcomes })
    };
    let missions: Vec<Started> = group.rows.iter().filter_map(started).collect();
    let mut terrains: BTreeMap<&str, Vec<Vec<f64>>> = BTreeMap::new();
    missions.iter().for_each(|m| terrains.entry(&m.mission.terrain_id).or_default().push(m.outcomes.clone()));
    let sums: Vec<components::Group> = terrains.values().map(|t| components::Group::of(t)).collect();
    let components = Components::of(&sums);
    let shares = components.and_then(|c| c.shares()).map(|shares| with_intervals(data, &group.name, &sums, shares));
    (!missions.is_empty()).then(|| Split { name: group.name.clone(), missions, components, shares })
}

fn with_intervals(
    data: &Data,
    group: &str,
    terrains: &[components::Group],
    shares: [f64; 3],
) -> [(f64, Option<Interval>); 3] {
    let mut stream = stream(data, group, "components");
    let redrawn = bootstrap::redraw(&[terrains.len()], REPLICATES, &mut stream, |drawn| {
        let sums: Vec<components::Group> = drawn[0].iter().map(|&t| terrains[t]).collect();
        Components::of(&sums).and_then(|c| c.shares()).unwrap_or([f64::NAN; 3])
    });
    let interval = |k: usize| {
        let values: Vec<f64> = redrawn.iter().map(|s| s[k]).collect();
        Interval::percentile(shares[k], &values, LEVEL)
    };
    [0, 1, 2].map(|k| (shares[k], interval(k)))
}

/// Missions by the share of their starts that succeeded.
fn histogram(group: &Split) -> Figure {
    let starts = group.missions.iter().map(|m| m.outcomes.len()).max().unwrap_or(1);
    let boxes = starts.min(BOXES_MAX);
    let mut counts = vec![0usize; boxes + 1];
    group.missions.iter().for_each(|m| counts[(m.probability() * boxes as f64).round() as usize] += 1);
    let id = slug(&format!("probability-{}", group.name));
    let total = group.missions.len() as f64;
    let tallest = counts.iter().copied().max().unwrap_or(0) as f64;
    let half = 0.5 / boxes as f64;
    let x = (Axis::linear(-half, 1.0 + half), "success probability of a mission");
    let y = (Axis::linear(0.0, 108.0 * tallest / total), "missions, %");
    let mut plot = Plot::new((WIDTH, HEIGHT), x, y, &[]);
    for (i, n) in counts.iter().enumerate().filter(|(_, n)| **n > 0) {
        let at = i as f64 / boxes as f64;
        let corners = plot.place([(at - 0.86 * half, 100.0 * *n as f64 / total), (at + 0.86 * half, 0.0)]);
        if let [from, to] = corners.as_slice() {
            plot.svg.rect(*from, (to.0 - from.0, to.1 - from.1), Paint::Series(0), 1.0);
        }
    }
    let mut numbers = Numbers::computed(REPLICATES_QUERY, &HISTOGRAM);
    for (i, n) in counts.iter().enumerate() {
        numbers.row([text(&group.name), number(i as f64 / boxes as f64), count(*n)]);
    }
    let certain = set::percent(counts[boxes] as f64 / total, 0);
    let hopeless = set::percent(counts[0] as f64 / total, 0);
    Figure {
        id,
        title: format!("Group {}.", group.name),
        caption: format!(
            "{}, up to {} each.",
            set::counted(group.missions.len(), "mission"),
            set::counted(starts, "start")
        ),
        description: format!(
            "Histogram of success probabilities, group {}: {certain} of the missions always succeed, {hopeless} never.",
            group.name
        ),
        svg: plot.svg,
        numbers,
    }
}

const HISTOGRAM: [(&str, &str); 3] = [("group", ""), ("success_probability", "1"), ("missions", "1")];

/// Shares of the three components, one bar per group.
fn stacked(groups: &[&Split]) -> Figure {
    let label = |g: &&Split| RowLabel { name: g.name.clone(), detail: format!("n = {}", g.missions.len()) };
    let labels: Vec<RowLabel> = groups.iter().map(label).collect();
    let legend: Vec<Entry> = PARTS.iter().map(|p| (Mark::Fill(p.1), p.0.to_owned())).collect();
    let mut rows = Rows::new(&labels, 46.0, (Axis::linear(0.0, 100.0), "share of the variance, %"), &legend);
    for (row, group) in groups.iter().enumerate() {
        bar(&mut rows, row, group);
    }
    let in_words = |g: &&Split| {
        let parts = g.shares.iter().flatten().zip(PARTS).map(|(s, p)| format!("{} {}", p.0, set::percent(s.0, 0)));
        format!("group {}: {}", g.name, parts.collect::<Vec<_>>().join(", "))
    };
    Figure {
        id: "variance-of-outcomes".into(),
        title: "Components of the variance of an outcome.".into(),
        caption: "n is the number of missions. Intervals are in the table.".into(),
        description: format!("Shares of the variance. {}.", groups.iter().map(in_words).collect::<Vec<_>>().join("; ")),
        svg: rows.svg,
        numbers: components_of(groups.iter().copied()),
    }
}

fn bar(rows: &mut Rows, row: usize, group: &Split) {
    let y = rows.centre(row) - 13.0;
    let mut before = 0.0;
    for ((share, _), (_, paint)) in group.shares.iter().flatten().zip(PARTS) {
        let ends = (rows.x.at(100.0 * before), rows.x.at(100.0 * (before + share)));
        before += share;
        let (Some(from), Some(to)) = ends else { continue };
        rows.svg.rect((from, y), (to - from, 26.0), paint, 1.0);
        let label = set::percent(*share, 0);
        if to - from > text_width(&label, 11.5) + 6.0 {
            rows.svg.text_sized((0.5 * (from + to), y + 17.0), Anchor::Middle, Paint::Paper, 11.5, &label);
        }
    }
}

fn table(groups: &[Split]) -> TableBlock {
    let caption = "Variance of outcomes by group".into();
    TableBlock { id: "variance-components".into(), caption, numbers: components_of(groups) }
}

fn components_of<'a>(groups: impl IntoIterator<Item = &'a Split<'a>>) -> Numbers {
    let columns = [
        ("group", ""),
        ("missions", "1"),
        ("starts", "1"),
        ("success", "%"),
        ("component", ""),
        ("variance", "1"),
        ("share", "%"),
        ("low", "%"),
        ("high", "%"),
        ("note", ""),
    ];
    let mut numbers = Numbers::computed(REPLICATES_QUERY, &columns);
    for group in groups {
        let starts: usize = group.missions.iter().map(|m| m.outcomes.len()).sum();
        let goals: f64 = group.missions.iter().flat_map(|m| &m.outcomes).sum();
        let estimates = group.components.map_or([f64::NAN; 3], |c| [c.group, c.member, c.repeat]);
        for (k, (name, _)) in PARTS.iter().enumerate() {
            let (share, interval) = group.shares.map_or((f64::NAN, None), |s| s[k]);
            numbers.row([
                text(&group.name),
                count(group.missions.len()),
                count(starts),
                number(100.0 * goals / starts as f64),
                text(*name),
                number(estimates[k]),
                number(100.0 * share),
                number(interval.map_or(f64::NAN, |i| 100.0 * i.low)),
                number(interval.map_or(f64::NAN, |i| 100.0 * i.high)),
                text(if estimates[k] < 0.0 { "negative estimate, set to zero" } else { "" }),
            ]);
        }
    }
    numbers
}
