//! How the missions went, by group: outcomes and how far they came, figures of the successful ones, maps, missions in detail.

pub mod boxes;
mod incidence;
mod maps;
pub(super) mod outcomes;
mod strip;
mod survivors;

use super::clusters::{Pairing, REPLICATES, in_words};
use super::{Question, outcome};
use crate::ReportError;
use crate::content::{Block, Numbers, TableBlock, text};
use crate::data::{Data, Group};
use crate::render::number as set;
use sastrugi_schemas::tables::MissionRow;
use std::collections::BTreeSet;

/// Registry entry.
pub const QUESTION: Question = Question { id: "missions", name: "Missions", title: "How did the missions go?", answer };

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
    let pairing = Pairing::of(data);
    let compared = boxes::compared(data, &groups);
    let mut figures = vec![outcomes::stacked(data, &groups)];
    figures.extend(compared.iter().filter_map(|c| boxes::figure(data, c)));
    let mut blocks = vec![
        Block::Text(introduction(data, &groups, &pairing)),
        Block::Figures(figures),
        Block::Table(boxes::medians(data, &compared)),
    ];
    blocks.extend(incidence::blocks(data, &groups));
    blocks.extend(survivors::blocks(data, &groups));
    let drawn = maps::drawn(data, &groups)?;
    section(&mut blocks, "Where they drove", MAPS, maps::figures(data, &drawn)?);
    section(&mut blocks, "Missions in detail", STRIPS, strip::figures(data, &groups, &drawn)?);
    blocks.extend(parameters(data).map(Block::FoldedTable));
    blocks.push(Block::FoldedTable(all(data)));
    Ok(blocks)
}

const MAPS: &str = "One terrain of each group: the one whose share of successful missions is in the middle (the lower middle of \
an even number, the first of equals). Paths are those recorded; where none was, the line that was asked for.";
const STRIPS: &str = "One mission of each kind of outcome: the one whose vertical acceleration is in the middle among those on \
the terrains above (on all terrains where there is none). Acceleration is the second difference of the recorded height.";

fn section(blocks: &mut Vec<Block>, heading: &str, words: &str, figures: Vec<crate::content::Figure>) {
    if !figures.is_empty() {
        blocks.extend([Block::Heading(heading.into()), Block::Text(words.into()), Block::Figures(figures)]);
    }
}

fn introduction(data: &Data, groups: &[Group<MissionRow>], pairing: &Pairing) -> String {
    let missions: usize = groups.iter().map(|g| g.rows.len()).sum();
    let goals: usize = groups.iter().map(|g| g.rows.iter().filter(|m| outcome::successful(m)).count()).sum();
    let vehicles: BTreeSet<&str> = groups.iter().flat_map(|g| g.rows.iter().map(|m| m.vehicle.as_str())).collect();
    let variants = match data.missions.len() - missions {
        0 => String::new(),
        n => format!(" {} more belong to variants and are compared further below.", set::count(n)),
    };
    format!(
        "{} missions driven by {}; {} reached their goal.{variants} Missions on one terrain resemble each other: intervals draw \
         whole {} anew ({REPLICATES} samples, fewer beyond 10 000 values; percentiles); with fewer than about ten in a group they are too short. The \
         sampling band of a figure holds 5 to 95 % of what such redraws give. Boxes are quartiles (linear between order \
         statistics), whiskers reach the last value within 1.5 interquartile ranges, circles lie beyond. Everything here is \
         exploratory.",
        set::count(missions),
        vehicles.into_iter().collect::<Vec<_>>().join(", "),
        set::count(goals),
        in_words(pairing),
    )
}

/// Every number of the plain runs: what was assumed stands beside what was measured or published.
fn parameters(data: &Data) -> Option<TableBlock> {
    let plain: BTreeSet<&str> =
        data.missions.iter().filter(|m| m.variant.is_none()).map(|m| m.traverse_id.as_str()).collect();
    let columns = [("run", ""), ("parameter", ""), ("value", ""), ("source", "")];
    let query = "select traverse_id, parameter, value, coalesce(source, 'setting of the study') from 'tables/parameters/*.parquet' where \
                 traverse_id in (select traverse_id from 'tables/missions/*.parquet' where variant is null)";
    let mut numbers = Numbers::new(query, &columns);
    for row in data.parameters.iter().filter(|row| plain.contains(row.traverse_id.as_str())) {
        let source = row.source.as_deref().unwrap_or("setting of the study");
        numbers.row([text(&row.traverse_id), text(&row.parameter), text(&row.value), text(source)]);
    }
    let caption = "Every number of vehicle, surface, steering and rules, with its source".into();
    (!numbers.rows.is_empty()).then(|| TableBlock { id: "run-parameters".into(), caption, numbers })
}

fn all(data: &Data) -> TableBlock {
    let names = [
        "terrain_id",
        "mission_id",
        "group",
        "variant",
        "vehicle",
        "outcome",
        "time_s",
        "path_length_m",
        "progress_m",
        "efficiency",
        "rms_vertical_acceleration_m_s2",
        "rms_pitch_rate_deg_s",
        "rms_roll_rate_deg_s",
        "max_pitch_deg",
        "max_roll_deg",
        "path",
    ];
    let numbers = Numbers::select("", &data.missions, &names);
    TableBlock { id: "missions".into(), caption: "All missions".into(), numbers }
}
