//! How sensitive results are to parameters: every variant of the study compared with its plain run.

use super::Question;
use super::clusters::{Clusters, LEVEL, block, stream};
use super::missions::METRICS;
use super::outcome::successful;
use super::sql;
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, count, number, text};
use crate::data::{Data, Group, Mission};
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_numeric::sums;
use sastrugi_statistics::Interval;
use std::collections::BTreeMap;

/// Registry entry.
pub const QUESTION: Question = Question {
    id: "sensitivity",
    name: "Sensitivity",
    title: "How sensitive are the results to the parameters?",
    answer,
};

/// Variants drawn; all are in the table.
const DRAWN_MAX: usize = 24;
/// Number of metrics whose medians are compared: the three RMS values.
const RMS: usize = 3;

/// Variants that repeat the plain run from more starts.
const MORE_STARTS: &str = "replicates = ";
/// Unit suffixes of parameter names.
const UNITS: [&str; 9] = ["n", "m", "s", "px", "rad", "percent", "deg", "hz", "kg"];

/// A variant in one group.
struct Effect {
    variant: String,
    group: String,
    index: usize,
    missions: usize,
    successes: usize,
    /// Missions that both runs drove; `None` if they share none, so that all missions of both runs are compared.
    pairs: Option<usize>,
    /// Change of the share of successes from the plain run, points, and its interval.
    change: f64,
    interval: Option<Interval>,
    /// Medians of the [`RMS`] metrics and their changes, %.
    medians: Vec<(f64, f64)>,
}

impl Effect {
    /// Sort key of variants: the largest change, in points or per cent.
    fn size(&self) -> f64 {
        self.medians.iter().map(|m| m.1.abs()).chain([self.change.abs()]).filter(|v| v.is_finite()).fold(0.0, f64::max)
    }
}

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    if !data.missions.iter().any(|m| m.variant.is_none()) {
        return Ok(Vec::new());
    }
    let effects = effects(data);
    if effects.is_empty() {
        return Ok(Vec::new());
    }
    let introduction = format!(
        "{} One parameter is changed at a time; everything else is as in the plain run of the same group. The change of success is \
         in percentage points, over the missions that both runs drove between the same points, or over all missions if there are \
         none; {} % intervals resample whole blocks of paired terrains (or terrains). Changes of medians are over the successful \
         missions of each run. The largest changes, in points or per cent, come first.",
        strongest(&effects),
        set::fixed(100.0 * LEVEL, 0)
    );
    Ok(vec![Block::Text(introduction), Block::Figures(vec![figure(&effects)]), Block::Table(table(data, &effects))])
}

/// The largest effect, in a sentence.
fn strongest(effects: &[Effect]) -> String {
    let largest = effects.iter().max_by(|a, b| a.size().total_cmp(&b.size())).filter(|e| e.size() > 0.0);
    let Some(effect) = largest else { return "No variant changes success or a median.".to_owned() };
    let median = METRICS.iter().zip(&effect.medians).find(|(_, m)| m.1.is_finite() && m.1.abs() >= effect.size());
    let change = match median.filter(|_| effect.change.abs() < effect.size()) {
        Some((metric, m)) => format!("the median {} by {} %", metric.name, set::fixed(m.1, 1)),
        None => format!("success by {} points", set::fixed(effect.change, 1)),
    };
    format!("The largest effect is that of {} in group {}, which changes {change}.", effect.variant, effect.group)
}

/// Every variant in every group that has a plain run, the variant with the largest effect first.
fn effects(data: &Data) -> Vec<Effect> {
    let variants = data.missions_by_variant().into_iter().filter(|(name, _)| !name.starts_with(MORE_STARTS));
    let (grouping, plain) = (data.grouping(), data.mission_groups());
    let plain: BTreeMap<&str, &Group<Mission>> = plain.iter().map(|group| (group.name.as_str(), group)).collect();
    let mut effects = Vec::new();
    for (name, missions) in variants {
        for group in grouping.groups_of(missions) {
            let reference = plain.get(group.name.as_str());
            effects.extend(reference.map(|plain| effect(data, name, &group, plain)));
        }
    }
    let mut largest: BTreeMap<String, f64> = BTreeMap::new();
    for e in &effects {
        let size = largest.entry(e.variant.clone()).or_default();
        *size = size.max(e.size());
    }
    effects.sort_by(|a, b| {
        let (first, second) = (largest[&a.variant], largest[&b.variant]);
        second.total_cmp(&first).then_with(|| (&a.variant, a.index).cmp(&(&b.variant, b.index)))
    });
    effects
}

