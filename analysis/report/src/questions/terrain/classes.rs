//! Roughness classes: their shares by group, and class maps.

use super::{median, representative, too_small};
use crate::ReportError;
use crate::content::{Figure, Numbers, count, number, slug, text};
use crate::data::{Data, Group};
use crate::papers;
use crate::questions::clusters::band;
use crate::questions::relief::{MAP_WIDTH, class_map_words, extent};
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows, WIDTH};
use crate::render::map::{Key, Map};
use crate::render::svg::{Anchor, Paint, Stroke, Symbol, text_width};
use crate::render::{number as set, picture};
use crate::sample::sample;
use sastrugi_imaging::hillshade::exaggeration;
use sastrugi_schemas::tables::TerrainRow;
use sastrugi_schemas::{Cell, RoughnessClass};
use sastrugi_statistics::Interval;

/// Largest number of rows or columns of a class map.
const PIXELS: usize = 420;
/// Largest number of terrains of a group that have a ring in the chart of shares.
const RINGS_MAX: usize = 300;
/// Text on bars does not follow the theme.
const DARK: Paint = Paint::Fixed([0x1b, 0x20, 0x26]);
const LIGHT: Paint = Paint::Fixed([0xff, 0xff, 0xff]);

/// Class shares, then one map per group.
pub fn figures(data: &Data, groups: &[Group<TerrainRow>]) -> Result<Vec<Figure>, ReportError> {
    let mut figures: Vec<Figure> = shares(data, groups).into_iter().collect();
    for group in groups {
        figures.extend(map(data, group)?);
    }
    Ok(figures)
}

fn share(terrain: &TerrainRow, class: RoughnessClass) -> f64 {
    match class {
        RoughnessClass::Low => terrain.share_low,
        RoughnessClass::Semi => terrain.share_semi,
        RoughnessClass::High => terrain.share_high,
    }
}

/// A bar for each class and group (the median), with its sampling band and the published value, and a ring for each terrain.
fn shares(data: &Data, groups: &[Group<TerrainRow>]) -> Option<Figure> {
    let known: Vec<&Group<TerrainRow>> =
        groups.iter().filter(|g| median(&g.rows, |t| t.share_low).is_finite()).collect();
    if known.is_empty() {
        return None;
    }
    let small: Vec<&Group<TerrainRow>> = groups.iter().filter(|g| all_too_small(g)).collect();
    let label = |g: &&Group<TerrainRow>| RowLabel { name: g.name.clone(), detail: format!("n = {}", g.rows.len()) };
    let labels: Vec<RowLabel> = known.iter().chain(&small).map(label).collect();
    let bars = bars(data, &known);
    let mut rows = Rows::new(&labels, 84.0, (Axis::linear(0.0, 100.0), "share of the area, %"), &legend(data, &bars));
    bars.iter().for_each(|bar| share_bar(&mut rows, bar));
    (known.len()..labels.len()).for_each(|row| note_too_small(&mut rows, row));
    Some(shares_figure(data, rows, &known, &bars))
}

fn all_too_small(group: &Group<TerrainRow>) -> bool {
    group.rows.iter().all(|t| too_small(t))
}

/// The note in place of bars.
fn note_too_small(rows: &mut Rows, row: usize) {
    if let Some(x) = rows.x.clamped(0.0) {
        let at = (x + 6.0, rows.centre(row) + 4.3);
        rows.svg.text(at, Anchor::Start, Paint::Muted, "surface too small: all cells lie in the border");
    }
}

/// Median share of a class in a group, per cent, with its band, published value and terrains.
struct Bar {
    row: usize,
    class: RoughnessClass,
    /// Number of terrains.
    count: usize,
    /// Values of the terrains, or of a random sample of [`RINGS_MAX`] of them.
    drawn: Vec<f64>,
    median: f64,
    band: Option<Interval>,
    published: Option<f64>,
}

/// Name of a share in the table `terrains` and in papers.
fn column(class: RoughnessClass) -> &'static str {
    match class {
        RoughnessClass::Low => "share_low",
        RoughnessClass::Semi => "share_semi",
        RoughnessClass::High => "share_high",
    }
}

