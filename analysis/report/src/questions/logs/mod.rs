//! Do missions match the logs of real drives? The rank of each log's metrics among those of the missions.

use super::Question;
use super::clusters::LEVEL;
use super::comparison::ALPHA;
use super::outcome::{self, successful};
use crate::ReportError;
use crate::content::{Block, Figure, Gives, Numbers, TableBlock, count, number, text};
use crate::data::{Data, Group, Mission};
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::LogRow;
use sastrugi_statistics::{Interval, Place};
use std::collections::{BTreeMap, BTreeSet};

/// Registry entry.
pub const QUESTION: Question = Question { id: "logs", name: "Logs", title: "Do the missions match the logs?", answer };

/// Percentiles that bound the middle of the missions.
const MIDDLE: [f64; 2] = [2.5, 97.5];
/// Logs drawn; all are in the table.
const DRAWN_MAX: usize = 6;
/// Marks that distinguish groups in a chart.
const SYMBOLS: [Symbol; 4] = [Symbol::Disc, Symbol::Square, Symbol::Triangle, Symbol::Diamond];

/// A metric that missions and logs have in common.
struct Shared {
    column: &'static str,
    name: &'static str,
    unit: &'static str,
    of_mission: fn(&Mission) -> f64,
    /// Value, noise floor (NaN if unknown), and whether the value is above the noise.
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

/// Where a metric of a log falls among the missions, or what is open about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Within,
    Below,
    Above,
    CannotTell,
    NotJudged,
    NoValue,
}

impl Verdict {
    const ALL: [Self; 6] = [Self::Within, Self::Below, Self::Above, Self::CannotTell, Self::NotJudged, Self::NoValue];

    /// True if it places the log among the missions.
    const fn decides(self) -> bool {
        matches!(self, Self::Within | Self::Below | Self::Above)
    }

    /// As in the table.
    const fn words(self) -> &'static str {
        match self {
            Self::Within => "within the middle 95 %",
            Self::Below => "below the missions",
            Self::Above => "above the missions",
            Self::CannotTell => "cannot tell",
            Self::NotJudged => "not judged",
            Self::NoValue => "no value",
        }
    }

    /// After the number of comparisons that have it.
    const fn counted(self) -> &'static str {
        match self {
            Self::Within => "within the middle 95 % of the missions",
            Self::CannotTell => "undecided",
            Self::NoValue => "without a value",
            Self::Below | Self::Above | Self::NotJudged => self.words(),
        }
    }
}

/// A metric of a log compared with the missions of a group.
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
    place: Option<Place>,
    /// Why the log is not a complete drive to a goal.
    unfinished: Option<String>,
}

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let Some(logs) = &data.logs else { return Ok(Vec::new()) };
    let groups = data.mission_groups();
    if logs.is_empty() {
        return Ok(vec![Block::Warning("The tables given with --logs are empty.".into())]);
    }
    if groups.is_empty() {
        return Ok(vec![Block::Warning("The release has no missions to compare the logs with.".into())]);
    }
    let logs = &named(logs);
    let placed = placed(logs, &groups);
    let mut blocks = vec![Block::Result(in_words(&placed)), Block::Text(introduction())];
    blocks.extend(rates(data, logs).map(Block::Warning));
    blocks.extend(too_few(&placed).map(Block::Warning));
    let drawings = drawings(&placed);
    blocks.extend(left_out(logs.len(), drawings.len()).map(Block::Text));
    blocks.push(Block::Figures(drawings));
    blocks.push(Block::Table(table(&placed)));
    blocks.push(Block::FoldedTable(all(logs)));
    Ok(blocks)
}

/// Every log once, named by the shortest end of its path that is unique: the page must not reveal the machine it was made on.
fn named(logs: &[LogRow]) -> Vec<LogRow> {
    // Unknown values are NaN, which equals nothing, so rows are compared as text.
    let mut seen = BTreeSet::new();
    let all: Vec<LogRow> = logs.iter().filter(|log| seen.insert(format!("{log:?}"))).cloned().collect();
    let tail = |id: &str, parts: usize| {
        let all: Vec<&str> = id.split(['/', '\\']).filter(|part| !part.is_empty()).collect();
        all[all.len().saturating_sub(parts)..].join("/")
    };
    let ids: Vec<String> = all.iter().map(|log| log.log_id.clone()).collect();
    let unique = |id: &String| {
        let others = || ids.iter().filter(|other| *other != id);
        let parts = (1..64).find(|&n| others().all(|other| tail(other, n) != tail(id, n)));
        tail(id, parts.unwrap_or(64))
    };
    // The same log, analysed more than once with different settings.
    let again = |k: usize| match ids[..k].iter().filter(|id| **id == ids[k]).count() {
        0 => String::new(),
        n => format!(" ({})", n + 1),
    };
    let names: Vec<String> = (0..ids.len()).map(|k| format!("{}{}", unique(&ids[k]), again(k))).collect();
    all.into_iter().zip(names).map(|(log, log_id)| LogRow { log_id, ..log }).collect()
}