fn effect(data: &Data, variant: &str, group: &Group<Mission>, plain: &Group<Mission>) -> Effect {
    let pairs = pairs(group, plain);
    let item = format!("{variant} in {}", group.name);
    let mut stream = stream(data, &item, "success");
    let (change, interval) = if pairs.is_empty() {
        let items =
            |g: &Group<'_, Mission>| g.rows.iter().map(|m| (m.terrain_id.clone(), success(m))).collect::<Vec<_>>();
        let difference = |v: &[Vec<f64>]| sums::mean(&v[1]) - sums::mean(&v[0]);
        let all = [items(plain), items(group)];
        let borrowed = all.each_ref().map(|g| g.iter().map(|(t, v)| (t.as_str(), *v)).collect::<Vec<_>>());
        let values = borrowed.each_ref().map(|g| g.iter().map(|v| v.1).collect());
        (difference(&values), Clusters::new(&borrowed).interval(&mut stream, LEVEL, difference))
    } else {
        let changes: Vec<(&str, f64)> =
            pairs.iter().map(|(plain, changed)| (block(&plain.pair_id), success(changed) - success(plain))).collect();
        let all: Vec<f64> = changes.iter().map(|c| c.1).collect();
        let interval = Clusters::new(&[changes]).interval(&mut stream, LEVEL, |v| sums::mean(&v[0]));
        (sums::mean(&all), interval)
    };
    let medians = METRICS[..RMS].iter().map(|m| {
        let median = |g: &Group<Mission>| {
            let goals = g.rows.iter().filter(|m| successful(m));
            sums::median(&sums::finite(&goals.map(|row| (m.of)(row)).collect::<Vec<_>>()))
        };
        (median(group), 100.0 * (median(group) / median(plain) - 1.0))
    });
    Effect {
        variant: variant.into(),
        group: group.name.clone(),
        index: group.index,
        missions: group.rows.len(),
        successes: group.rows.iter().filter(|m| successful(m)).count(),
        pairs: (!pairs.is_empty()).then_some(pairs.len()),
        change,
        interval,
        medians: medians.collect(),
    }
}

/// Success in per cent.
fn success(mission: &Mission) -> f64 {
    if successful(mission) { 100.0 } else { 0.0 }
}

/// Missions of the plain run and of the variant with a `pair_id` in common.
fn pairs<'a>(group: &Group<'a, Mission>, plain: &Group<'a, Mission>) -> Vec<(&'a Mission, &'a Mission)> {
    let by_pair: BTreeMap<&str, &'a Mission> = plain.rows.iter().map(|m| (m.pair_id.as_str(), *m)).collect();
    group.rows.iter().filter_map(|m| Some((*by_pair.get(m.pair_id.as_str())?, *m))).collect()
}

/// Changes of success with their intervals: a row for each variant, a mark for each group.
fn figure(effects: &[Effect]) -> Figure {
    let mut variants: Vec<&str> = Vec::new();
    effects.iter().for_each(|e| {
        if !variants.contains(&e.variant.as_str()) {
            variants.push(&e.variant)
        }
    });
    let left_out = variants.len().saturating_sub(DRAWN_MAX);
    variants.truncate(DRAWN_MAX);
    let groups: BTreeMap<usize, &str> = effects.iter().map(|e| (e.index, e.group.as_str())).collect();
    let drawn = || effects.iter().filter(|e| variants.contains(&e.variant.as_str()));
    let ends = drawn().flat_map(|e| e.interval.map_or([e.change; 2], |i| [i.low, i.high])).filter(|v| v.is_finite());
    let (low, high) = ends.fold((-1.0, 1.0), |(a, b): (f64, f64), v| (a.min(v), b.max(v)));
    let margin = 0.05 * (high - low);
    let axis = Axis::linear(low - margin, high + margin);
    let labels: Vec<RowLabel> = variants.iter().map(|v| label(v)).collect();
    let entry =
        |(index, name): (&usize, &&str)| (Mark::Symbol(symbol(*index), Paint::Series(*index)), format!("group {name}"));
    let legend: Vec<Entry> = groups.iter().map(entry).collect();
    let height = 26.0 + 9.0 * groups.len() as f64;
    let mut rows = Rows::new(&labels, height, (axis, "change of success, points"), &legend);
    rows.vertical(0.0, variants.len());
    for effect in drawn() {
        let place = groups.keys().position(|g| *g == effect.index).unwrap_or(0) as f64;
        let row = variants.iter().position(|v| *v == effect.variant).unwrap_or(0);
        draw(&mut rows, row, 9.0 * (place - 0.5 * (groups.len() - 1) as f64), effect);
    }
    let more = match left_out {
        0 => String::new(),
        n => format!(" The table has {} with smaller effects.", set::counted(n, "more variant")),
    };
    Figure {
        id: "sensitivity-of-success".into(),
        title: "Change of success.".into(),
        caption: format!("Marks are changes from the plain run; lines are their 95 % intervals.{more}"),
        description: describe(effects),
        svg: rows.svg,
        numbers: numbers(effects),
    }
}

