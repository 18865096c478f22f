//! Whether missions are like logs of real drives: where each log's figures fall among those of the missions.

use super::Question;
use super::clusters::{Clusters, LEVEL, REPLICATES, stream};
use super::outcome::successful;
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, count, number, text};
use crate::data::{Data, Group};
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::{LogRow, MissionRow};
use sastrugi_statistics::Interval;

/// Registry entry.
pub const QUESTION: Question = Question { id: "logs", name: "Logs", title: "Do the missions match the logs?", answer };

/// What counts as the middle of the missions, %.
const MIDDLE: [f64; 2] = [2.5, 97.5];
/// Logs that are drawn; all are in the table.
const DRAWN_MAX: usize = 6;
/// Groups that a chart tells apart.
const SYMBOLS: [Symbol; 4] = [Symbol::Disc, Symbol::Square, Symbol::Triangle, Symbol::Diamond];

/// A figure that missions and logs have in common.
struct Shared {
    column: &'static str,
    name: &'static str,
    unit: &'static str,
    of_mission: fn(&MissionRow) -> f64,
    /// Value, noise floor (NaN where none is known), and whether it tells.
    of_log: fn(&LogRow) -> (f64, f64, bool),
}

const SHARED: [Shared; 8] = [
    Shared {
        column: "efficiency",
        name: "efficiency",
        unit: "",
        of_mission: |m| m.efficiency,
        of_log: |l| (l.efficiency, f64::NAN, true),
    },
    Shared {
        column: "rms_vertical_acceleration_m_s2",
        name: "RMS vertical acceleration",
        unit: "m/s²",
        of_mission: |m| m.rms_vertical_acceleration_m_s2,
        of_log: |l| {
            (l.rms_vertical_acceleration_m_s2, l.vertical_acceleration_floor_m_s2, l.vertical_acceleration_tells)
        },
    },
    Shared {
        column: "rms_pitch_rate_deg_s",
        name: "RMS pitch rate",
        unit: "°/s",
        of_mission: |m| m.rms_pitch_rate_deg_s,
        of_log: |l| (l.rms_pitch_rate_deg_s, l.pitch_rate_floor_deg_s, l.pitch_rate_tells),
    },
    Shared {
        column: "rms_roll_rate_deg_s",
        name: "RMS roll rate",
        unit: "°/s",
        of_mission: |m| m.rms_roll_rate_deg_s,
        of_log: |l| (l.rms_roll_rate_deg_s, l.roll_rate_floor_deg_s, l.roll_rate_tells),
    },
    Shared {
        column: "rms_body_pitch_rate_deg_s",
        name: "RMS body pitch rate",
        unit: "°/s",
        of_mission: |m| m.rms_body_pitch_rate_deg_s,
        of_log: |l| (l.rms_body_pitch_rate_deg_s, f64::NAN, true),
    },
    Shared {
        column: "rms_body_roll_rate_deg_s",
        name: "RMS body roll rate",
        unit: "°/s",
        of_mission: |m| m.rms_body_roll_rate_deg_s,
        of_log: |l| (l.rms_body_roll_rate_deg_s, f64::NAN, true),
    },
    Shared {
        column: "max_pitch_deg",
        name: "largest pitch",
        unit: "°",
        of_mission: |m| m.max_pitch_deg,
        of_log: |l| (l.max_pitch_deg, f64::NAN, true),
    },
    Shared {
        column: "max_roll_deg",
        name: "largest roll",
        unit: "°",
        of_mission: |m| m.max_roll_deg,
        of_log: |l| (l.max_roll_deg, f64::NAN, true),
    },
];

