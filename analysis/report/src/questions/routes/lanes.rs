//! Values of every pair by group, with a lane for each method: ratios of cost and of effort, shares of vertices.

use super::methods::{Method, found, geometric_mean, groups, vertex_share};
use super::ratios::{Pair, Ratio};
use crate::content::{Figure, Numbers, number, text};
use crate::data::Data;
use crate::papers::bayrak;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_statistics::Interval;

/// Height of a lane, px.
const LANE: f64 = 15.0;
/// Space between groups, px.
const GAP: f64 = 16.0;

/// A group in a figure.
struct Row {
    group: String,
    lanes: Vec<Lane>,
    /// Published smallest and largest value.
    band: Option<(f64, f64)>,
}

/// A method in a row.
struct Lane {
    method: usize,
    /// Terrain and value.
    values: Vec<(String, f64)>,
    interval: Option<Interval>,
}

/// What is drawn.
struct Strip<'a> {
    id: &'static str,
    title: &'static str,
    axis: &'static str,
    column: &'static str,
    caption: &'a str,
    query: &'static str,
    one: bool,
}

/// The figures that have values.
pub fn figures(data: &Data, methods: &[Method], ratios: &[Ratio]) -> Vec<Figure> {
    let beside = "Marks are pairs of start and goal; the tick is their geometric mean, and the bar below it the interval of the mean where there \
                  are enough terrains.";
    let query = "select \"group\", terrain_id, pair_id, stage_id, variant, smoothed_cost_m, expansions from 'tables/routes/*.parquet' where outcome = 'found'";
    let cost = Strip {
        id: "route-cost-ratios",
        title: "Smoothed cost relative to the reference.",
        axis: "smoothed cost / reference",
        column: "cost_ratio",
        caption: beside,
        query,
        one: true,
    };
    let effort = Strip {
        id: "route-expansion-ratios",
        title: "Search effort relative to the reference.",
        axis: "expansions / reference",
        column: "expansion_ratio",
        ..cost
    };
    let banded = if bayrak::applicable(data).is_some() {
        " Grey bands: shares in Bayrak (2008) for roadmaps without threshold on maps of the same kind, of all sizes."
    } else {
        ""
    };
    let caption = format!("Marks are routes; the tick is their geometric mean.{banded}");
    let shares = Strip {
        id: "vertex-shares",
        title: "Vertices of the search graph.",
        axis: "vertices, % of the cells that may be entered",
        column: "vertex_share_percent",
        caption: &caption,
        query: "select \"group\", terrain_id, stage_id, variant, 100 * vertices / free_cells from 'tables/routes/*.parquet' where outcome = 'found'",
        one: false,
    };
    let ratio_rows = |of: fn(&Pair) -> f64, interval: fn(&Ratio) -> Option<Interval>| {
        let lane = |r: &Ratio| Lane {
            method: r.method,
            values: r.pairs.iter().map(|p| (p.terrain_id.clone(), of(p))).collect(),
            interval: interval(r),
        };
        let chunks = ratios.chunk_by(|a, b| a.group == b.group);
        chunks.map(|c| Row { group: c[0].group.clone(), lanes: c.iter().map(lane).collect(), band: None }).collect()
    };
    [
        figure(&cost, methods, ratio_rows(|p| p.cost, |r| r.cost)),
        figure(&effort, methods, ratio_rows(|p| p.expansions, |r| r.expansions)),
        figure(&shares, methods, share_rows(data, methods)),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Shares of vertices of the roadmap methods; a grid uses all cells.
fn share_rows(data: &Data, methods: &[Method]) -> Vec<Row> {
    let paper = bayrak::applicable(data);
    let row = |(group, routes): (String, Vec<&sastrugi_schemas::tables::RouteRow>)| {
        let lane = |(method, m): (usize, &Method)| {
            let own = routes.iter().filter(|r| m.holds(r) && found(r) && r.method == "roadmap");
            let values = own.map(|r| (r.terrain_id.clone(), 100.0 * vertex_share(r))).collect();
            Lane { method, values, interval: None }
        };
        let lanes = methods.iter().enumerate().map(lane).filter(|l| !l.values.is_empty()).collect();
        let band = paper.as_ref().and_then(|p| p.share_band(&group));
        Row { group, lanes, band }
    };
    groups(data).into_iter().map(row).filter(|r: &Row| !r.lanes.is_empty()).collect()
}

fn figure(strip: &Strip, methods: &[Method], rows: Vec<Row>) -> Option<Figure> {
    let usable = |v: &&(String, f64)| v.1 > 0.0 && v.1.is_finite();
    let values = || rows.iter().flat_map(|r| &r.lanes).flat_map(|l| &l.values).filter(usable).map(|v| v.1);
    let bands = || rows.iter().filter_map(|r| r.band).flat_map(|b| [b.0, b.1]);
    let (low, high) = values().chain(bands()).fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    if high <= 0.0 {
        return None;
    }
    let (low, high) = if strip.one { (low.min(1.0), high.max(1.0)) } else { (low, high) };
    let most = rows.iter().map(|r| r.lanes.len()).max().unwrap_or(1);
    let height = LANE * most as f64 + GAP;
    let label = |r: &Row| {
        let n = r.lanes.iter().map(|l| l.values.len()).max().unwrap_or(0);
        RowLabel { name: r.group.clone(), detail: format!("n = {n}") }
    };
    let labels: Vec<RowLabel> = rows.iter().map(label).collect();
    let occurs = |i: &usize| rows.iter().flat_map(|r| &r.lanes).any(|l| l.method == *i);
    let entry = |i: usize| (Mark::Symbol(symbol(i), Paint::Series(i)), methods[i].name.clone());
    let entries: Vec<Entry> = (0..methods.len()).filter(occurs).map(entry).collect();
    let mut drawn = Rows::new(&labels, height, (Axis::log(low / 1.1, high * 1.1), strip.axis), &entries);
    for (i, row) in rows.iter().enumerate() {
        let centre = drawn.centre(i);
        draw_band(&mut drawn, centre, height - 4.0, row.band);
        for (k, lane) in row.lanes.iter().enumerate() {
            let y = centre + LANE * (k as f64 - 0.5 * (row.lanes.len() as f64 - 1.0));
            draw_lane(&mut drawn, y, lane);
        }
    }
    if strip.one {
        drawn.vertical(1.0, rows.len());
    }
    Some(Figure {
        id: strip.id.into(),
        title: strip.title.into(),
        caption: strip.caption.into(),
        description: describe(strip, methods, &rows),
        svg: drawn.svg,
        numbers: numbers(strip, methods, &rows),
    })
}

fn draw_band(drawn: &mut Rows, y: f64, height: f64, band: Option<(f64, f64)>) {
    if let Some((Some(from), Some(to))) = band.map(|(low, high)| (drawn.x.clamped(low), drawn.x.clamped(high))) {
        // A single published map is a line.
        drawn.svg.rect((from - 1.0, y - 0.5 * height), (to - from + 2.0, height), Paint::Muted, 0.22);
    }
}

fn draw_lane(drawn: &mut Rows, y: f64, lane: &Lane) {
    let paint = Paint::Series(lane.method);
    let axis = drawn.x;
    for x in lane.values.iter().filter_map(|v| axis.at(v.1)) {
        drawn.svg.symbol(symbol(lane.method), (x, y), 2.6, paint);
    }
    if let Some((Some(from), Some(to))) = lane.interval.map(|i| (axis.at(i.low), axis.at(i.high))) {
        drawn.svg.segment((from, y + 5.5), (to, y + 5.5), Stroke::new(Paint::Ink, 1.8));
    }
    if let Some(x) = axis.at(geometric_mean(lane.values.iter().map(|v| v.1))) {
        drawn.svg.segment((x, y - 6.0), (x, y + 6.0), Stroke::new(Paint::Ink, 1.8));
    }
}

/// Mark of a method, which distinguishes it without colour.
fn symbol(method: usize) -> Symbol {
    let all =
        [Symbol::Disc, Symbol::Square, Symbol::Triangle, Symbol::Diamond, Symbol::Ring, Symbol::Cross, Symbol::Frame];
    all[method % all.len()]
}

fn describe(strip: &Strip, methods: &[Method], rows: &[Row]) -> String {
    let lane = |l: &Lane| {
        format!("{} {}", methods[l.method].name, set::plain(geometric_mean(l.values.iter().map(|v| v.1)), 3))
    };
    let row = |r: &Row| format!("{}: {}", r.group, r.lanes.iter().map(lane).collect::<Vec<_>>().join(", "));
    format!("{}, geometric means. {}.", strip.axis, rows.iter().map(row).collect::<Vec<_>>().join("; "))
}

fn numbers(strip: &Strip, methods: &[Method], rows: &[Row]) -> Numbers {
    let columns = [("group", ""), ("method", ""), ("terrain_id", ""), (strip.column, "1")];
    let mut numbers = Numbers::computed(strip.query, &columns);
    for (row, lane) in rows.iter().flat_map(|r| r.lanes.iter().map(move |l| (r, l))) {
        for (terrain, value) in &lane.values {
            numbers.row([text(&row.group), text(&methods[lane.method].name), text(terrain), number(*value)]);
        }
    }
    numbers
}