/// A variant in two lines: the parameter without its unit, and its table with the value.
fn label(variant: &str) -> RowLabel {
    let (path, value) = variant.split_once(" = ").unwrap_or((variant, ""));
    let mut parts = path.rsplit('.');
    let mut words: Vec<&str> = parts.next().unwrap_or(path).split('_').collect();
    while words.len() > 1 && words.last().is_some_and(|w| UNITS.contains(w)) {
        words.pop();
    }
    let value = value.parse().map_or_else(|_| value.to_owned(), |v| set::plain(v, 4));
    let detail = parts.next().map_or_else(|| value.clone(), |table| format!("{}: {value}", table.replace('_', " ")));
    RowLabel { name: words.join(" "), detail }
}

fn symbol(index: usize) -> Symbol {
    [Symbol::Disc, Symbol::Square, Symbol::Triangle, Symbol::Diamond][index % 4]
}

fn draw(rows: &mut Rows, row: usize, shift: f64, effect: &Effect) {
    let y = rows.centre(row) + shift;
    let ends = effect.interval.and_then(|i| Some((rows.x.clamped(i.low)?, rows.x.clamped(i.high)?)));
    if let Some((from, to)) = ends {
        rows.svg.segment((from, y), (to, y), Stroke::new(Paint::Series(effect.index), 1.8));
    }
    if let Some(x) = rows.x.at(effect.change) {
        rows.svg.symbol(symbol(effect.index), (x, y), 3.4, Paint::Series(effect.index));
    }
}

fn describe(effects: &[Effect]) -> String {
    let part = |e: &Effect| format!("{} in group {}: {} points", e.variant, e.group, set::fixed(e.change, 1));
    let parts: Vec<String> = effects.iter().take(6).map(part).collect();
    format!(
        "Changes of the share of successful missions from the plain run. The largest effects: {}.",
        parts.join("; ")
    )
}

fn numbers(effects: &[Effect]) -> Numbers {
    let columns = [("variant", ""), ("group", ""), ("change", "points"), ("low", "points"), ("high", "points")];
    let mut numbers = Numbers::computed(sql::variants(), &columns);
    for e in effects {
        numbers.row([
            text(&e.variant),
            text(&e.group),
            number(e.change),
            number(e.interval.map_or(f64::NAN, |i| i.low)),
            number(e.interval.map_or(f64::NAN, |i| i.high)),
        ]);
    }
    numbers
}

fn table(data: &Data, effects: &[Effect]) -> TableBlock {
    let columns = [
        ("variant", ""),
        ("group", ""),
        ("successes", "1"),
        ("missions", "1"),
        ("pairs", "1"),
        ("change", "points"),
        ("low", "points"),
        ("high", "points"),
        ("acceleration", "m/s2"),
        ("its change", "%"),
        ("pitch rate", "deg/s"),
        ("its change", "%"),
        ("roll rate", "deg/s"),
        ("its change", "%"),
    ];
    let mut numbers = Numbers::computed(sql::variants(), &columns);
    for e in effects {
        let head = [
            text(&e.variant),
            text(&e.group),
            count(e.successes),
            count(e.missions),
            e.pairs.map_or(sastrugi_schemas::Cell::Null, count),
            number(e.change),
            number(e.interval.map_or(f64::NAN, |i| i.low)),
            number(e.interval.map_or(f64::NAN, |i| i.high)),
        ];
        numbers.row(head.into_iter().chain(e.medians.iter().flat_map(|m| [number(m.0), number(m.1)])));
    }
    for group in data.mission_groups() {
        numbers.rows.push(plain(&group));
    }
    TableBlock { id: "sensitivity".into(), caption: "Variants, then the plain run".into(), numbers }
}

/// The row of a group's plain run.
fn plain(group: &Group<Mission>) -> Vec<sastrugi_schemas::Cell> {
    let none = || number(f64::NAN);
    let goals: Vec<&&Mission> = group.rows.iter().filter(|m| successful(m)).collect();
    let head =
        [text("none"), text(&group.name), count(goals.len()), count(group.rows.len()), none(), none(), none(), none()];
    let median = |k: usize| {
        let values: Vec<f64> = goals.iter().map(|m| (METRICS[k].of)(m)).collect();
        [number(sums::median(&sums::finite(&values))), none()]
    };
    head.into_iter().chain((0..RMS).flat_map(median)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_labels() {
        let of = |variant| {
            let label = label(variant);
            (label.name, label.detail)
        };
        assert_eq!(of("vehicle_changes.tyre.damping_n_s_m = 250.0"), ("damping".into(), "tyre: 250".into()));
        assert_eq!(of("phase_max_rad = 3.141592653589793"), ("phase max".into(), "3.142".into()));
        assert_eq!(of("mode = \"paper\""), ("mode".into(), "\"paper\"".into()));
        assert_eq!(of("m"), ("m".into(), "".into()));
    }
}