fn bars(data: &Data, groups: &[&Group<TerrainRow>]) -> Vec<Bar> {
    let paper = papers::applicable(data);
    let of_class = |class: RoughnessClass| {
        let percent = |t: &TerrainRow| 100.0 * share(t, class);
        let medians: Vec<(&str, f64)> = groups.iter().map(|g| (g.name.as_str(), median(&g.rows, percent))).collect();
        let marks = paper.as_ref().map_or_else(|| vec![None; groups.len()], |p| p.marks(column(class), &medians));
        let bar = move |((row, group), published): ((usize, &&Group<TerrainRow>), Option<f64>)| {
            let values: Vec<(&str, f64)> =
                group.rows.iter().map(|t| (t.terrain_id.as_str(), 100.0 * share(t, class))).collect();
            let band = band(data, &group.name, column(class), &values);
            let terrains = values.into_iter().map(|v| v.1).collect();
            let drawn = sample(terrains, RINGS_MAX, &mut data.stream(&group.name, &format!("rings {}", column(class))));
            let (count, median) = (group.rows.len(), median(&group.rows, percent));
            Bar { row, class, count, drawn, median, band, published }
        };
        groups.iter().enumerate().zip(marks).map(bar).collect::<Vec<_>>()
    };
    RoughnessClass::ALL.into_iter().flat_map(of_class).collect()
}

fn legend(data: &Data, bars: &[Bar]) -> Vec<Entry> {
    let mut entries = class_entries();
    if bars.iter().any(|b| b.band.is_some()) {
        entries.push((Mark::Line(Stroke::new(Paint::Ink, 2.2)), "sampling band of the median".into()));
    }
    let marked = bars.iter().find(|b| b.published.is_some());
    if let Some((paper, bar)) = papers::applicable(data).zip(marked) {
        entries.push((Mark::Symbol(Symbol::Diamond, Paint::Ink), papers::mark_in_words(&paper, column(bar.class))));
    }
    entries
}

fn share_bar(rows: &mut Rows, bar: &Bar) {
    let y = rows.centre(bar.row) + 25.0 * (bar.class as usize as f64 - 1.0) - 3.0;
    let at = |rows: &Rows, percent: f64| rows.x.clamped(percent);
    let (Some(zero), Some(end)) = (at(rows, 0.0), at(rows, bar.median)) else { return };
    rows.svg.rect((zero, y - 7.0), (end - zero, 13.0), Paint::Fixed(bar.class.colour()), 1.0);
    let terrains: Vec<f64> = bar.drawn.iter().filter_map(|t| at(rows, *t)).collect();
    terrains.iter().for_each(|&x| rows.svg.ring((x, y), 2.2, Stroke::new(Paint::Ink, 0.9).faint(0.6)));
    let mut last = terrains.iter().copied().fold(end, f64::max);
    if let Some((from, to)) = bar.band.and_then(|b| Some((at(rows, b.low)?, at(rows, b.high)?))) {
        rows.svg.segment((from, y + 10.0), (to, y + 10.0), Stroke::new(Paint::Ink, 2.2));
        rows.svg.disc((end, y + 10.0), 2.6, Paint::Ink, 1.0);
    }
    if let Some(x) = bar.published.and_then(|p| at(rows, p)) {
        rows.svg.symbol(Symbol::Diamond, (x, y), 5.4, Paint::Paper);
        rows.svg.symbol(Symbol::Diamond, (x, y), 4.0, Paint::Ink);
        last = last.max(x);
    }
    let value = format!("{} %", set::fixed(bar.median, 1));
    let width = text_width(&value, 11.5);
    // After the last mark; if there is no room, on the bar; if the bar is short, at the edge.
    let (x, anchor, paint) = match (last + 8.0 + width <= WIDTH, end - zero > width + 12.0) {
        (true, _) => (last + 8.0, Anchor::Start, Paint::Ink),
        (false, true) => (zero + 6.0, Anchor::Start, label_on(bar.class)),
        (false, false) => (WIDTH - 1.0, Anchor::End, Paint::Ink),
    };
    rows.svg.text_sized((x, y + 3.6), anchor, paint, 11.5, &value);
}

/// Text on a bar of the class colour.
fn label_on(class: RoughnessClass) -> Paint {
    if class == RoughnessClass::Low { LIGHT } else { DARK }
}

