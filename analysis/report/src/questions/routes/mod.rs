//! How good the routes are: vertices, cost and effort by group of terrains and method, ratios to a reference over common pairs, maps.

mod lanes;
pub mod maps;
pub mod methods;
mod ratios;

use super::Question;
use super::clusters::LEVEL;
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, count, number, text};
use crate::data::Data;
use crate::render::number as set;
use crate::sample::{ROWS_MAX, sample};
use methods::{Method, found, geometric_mean, groups, methods};
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::RouteRow;

/// Registry entry.
pub const QUESTION: Question = Question { id: "routes", name: "Routes", title: "How good are the routes?", answer };

/// Fewest terrains for a bootstrap interval: six give 462 different bootstrap samples, three only ten.
pub const TERRAINS_MIN: usize = 6;

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let methods = methods(&data.routes);
    let ratios = ratios::ratios(data, &methods);
    let mut blocks = Vec::new();
    if data.routes.is_empty() {
        return Ok(blocks);
    }
    blocks.push(Block::Result(in_words(data, &methods, &ratios)));
    blocks.extend(missing(data).map(Block::Warning));
    blocks.push(Block::Table(summary(data, &methods)));
    blocks.push(Block::Figures(lanes::figures(data, &methods, &ratios)));
    if !ratios.is_empty() {
        blocks.push(Block::Text(ratio_words(ratios::have_intervals(&ratios))));
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

/// How many searches found a route, how long the routes are, and how the methods compare.
fn in_words(data: &Data, methods: &[Method], ratios: &[ratios::Ratio]) -> String {
    let reached: Vec<&RouteRow> = data.routes.iter().filter(|r| found(r)).collect();
    let searches =
        if data.routes.len() == 1 { "1 search".into() } else { format!("{} searches", set::count(data.routes.len())) };
    let by = if methods.len() > 1 { format!(" by {} methods", set::count(methods.len())) } else { String::new() };
    let detour = sums::median(&sums::finite(&reached.iter().map(|r| r.length_m / r.straight_m).collect::<Vec<_>>()));
    let length = match detour.is_finite() {
        true => format!("; the median length is {} times the straight distance", set::significant(detour, 3)),
        false => String::new(),
    };
    let counts = format!("{} of {searches}{by} found a route{length}.", set::count(reached.len()));
    match verdict(methods, ratios) {
        Some(compared) => format!("{counts} {compared}"),
        None => counts,
    }
}

/// The first map of routes; empty if the release has none.
pub(super) fn picture(data: &Data) -> Result<Vec<Figure>, ReportError> {
    if data.routes.is_empty() {
        return Ok(Vec::new());
    }
    Ok(maps::first(data, &methods(&data.routes), "summary-routes-clip")?.into_iter().collect())
}

/// One sentence for each method, which compares it with its reference.
fn verdict(methods: &[Method], ratios: &[ratios::Ratio]) -> Option<String> {
    let pooled = |method: usize| {
        let values: Vec<&ratios::Pair> = ratios.iter().filter(|r| r.method == method).flat_map(|r| &r.pairs).collect();
        let mean = |of: fn(&ratios::Pair) -> f64| geometric_mean(values.iter().map(|p| of(p)));
        let reference = ratios.iter().find(|r| r.method == method)?.reference;
        Some((method, reference, values.len(), mean(|p| p.cost), mean(|p| p.expansions)))
    };
    let sentence = |(method, reference, pairs, cost, expansions): (usize, usize, usize, f64, f64)| {
        format!(
            "Smoothed routes of {} cost {} times those of {}, and the search expands {} times as many vertices ({}).",
            methods[method].name,
            set::significant(cost, 3),
            methods[reference].name,
            set::significant(expansions, 2),
            set::counted(pairs, "common pair")
        )
    };
    let words: Vec<String> = (0..methods.len()).filter_map(pooled).map(sentence).collect();
    (!words.is_empty()).then(|| format!("{} Factors are geometric means over all groups.", words.join(" ")))
}

/// How many searches found no route, and why.
fn missing(data: &Data) -> Option<String> {
    let of = |outcome: &str| data.routes.iter().filter(|r| r.outcome == outcome).count();
    let (none, budget) = (of("no_path"), of("budget"));
    let missing = data.routes.len() - data.routes.iter().filter(|r| found(r)).count();
    let causes =
        [(none, "because none exists within the limits"), (budget, "because the search ran out of expansions")];
    let causes: Vec<String> =
        causes.iter().filter(|(n, _)| *n > 0).map(|(n, why)| format!("{} {why}", set::count(*n))).collect();
    (missing > 0).then(|| {
        format!(
            "{} of {} found no route{}. Medians and ratios cover only the routes found, so a method that fails on the hard pairs looks \
             better than it is.",
            set::count(missing),
            if data.routes.len() == 1 { "1 search".into() } else { format!("{} searches", set::count(data.routes.len())) },
            if causes.is_empty() { String::new() } else { format!(": {}", causes.join(", ")) }
        )
    })
}

/// What the ratios are; some or none of them have intervals.
fn ratio_words(with_intervals: bool) -> String {
    let few = format!("fewer than {TERRAINS_MIN} terrains give too few different samples for an interval");
    let intervals = match with_intervals {
        true => format!(
            "The {} % interval resamples whole terrains, because pairs on one terrain are correlated; {few}, and only the smallest and largest \
             ratio are given.",
            set::fixed(100.0 * LEVEL, 0)
        ),
        false => format!("There are no intervals: pairs on one terrain are correlated, and {few}."),
    };
    format!(
        "A ratio compares two methods between the same start and goal, by the cost of the smoothed path in steps of a quarter cell. The reference \
         is the grid search with the same limits and cost if there is one, otherwise the first such method. Means are geometric. {intervals}"
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
    let mut numbers = Numbers::computed(query, &columns);
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
        caption: "Routes by group and method, medians over the routes found".into(),
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
    let listed = sample(data.routes.iter().collect(), ROWS_MAX, &mut data.stream("routes", "listed"));
    let numbers = Numbers::select("", listed, &names).of_all(data.routes.len());
    TableBlock { id: "routes".into(), caption: "All routes".into(), numbers }
}
