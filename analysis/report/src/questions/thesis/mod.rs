//! Published routes and formations of Bayrak (2008) compared with ours, as ratios.

use super::Question;
use super::routes::maps::legend_track;
use super::routes::methods::{found, geometric_mean, methods};
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, count, number, slug, text};
use crate::data::{Data, Natural, natural};
use crate::papers::bayrak::{self, PublishedRoute, Thesis, kind};
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_schemas::capital;
use sastrugi_schemas::tables::{FormationRow, RouteRow};
use std::collections::{BTreeMap, BTreeSet};

/// Registry entry.
pub const QUESTION: Question = Question {
    id: "thesis",
    name: "Bayrak (2008)",
    title: "How do routes and formations compare with those of Bayrak (2008)?",
    answer,
};

/// Fewest values of ours for a verdict: the next value falls between the smallest and the largest of six with a probability of 5/7.
const VALUES_MIN: usize = 6;
/// Members of the teams in the thesis.
const MEMBERS: i64 = 4;

/// A quantity that is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Quantity {
    id: &'static str,
    name: &'static str,
    unit: &'static str,
}

const SHARE: Quantity = Quantity { id: "share", name: "vertices relative to cells", unit: "%" };
const SEARCHED: Quantity = Quantity { id: "searched", name: "A* cost relative to the grid", unit: "1" };
const SMOOTHED: Quantity = Quantity { id: "smoothed", name: "smoothed cost relative to the grid", unit: "1" };
const GAIN: Quantity = Quantity { id: "gain", name: "smoothed cost relative to A* cost", unit: "1" };
const DEPTH: Quantity = Quantity { id: "depth", name: "depth error relative to spacing", unit: "%" };
const WIDTH: Quantity = Quantity { id: "width", name: "width error relative to spacing", unit: "%" };

impl Quantity {
    fn of_teams(self) -> bool {
        self == DEPTH || self == WIDTH
    }
}

/// A published value and ours.
struct Row {
    quantity: Quantity,
    group: String,
    /// Method or formation.
    of: String,
    paper: f64,
    origin: String,
    /// Number of the line of a method in the section on routes; `None` for a formation.
    colour: Option<usize>,
    /// Terrain and value.
    ours: Vec<(String, f64)>,
}

impl Row {
    fn mean(&self) -> f64 {
        geometric_mean(self.ours.iter().map(|v| v.1))
    }

    fn ends(&self) -> (f64, f64) {
        self.ours.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v.1), h.max(v.1)))
    }

    /// Whether the published value lies between our smallest and largest value; `None` if we have too few.
    fn inside(&self) -> Option<bool> {
        let (low, high) = self.ends();
        (self.ours.len() >= VALUES_MIN).then_some(low <= self.paper && self.paper <= high)
    }
}

/// Routes, then formations, as far as we have values.
fn all_rows(data: &Data, thesis: &Thesis) -> Vec<Row> {
    let mut rows = route_rows(data, thesis);
    rows.extend(formation_rows(data, thesis));
    rows.retain(|r| !r.ours.is_empty());
    rows
}

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let Some(thesis) = bayrak::applicable(data) else { return Ok(Vec::new()) };
    let rows = all_rows(data, &thesis);
    if rows.is_empty() {
        return Ok(Vec::new());
    }
    let mut blocks: Vec<Block> = verdict(&rows).map(Block::Result).into_iter().collect();
    blocks.push(Block::Text(introduction(&thesis)));
    blocks.push(Block::Figures([SHARE, SMOOTHED, DEPTH, WIDTH].into_iter().filter_map(|q| figure(&rows, q)).collect()));
    blocks.extend(tables(&rows));
    Ok(blocks)
}

fn verdict(rows: &[Row]) -> Option<String> {
    let known: Vec<bool> = rows.iter().filter_map(Row::inside).collect();
    let inside = known.iter().filter(|i| **i).count();
    let open = match rows.len() - known.len() {
        0 => String::new(),
        n => format!("; for {} more, we have too few values for a verdict", set::count(n)),
    };
    (!known.is_empty()).then(|| {
        format!(
            "{} of {} published ratios lie{} between our smallest and largest value{open} (Bayrak, 2008).",
            if inside == 0 { "None".into() } else { set::count(inside) },
            set::count(known.len()),
            if inside < 2 { "s" } else { "" }
        )
    })
}