fn shares_figure(data: &Data, rows: Rows, groups: &[&Group<TerrainRow>], bars: &[Bar]) -> Figure {
    let in_words = |g: &&Group<TerrainRow>| {
        let parts =
            RoughnessClass::ALL.map(|c| format!("{} {}", c.name(), set::percent(median(&g.rows, |t| share(t, c)), 1)));
        format!("group {}: {}", g.name, parts.join(", "))
    };
    Figure {
        id: "class-shares".into(),
        title: papers::title(data, "class-shares", "Shares of the roughness classes."),
        caption: format!(
            "Bars and numbers are medians over terrains; circles are {}. Medians need not add up to 100 %.",
            if bars.iter().any(|bar| bar.drawn.len() < bar.count) {
                format!("the terrains, or a random sample of {RINGS_MAX} of a group")
            } else {
                "the terrains".to_owned()
            }
        ),
        description: format!("Median shares. {}.", groups.iter().map(in_words).collect::<Vec<_>>().join("; ")),
        svg: rows.svg,
        numbers: share_numbers(groups, bars),
    }
}

/// Numbers of the bars; without the columns of bands and of a paper if no bar has any.
fn share_numbers(groups: &[&Group<TerrainRow>], bars: &[Bar]) -> Numbers {
    let (bands, paper) = (bars.iter().any(|b| b.band.is_some()), bars.iter().any(|b| b.published.is_some()));
    let of_bands = [("band, 5 %", "%"), ("band, 95 %", "%")];
    let columns: Vec<(&str, &str)> = [("group", ""), ("class", ""), ("terrains", "1"), ("median", "%")]
        .into_iter()
        .chain(of_bands.into_iter().filter(|_| bands))
        .chain([("paper", "%")].into_iter().filter(|_| paper))
        .collect();
    let mut numbers = Numbers::computed(super::TERRAINS, &columns);
    for bar in bars {
        let head = [text(&groups[bar.row].name), text(bar.class.name()), count(bar.count), number(bar.median)];
        let ends = bar.band.map_or([f64::NAN; 2], |b| [b.low, b.high]).map(number);
        let published = number(bar.published.unwrap_or(f64::NAN));
        let tail = ends.into_iter().filter(|_| bands).chain([published].into_iter().filter(|_| paper));
        numbers.row(head.into_iter().chain(tail));
    }
    numbers
}

fn class_entries() -> Vec<Entry> {
    RoughnessClass::ALL.map(|c| (Mark::Fill(Paint::Fixed(c.colour())), c.name().to_owned())).into()
}

/// The class map of the group's representative; `None` for groups with missions, whose class maps are drawn with the missions.
fn map(data: &Data, group: &Group<TerrainRow>) -> Result<Option<Figure>, ReportError> {
    let driven = |t: &&TerrainRow| !data.missions_on(&t.terrain_id).is_empty();
    let Some(terrain) = representative(group).filter(|_| !group.rows.iter().any(driven)) else { return Ok(None) };
    let path = format!("classes/{}.tif", terrain.terrain_id);
    let Some(codes) = data.files.classes(&path)? else { return Ok(None) };
    let heights = data.files.grid(&terrain.path)?;
    let picture = picture::classes(&codes, heights.as_ref(), exaggeration(terrain.rms_slope), PIXELS)?;
    let class = |c| (Mark::Fill(Paint::Fixed(picture::class_colour(c))), RoughnessClass::name(c).to_owned());
    let map = Map::new(&picture, MAP_WIDTH, &Key::Entries(&RoughnessClass::ALL.map(class)));
    let columns = [("file", ""), ("rows", "1"), ("cols", "1"), ("cell_x_m", "m")];
    let mut numbers = Numbers::of_file(path.as_str(), &columns);
    numbers.row([text(path), Cell::I64(terrain.rows), Cell::I64(terrain.cols), number(terrain.cell_x_m)]);
    Ok(Some(Figure {
        id: slug(&format!("classes-{}", terrain.terrain_id)),
        title: format!("Classes, group {}.", group.name),
        caption: format!("{}: {} over its relief.", terrain.terrain_id, class_map_words(data)),
        description: format!("Map of roughness classes, {}.", extent(&codes)),
        svg: map.svg,
        numbers,
    }))
}
