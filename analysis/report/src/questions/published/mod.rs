//! Published results compared with ours, where the release has the groups of a paper.

use super::Question;
use super::clusters::{BAND, Clusters, Pairing, in_words, stream};
use super::missions::METRICS;
use super::missions::boxes::{success_shares, successful};
use super::outcome::successful as reached;
use crate::ReportError;
use crate::content::{Block, Numbers, TableBlock, number, text};
use crate::data::{Data, Group, Mission};
use crate::papers::{self, Paper, Published};
use crate::render::number as set;
use sastrugi_numeric::sums;
use sastrugi_schemas::counted;
use sastrugi_schemas::tables::TerrainRow;
use sastrugi_statistics::{BoxPlot, Interval};
use std::collections::BTreeSet;

/// Registry entry.
pub const QUESTION: Question = Question {
    id: "published",
    name: "Published results",
    title: "How does this compare with published results?",
    answer,
};

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let Some(paper) = papers::applicable(data) else { return Ok(Vec::new()) };
    let pairing = Pairing::of(data);
    let rows = rows(data, &paper, &pairing);
    let paired = if pairing.is_common() {
        " Our groups share their random draws, so our changes scatter less than those of independent groups."
    } else {
        ""
    };
    let introduction = format!(
        "The table has every value that {} ({}) print for their groups, and ours for groups of the same fractal dimension, \
         whether they agree or not; nothing was tuned to them. The band holds 5 to 95 % of the values of our own study when whole \
         {} are resampled; a published value is inside if it lies in the band within its rounding. The paper's values scatter \
         too, so one just outside is not a contradiction. Changes from one group to the next share a group, so they are not \
         independent.{paired} The paper prints changes of medians, absolute and relative; its medians follow from both.",
        paper.authors,
        paper.title,
        in_words(&pairing)
    );
    let mut blocks: Vec<Block> = verdict(&rows, &paper.authors).map(Block::Result).into_iter().collect();
    blocks.extend(difference(data, &paper).map(Block::Warning));
    blocks.push(Block::Text(introduction));
    blocks.push(Block::Table(table(data, &paper, &rows)));
    Ok(blocks)
}

/// How the numbers of terrains and missions differ from the paper's, in a sentence; `None` if they do not.
fn difference(data: &Data, paper: &Paper) -> Option<String> {
    let groups = shared(data.terrain_groups(), paper);
    let terrains: Vec<usize> = groups.iter().map(|g| g.rows.len()).collect();
    let on = |t: &&TerrainRow| data.missions_on(&t.terrain_id).len();
    let per_terrain: Vec<usize> = groups.iter().flat_map(|g| g.rows.iter().map(on)).collect();
    let same = terrains.iter().all(|n| *n == paper.terrains_per_group)
        && per_terrain.iter().all(|n| *n == paper.missions_per_terrain);
    (!same).then(|| {
        format!(
            "Settings differ from those of {}: this release has {} per group and {} per terrain, the paper {} and {}. \
             The differences are therefore not a verdict on the paper.",
            paper.authors,
            counted(span(&terrains), "terrain"),
            counted(span(&per_terrain), "mission"),
            paper.terrains_per_group,
            paper.missions_per_terrain
        )
    })
}

/// `4` or `2 to 5`.
fn span(counts: &[usize]) -> String {
    match (counts.iter().min(), counts.iter().max()) {
        (Some(low), Some(high)) if low < high => format!("{} to {}", set::count(*low), set::count(*high)),
        (Some(n), _) => set::count(*n),
        _ => "0".into(),
    }
}

/// The groups that the paper has too, in its order.
fn shared<'a, R>(groups: Vec<Group<'a, R>>, paper: &Paper) -> Vec<Group<'a, R>> {
    groups.into_iter().filter(|own| paper.groups.iter().any(|g| papers::same(&own.name, *g))).collect()
}

/// A published value and ours.
struct Row<'a> {
    published: &'a Published,
    /// Group, or groups from and to.
    of: String,
    value: f64,
    rounding: f64,
    ours: f64,
    band: Option<Interval>,
}

impl Row<'_> {
    /// Whether the published value lies in the band within its rounding; `None` without a band.
    fn inside(&self) -> Option<bool> {
        self.band.map(|b| self.value + self.rounding >= b.low && self.value - self.rounding <= b.high)
    }
}