fn introduction(thesis: &Thesis) -> String {
    format!(
        "{} ({}, {}) tested one map of each kind and size, with one pair of opposite corners whose margin the thesis does not state, so costs can only be \
         compared as ratios. Heights and number of hills are not printed either; our maps share only the kind and the size. The band spans our smallest to \
         largest value over pairs and terrains: of n exchangeable values, the next falls inside with a probability of (n − 1)/(n + 1); below {} values there \
         is no verdict. Means are geometric. Our A* costs are evaluated again in steps of a quarter cell. Errors of formations are compared with the teams on \
         the 2000 × 2000 map of the same kind, as means over followers.",
        thesis.author,
        thesis.year,
        thesis.title,
        set::count(VALUES_MIN)
    )
}

/// Routes by label, in natural order.
fn by_group(data: &Data) -> BTreeMap<Natural, Vec<&RouteRow>> {
    let mut groups: BTreeMap<Natural, Vec<&RouteRow>> = BTreeMap::new();
    for route in data.routes.iter().filter(|r| found(r)) {
        groups.entry(natural(route.group.as_deref().unwrap_or_default())).or_default().push(route);
    }
    groups
}

fn route_rows(data: &Data, thesis: &Thesis) -> Vec<Row> {
    let methods = methods(&data.routes);
    let mut rows = Vec::new();
    for (group, routes) in by_group(data) {
        let Some(map) = thesis.map(&group.1) else { continue };
        let Some(grid) = map.route("grid") else { continue };
        for printed in &map.methods {
            let own: Vec<&RouteRow> =
                routes.iter().copied().filter(|r| bayrak::method(r) == Some(printed.method.as_str())).collect();
            let colour = own.first().and_then(|route| methods.iter().position(|m| m.holds(route)));
            let mut row = |quantity: Quantity, paper: f64, ours: Vec<(String, f64)>| {
                let (group, of, origin) =
                    (group.1.clone(), method_name(&printed.method).to_owned(), map.origin.clone());
                rows.push(Row { quantity, group, of, paper, origin, colour, ours });
            };
            let single = |of: fn(&RouteRow) -> f64| own.iter().map(|r| (r.terrain_id.clone(), of(r))).collect();
            row(GAIN, printed.smoothed_cost / printed.searched_cost, single(|r| r.smoothed_cost_m / r.path_cost_m));
            if printed.method == "grid" {
                continue;
            }
            let share = |p: &PublishedRoute| 100.0 * p.vertices as f64 / map.cells as f64;
            row(SHARE, share(printed), single(|r| 100.0 * r.vertices as f64 / r.free_cells as f64));
            row(SEARCHED, printed.searched_cost / grid.searched_cost, over_grid(&routes, &own, |r| r.path_cost_m));
            row(SMOOTHED, printed.smoothed_cost / grid.smoothed_cost, over_grid(&routes, &own, |r| r.smoothed_cost_m));
        }
    }
    rows
}

/// Costs relative to those of the grid between the same ends.
fn over_grid(routes: &[&RouteRow], own: &[&RouteRow], of: fn(&RouteRow) -> f64) -> Vec<(String, f64)> {
    let key = |r: &RouteRow| (r.terrain_id.clone(), r.pair_id.clone());
    let grid: BTreeMap<_, f64> =
        routes.iter().filter(|r| bayrak::method(r) == Some("grid")).map(|r| (key(r), of(r))).collect();
    let ratio = |r: &&RouteRow| Some((r.terrain_id.clone(), of(r) / grid.get(&key(r))?));
    own.iter().filter_map(ratio).filter(|v| v.1.is_finite() && v.1 > 0.0).collect()
}

fn method_name(method: &str) -> &str {
    match method {
        "hdt2" => "HDT 2",
        "hdt5" => "HDT 5",
        "nohdt" => "NoHDT",
        other => other,
    }
}

