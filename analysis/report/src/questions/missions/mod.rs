//! How the missions went, by group: outcomes, figures of the successful ones, one mission in detail.

mod boxes;
mod outcomes;
mod strip;

use super::{Question, outcome};
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock};
use crate::data::{Data, Group};
use crate::render::number as set;
use sastrugi_numeric::Streams;
use sastrugi_schemas::tables::MissionRow;
use sastrugi_statistics::{Interval, cluster_median};
use std::collections::BTreeMap;

/// Registry entry.
pub const QUESTION: Question = Question { id: "missions", name: "Missions", title: "How did the missions go?", answer };

/// Bootstrap samples behind an interval.
const REPLICATES: usize = 1000;
/// Nominal coverage of an interval.
const LEVEL: f64 = 0.95;

/// A figure of a mission.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Column of the table `missions`.
    pub column: &'static str,
    /// Words.
    pub name: &'static str,
    /// Unit as it is set in text.
    pub unit: &'static str,
    /// Value in a row.
    pub of: fn(&MissionRow) -> f64,
}

/// The figures that are compared between groups: successful missions only.
pub const METRICS: [Metric; 4] = [
    Metric {
        column: "rms_vertical_acceleration_m_s2",
        name: "RMS vertical acceleration",
        unit: "m/s²",
        of: |m| m.rms_vertical_acceleration_m_s2,
    },
    Metric { column: "rms_pitch_rate_deg_s", name: "RMS pitch rate", unit: "°/s", of: |m| m.rms_pitch_rate_deg_s },
    Metric { column: "rms_roll_rate_deg_s", name: "RMS roll rate", unit: "°/s", of: |m| m.rms_roll_rate_deg_s },
    Metric { column: "time_s", name: "time to the goal", unit: "s", of: |m| m.time_s },
];

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let groups = data.mission_groups();
    if groups.is_empty() {
        return Ok(Vec::new());
    }
    let mut figures = vec![outcomes::stacked(&groups)];
    figures.extend(boxes::success(data, &groups));
    let measured = boxes::measured(data, &groups);
    figures.extend(measured.iter().filter_map(boxes::metric));
    let mut blocks =
        vec![Block::Text(introduction(&groups)), Block::Figures(figures), Block::Table(boxes::medians(&measured))];
    let strip: Vec<Figure> = strip::figure(data)?.into_iter().collect();
    if !strip.is_empty() {
        blocks.extend([Block::Heading("One mission in detail".into()), Block::Figures(strip)]);
    }
    blocks.push(Block::FoldedTable(all(data)));
    Ok(blocks)
}

fn introduction(groups: &[Group<MissionRow>]) -> String {
    let missions: usize = groups.iter().map(|g| g.rows.len()).sum();
    let goals: usize = groups.iter().map(|g| g.rows.iter().filter(|m| outcome::successful(m)).count()).sum();
    let vehicles: std::collections::BTreeSet<&str> =
        groups.iter().flat_map(|g| g.rows.iter().map(|m| m.vehicle.as_str())).collect();
    format!(
        "{} missions driven by {}; {} reached their goal. Missions on one terrain resemble each other, so intervals of \
         medians draw whole terrains anew (percentile bootstrap, {} %, {REPLICATES} samples); with fewer than about ten \
         terrains in a group they are too short. Boxes are quartiles (linear between order statistics), whiskers reach the \
         last value within 1.5 interquartile ranges, circles lie beyond. Everything here is exploratory.",
        set::count(missions),
        vehicles.into_iter().collect::<Vec<_>>().join(", "),
        set::count(goals),
        set::fixed(100.0 * LEVEL, 0)
    )
}

/// Median over missions with an interval over terrains; the stream is named by group and figure.
pub fn interval(data: &Data, group: &str, figure: &str, values: &[(&str, f64)]) -> Option<Interval> {
    let mut clusters: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    values.iter().for_each(|&(terrain, value)| clusters.entry(terrain).or_default().push(value));
    let clusters: Vec<Vec<f64>> = clusters.into_values().collect();
    let mut stream = Streams::for_item(data.study.seed, "report", group).stream(figure);
    cluster_median(&clusters, REPLICATES, LEVEL, &mut stream)
}

fn all(data: &Data) -> TableBlock {
    let names = [
        "terrain_id",
        "mission_id",
        "group",
        "vehicle",
        "outcome",
        "time_s",
        "path_length_m",
        "efficiency",
        "rms_vertical_acceleration_m_s2",
        "rms_pitch_rate_deg_s",
        "rms_roll_rate_deg_s",
        "max_pitch_deg",
        "max_roll_deg",
        "path",
    ];
    let numbers = Numbers::select("tables/missions", &data.missions, &names);
    TableBlock { id: "missions".into(), caption: "All missions".into(), numbers }
}
