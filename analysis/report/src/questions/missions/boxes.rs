//! Box plots by group, with intervals of the medians and published medians where there are any.

use super::{METRICS, Metric, interval};
use crate::content::{Figure, Numbers, Size, TableBlock, count, number, slug, text};
use crate::data::{Data, Group};
use crate::papers;
use crate::questions::outcome;
use crate::render::axis::Axis;
use crate::render::chart::{Beside, Entry, Mark, RowLabel, Rows};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_schemas::tables::MissionRow;
use sastrugi_statistics::{BoxPlot, Interval};
use std::collections::{BTreeMap, BTreeSet};

/// How much outliers may widen an axis on either side, in lengths of what stands without them.
const OUTLIERS_WIDEN: f64 = 0.5;

/// A group as it is drawn.
pub struct Sample<'a> {
    group: String,
    index: usize,
    /// Terrain and value.
    values: Vec<(&'a str, f64)>,
    plot: BoxPlot,
    interval: Option<Interval>,
    published: Option<f64>,
}

impl Sample<'_> {
    fn terrains(&self) -> usize {
        self.values.iter().map(|v| v.0).collect::<BTreeSet<_>>().len()
    }
}

/// Shares of successful missions, one value per terrain.
pub fn success(data: &Data, groups: &[Group<MissionRow>]) -> Option<Figure> {
    let samples = samples(data, groups, "success", success_shares);
    let several = samples.iter().any(|s| s.values.len() > 1);
    let words = Words {
        id: "success-by-terrain".into(),
        title: "Success on each terrain.".into(),
        axis: "successful missions, %".into(),
        n_is: "terrains",
        query: "tables/missions, share of outcome = 'success' by terrain".into(),
        value: ("success_percent", "%"),
    };
    several.then(|| figure(&samples, words))
}

/// Samples of every figure that is compared between groups.
pub fn measured<'a>(data: &Data, groups: &[Group<'a, MissionRow>]) -> Vec<(&'static Metric, Vec<Sample<'a>>)> {
    METRICS.iter().map(|m| (m, samples(data, groups, m.column, |g| successful(g, m)))).collect()
}

/// One figure of the successful missions; `None` when no mission has it.
pub fn metric((metric, samples): &(&Metric, Vec<Sample>)) -> Option<Figure> {
    let words = Words {
        id: slug(metric.column),
        title: format!("{}.", capital(metric.name)),
        axis: format!("{}, {}", metric.name, metric.unit),
        n_is: "successful missions",
        query: format!("tables/missions where outcome = 'success', column {}", metric.column),
        value: (metric.column, metric.unit),
    };
    (!samples.is_empty()).then(|| figure(samples, words))
}

/// Medians, quartiles and intervals of every figure and group.
pub fn medians(measured: &[(&Metric, Vec<Sample>)]) -> TableBlock {
    let columns = [
        ("figure", ""),
        ("unit", ""),
        ("group", ""),
        ("missions", ""),
        ("terrains", ""),
        ("first quartile", ""),
        ("median", ""),
        ("third quartile", ""),
        ("interval, low", ""),
        ("interval, high", ""),
        ("outliers", ""),
    ];
    let mut numbers = Numbers::new("tables/missions where outcome = 'success', by group", &columns);
    for (metric, samples) in measured {
        for s in samples {
            let end = |f: fn(&Interval) -> f64| s.interval.as_ref().map_or(f64::NAN, f);
            numbers.row([
                text(metric.name),
                text(metric.unit),
                text(&s.group),
                count(s.plot.count),
                count(s.terrains()),
                number(s.plot.quartile_low),
                number(s.plot.median),
                number(s.plot.quartile_high),
                number(end(|i| i.low)),
                number(end(|i| i.high)),
                count(s.plot.outliers.len()),
            ]);
        }
    }
    TableBlock { id: "mission-medians".into(), caption: "Successful missions by group".into(), numbers }
}

fn samples<'a>(
    data: &Data,
    groups: &[Group<'a, MissionRow>],
    figure: &str,
    values: impl Fn(&Group<'a, MissionRow>) -> Vec<(&'a str, f64)>,
) -> Vec<Sample<'a>> {
    let published = papers::applicable(data);
    let sample = |g: &Group<'a, MissionRow>| {
        let values = values(g);
        let plot = BoxPlot::of(&values.iter().map(|v| v.1).collect::<Vec<_>>())?;
        let interval = interval(data, &g.name, figure, &values);
        let published = published.as_ref().and_then(|p| p.value(figure, &g.name));
        Some(Sample { group: g.name.clone(), index: g.index, values, plot, interval, published })
    };
    groups.iter().filter_map(sample).collect()
}