/// A metric of a run.
type Metric = fn(&FormationRow) -> f64;

/// Teams of four without losses on maps of a kind that the thesis has.
fn formation_rows(data: &Data, thesis: &Thesis) -> Vec<Row> {
    let mut groups: BTreeMap<(Natural, &str), Vec<&FormationRow>> = BTreeMap::new();
    let alike =
        |f: &&FormationRow| f.members == MEMBERS && f.lost == 0 && f.variant.is_none() && f.outcome == "arrived";
    for run in data.formations.iter().filter(alike) {
        let label = run.group.as_deref().unwrap_or_default();
        groups.entry((natural(label), &run.formation)).or_default().push(run);
    }
    let mut rows = Vec::new();
    for ((group, formation), runs) in groups {
        let printed = thesis.formations.iter().find(|f| kind(&f.group) == kind(&group.1) && f.formation == formation);
        let Some(printed) = printed.filter(|_| thesis.map(&group.1).is_some()) else { continue };
        let depth: Metric = |f| f.depth_error_m;
        let errors = [(DEPTH, &printed.depth_errors, depth), (WIDTH, &printed.width_errors, |f| f.width_error_m)];
        for (quantity, values, of) in errors {
            let paper = 100.0 * sastrugi_numeric::sums::mean(values) / thesis.spacing;
            let ours = runs.iter().map(|r| (r.terrain_id.clone(), 100.0 * of(r) / r.spacing_m));
            let ours = ours.filter(|v| v.1.is_finite() && v.1 > 0.0).collect();
            let origin = format!("Table 5.5, {}", printed.group);
            let (group, of) = (group.1.clone(), formation.to_owned());
            rows.push(Row { quantity, group, of, paper, origin, colour: None, ours });
        }
    }
    rows
}

/// Our values as a band with its mean and the published value as a diamond, with a lane for each method or formation.
fn figure(rows: &[Row], quantity: Quantity) -> Option<Figure> {
    let rows: Vec<&Row> = rows.iter().filter(|r| r.quantity == quantity).collect();
    let values = || rows.iter().flat_map(|r| [r.paper, r.ends().0, r.ends().1]);
    let (low, high) = values().fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    if rows.is_empty() || low <= 0.0 {
        return None;
    }
    let names: Vec<&str> = rows.iter().map(|r| r.of.as_str()).collect::<BTreeSet<_>>().into_iter().collect();
    let groups: Vec<&[&Row]> = rows.chunk_by(|a, b| a.group == b.group).collect();
    let label = |g: &&[&Row]| RowLabel {
        name: g[0].group.clone(),
        detail: format!("n = {}", g.iter().map(|r| r.ours.len()).max().unwrap_or(0)),
    };
    let labels: Vec<RowLabel> = groups.iter().map(label).collect();
    let line = |i: usize| Stroke { width: 3.0, ..legend_track(i) };
    let colour = |name: &str| {
        let own = rows.iter().find(|row| row.of == name).and_then(|row| row.colour);
        own.unwrap_or_else(|| names.iter().position(|other| *other == name).unwrap_or(0))
    };
    let mut entries: Vec<Entry> = names.iter().map(|n| (Mark::Line(line(colour(n))), (*n).to_owned())).collect();
    entries.push((Mark::Symbol(Symbol::Diamond, Paint::Ink), "published".into()));
    let height = 15.0 * names.len() as f64 + 16.0;
    let unit = if quantity.unit == "1" { String::new() } else { format!(", {}", quantity.unit) };
    let title = format!("{}{unit}", quantity.name);
    let mut drawn = Rows::new(&labels, height, (Axis::log(low / 1.1, high * 1.1), &title), &entries);
    for (g, group) in groups.iter().enumerate() {
        for (k, row) in group.iter().enumerate() {
            let y = drawn.centre(g) + 15.0 * (k as f64 - 0.5 * (group.len() as f64 - 1.0));
            draw(&mut drawn, y, row, line(colour(&row.of)));
        }
    }
    if quantity == SMOOTHED {
        drawn.vertical(1.0, groups.len());
    }
    Some(Figure {
        id: slug(&format!("bayrak-{}", quantity.id)),
        title: format!("{}: published and ours.", capital(quantity.name)),
        caption: "Lines span our smallest to largest value; ticks are geometric means; diamonds are the published values. n is the number of our values."
            .into(),
        description: describe(&rows, &title),
        svg: drawn.svg,
        numbers: numbers(&rows),
    })
}