/// Rows of the values, then of the steps, in the paper's order. The values behind them are collected once for each published number, and kept
/// for one of them at a time.
fn rows<'a>(data: &Data, paper: &'a Paper, pairing: &Pairing) -> Vec<Row<'a>> {
    let ours = Ours {
        terrains: shared(data.terrain_groups(), paper),
        missions: shared(data.mission_groups(), paper),
        pairing,
    };
    let mut rows: Vec<Vec<Row>> = Vec::new();
    rows.resize_with(paper.values.len() + paper.steps.len(), Vec::new);
    let values = paper.values.iter().map(|published| (published, false));
    let all: Vec<(&Published, bool)> = values.chain(paper.steps.iter().map(|published| (published, true))).collect();
    let figures: BTreeSet<&str> = all.iter().map(|(published, _)| published.figure.as_str()).collect();
    for figure in figures {
        let sample = ours.sample(figure);
        for (place, &(published, is_step)) in all.iter().enumerate().filter(|(_, (p, _))| p.figure == figure) {
            rows[place] = match is_step {
                true => steps(data, published, &sample),
                false => of_groups(data, paper, published, &sample),
            };
        }
    }
    rows.into_iter().flatten().collect()
}

/// A published value of each group, and ours.
fn of_groups<'a>(data: &Data, paper: &Paper, published: &'a Published, sample: &Sample) -> Vec<Row<'a>> {
    let row = |(g, (name, items)): (usize, &Items)| {
        let k = paper.groups.iter().position(|p| papers::same(name, *p))?;
        let purpose = format!("published {g} {}", published.figure);
        let (ours, band) = estimate(data, name, &purpose, &[items.as_slice()], sample.statistic, |own| own[0]);
        let (value, rounding) = (published.values[k], published.rounding[k]);
        Some(Row { published, of: name.clone(), value, rounding, ours, band })
    };
    sample.groups.iter().enumerate().filter_map(row).collect()
}

/// A published change from each group to the next, and ours.
fn steps<'a>(data: &Data, published: &'a Published, sample: &Sample) -> Vec<Row<'a>> {
    let row = |(k, pair): (usize, &[Items])| {
        let change = |own: &[f64]| if published.relative { 100.0 * (own[1] / own[0] - 1.0) } else { own[1] - own[0] };
        let of = format!("{} to {}", pair[0].0, pair[1].0);
        let items = [pair[0].1.as_slice(), pair[1].1.as_slice()];
        let purpose = format!("published step {} {}", published.figure, published.unit);
        let (ours, band) = estimate(data, &of, &purpose, &items, sample.statistic, change);
        let (value, rounding) = (published.values[k], published.rounding[k]);
        Row { published, of, value, rounding, ours, band }
    };
    sample.groups.windows(2).enumerate().map(row).collect()
}

/// Name of a group, and its values with the clusters that they belong to.
type Items<'a> = (String, Vec<(&'a str, f64)>);

/// A function of the statistics of one or two groups, and its sampling band.
fn estimate(
    data: &Data,
    item: &str,
    purpose: &str,
    groups: &[&[(&str, f64)]],
    statistic: Statistic,
    of: impl Fn(&[f64]) -> f64,
) -> (f64, Option<Interval>) {
    let groups: Vec<Vec<(&str, f64)>> = groups.iter().map(|g| g.to_vec()).collect();
    let (clusters, mut stream) = (Clusters::new(&groups), stream(data, item, purpose));
    let band = match statistic {
        Statistic::Median => clusters.interval_of_medians(&mut stream, BAND, &of),
        _ => clusters.interval(&mut stream, BAND, |pooled| {
            of(&pooled.iter().map(|values| statistic.of(values)).collect::<Vec<_>>())
        }),
    };
    let own = |group: &Vec<(&str, f64)>| statistic.of(&group.iter().map(|v| v.1).collect::<Vec<_>>());
    (of(&groups.iter().map(own).collect::<Vec<_>>()), band)
}

/// The published statistic of a group's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Statistic {
    Mean,
    Median,
    /// Number of values beyond 1.5 interquartile ranges of the quartiles.
    Outliers,
}

impl Statistic {
    fn of(self, values: &[f64]) -> f64 {
        match self {
            Self::Mean => sums::mean(values),
            Self::Median => sums::median(values),
            Self::Outliers => BoxPlot::of(values).map_or(f64::NAN, |b| b.outliers.len() as f64),
        }
    }
}

/// The values behind a published number, by group, and the statistic over those of a group.
struct Sample<'a> {
    groups: Vec<Items<'a>>,
    statistic: Statistic,
}