/// Every metric of every log, compared with the group that the log names, or with every group.
fn placed<'a>(logs: &'a [LogRow], groups: &'a [Group<'a, Mission>]) -> Vec<Placed<'a>> {
    let mut placed = Vec::new();
    for (log, row) in logs.iter().enumerate() {
        let own = |g: &&Group<Mission>| row.group.as_deref().is_none_or(|label| label == g.label || label == g.name);
        let beside: Vec<&Group<Mission>> = match groups.iter().any(|g| own(&g)) {
            true => groups.iter().filter(own).collect(),
            false => groups.iter().collect(),
        };
        for shared in &SHARED {
            placed.extend(beside.iter().map(|group| place((log, row), group, shared)));
        }
    }
    placed
}

fn place<'a>((log, row): (usize, &'a LogRow), group: &'a Group<'a, Mission>, shared: &'static Shared) -> Placed<'a> {
    let mut terrains: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for mission in group.rows.iter().filter(|m| successful(m)) {
        let value = (shared.of_mission)(mission);
        if value.is_finite() {
            terrains.entry(&mission.terrain_id).or_default().push(value);
        }
    }
    let terrains: Vec<Vec<f64>> = terrains.into_values().collect();
    let mut sorted = terrains.concat();
    sorted.sort_by(f64::total_cmp);
    let (value, floor, tells) = (shared.of_log)(row);
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
        place: Place::of(value, &terrains, LEVEL),
        unfinished: unfinished(row),
    }
}

/// Why a log cannot be compared with successful missions: it is incomplete, or its drive failed.
fn unfinished(log: &LogRow) -> Option<String> {
    let failed = log.outcome.as_deref().filter(|outcome| *outcome != outcome::ALL[0].word);
    let words =
        |outcome: &str| outcome::ALL.iter().find(|o| o.word == outcome).map_or(outcome.to_owned(), |o| o.name.into());
    match (&log.broken, failed) {
        (Some(_), _) => Some("the log is incomplete".into()),
        (None, Some(outcome)) => Some(format!("outcome {}", words(outcome))),
        (None, None) => None,
    }
}

impl Placed<'_> {
    /// The verdict, and the reason for it if it needs one.
    fn verdict(&self) -> (Verdict, &str) {
        let Some(place) = &self.place else { return (Verdict::NoValue, "") };
        let inside = (MIDDLE[0]..=MIDDLE[1]).contains(&(100.0 * place.share_below.estimate));
        match &self.unfinished {
            Some(why) => (Verdict::NotJudged, why),
            None if !self.tells => (Verdict::CannotTell, "below three times the noise floor"),
            None if place.p() <= ALPHA && place.p_above < place.p_below => (Verdict::Above, ""),
            None if place.p() <= ALPHA => (Verdict::Below, ""),
            None if inside => (Verdict::Within, ""),
            None if place.least_p() > ALPHA => (Verdict::CannotTell, "at the edge, and too few terrains"),
            None => (Verdict::CannotTell, "at the edge"),
        }
    }

    fn verdict_in_words(&self) -> String {
        match self.verdict() {
            (verdict, "") => verdict.words().to_owned(),
            (verdict, why) => format!("{}: {why}", verdict.words()),
        }
    }
}

/// How many comparisons have each verdict.
fn verdicts(placed: &[Placed]) -> String {
    let part = |verdict: Verdict| {
        let n = placed.iter().filter(|p| p.verdict().0 == verdict).count();
        (n > 0).then(|| format!("{} {}", set::count(n), verdict.counted()))
    };
    let logs = placed.iter().map(|p| p.log).max().map_or(0, |last| last + 1);
    let parts: Vec<String> = Verdict::ALL.into_iter().filter_map(part).collect();
    format!(
        "{} of {} with groups of missions, metric by metric: {}.",
        set::counted(placed.len(), "comparison"),
        set::counted(logs, "log"),
        parts.join(", ")
    )
}

fn in_words(placed: &[Placed]) -> String {
    let told = |p: &&Placed| p.tells && p.unfinished.is_none() && p.place.is_some_and(|place| place.least_p() <= ALPHA);
    let by_chance = match placed.iter().filter(told).count() {
        0 => String::new(),
        n => format!(
            " If the drives were like the missions, about {} of the {} that can be decided would be below or above them by chance.",
            set::plain(ALPHA * n as f64, 2),
            set::counted(n, "comparison")
        ),
    };
    format!("{}{by_chance}", verdicts(placed))
}

