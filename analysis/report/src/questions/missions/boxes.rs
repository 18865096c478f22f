//! Box plots by group, with sampling bands of the medians and published medians where there are any.

use super::{METRICS, Metric};
use crate::content::{Figure, Numbers, TableBlock, count, number, slug, text};
use crate::data::{Data, Group, Mission};
use crate::papers;
use crate::questions::clusters::band;
use crate::questions::outcome;
use crate::questions::sql;
use crate::render::axis::Axis;
use crate::render::chart::{Beside, Entry, Mark, RowLabel, Rows};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use crate::sample::{ROWS_MAX, sample};
use sastrugi_schemas::capital;
use sastrugi_statistics::{BoxPlot, Interval};
use std::collections::{BTreeMap, BTreeSet};

/// How much outliers may widen an axis on either side, as a multiple of its length without them.
const OUTLIERS_WIDEN: f64 = 0.5;
/// Largest number of outliers of a group that are drawn.
const OUTLIERS_MAX: usize = 500;

/// A group as drawn.
pub struct Sample<'a> {
    group: String,
    index: usize,
    /// Number of terrains with values.
    terrains: usize,
    /// Terrain and value, or a random sample of them.
    listed: Vec<(&'a str, f64)>,
    /// Lowest and highest value.
    ends: (f64, f64),
    plot: BoxPlot,
    band: Option<Interval>,
    published: Option<f64>,
}

/// A metric that is compared between groups, and its values.
pub struct Compared<'a> {
    name: &'static str,
    unit: &'static str,
    /// Name in the papers, and of the random stream of its band.
    figure: &'static str,
    n_is: &'static str,
    query: String,
    samples: Vec<Sample<'a>>,
}

/// Success on each terrain, then the metrics of the successful missions.
pub fn compared<'a>(data: &Data, groups: &[Group<'a, Mission>]) -> Vec<Compared<'a>> {
    let success = Compared {
        name: "success on a terrain",
        unit: "%",
        figure: "success",
        n_is: "terrains",
        query: format!(
            "{} group by all",
            sql::missions(data, "terrain_id, 100 * avg(if(outcome = 'success', 1, 0))", None)
        ),
        samples: samples(data, groups, "success", success_shares),
    };
    let metric = |m: &'static Metric| Compared {
        name: m.name,
        unit: m.unit,
        figure: m.column,
        n_is: "successful missions",
        query: sql::missions(data, &format!("terrain_id, {}", m.column), Some("success")),
        samples: samples(data, groups, m.column, |g| successful(g, m)),
    };
    std::iter::once(success).chain(METRICS.iter().map(metric)).collect()
}

/// True if any median has a sampling band.
pub fn have_bands(compared: &[Compared]) -> bool {
    compared.iter().flat_map(|figure| &figure.samples).any(|s| s.band.is_some())
}

/// Medians, quartiles and sampling bands of every metric and group.
pub fn medians(data: &Data, compared: &[Compared]) -> TableBlock {
    let columns = [
        ("metric", ""),
        ("unit", ""),
        ("group", ""),
        ("values", ""),
        ("terrains", ""),
        ("first quartile", ""),
        ("median", ""),
        ("third quartile", ""),
        ("band, 5 %", ""),
        ("band, 95 %", ""),
        ("outliers", ""),
    ];
    let mut numbers = Numbers::computed(sql::compared(data), &columns).with_mixed_units();
    for figure in compared {
        for s in &figure.samples {
            let end = |f: fn(&Interval) -> f64| s.band.as_ref().map_or(f64::NAN, f);
            numbers.row([
                text(figure.name),
                text(figure.unit),
                text(&s.group),
                count(s.plot.count),
                count(s.terrains),
                number(s.plot.quartile_low),
                number(s.plot.median),
                number(s.plot.quartile_high),
                number(end(|i| i.low)),
                number(end(|i| i.high)),
                count(s.plot.outliers.len()),
            ]);
        }
    }
    let caption = "Success per terrain, and metrics of successful missions, by group".into();
    TableBlock { id: "mission-medians".into(), caption, numbers }
}

