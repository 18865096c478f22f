//! Tracks over the relief with its rocks: one world of each set.

use super::outcomes::{ALL, index, track};
use super::sets::{Set, World};
use super::worlds::EFFICIENCY;
use crate::ReportError;
use crate::content::{Figure, Numbers, slug};
use crate::data::{Data, of_key};
use crate::questions::relief::extent;
use crate::questions::routes::maps::{DARK, LIGHT};
use crate::questions::sql::quoted;
use crate::render::chart::{Entry, Mark, WIDTH};
use crate::render::colour::Rgb;
use crate::render::map::{Key, Map};
use crate::render::svg::{Paint, Symbol};
use crate::render::{number as set_number, picture, thin};
use sastrugi_numeric::Grid;
use sastrugi_schemas::tables::{RoverRow, RoverSampleRow, TerrainRow};

/// Sets drawn.
const SETS_MAX: usize = 6;
/// Tracks on one map.
const TRACKS_MAX: usize = 25;
/// Largest number of rows or columns of a picture.
const PIXELS: usize = 560;
/// Margin around the tracks, as a share of their extent.
const MARGIN: f64 = 0.06;
/// Least distance between points drawn, px.
const STEP_PX: f64 = 1.6;
/// Sand and rock.
const GROUND: [(u8, Rgb); 2] = [(0, [0xee, 0xdf, 0xc0]), (1, [0x6d, 0x5f, 0x55])];

/// What is drawn, in words.
pub const WORDS: &str = "One world of each set: the one with the median mean efficiency (the lower middle of an even number). If a world has \
many rovers, only some of them, evenly chosen, are drawn.";

/// A map for each set whose world has samples and heights in the release.
pub fn figures(data: &Data, sets: &[Set]) -> Result<Vec<Figure>, ReportError> {
    let mut figures = Vec::new();
    for set in sets.iter().take(SETS_MAX) {
        if let Some(world) = middle(set) {
            let clip = format!("{}-clip", slug(&format!("rover-tracks-{}", set.name)));
            figures.extend(figure(data, set, world, &clip)?);
        }
    }
    Ok(figures)
}

/// The first of these maps; `clip` is a name that is unique on the page.
pub fn first(data: &Data, sets: &[Set], clip: &str) -> Result<Option<Figure>, ReportError> {
    for set in sets.iter().take(SETS_MAX) {
        let Some(world) = middle(set) else { continue };
        if let Some(map) = figure(data, set, world, clip)? {
            return Ok(Some(map));
        }
    }
    Ok(None)
}

fn middle<'a, 'b>(set: &'b Set<'a>) -> Option<&'b World<'a>> {
    let mut ranked: Vec<(&World, f64)> = set.worlds.iter().map(|w| (w, EFFICIENCY.of(w))).collect();
    ranked.sort_by(|a, b| a.1.total_cmp(&b.1));
    ranked.get(ranked.len().saturating_sub(1) / 2).map(|r| r.0)
}

fn figure(data: &Data, set: &Set, world: &World, clip: &str) -> Result<Option<Figure>, ReportError> {
    let Some(terrain) = data.terrain(world.terrain_id) else { return Ok(None) };
    let Some(heights) = data.files.grid(&terrain.path)? else { return Ok(None) };
    let samples = data.files.rover_samples(world.terrain_id)?;
    let rovers = thin::every(&world.rovers, TRACKS_MAX);
    let paths: Vec<Vec<(f64, f64)>> = rovers.iter().map(|r| path(&samples, r)).collect();
    if paths.iter().all(|p| p.len() < 2) || heights.range().is_none() {
        return Ok(None);
    }
    let window = window(&heights, &rovers, &paths);
    let heights = window.of(&heights);
    let rocks = rocks(data, terrain)?.map(|codes| window.of(&codes)).filter(|codes| codes.geometry == heights.geometry);
    let picture = picture::ground(&heights, rocks.as_ref(), &GROUND, PIXELS)?;
    let id = slug(&format!("rover-tracks-{}", set.name));
    let kinds: Vec<usize> = (0..ALL.len()).filter(|k| rovers.iter().any(|r| index(r) == *k)).collect();
    let rock = rocks.is_some().then(|| (Mark::Fill(Paint::Fixed(GROUND[1].1)), "rock".to_owned()));
    let ends =
        [(Symbol::Ring, "start"), (Symbol::Diamond, "goal")].map(|(s, w)| (Mark::Symbol(s, Paint::Ink), w.to_owned()));
    let entries: Vec<Entry> = kinds
        .iter()
        .map(|&k| {
            (
                Mark::Track(crate::render::svg::Stroke { paint: super::outcomes::paint(k), ..track(k) }, ALL[k].symbol),
                ALL[k].name.to_owned(),
            )
        })
        .chain(ends)
        .chain(rock)
        .collect();
    let mut map = Map::new(&picture, WIDTH, &Key::Entries(&entries));
    map.clip(clip);
    draw(&mut map, &rovers, &paths);
    map.svg.close();
    Ok(Some(Figure {
        id,
        title: format!("{}.", set.name),
        caption: format!(
            "{}: {} of {}, mean efficiency {}.",
            world.terrain_id,
            set_number::count(rovers.len()),
            set_number::counted(world.rovers.len(), "rover"),
            set_number::significant(EFFICIENCY.of(world), 3)
        ),
        description: describe(set, &heights, &rovers),
        svg: map.svg,
        numbers: numbers(set, world, &rovers),
    }))
}