fn introduction() -> String {
    format!(
        "Columns of the same name have the same meaning in the tables missions and logs (sastrugi analyze). Each metric of a log is compared \
         with the missions that reached their goal: the table gives their 5th, 50th and 95th percentile and the share of missions below the log \
         (every terrain has the same weight, ties count half), with a {} % interval over terrains (Clopper and Pearson's). p is the probability \
         that one more drive, on one more terrain of the kind, would lie as far out (a rank among terrains, Lee, Barber and Willett; two-sided, \
         not adjusted). A log is below or above the missions if p is at most {}; otherwise it is within their middle 95 % if its share is. p is \
         never below 2 / (terrains + 1), so at least {} terrains are needed to find a log below or above. One log is one drive and may be \
         atypical. Below three times its noise floor, a metric cannot tell; a log that is incomplete or failed is not judged. A log that names a \
         group is compared with that group only. Exploratory.",
        set::fixed(100.0 * LEVEL, 0),
        set::plain(ALPHA, 2),
        set::fixed((2.0 / ALPHA - 1.0).ceil(), 0),
    )
}

/// Groups with too few terrains for a significant p.
fn too_few(placed: &[Placed]) -> Option<String> {
    let few = |p: &&Placed| p.place.is_some_and(|place| place.least_p() > ALPHA);
    let groups: BTreeMap<&str, usize> =
        placed.iter().filter(few).map(|p| (p.group, p.place.map_or(0, |place| place.terrains))).collect();
    let list: Vec<String> =
        groups.iter().map(|(group, n)| format!("{group} ({})", set::counted(*n, "terrain"))).collect();
    (!list.is_empty())
        .then(|| format!("Too few terrains to show that a drive differs from the missions: {}.", list.join(", ")))
}

/// Logs sampled at another rate than the missions: the RMS of a derivative grows with the sample rate.
fn rates(data: &Data, logs: &[LogRow]) -> Option<String> {
    let missions = data.missions.first()?.sample_rate_hz;
    let other = |log: &&LogRow| (log.sample_rate_hz / missions - 1.0).abs() > 0.01;
    let logs: Vec<&str> = logs.iter().filter(other).map(|log| log.log_id.as_str()).collect();
    (!logs.is_empty()).then(|| {
        format!(
            "Sampled at another rate than the missions ({} Hz), so that accelerations and angular rates cover different bands: {}. \
             Analyse these logs with --rate.",
            set::plain(missions, 4),
            logs.join(", ")
        )
    })
}

fn drawings(placed: &[Placed]) -> Vec<Figure> {
    let of_log = |log: usize| placed.iter().filter(|p| p.log == log && p.place.is_some()).collect::<Vec<_>>();
    let logs = placed.iter().map(|p| p.log + 1).max().unwrap_or(0);
    (0..logs).map(of_log).filter(|p| !p.is_empty()).take(DRAWN_MAX).map(|p| drawing(&p)).collect()
}

/// How many of the logs are drawn; `None` if all are.
fn left_out(logs: usize, drawn: usize) -> Option<String> {
    (drawn < logs).then(|| {
        format!(
            "{} of {} {} drawn; the table has all.",
            set::count(drawn),
            set::counted(logs, "log"),
            if drawn == 1 { "is" } else { "are" }
        )
    })
}

/// The rank of a log: a row for each metric, a mark for each group.
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
        let Some(place) = p.place.map(|place| in_percent(place.share_below)) else { continue };
        let paint = if p.verdict().0.decides() { Paint::Series(p.group_index) } else { Paint::Muted };
        if let (Some(from), Some(to)) = (rows.x.clamped(place.low), rows.x.clamped(place.high)) {
            rows.svg.segment((from, y), (to, y), Stroke::new(paint, 1.8));
        }
        if let Some(x) = rows.x.at(place.estimate) {
            rows.svg.symbol(symbol(p.group_index), (x, y), 3.4, paint);
        }
    }
    let log_id = placed[0].log_id;
    let words = |p: &&&Placed| {
        let at = p.place.map_or(f64::NAN, |place| 100.0 * place.share_below.estimate);
        format!("{}, {}: {} %", p.shared.name, p.group, set::fixed(at, 0))
    };
    let parts: Vec<String> = placed.iter().take(8).map(|p| words(&p)).collect();
    Figure {
        id: format!("log-{log_id}"),
        title: format!("Where {log_id} falls among the missions."),
        caption: "Marks are the share of missions below the log; lines are 95 % intervals over terrains. The middle 95 % of the missions \
                  lie between the two vertical lines. Grey: undecided, or not judged."
            .into(),
        description: format!("Share of missions below the log, by metric. {}.", parts.join("; ")),
        svg: rows.svg,
        numbers: numbers(placed.iter().copied()),
    }
}