fn samples<'a>(
    data: &Data,
    groups: &[Group<'a, Mission>],
    figure: &str,
    values: impl Fn(&Group<'a, Mission>) -> Vec<(&'a str, f64)>,
) -> Vec<Sample<'a>> {
    let values: Vec<Vec<(&'a str, f64)>> = groups.iter().map(values).collect();
    let is_long = values.iter().map(Vec::len).sum::<usize>() > ROWS_MAX;
    let listed_max = if is_long { ROWS_MAX / groups.len() } else { ROWS_MAX };
    let of_group = |(g, values): (&Group<'a, Mission>, Vec<(&'a str, f64)>)| {
        let plot = BoxPlot::of(&values.iter().map(|v| v.1).collect::<Vec<_>>())?;
        let band = band(data, &g.name, figure, &values);
        let terrains = values.iter().map(|v| v.0).collect::<BTreeSet<_>>().len();
        let ends = ends(values.iter().map(|v| v.1));
        let listed = sample(values, listed_max, &mut data.stream(&g.name, &format!("listed {figure}")));
        let (group, index) = (g.name.clone(), g.index);
        Some(Sample { group, index, terrains, listed, ends, plot, band, published: None })
    };
    let mut samples: Vec<Sample<'a>> = groups.iter().zip(values).filter_map(of_group).collect();
    if let Some(paper) = papers::applicable(data) {
        let medians: Vec<(&str, f64)> = samples.iter().map(|s| (s.group.as_str(), s.plot.median)).collect();
        let marks = paper.marks(figure, &medians);
        samples.iter_mut().zip(marks).for_each(|(s, mark)| s.published = mark);
    }
    samples
}

/// Values of the successful missions of a group, with their terrains.
pub fn successful<'a>(group: &Group<'a, Mission>, metric: &Metric) -> Vec<(&'a str, f64)> {
    let goals = group.rows.iter().filter(|m| outcome::successful(m));
    goals.map(|m| (m.terrain_id.as_str(), (metric.of)(m))).filter(|v| v.1.is_finite()).collect()
}

/// Share of successful missions on each terrain of a group, %.
pub fn success_shares<'a>(group: &Group<'a, Mission>) -> Vec<(&'a str, f64)> {
    let mut terrains: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for mission in &group.rows {
        let (goals, all) = terrains.entry(&mission.terrain_id).or_default();
        *goals += usize::from(outcome::successful(mission));
        *all += 1;
    }
    terrains.into_iter().map(|(id, (goals, all))| (id, 100.0 * goals as f64 / all as f64)).collect()
}

/// Box plots of a metric; `None` when no mission has it, or when success is known on only one terrain per group.
pub fn figure(data: &Data, compared: &Compared) -> Option<Figure> {
    let samples = &compared.samples;
    if samples.is_empty() || compared.figure == "success" && samples.iter().all(|s| s.plot.count < 2) {
        return None;
    }
    let label = |s: &Sample| RowLabel { name: s.group.clone(), detail: format!("n = {}", s.plot.count) };
    let labels: Vec<RowLabel> = samples.iter().map(label).collect();
    let axis = axis(samples);
    let beyond = match beyond(samples, &axis) {
        0 => String::new(),
        n => format!(" Triangles at the edge: {} beyond the axis.", set::counted(n, "value")),
    };
    let of_outliers = match samples.iter().any(|s| s.plot.outliers.len() > OUTLIERS_MAX) {
        true => {
            format!(
                " Where more than {OUTLIERS_MAX} values of a group lie beyond the whiskers, {OUTLIERS_MAX} of them, drawn at random, \
                 are shown."
            )
        }
        false => String::new(),
    };
    let axis_title = format!("{}, {}", compared.name, compared.unit);
    let mut rows = Rows::new(&labels, 54.0, (axis, &axis_title), &legend(data, compared));
    for (row, s) in samples.iter().enumerate() {
        let beside = Beside { interval: s.band.map(|i| (i.low, i.high)), published: s.published };
        let mut stream = data.stream(&s.group, &format!("outliers {}", compared.figure));
        let outliers = sample(s.plot.outliers.clone(), OUTLIERS_MAX, &mut stream);
        rows.box_plot(row, &BoxPlot { outliers, ..s.plot.clone() }, beside, Paint::Series(s.index));
    }
    let id = if compared.figure == "success" { "success-by-terrain".into() } else { slug(compared.figure) };
    let title = papers::title(data, &id, &format!("{}.", capital(compared.name)));
    Some(Figure {
        title,
        caption: format!("n is the number of {}.{beyond}{of_outliers}", compared.n_is),
        description: describe(samples, &axis_title),
        svg: rows.svg,
        numbers: numbers(compared),
        id,
    })
}