/// A log's figure beside the missions of a group.
struct Placed<'a> {
    /// Number of the log among all.
    log: usize,
    log_id: &'a str,
    group: &'a str,
    group_index: usize,
    shared: &'static Shared,
    value: f64,
    floor: f64,
    tells: bool,
    missions: usize,
    /// 5th, 50th and 95th percentile of the missions.
    spread: [f64; 3],
    /// Share of the missions below the log, %.
    place: Option<Interval>,
}

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let Some(logs) = &data.logs else { return Ok(Vec::new()) };
    let groups = data.mission_groups();
    if logs.is_empty() {
        return Ok(vec![Block::Warning("The tables of logs hold no log.".into())]);
    }
    if groups.is_empty() {
        return Ok(vec![Block::Warning("The release has no missions to put beside the logs.".into())]);
    }
    let placed = placed(data, logs, &groups);
    let mut blocks = vec![Block::Text(in_words(&placed)), Block::Text(introduction())];
    blocks.extend(rates(data, logs).map(Block::Warning));
    blocks.push(Block::Figures(drawings(&placed)));
    blocks.push(Block::Table(table(&placed)));
    blocks.push(Block::FoldedTable(all(logs)));
    Ok(blocks)
}

/// Every figure of every log beside the group that the log names, or beside every group.
fn placed<'a>(data: &Data, logs: &'a [LogRow], groups: &'a [Group<'a, MissionRow>]) -> Vec<Placed<'a>> {
    let mut placed = Vec::new();
    for (log, row) in logs.iter().enumerate() {
        let own = groups.iter().find(|g| row.group.as_deref() == Some(g.name.as_str()));
        for shared in &SHARED {
            let beside = own.map_or(groups, std::slice::from_ref);
            placed.extend(beside.iter().map(|group| place(data, (log, row), group, shared)));
        }
    }
    placed
}

fn place<'a>(
    data: &Data,
    (log, row): (usize, &'a LogRow),
    group: &'a Group<'a, MissionRow>,
    shared: &'static Shared,
) -> Placed<'a> {
    let of = |m: &&MissionRow| (m.terrain_id.clone(), (shared.of_mission)(m));
    let known: Vec<(String, f64)> =
        group.rows.iter().copied().filter(|m| successful(m)).map(|m| of(&m)).filter(|v| v.1.is_finite()).collect();
    let borrowed: Vec<(&str, f64)> = known.iter().map(|(t, v)| (t.as_str(), *v)).collect();
    let mut sorted: Vec<f64> = borrowed.iter().map(|v| v.1).collect();
    sorted.sort_by(f64::total_cmp);
    let (value, floor, tells) = (shared.of_log)(row);
    let share = |drawn: &[Vec<f64>]| 100.0 * share_below(&drawn[0], value);
    let item = format!("{} beside {}", row.log_id, group.name);
    let interval = || Clusters::new(&[borrowed]).interval(&mut stream(data, &item, shared.column), LEVEL, share);
    Placed {
        log,
        log_id: &row.log_id,
        group: &group.name,
        group_index: group.index,
        shared,
        value,
        floor,
        tells,
        missions: sorted.len(),
        spread: [0.05, 0.5, 0.95].map(|q| sums::quantile_sorted(&sorted, q)),
        place: if value.is_finite() { interval() } else { None },
    }
}

/// Share of the values below one, equal ones counted half; NaN for no values.
fn share_below(values: &[f64], value: f64) -> f64 {
    let sum: f64 = values
        .iter()
        .map(|v| {
            if *v < value {
                1.0
            } else if *v == value {
                0.5
            } else {
                0.0
            }
        })
        .sum();
    sum / values.len() as f64
}

impl Placed<'_> {
    fn verdict(&self) -> &'static str {
        let Some(place) = self.place else { return "no value" };
        let inside = |v: f64| (MIDDLE[0]..=MIDDLE[1]).contains(&v);
        match (inside(place.low), inside(place.high)) {
            _ if !self.tells => "cannot tell: below three noise floors",
            (true, true) => "like the missions",
            (false, false) if place.high < MIDDLE[0] => "below them",
            (false, false) if place.low > MIDDLE[1] => "above them",
            _ => "cannot tell: at their edge",
        }
    }
}