fn in_percent(share: Interval) -> Interval {
    let Interval { estimate, low, high, level } = share;
    Interval { estimate: 100.0 * estimate, low: 100.0 * low, high: 100.0 * high, level }
}

fn numbers<'a>(placed: impl Iterator<Item = &'a Placed<'a>>) -> Numbers {
    let columns = [
        ("log", ""),
        ("metric", ""),
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
        ("p", ""),
        ("missions", ""),
        ("terrains", ""),
    ];
    let query = "LOGS.parquet of --logs, with tables/missions";
    let mut numbers = Numbers::of_file(query, &columns).with_mixed_units();
    for p in placed {
        let head =
            [text(p.log_id), text(p.shared.name), text(p.group), text(p.verdict_in_words()), text(p.shared.unit)];
        let place = p.place.map_or([f64::NAN; 4], |place| {
            let share = in_percent(place.share_below);
            [share.estimate, share.low, share.high, place.p()]
        });
        let values = [p.value, p.floor].into_iter().chain(p.spread).chain(place).map(number);
        let terrains = p.place.map_or(0, |place| place.terrains);
        numbers.row(head.into_iter().chain(values).chain([count(p.missions), count(terrains)]));
    }
    numbers
}

fn table(placed: &[Placed]) -> TableBlock {
    let caption = "Metrics of the logs compared with the missions".into();
    TableBlock { id: "logs-beside-missions".into(), caption, numbers: numbers(placed.iter()) }
}

/// What `analyze` found out about each log.
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
    let table = Numbers::select("", logs, &names);
    let numbers = Numbers { query: "LOGS.parquet of --logs".into(), gives: Gives::File, ..table };
    TableBlock { id: "logs".into(), caption: "All logs".into(), numbers }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive far above the missions of six terrains: too few to tell, so its line is grey, as the caption says. Of seven logs, six are drawn.
    #[test]
    fn val_undecided_logs_are_grey_and_the_others_are_counted() {
        let mut data = crate::tests::made_up::full(6, 24);
        let log = |k: usize| LogRow {
            log_id: format!("{k}.mcap"),
            group: Some("2.30".into()),
            rms_vertical_acceleration_m_s2: 1e3,
            ..crate::tests::made_up::log()
        };
        data.logs = Some((0..7).map(log).collect());
        let blocks = answer(&data).unwrap();
        let figures = blocks.iter().find_map(|b| if let Block::Figures(figures) = b { Some(figures) } else { None });
        let figures = figures.unwrap();
        assert_eq!(figures.len(), DRAWN_MAX);
        let svg = figures[0].svg.finish("id", "t", "d");
        assert!(svg.contains("stroke-width=\"1.8\"") && figures[0].caption.contains("Grey"), "{svg}");
        let mut lines = svg.split('<').filter(|shape| shape.contains("stroke-width=\"1.8\""));
        assert!(lines.all(|line| line.contains("l-muted")), "{svg}");
        let says = |words: &str| blocks.iter().any(|b| matches!(b, Block::Text(text) if text == words));
        assert!(says("6 of 7 logs are drawn; the table has all."));
        data.logs = Some(vec![log(1)]);
        assert!(!answer(&data).unwrap().iter().any(|b| matches!(b, Block::Text(text) if text.contains("drawn"))));
    }

    /// The result, which the summary repeats, states how many verdicts chance alone would give.
    #[test]
    fn val_the_result_states_what_chance_gives() {
        let mut data = crate::tests::made_up::full(40, 2);
        data.logs = Some(vec![LogRow { rms_vertical_acceleration_m_s2: 1e3, ..crate::tests::made_up::log() }]);
        let blocks = answer(&data).unwrap();
        assert!(matches!(&blocks[0], Block::Result(words) if words.ends_with(" by chance.")), "{:?}", blocks[0]);
    }

    #[test]
    fn val_logs_have_the_shortest_unique_names() {
        let log =
            |log_id: &str, samples: i64| LogRow { log_id: log_id.into(), samples, ..crate::tests::made_up::log() };
        let logs = [("/data/a/run.mcap", 1), ("/data/b/run.mcap", 1), ("c.mcap", 1), ("c.mcap", 2), ("c.mcap", 1)];
        let names: Vec<String> = named(&logs.map(|(id, n)| log(id, n))).into_iter().map(|l| l.log_id).collect();
        assert_eq!(names, ["a/run.mcap", "b/run.mcap", "c.mcap", "c.mcap (2)"]);
    }
}