/// The groups that the paper has too.
struct Ours<'a, 'p> {
    terrains: Vec<Group<'a, TerrainRow>>,
    missions: Vec<Group<'a, Mission>>,
    pairing: &'p Pairing<'a>,
}

impl<'a> Ours<'a, '_> {
    /// Values and statistic of a published number.
    fn sample(&self, figure: &str) -> Sample<'a> {
        let of_terrain = |t: &&'a TerrainRow| (t.terrain_id.as_str(), 100.0 * share(t, figure));
        let of_group =
            |g: &Group<'a, TerrainRow>| -> Items<'a> { (g.name.clone(), g.rows.iter().map(of_terrain).collect()) };
        let metric = METRICS.iter().find(|m| m.column == figure || figure == "time_outliers" && m.column == "time_s");
        let missions = self.missions.iter();
        let values: Vec<Items<'a>> = match (figure, metric) {
            (_, Some(metric)) => missions.map(|g| (g.name.clone(), successful(g, metric))).collect(),
            ("success_percent", _) => missions.map(|g| (g.name.clone(), percents(g))).collect(),
            ("success", _) => missions.map(|g| (g.name.clone(), success_shares(g))).collect(),
            _ => self.terrains.iter().map(of_group).collect(),
        };
        let clustered = |(name, items): Items<'a>| {
            let known = items.into_iter().filter(|v| v.1.is_finite());
            let mut known: Vec<(&'a str, f64)> = known.map(|v| (self.pairing.cluster(v.0), v.1)).collect();
            // Resampling keeps the order; medians need it, and quartiles of sorted values are fast.
            known.sort_by(|a, b| a.1.total_cmp(&b.1));
            (name, known)
        };
        let statistic = match figure {
            "success_percent" => Statistic::Mean,
            "time_outliers" => Statistic::Outliers,
            _ => Statistic::Median,
        };
        Sample { groups: values.into_iter().map(clustered).collect(), statistic }
    }
}

/// 100 for a successful mission of a group, otherwise 0, with its terrain.
fn percents<'a>(group: &Group<'a, Mission>) -> Vec<(&'a str, f64)> {
    let percent = |m: &&'a Mission| (m.terrain_id.as_str(), if reached(m) { 100.0 } else { 0.0 });
    group.rows.iter().map(percent).collect()
}

fn share(terrain: &TerrainRow, column: &str) -> f64 {
    match column {
        "share_low" => terrain.share_low,
        "share_semi" => terrain.share_semi,
        "share_high" => terrain.share_high,
        _ => f64::NAN,
    }
}

/// How many of the published values are inside, in a sentence; `None` without a band.
fn verdict(rows: &[Row], authors: &str) -> Option<String> {
    let known: Vec<bool> = rows.iter().filter_map(Row::inside).collect();
    let inside = known.iter().filter(|i| **i).count();
    let all = set::count(known.len());
    (!known.is_empty()).then(|| match inside {
        0 => format!("None of {all} published values lies inside our sampling band ({authors})."),
        1 => format!("1 of {all} published values lies inside our sampling band ({authors})."),
        n => format!("{} of {all} published values lie inside our sampling band ({authors}).", set::count(n)),
    })
}

fn table(data: &Data, paper: &Paper, rows: &[Row]) -> TableBlock {
    let columns = [
        ("quantity", ""),
        ("unit", ""),
        ("group", ""),
        ("paper", ""),
        ("ours", ""),
        ("band, 5 %", ""),
        ("band, 95 %", ""),
        ("paper is", ""),
        ("printed in", ""),
    ];
    let query = match data.missions.is_empty() {
        true => "select * from 'tables/terrains/*.parquet'",
        false => "select * from 'tables/missions/*.parquet' join 'tables/terrains/*.parquet' using (terrain_id)",
    };
    let mut numbers = Numbers::computed(query, &columns).with_mixed_units();
    for row in rows {
        let verdict = row.inside().map_or(set::ABSENT, |inside| if inside { "inside" } else { "outside" });
        numbers.row([
            text(&row.published.name),
            text(&row.published.unit),
            text(&row.of),
            number(row.value),
            number(row.ours),
            number(row.band.map_or(f64::NAN, |b| b.low)),
            number(row.band.map_or(f64::NAN, |b| b.high)),
            text(verdict),
            text(&row.published.origin),
        ]);
    }
    let caption = format!("Published values: {} and this release", paper.authors);
    TableBlock { id: "published".into(), caption, numbers }
}