fn in_words(placed: &[Placed]) -> String {
    let words = ["like the missions", "below them", "above them", "cannot tell", "no value"];
    let part = |word: &&str| {
        let n = placed.iter().filter(|p| p.verdict().starts_with(word)).count();
        (n > 0).then(|| format!("{word}: {}", set::count(n)))
    };
    let logs = placed.iter().map(|p| p.log).max().map_or(0, |last| last + 1);
    let parts: Vec<String> = words.iter().filter_map(part).collect();
    format!(
        "{} of {}, each beside a group of missions: {}.",
        set::counted(placed.len(), "figure"),
        set::counted(logs, "log"),
        parts.join("; ")
    )
}

fn introduction() -> String {
    format!(
        "Columns of the same name mean the same in the tables missions and logs (sastrugi analyze). Beside each figure of a log stand the missions that \
         reached their goal: their 5th, 50th and 95th percentile, and the place of the log among them, which is the share of missions below it \
         (equal ones count half) with a {} % interval that draws whole terrains anew ({REPLICATES} redraws, fewer beyond 10 000 missions; percentiles). A log \
         is like the missions where the interval lies within {} to {} %. One log is one drive: it may be an odd one. Below three \
         noise floors the log itself cannot tell. A log that names a group stands beside that group only. Exploratory.",
        set::fixed(100.0 * LEVEL, 0),
        set::fixed(MIDDLE[0], 1),
        set::fixed(MIDDLE[1], 1),
    )
}

/// Root mean squares of derivatives grow with the rate of the samples.
fn rates(data: &Data, logs: &[LogRow]) -> Option<String> {
    let missions = data.missions.first()?.sample_rate_hz;
    let other = |log: &&LogRow| (log.sample_rate_hz / missions - 1.0).abs() > 0.01;
    let logs: Vec<&str> = logs.iter().filter(other).map(|log| log.log_id.as_str()).collect();
    (!logs.is_empty()).then(|| {
        format!(
            "Sampled at another rate than the missions ({} Hz), so that accelerations and rates are not of one band: {}. Analyse \
             these logs with --rate.",
            set::plain(missions, 4),
            logs.join(", ")
        )
    })
}

fn drawings(placed: &[Placed]) -> Vec<Figure> {
    let of_log = |log: usize| placed.iter().filter(|p| p.log == log && p.place.is_some()).collect::<Vec<_>>();
    (0..DRAWN_MAX).map(of_log).filter(|p| !p.is_empty()).map(|p| drawing(&p)).collect()
}

