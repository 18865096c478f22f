//! Routes of all methods between one start and goal of each group, over the relief.

use super::methods::{Method, found, groups};
use crate::ReportError;
use crate::content::{Figure, Numbers, slug};
use crate::data::{Data, of_key};
use crate::questions::relief::{MAP_WIDTH, exaggeration_words, extent};
use crate::questions::sql::quoted;
use crate::render::chart::{Entry, Mark};
use crate::render::colour::NO_DATA;
use crate::render::map::{Key, Map};
use crate::render::svg::{Paint, SERIES, Stroke, Symbol};
use crate::render::{number as set, picture, thin};
use sastrugi_imaging::hillshade::exaggeration;
use sastrugi_numeric::Grid;
use sastrugi_schemas::tables::{RoutePointRow, RouteRow};

/// Largest number of groups drawn.
const GROUPS_MAX: usize = 12;
/// Largest number of rows or columns of a relief.
const PIXELS: usize = 420;
/// Marks on maps do not follow the theme.
pub const DARK: Paint = Paint::Fixed([0x1b, 0x20, 0x26]);
/// Halo that sets marks off from the ground.
pub const LIGHT: Paint = Paint::Fixed([0xff, 0xff, 0xff]);
/// Dashes by number, so that nothing depends on colour alone.
const DASHES: [&str; 6] = ["", "7 3", "2 3", "9 3 2 3", "5 2 1 2 1 2", "1 4"];

/// Line by number on a picture. Each time the colours have been through, they have the next dashes: the first 36 lines differ.
pub fn track(index: usize) -> Stroke {
    let dash = DASHES[(index + index / SERIES.len()) % DASHES.len()];
    Stroke::new(Paint::Fixed(SERIES[index % SERIES.len()]), 1.9).dashed(dash)
}

/// The same in a legend, which follows the theme.
pub fn legend_track(index: usize) -> Stroke {
    Stroke { paint: Paint::Series(index), ..track(index) }
}

/// What is drawn, and how many maps there are.
pub fn words(maps: usize) -> String {
    let what = match maps {
        1 => "One map".to_owned(),
        n => format!("{}, one for each group (at most {GROUPS_MAX})", set::counted(n, "map")),
    };
    format!(
        "{what}: of the pairs that most methods connect, the one whose first route has the median smoothed cost (the lower middle of an even \
         number, the first of equals). Lines are smoothed routes."
    )
}

/// A map for each group with a route whose relief is in the release.
pub fn figures(data: &Data, methods: &[Method]) -> Result<Vec<Figure>, ReportError> {
    let points = data.files.route_points()?;
    let mut figures = Vec::new();
    for (group, routes) in groups(data).into_iter().take(GROUPS_MAX) {
        let clip = format!("{}-clip", slug(&format!("routes-{group}")));
        figures.extend(figure(data, methods, &points, (group.as_str(), &middle(&routes)[..]), &clip)?);
    }
    Ok(figures)
}

/// The first of these maps; `clip` is a name that is unique on the page.
pub fn first(data: &Data, methods: &[Method], clip: &str) -> Result<Option<Figure>, ReportError> {
    let points = data.files.route_points()?;
    for (group, routes) in groups(data).into_iter().take(GROUPS_MAX) {
        if let Some(map) = figure(data, methods, &points, (group.as_str(), &middle(&routes)[..]), clip)? {
            return Ok(Some(map));
        }
    }
    Ok(None)
}

/// Routes of the pair with the median cost among those that most methods connect.
fn middle<'a>(routes: &[&'a RouteRow]) -> Vec<&'a RouteRow> {
    let mut pairs: std::collections::BTreeMap<(&str, &str), Vec<&RouteRow>> = Default::default();
    for route in routes.iter().filter(|r| found(r) && r.variant.is_none()) {
        pairs.entry((&route.terrain_id, &route.pair_id)).or_default().push(route);
    }
    let most = pairs.values().map(Vec::len).max().unwrap_or(0);
    let mut ranked: Vec<Vec<&RouteRow>> = pairs.into_values().filter(|p| p.len() == most).collect();
    ranked.sort_by(|a, b| a[0].smoothed_cost_m.total_cmp(&b[0].smoothed_cost_m));
    let at = ranked.len().saturating_sub(1) / 2;
    if ranked.is_empty() { Vec::new() } else { ranked.swap_remove(at) }
}