fn path(samples: &[RoverSampleRow], rover: &RoverRow) -> Vec<(f64, f64)> {
    let own = of_key(samples, |s| &s.rover_id, &rover.rover_id);
    own.iter().map(|s| (s.x_m, s.y_m)).filter(|p| p.0.is_finite() && p.1.is_finite()).collect()
}

/// Codes of sand and rock, if the generator wrote them.
fn rocks(data: &Data, terrain: &TerrainRow) -> Result<Option<Grid<u8>>, ReportError> {
    let Some(stem) = terrain.path.strip_suffix(".tif") else { return Ok(None) };
    let map = data.files.grid(&format!("{stem}.class.tif"))?;
    Ok(map.map(|codes| codes.map(|v| if v.is_finite() { v as u8 } else { u8::MAX })))
}

/// A part of the rasters of a world.
struct Window {
    row: usize,
    col: usize,
    rows: usize,
    cols: usize,
}

impl Window {
    fn of<T: Copy>(&self, grid: &Grid<T>) -> Grid<T> {
        let fits = self.row + self.rows <= grid.rows() && self.col + self.cols <= grid.cols();
        let [row, col, rows, cols] =
            if fits { [self.row, self.col, self.rows, self.cols] } else { [0, 0, grid.rows(), grid.cols()] };
        grid.window(row, col, rows, cols)
    }
}

/// The part of the raster that contains starts, goals and tracks.
fn window(grid: &Grid, rovers: &[&RoverRow], paths: &[Vec<(f64, f64)>]) -> Window {
    let ends = rovers.iter().flat_map(|r| [(r.start_x_m, r.start_y_m), (r.goal_x_m, r.goal_y_m)]);
    let points = || ends.clone().chain(paths.iter().flatten().copied());
    let span = |of: fn((f64, f64)) -> f64, origin: f64, cell: f64, cells: usize| {
        let (low, high) = points().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        let margin = (MARGIN * (high - low)).max(2.0 * cell);
        let index = |v: f64| (((v - origin) / cell).max(0.0) as usize).min(cells - 1);
        (index(low - margin), index(high + margin))
    };
    let g = grid.geometry;
    let (west, east) = span(|p| p.0, g.origin[0], g.cell[0], g.cols);
    let (south, north) = span(|p| p.1, g.origin[1], g.cell[1], g.rows);
    Window { row: g.rows - 1 - north, col: west, rows: north - south + 1, cols: east - west + 1 }
}

fn draw(map: &mut Map, rovers: &[&RoverRow], paths: &[Vec<(f64, f64)>]) {
    // Rovers that arrive are drawn last, so that the others do not cover them.
    let mut order: Vec<usize> = (0..rovers.len()).collect();
    order.sort_by_key(|&k| (std::cmp::Reverse(index(rovers[k])), k));
    let placed: Vec<Vec<(f64, f64)>> =
        paths.iter().map(|p| apart(p.iter().filter_map(|&(x, y)| map.at(x, y)))).collect();
    for &k in &order {
        map.svg.polyline(&placed[k], track(index(rovers[k])));
    }
    for &k in &order {
        let rover = rovers[k];
        if let Some(at) = map.at(rover.start_x_m, rover.start_y_m) {
            map.svg.disc(at, 3.6, LIGHT, 0.9);
            map.svg.symbol(Symbol::Ring, at, 2.4, DARK);
        }
        if let Some(&at) = placed[k].last().filter(|_| index(rover) != 0) {
            map.svg.disc(at, 5.2, LIGHT, 0.9);
            map.svg.symbol(ALL[index(rover)].symbol, at, 3.6, track(index(rover)).paint);
        }
    }
    for rover in rovers {
        if let Some(at) = map.at(rover.goal_x_m, rover.goal_y_m) {
            map.svg.symbol(Symbol::Diamond, at, 6.0, LIGHT);
            map.svg.symbol(Symbol::Diamond, at, 4.4, DARK);
        }
        if rovers.iter().all(|r| (r.goal_x_m, r.goal_y_m) == (rover.goal_x_m, rover.goal_y_m)) {
            break;
        }
    }
}

/// Points at least [`STEP_PX`] apart, and the last one.
fn apart(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    let mut last = None;
    for point in points {
        if kept.last().is_none_or(|k| libm::hypot(point.0 - k.0, point.1 - k.1) >= STEP_PX) {
            kept.push(point);
            last = None;
        } else {
            last = Some(point);
        }
    }
    kept.extend(last);
    kept
}

fn describe(set: &Set, heights: &Grid, rovers: &[&RoverRow]) -> String {
    let parts: Vec<String> = (0..ALL.len())
        .map(|k| (rovers.iter().filter(|r| index(r) == k).count(), ALL[k].name))
        .filter(|(n, _)| *n > 0)
        .map(|(n, name)| format!("{n} {name}"))
        .collect();
    format!("Map of rover tracks, {}, {}: {}.", set.name, extent(heights), parts.join(", "))
}

fn numbers(set: &Set, world: &World, rovers: &[&RoverRow]) -> Numbers {
    let ids: Vec<String> = rovers.iter().map(|r| quoted(&r.rover_id)).collect();
    let condition = format!(
        "{} and terrain_id = {} and rover_id in ({})",
        set.condition(),
        quoted(world.terrain_id),
        ids.join(", ")
    );
    let columns = [
        "rover_id",
        "outcome",
        "start_x_m",
        "start_y_m",
        "goal_x_m",
        "goal_y_m",
        "distance_m",
        "residual_m",
        "efficiency",
    ];
    Numbers::select(&condition, rovers.iter().copied(), &columns)
}
