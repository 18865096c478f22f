//! How good the routes are: vertices, costs and effort by group of terrains and method, ratios to a reference over common pairs, maps.

mod lanes;
pub mod maps;
pub mod methods;
mod ratios;

use super::Question;
use super::clusters::LEVEL;
use crate::ReportError;
use crate::content::{Block, Numbers, TableBlock, count, number, text};
use crate::data::Data;
use crate::render::number as set;
use methods::{Method, found, geometric_mean, groups, methods};
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::RouteRow;

/// Registry entry.
pub const QUESTION: Question = Question { id: "routes", name: "Routes", title: "How good are the routes?", answer };

/// Fewest terrains for a bootstrap interval: six give 462 different redraws, three only ten.
pub const TERRAINS_MIN: usize = 6;

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let methods = methods(&data.routes);
    let ratios = ratios::ratios(data, &methods);
    let mut blocks = Vec::new();
    if data.routes.is_empty() {
        return Ok(blocks);
    }
    blocks.extend(verdict(&methods, &ratios).map(Block::Text));
    blocks.extend(missing(data).map(Block::Warning));
    blocks.push(Block::Table(summary(data, &methods)));
    blocks.push(Block::Figures(lanes::figures(data, &methods, &ratios)));
    if !ratios.is_empty() {
        blocks.push(Block::Text(ratio_words()));
        blocks.push(Block::Table(ratios::table(&ratios)));
    }
    let maps = maps::figures(data, &methods)?;
    if !maps.is_empty() {
        blocks.extend([
            Block::Heading("Where the routes lead".into()),
            Block::Text(maps::words(maps.len())),
            Block::Figures(maps),
        ]);
    }
    blocks.push(Block::FoldedTable(all(data)));
    Ok(blocks)
}

/// One sentence for each reference: the cheapest and the dearest method beside it.
fn verdict(methods: &[Method], ratios: &[ratios::Ratio]) -> Option<String> {
    let pooled = |method: usize| {
        let values: Vec<&ratios::Pair> = ratios.iter().filter(|r| r.method == method).flat_map(|r| &r.pairs).collect();
        let mean = |of: fn(&ratios::Pair) -> f64| geometric_mean(values.iter().map(|p| of(p)));
        let reference = ratios.iter().find(|r| r.method == method)?.reference;
        Some((method, reference, values.len(), mean(|p| p.cost), mean(|p| p.expansions)))
    };
    let sentence = |(method, reference, pairs, cost, expansions): (usize, usize, usize, f64, f64)| {
        format!(
            "{} costs {} times the route of {} and expands {} times the vertices ({}).",
            methods[method].name,
            set::plain(cost, 3),
            methods[reference].name,
            set::plain(expansions, 2),
            set::counted(pairs, "common pair")
        )
    };
    let words: Vec<String> = (0..methods.len()).filter_map(pooled).map(sentence).collect();
    (!words.is_empty()).then(|| format!("Geometric means over all groups, smoothed routes: {}", words.join(" ")))
}

/// How many routes were not found, and how.
fn missing(data: &Data) -> Option<String> {
    let of = |outcome: &str| data.routes.iter().filter(|r| r.outcome == outcome).count();
    let (none, budget) = (of("no_path"), of("budget"));
    let missing = data.routes.len() - data.routes.iter().filter(|r| found(r)).count();
    (missing > 0).then(|| {
        format!(
            "{} of {} searches found no route: {} because none exists within the limits, {} because the search used up its \
             expansions. Medians and ratios are of the routes found, and a method that fails on the hard pairs looks better by them.",
            set::count(missing),
            set::count(data.routes.len()),
            set::count(none),
            set::count(budget)
        )
    })
}

fn ratio_words() -> String {
    format!(
        "A ratio compares two methods between the same start and goal, by the cost of the smoothed path along quarter cells. Reference is the \
         grid search with the same limits and cost where there is one, else the first such method. Means are geometric. The {} % interval draws \
         whole terrains anew, because pairs on one terrain resemble each other; with fewer than {TERRAINS_MIN} terrains such redraws are too coarse for \
         an interval, and the smallest and largest ratio stand alone.",
        set::fixed(100.0 * LEVEL, 0)
    )
}

/// Medians by group and method.
fn summary(data: &Data, methods: &[Method]) -> TableBlock {
    let columns = [
        ("group", ""),
        ("method", ""),
        ("search", ""),
        ("pairs", "1"),
        ("found", "1"),
        ("vertex share", "%"),
        ("vertices", "1"),
        ("edges", "1"),
        ("expansions", "1"),
        ("search cost", "m"),
        ("path cost", "m"),
        ("smoothed cost", "m"),
    ];
    let query = "select \"group\", stage_id, variant, method, outcome, free_cells, vertices, edges, expansions, search_cost_m, path_cost_m, \
                 smoothed_cost_m from 'tables/routes/*.parquet'";
    let mut numbers = Numbers::computed(query, &columns).with_mixed_units();
    for (group, routes) in groups(data) {
        for method in methods {
            let rows: Vec<&RouteRow> = routes.iter().copied().filter(|r| method.holds(r)).collect();
            let reached: Vec<&RouteRow> = rows.iter().copied().filter(|r| found(r)).collect();
            let median = |of: fn(&RouteRow) -> f64| {
                number(sums::median(&sums::finite(&reached.iter().map(|r| of(r)).collect::<Vec<_>>())))
            };
            if rows.is_empty() {
                continue;
            }
            numbers.row([
                text(&group),
                text(&method.name),
                text(&method.search),
                count(rows.len()),
                count(reached.len()),
                median(|r| 100.0 * methods::vertex_share(r)),
                median(|r| r.vertices as f64),
                median(|r| r.edges as f64),
                median(|r| r.expansions as f64),
                median(|r| r.search_cost_m),
                median(|r| r.path_cost_m),
                median(|r| r.smoothed_cost_m),
            ]);
        }
    }
    TableBlock {
        id: "routes-by-method".into(),
        caption: "Routes by group and method, medians of those found".into(),
        numbers,
    }
}

fn all(data: &Data) -> TableBlock {
    let names = [
        "terrain_id",
        "route_id",
        "group",
        "variant",
        "method",
        "outcome",
        "straight_m",
        "length_m",
        "smoothed_cost_m",
        "cost_bound",
        "vertices",
        "repaired",
        "expansions",
        "steepest_up_deg",
        "steepest_down_deg",
        "path",
    ];
    TableBlock { id: "routes".into(), caption: "All routes".into(), numbers: Numbers::select("", &data.routes, &names) }
}