fn successful<'a>(group: &Group<'a, MissionRow>, metric: &Metric) -> Vec<(&'a str, f64)> {
    let goals = group.rows.iter().filter(|m| outcome::successful(m));
    goals.map(|m| (m.terrain_id.as_str(), (metric.of)(m))).filter(|v| v.1.is_finite()).collect()
}

fn success_shares<'a>(group: &Group<'a, MissionRow>) -> Vec<(&'a str, f64)> {
    let mut terrains: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for mission in &group.rows {
        let (goals, all) = terrains.entry(&mission.terrain_id).or_default();
        *goals += usize::from(outcome::successful(mission));
        *all += 1;
    }
    terrains.into_iter().map(|(id, (goals, all))| (id, 100.0 * goals as f64 / all as f64)).collect()
}

/// The words around a box plot.
struct Words {
    id: String,
    title: String,
    axis: String,
    n_is: &'static str,
    query: String,
    value: (&'static str, &'static str),
}

fn figure(samples: &[Sample], words: Words) -> Figure {
    let label = |s: &Sample| RowLabel { name: s.group.clone(), detail: format!("n = {}", s.plot.count) };
    let labels: Vec<RowLabel> = samples.iter().map(label).collect();
    let axis = axis(samples);
    let beyond = match beyond(samples, &axis) {
        0 => String::new(),
        n => format!(" {} beyond the axis: triangles at its edge.", set::counted(n, "value")),
    };
    let mut rows = Rows::new(&labels, 54.0, (axis, &words.axis), &legend(samples));
    for (row, s) in samples.iter().enumerate() {
        let beside = Beside { interval: s.interval.map(|i| (i.low, i.high)), published: s.published };
        rows.box_plot(row, &s.plot, beside, Paint::Series(s.index));
    }
    let mut numbers = Numbers::new(words.query, &[("group", ""), ("terrain_id", ""), words.value]);
    for s in samples {
        s.values.iter().for_each(|v| numbers.row([text(&s.group), text(v.0), number(v.1)]));
    }
    Figure {
        id: words.id,
        title: words.title,
        caption: format!("n counts {}.{beyond}", words.n_is),
        description: describe(samples, &words.axis),
        svg: rows.svg,
        size: Size::Column,
        numbers,
    }
}

/// The axis holds all boxes, whiskers and published medians; outliers widen it by no more than [`OUTLIERS_WIDEN`].
fn axis(samples: &[Sample]) -> Axis {
    let ends = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    };
    let inner = |s: &Sample| [s.plot.whisker_low, s.plot.whisker_high, s.published.unwrap_or(s.plot.median)];
    let (low, high) = ends(&mut samples.iter().flat_map(inner));
    let (lowest, highest) = ends(&mut samples.iter().flat_map(|s| s.values.iter().map(|v| v.1)));
    let room = (OUTLIERS_WIDEN * (high - low)).max(1e-3 * high.abs());
    let (low, high) = (low.min(lowest.max(low - room)), high.max(highest.min(high + room)));
    let margin = 0.04 * (high - low);
    Axis::linear(low - margin, high + margin)
}

/// Outliers that the axis does not reach.
fn beyond(samples: &[Sample], axis: &Axis) -> usize {
    let (low, high) = axis.range();
    samples.iter().flat_map(|s| &s.plot.outliers).filter(|v| **v < low || **v > high).count()
}

fn legend(samples: &[Sample]) -> Vec<Entry> {
    let mut entries = Vec::new();
    if samples.iter().any(|s| s.interval.is_some()) {
        entries.push((Mark::Line(Stroke::new(Paint::Ink, 2.2)), "95 % interval of the median".into()));
    }
    if samples.iter().any(|s| s.published.is_some()) {
        entries.push((Mark::Symbol(Symbol::Diamond, Paint::Ink), "published median".into()));
    }
    entries
}

fn describe(samples: &[Sample], axis: &str) -> String {
    let group = |s: &Sample| {
        let interval = s.interval.map_or_else(String::new, |i| {
            format!(", 95 % interval {} to {}", set::significant(i.low, 3), set::significant(i.high, 3))
        });
        format!("group {}: median {}{interval}, n = {}", s.group, set::significant(s.plot.median, 3), s.plot.count)
    };
    format!("Box plots of {axis}. {}.", samples.iter().map(group).collect::<Vec<_>>().join("; "))
}

fn capital(words: &str) -> String {
    let mut chars = words.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}
