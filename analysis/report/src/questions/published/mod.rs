//! Published figures beside ours, where the release holds the groups of a paper.

use super::Question;
use super::missions::{METRICS, interval};
use super::outcome::successful;
use crate::ReportError;
use crate::content::{Block, Numbers, TableBlock, number, text};
use crate::data::{Data, Group};
use crate::papers::{self, Paper, Published};
use crate::render::number as set;
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::{MissionRow, TerrainRow};

/// Registry entry.
pub const QUESTION: Question = Question {
    id: "published",
    name: "Published figures",
    title: "How does this compare with published figures?",
    answer,
};

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let Some(paper) = papers::applicable(data) else { return Ok(Vec::new()) };
    let introduction = format!(
        "Figures of {} ({}) for groups of the same fractal dimension stand in a column of their own. They are printed \
         whether they agree or not, and nothing was tuned to them.",
        paper.authors, paper.title
    );
    let mut blocks = vec![Block::Text(introduction)];
    blocks.extend(difference(data, &paper).map(Block::Warning));
    blocks.extend([values(data, &paper), steps(data, &paper)].into_iter().flatten().map(Block::Table));
    Ok(blocks)
}

/// How the counts differ from the paper's, as a sentence; `None` when they do not.
fn difference(data: &Data, paper: &Paper) -> Option<String> {
    let groups = shared(data.terrain_groups(), paper);
    let terrains: Vec<usize> = groups.iter().map(|g| g.rows.len()).collect();
    let on = |t: &&TerrainRow| data.missions_on(&t.terrain_id).len();
    let per_terrain: Vec<usize> = groups.iter().flat_map(|g| g.rows.iter().map(on)).collect();
    let same = terrains.iter().all(|n| *n == paper.terrains_per_group)
        && per_terrain.iter().all(|n| *n == paper.missions_per_terrain);
    (!same).then(|| {
        format!(
            "Settings differ: this release holds {} terrains a group and {} missions a terrain, the paper {} and {}. \
             Differences below are therefore no verdict.",
            span(&terrains),
            span(&per_terrain),
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

fn values(data: &Data, paper: &Paper) -> Option<TableBlock> {
    let groups = shared(data.mission_groups(), paper);
    let columns = [
        ("figure", ""),
        ("unit", ""),
        ("group", ""),
        ("published", ""),
        ("this release", ""),
        ("low", ""),
        ("high", ""),
        ("origin", ""),
    ];
    let mut numbers = Numbers::new(
        "tables/missions, medians of successful missions by group; 95 % intervals over terrains",
        &columns,
    );
    for published in &paper.values {
        for group in &groups {
            let (ours, low, high) = ours(data, group, &published.figure);
            numbers.row([
                text(&published.name),
                text(&published.unit),
                text(&group.name),
                number(paper.value(&published.figure, &group.name).unwrap_or(f64::NAN)),
                number(ours),
                number(low),
                number(high),
                text(&published.origin),
            ]);
        }
    }
    let caption = format!("Missions: {} and this release", paper.authors);
    (!groups.is_empty()).then(|| TableBlock { id: "published-missions".into(), caption, numbers })
}

/// Our figure and its interval; NaN where there is none.
fn ours(data: &Data, group: &Group<MissionRow>, figure: &str) -> (f64, f64, f64) {
    let goals: Vec<&&MissionRow> = group.rows.iter().filter(|m| successful(m)).collect();
    let Some(metric) = METRICS.iter().find(|m| m.column == figure) else {
        return (100.0 * goals.len() as f64 / group.rows.len() as f64, f64::NAN, f64::NAN);
    };
    let values: Vec<(&str, f64)> = goals.iter().map(|m| (m.terrain_id.as_str(), (metric.of)(m))).collect();
    let median = sums::median(&sums::finite(&values.iter().map(|v| v.1).collect::<Vec<_>>()));
    interval(data, &group.name, figure, &values).map_or((median, f64::NAN, f64::NAN), |i| (median, i.low, i.high))
}

fn steps(data: &Data, paper: &Paper) -> Option<TableBlock> {
    let groups = shared(data.terrain_groups(), paper);
    let columns = [
        ("change of", ""),
        ("unit", ""),
        ("from", ""),
        ("to", ""),
        ("published", ""),
        ("this release", ""),
        ("origin", ""),
    ];
    let mut numbers =
        Numbers::new("tables/terrains and tables/missions, differences of medians over terrains", &columns);
    for published in &paper.steps {
        for (pair, step) in groups.windows(2).zip(&published.values) {
            let ours = middle(data, &pair[1], published) - middle(data, &pair[0], published);
            numbers.row([
                text(&published.name),
                text(&published.unit),
                text(&pair[0].name),
                text(&pair[1].name),
                number(*step),
                number(ours),
                text(&published.origin),
            ]);
        }
    }
    let caption = format!("Changes from group to group: {} and this release", paper.authors);
    (groups.len() > 1).then(|| TableBlock { id: "published-steps".into(), caption, numbers })
}

/// Median over the terrains of a group, in per cent.
fn middle(data: &Data, group: &Group<TerrainRow>, published: &Published) -> f64 {
    let of = |t: &&TerrainRow| match published.figure.as_str() {
        "share_low" => 100.0 * t.share_low,
        "share_semi" => 100.0 * t.share_semi,
        "share_high" => 100.0 * t.share_high,
        _ => success(data, &t.terrain_id),
    };
    sums::median(&sums::finite(&group.rows.iter().map(of).collect::<Vec<_>>()))
}

/// Share of successful missions on a terrain, per cent; NaN without missions.
fn success(data: &Data, terrain_id: &str) -> f64 {
    let missions = data.missions_on(terrain_id);
    100.0 * missions.iter().filter(|m| successful(m)).count() as f64 / missions.len() as f64
}