/// The places of a log: a row for each figure, a mark for each group.
fn drawing(placed: &[&Placed]) -> Figure {
    let mut figures: Vec<&Shared> = Vec::new();
    let mut groups: Vec<(usize, &str)> = Vec::new();
    for p in placed {
        if !figures.iter().any(|f| f.column == p.shared.column) {
            figures.push(p.shared);
        }
        if !groups.contains(&(p.group_index, p.group)) {
            groups.push((p.group_index, p.group));
        }
    }
    let symbol = |index: usize| SYMBOLS[index % SYMBOLS.len()];
    let label = |f: &&Shared| match f.name.strip_prefix("RMS ") {
        Some(name) => RowLabel { name: name.into(), detail: "RMS".into() },
        None => RowLabel { name: f.name.into(), detail: String::new() },
    };
    let labels: Vec<RowLabel> = figures.iter().map(label).collect();
    let entry =
        |(index, name): &(usize, &str)| (Mark::Symbol(symbol(*index), Paint::Series(*index)), format!("group {name}"));
    let legend: Vec<Entry> = groups.iter().map(entry).collect();
    let step = 10.0;
    let height = 22.0 + step * groups.len() as f64;
    let mut rows = Rows::new(&labels, height, (Axis::linear(-3.0, 103.0), "missions below the log, %"), &legend);
    MIDDLE.iter().for_each(|at| rows.vertical(*at, labels.len()));
    for p in placed {
        let row = figures.iter().position(|f| f.column == p.shared.column).unwrap_or(0);
        let k = groups.iter().position(|g| g.0 == p.group_index).unwrap_or(0);
        let y = rows.centre(row) + step * (k as f64 - 0.5 * (groups.len() - 1) as f64);
        let Some(place) = p.place else { continue };
        let paint = if p.tells { Paint::Series(p.group_index) } else { Paint::Muted };
        if let (Some(from), Some(to)) = (rows.x.clamped(place.low), rows.x.clamped(place.high)) {
            rows.svg.segment((from, y), (to, y), Stroke::new(paint, 1.8));
        }
        if let Some(x) = rows.x.at(place.estimate) {
            rows.svg.symbol(symbol(p.group_index), (x, y), 3.4, paint);
        }
    }
    let log_id = placed[0].log_id;
    let words = |p: &&&Placed| {
        let at = p.place.map_or(f64::NAN, |i| i.estimate);
        format!("{}, {}: {} %", p.shared.name, p.group, set::fixed(at, 0))
    };
    let parts: Vec<String> = placed.iter().take(8).map(|p| words(&p)).collect();
    Figure {
        id: format!("log-{log_id}"),
        title: format!("Where {log_id} falls among the missions."),
        caption: "Marks are the share of missions below the log, lines 95 % intervals over terrains; between the two upright lines lie \
                  the middle 95 % of the missions. Grey: the log cannot tell."
            .into(),
        description: format!("Share of missions below the figures of the log. {}.", parts.join("; ")),
        svg: rows.svg,
        numbers: numbers(placed.iter().copied()),
    }
}

fn numbers<'a>(placed: impl Iterator<Item = &'a Placed<'a>>) -> Numbers {
    let columns = [
        ("log", ""),
        ("figure", ""),
        ("group", ""),
        ("verdict", ""),
        ("unit", ""),
        ("log's value", ""),
        ("noise floor", ""),
        ("missions, 5 %", ""),
        ("median", ""),
        ("95 %", ""),
        ("missions below, %", ""),
        ("low, %", ""),
        ("high, %", ""),
        ("missions", ""),
    ];
    let query = "logs of `analyze` beside tables/missions, plain run, outcome = 'success'";
    let mut numbers = Numbers::new(query, &columns).with_mixed_units();
    for p in placed {
        let head = [text(p.log_id), text(p.shared.name), text(p.group), text(p.verdict()), text(p.shared.unit)];
        let place = p.place.map_or([f64::NAN; 3], |i| [i.estimate, i.low, i.high]);
        let values = [p.value, p.floor].into_iter().chain(p.spread).chain(place).map(number);
        numbers.row(head.into_iter().chain(values).chain([count(p.missions)]));
    }
    numbers
}

fn table(placed: &[Placed]) -> TableBlock {
    let caption = "Figures of the logs beside the missions".into();
    TableBlock { id: "logs-beside-missions".into(), caption, numbers: numbers(placed.iter()) }
}

/// What `analyze` says of each log.
fn all(logs: &[LogRow]) -> TableBlock {
    let names = [
        "log_id",
        "group",
        "topic",
        "outcome",
        "time_s",
        "path_length_m",
        "sample_rate_hz",
        "resampled",
        "gaps",
        "band_vertical_acceleration_m_s2",
        "band_source",
        "band_vertical_acceleration_floor_m_s2",
        "broken",
    ];
    let numbers = Numbers::select("tables of `sastrugi analyze`", logs, &names);
    TableBlock { id: "logs".into(), caption: "The logs".into(), numbers }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand.
    #[test]
    fn val_share_below() {
        assert_eq!(share_below(&[1.0, 2.0, 2.0, 3.0], 2.0), 0.5);
        assert_eq!(share_below(&[1.0, 2.0], 9.0), 1.0);
        assert!(share_below(&[], 1.0).is_nan());
    }
}
