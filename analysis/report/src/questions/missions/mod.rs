//! How the missions went, by group: outcomes, distance to failure, metrics of the successful missions, maps, missions in detail.

pub mod boxes;
mod incidence;
mod maps;
mod outcomes;
mod strip;
mod survivors;

use super::clusters::{Pairing, REPLICATES, in_words};
use super::{Question, outcome};
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, Section, TableBlock, text};
use crate::data::{Data, Group, Mission};
use crate::render::number as set;
use crate::sample::{ROWS_MAX, sample};
use std::collections::BTreeSet;

/// Registry entry.
pub const QUESTION: Question = Question { id: "missions", name: "Missions", title: "How did the missions go?", answer };

/// A metric of a mission.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Column of the table `missions`.
    pub column: &'static str,
    /// Name on the page.
    pub name: &'static str,
    /// Unit as set in text.
    pub unit: &'static str,
    /// Value in a row.
    pub of: fn(&Mission) -> f64,
}

/// Metrics that are compared between groups, over successful missions only.
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
        Block::Result(verdict(&groups)),
        Block::Text(introduction(data, &groups, &pairing, boxes::have_bands(&compared))),
        Block::Figures(figures),
        Block::Table(boxes::medians(data, &compared)),
    ];
    blocks.extend(incidence::blocks(data, &groups));
    blocks.extend(survivors::blocks(data, &groups));
    let drawn = maps::drawn(data, &groups)?;
    section(&mut blocks, "Where the missions drove", MAPS, maps::figures(data, &drawn)?);
    section(&mut blocks, "Missions in detail", STRIPS, strip::figures(data, &groups, &drawn)?);
    blocks.extend(parameters(data).map(Block::FoldedTable));
    blocks.push(Block::FoldedTable(all(data)));
    Ok(blocks)
}

const MAPS: &str = "One terrain of each group: the one with the median share of successful missions (the lower middle of an even \
number, the first of equals). Paths are as recorded; without a recording, the straight line to the goal is drawn.";
const STRIPS: &str = "One mission for each of success, tipped and stuck: the one with the median vertical acceleration among those on the \
terrains above (on all terrains if these have none). Acceleration is the second difference of the recorded height.";

fn section(blocks: &mut Vec<Block>, heading: &str, words: &str, figures: Vec<Figure>) {
    if !figures.is_empty() {
        blocks.extend([Block::Heading(heading.into()), Block::Text(words.into()), Block::Figures(figures)]);
    }
}

/// The outcomes, as this section draws them.
pub(super) fn picture(section: &Section) -> Vec<Figure> {
    let figures = |block: &Block| if let Block::Figures(figures) = block { figures.first().cloned() } else { None };
    section.blocks.iter().find_map(figures).into_iter().collect()
}

/// How the missions ended.
fn verdict(groups: &[Group<Mission>]) -> String {
    let all = || groups.iter().flat_map(|g| g.rows.iter().copied());
    let terrains = all().map(|m| m.terrain_id.as_str()).collect::<BTreeSet<_>>().len();
    let ends = outcome::counts(all());
    let others = outcome::ALL.iter().zip(ends).skip(1).filter(|(_, n)| *n > 0);
    let others: Vec<String> = others.map(|(o, n)| format!("{}: {}", o.name, set::count(n))).collect();
    format!(
        "{} of {} on {} reached the goal; {}.",
        set::count(ends[0]),
        set::counted(all().count(), "mission"),
        set::counted(terrains, "terrain"),
        if others.is_empty() { "none failed".to_owned() } else { others.join(", ") }
    )
}

fn introduction(data: &Data, groups: &[Group<Mission>], pairing: &Pairing, has_bands: bool) -> String {
    let missions: usize = groups.iter().map(|g| g.rows.len()).sum();
    let vehicles: BTreeSet<&str> = groups.iter().flat_map(|g| g.rows.iter().map(|m| m.vehicle.as_str())).collect();
    let variants = match data.missions.len() - missions {
        0 => String::new(),
        n => format!(" The variants, with another {}, are compared further below.", set::counted(n, "mission")),
    };
    let intervals = match has_bands {
        true => format!(
            "so intervals are percentiles of bootstrap samples of whole {} ({REPLICATES} samples, fewer beyond 10 000 values); with fewer \
             than about ten of these in a group, intervals are too short. The sampling band of a metric holds 5 to 95 % of the bootstrap \
             values.",
            in_words(pairing)
        ),
        false => "so with one terrain in each group there are no intervals and no bands.".to_owned(),
    };
    format!(
        "The missions were driven by {}.{variants} Missions on one terrain are correlated, {intervals} Boxes are quartiles (linear \
         between order statistics), whiskers extend to the last value within 1.5 interquartile ranges, circles lie beyond. \
         Everything here is exploratory.",
        vehicles.into_iter().collect::<Vec<_>>().join(", "),
    )
}

/// Every parameter of the plain runs, with its source: assumed, measured or published.
fn parameters(data: &Data) -> Option<TableBlock> {
    let plain: BTreeSet<&str> =
        data.missions.iter().filter(|m| m.variant.is_none()).map(|m| m.traverse_id.as_str()).collect();
    let columns = [("run", ""), ("parameter", ""), ("value", ""), ("source", "")];
    let query = "select traverse_id, parameter, value, coalesce(source, 'the study, or a default') from 'tables/parameters/*.parquet' where \
                 traverse_id in (select traverse_id from 'tables/missions/*.parquet' where variant is null)";
    let mut numbers = Numbers::new(query, &columns);
    for row in data.parameters.iter().filter(|row| plain.contains(row.traverse_id.as_str())) {
        let source = row.source.as_deref().unwrap_or("the study, or a default");
        numbers.row([text(&row.traverse_id), text(&row.parameter), text(&row.value), text(source)]);
    }
    let caption = "All parameters of vehicle, surface, steering and rules, with their sources".into();
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
    let listed = sample(data.missions.iter().collect(), ROWS_MAX, &mut data.stream("missions", "listed"));
    let numbers = Numbers::select("", listed, &names).of_all(data.missions.len());
    TableBlock { id: "missions".into(), caption: "All missions".into(), numbers }
}