fn draw(drawn: &mut Rows, y: f64, row: &Row, stroke: Stroke) {
    let axis = drawn.x;
    let (low, high) = row.ends();
    if let (Some(from), Some(to)) = (axis.at(low), axis.at(high)) {
        drawn.svg.segment((from - 1.0, y), (to + 1.0, y), stroke.faint(0.6));
    }
    if let Some(x) = axis.at(row.mean()) {
        drawn.svg.segment((x, y - 6.0), (x, y + 6.0), Stroke { width: 2.4, dash: "", ..stroke });
    }
    if let Some(x) = axis.at(row.paper) {
        drawn.svg.symbol(Symbol::Diamond, (x, y), 4.8, Paint::Paper);
        drawn.svg.symbol(Symbol::Diamond, (x, y), 3.6, Paint::Ink);
    }
}

fn describe(rows: &[&Row], title: &str) -> String {
    let row = |r: &&Row| {
        format!("{} {}: published {}, ours {}", r.group, r.of, set::plain(r.paper, 3), set::plain(r.mean(), 3))
    };
    format!("{title}. {}.", rows.iter().map(row).collect::<Vec<_>>().join("; "))
}

/// A table of the routes and one of the formations, where there are rows.
fn tables(rows: &[Row]) -> Vec<Block> {
    let (teams, routes): (Vec<&Row>, Vec<&Row>) = rows.iter().partition(|r| r.quantity.of_teams());
    let table = |id: &str, what: &str, rows: Vec<&Row>| {
        let caption = format!("{what}: Bayrak (2008) and this release");
        Block::Table(TableBlock { id: id.into(), caption, numbers: numbers(&rows) })
    };
    let tables = [("bayrak-routes", "Routes", routes), ("bayrak-formations", "Formations", teams)];
    tables.into_iter().filter(|t| !t.2.is_empty()).map(|(id, what, rows)| table(id, what, rows)).collect()
}

fn numbers(rows: &[&Row]) -> Numbers {
    let columns = [
        ("ratio", ""),
        ("unit", ""),
        ("group", ""),
        ("method or formation", ""),
        ("published", ""),
        ("ours", ""),
        ("smallest", ""),
        ("largest", ""),
        ("values", ""),
        ("terrains", ""),
        ("published is", ""),
        ("printed in", ""),
    ];
    let query = if rows.iter().any(|r| r.quantity.of_teams()) {
        "select \"group\", terrain_id, formation, depth_error_m, width_error_m, spacing_m from 'tables/formations/*.parquet' where outcome = 'arrived' \
         and lost = 0 and members = 4 and variant is null"
    } else {
        "select \"group\", terrain_id, pair_id, stage_id, method, threshold_m, vertices, free_cells, path_cost_m, smoothed_cost_m from \
         'tables/routes/*.parquet' where outcome = 'found' and variant is null"
    };
    let mut numbers = Numbers::computed(query, &columns).with_mixed_units();
    for row in rows {
        let terrains = row.ours.iter().map(|v| v.0.as_str()).collect::<BTreeSet<_>>().len();
        let verdict = row.inside().map_or(set::ABSENT, |inside| if inside { "inside" } else { "outside" });
        let (low, high) = row.ends();
        numbers.row([
            text(row.quantity.name),
            text(if row.quantity.unit == "1" { "" } else { row.quantity.unit }),
            text(&row.group),
            text(&row.of),
            number(row.paper),
            number(row.mean()),
            number(low),
            number(high),
            count(row.ours.len()),
            count(terrains),
            text(verdict),
            text(&row.origin),
        ]);
    }
    numbers
}