fn figure(
    data: &Data,
    methods: &[Method],
    points: &[RoutePointRow],
    (group, routes): (&str, &[&RouteRow]),
    clip: &str,
) -> Result<Option<Figure>, ReportError> {
    let Some(first) = routes.first() else { return Ok(None) };
    let Some(terrain) = data.terrain(&first.terrain_id) else { return Ok(None) };
    let Some(grid) = ground(data, &terrain.path, first)? else { return Ok(None) };
    let Some(range) = grid.range() else { return Ok(None) };
    let factor = exaggeration(terrain.rms_slope);
    let picture = picture::relief(&grid, range, factor, PIXELS)?;
    let id = slug(&format!("routes-{group}"));
    let number_of = |route: &RouteRow| methods.iter().position(|m| m.holds(route)).unwrap_or(0);
    let entry = |r: &&RouteRow| {
        let cost = set::with_unit(r.smoothed_cost_m, 4, "m");
        (Mark::Line(legend_track(number_of(r))), format!("{}: {cost}", r.stage_id))
    };
    let ends =
        [(Symbol::Ring, "start"), (Symbol::Disc, "goal")].map(|(s, w)| (Mark::Symbol(s, Paint::Ink), w.to_owned()));
    let entries: Vec<Entry> = routes.iter().map(entry).chain(ends).chain(closed(&grid)).collect();
    let mut map = Map::new(&picture, MAP_WIDTH, &Key::Entries(&entries));
    map.clip(clip);
    for route in routes {
        draw(&mut map, &line_of(points, route), track(number_of(route)));
    }
    draw_ends(&mut map, first);
    map.svg.close();
    let costs: Vec<String> = entries.iter().take(routes.len()).map(|e| e.1.clone()).collect();
    let condition = format!("terrain_id = {} and pair_id = {}", quoted(&first.terrain_id), quoted(&first.pair_id));
    let condition = format!("{condition} and outcome = 'found' and variant is null");
    let columns =
        ["route_id", "method", "threshold_m", "smoothed_cost_m", "length_m", "vertices", "expansions", "path"];
    Ok(Some(Figure {
        id,
        title: format!("Routes, group {group}."),
        caption: format!("{}. Costs are in metres of level ground.{}", terrain.terrain_id, exaggeration_words(factor)),
        description: format!("Map of routes, {}; smoothed costs: {}.", extent(&grid), costs.join(", ")),
        svg: map.svg,
        numbers: Numbers::select(&condition, routes.iter().copied(), &columns),
    }))
}

/// Heights of a terrain without the cells that a route's obstacles block. `None` where the release has no such file.
pub fn ground(data: &Data, path: &str, route: &RouteRow) -> Result<Option<Grid>, ReportError> {
    let Some(mut heights) = data.files.grid(path)? else { return Ok(None) };
    let blocked = format!("route/{}/{}.blocked.tif", route.terrain_id, route.stage_id);
    let Some(blocked) = data.files.classes(&blocked)? else { return Ok(Some(heights)) };
    let geometry = heights.geometry;
    for (k, height) in heights.values.iter_mut().enumerate() {
        let (x, y) = (geometry.x(k % geometry.cols), geometry.y(k / geometry.cols));
        if blocked.geometry.cell_at(x, y).is_some_and(|(row, col)| blocked.at(row, col) == 1) {
            *height = f64::NAN;
        }
    }
    Ok(Some(heights))
}

/// Legend entry of cells without data; `None` if there are none.
pub fn closed(grid: &Grid) -> Option<Entry> {
    let any = grid.finite_count() < grid.values.len();
    any.then(|| (Mark::Fill(Paint::Fixed(NO_DATA)), "cannot be entered".to_owned()))
}

/// The smoothed path of a route; empty if the release does not have its points.
fn line_of(points: &[RoutePointRow], route: &RouteRow) -> Vec<(f64, f64)> {
    let of_terrain = of_key(points, |p| &p.terrain_id, &route.terrain_id);
    let own = of_key(of_terrain, |p| &p.route_id, &route.route_id);
    let line: Vec<(f64, f64)> = own.iter().filter(|p| p.form == "smoothed").map(|p| (p.x_m, p.y_m)).collect();
    thin::every(&line, 400)
}

/// A line with a light edge.
pub fn draw(map: &mut Map, line: &[(f64, f64)], stroke: Stroke) {
    let placed: Vec<(f64, f64)> = line.iter().filter_map(|&(x, y)| map.at(x, y)).collect();
    map.svg.polyline(&placed, Stroke::new(LIGHT, stroke.width + 1.8).faint(0.7));
    map.svg.polyline(&placed, stroke);
}

fn draw_ends(map: &mut Map, route: &RouteRow) {
    let ends = [(route.start_x_m, route.start_y_m, Symbol::Ring), (route.goal_x_m, route.goal_y_m, Symbol::Disc)];
    for (x, y, symbol) in ends {
        if let Some(at) = map.at(x, y) {
            map.svg.disc(at, 6.0, LIGHT, 1.0);
            map.svg.symbol(symbol, at, 4.2, DARK);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{track, words};
    use std::collections::BTreeSet;

    /// Colours repeat after six lines; colour and dashes together do not.
    #[test]
    fn val_many_lines_are_told_apart() {
        let lines: BTreeSet<String> = (0..36).map(|k| format!("{:?} {}", track(k).paint, track(k).dash)).collect();
        assert_eq!(lines.len(), 36);
    }

    #[test]
    fn val_maps_are_counted_where_there_are_several() {
        assert!(words(1).starts_with("One map: of the pairs"));
        assert!(words(3).starts_with("3 maps, one for each group (at most 12): of the pairs"));
    }
}