fn numbers(compared: &Compared) -> Numbers {
    let column = if compared.figure == "success" { "success_percent" } else { compared.figure };
    let mut numbers =
        Numbers::new(compared.query.clone(), &[("group", ""), ("terrain_id", ""), (column, compared.unit)]);
    for s in &compared.samples {
        s.listed.iter().for_each(|v| numbers.row([text(&s.group), text(v.0), number(v.1)]));
    }
    numbers.of_all(compared.samples.iter().map(|s| s.plot.count).sum())
}

/// The axis holds all boxes, whiskers and published medians; outliers widen it by no more than [`OUTLIERS_WIDEN`]. Of few values, a quartile may
/// lie beyond the whisker: it is interpolated towards an outlier.
fn axis(samples: &[Sample]) -> Axis {
    let inner = |s: &Sample| {
        let BoxPlot { whisker_low, quartile_low, quartile_high, whisker_high, .. } = s.plot;
        [whisker_low, quartile_low, quartile_high, whisker_high, s.published.unwrap_or(s.plot.median)]
    };
    let (low, high) = ends(samples.iter().flat_map(inner));
    let (lowest, highest) = ends(samples.iter().flat_map(|s| [s.ends.0, s.ends.1]));
    let room = (OUTLIERS_WIDEN * (high - low)).max(1e-3 * high.abs());
    let (low, high) = (low.min(lowest.max(low - room)), high.max(highest.min(high + room)));
    let margin = 0.04 * (high - low);
    Axis::linear(low - margin, high + margin)
}

/// Lowest and highest value.
fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
}

/// Number of outliers beyond the axis.
fn beyond(samples: &[Sample], axis: &Axis) -> usize {
    let (low, high) = axis.range();
    samples.iter().flat_map(|s| &s.plot.outliers).filter(|v| **v < low || **v > high).count()
}

fn legend(data: &Data, compared: &Compared) -> Vec<Entry> {
    let mut entries = Vec::new();
    if compared.samples.iter().any(|s| s.band.is_some()) {
        entries.push((Mark::Line(Stroke::new(Paint::Ink, 2.2)), "sampling band of the median".into()));
    }
    let marked = compared.samples.iter().any(|s| s.published.is_some());
    if let Some(paper) = papers::applicable(data).filter(|_| marked) {
        entries.push((Mark::Symbol(Symbol::Diamond, Paint::Ink), papers::mark_in_words(&paper, compared.figure)));
    }
    entries
}

fn describe(samples: &[Sample], axis: &str) -> String {
    let group = |s: &Sample| {
        let band = s.band.map_or_else(String::new, |i| {
            format!(", sampling band {} to {}", set::significant(i.low, 3), set::significant(i.high, 3))
        });
        let paper = s.published.map_or_else(String::new, |p| format!(", paper {}", set::significant(p, 3)));
        format!("group {}: median {}{band}{paper}, n = {}", s.group, set::significant(s.plot.median, 3), s.plot.count)
    };
    format!("Box plots of {axis}. {}.", samples.iter().map(group).collect::<Vec<_>>().join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: of 0, 1, 2 and 10, the quartiles are 0.75 and 4, and 10 is an outlier, so the whisker ends at 2, within the box. The axis holds the
    /// box.
    #[test]
    fn val_the_axis_holds_the_box_of_few_values() {
        let values = [0.0, 1.0, 2.0, 10.0];
        let plot = BoxPlot::of(&values).unwrap();
        assert_eq!((plot.whisker_high, plot.quartile_high, &plot.outliers[..]), (2.0, 4.0, &[10.0][..]));
        let sample = Sample {
            group: "g".into(),
            index: 0,
            terrains: 1,
            listed: Vec::new(),
            ends: ends(values.into_iter()),
            plot,
            band: None,
            published: None,
        };
        let (low, high) = axis(&[sample]).range();
        assert!(low < 0.0 && high > 4.0, "{low} to {high}");
    }
}
