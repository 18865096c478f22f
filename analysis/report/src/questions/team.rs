//! Errors and tracks of teams, for the questions about formations and losses.

use crate::ReportError;
use crate::content::{Figure, Numbers, number};
use crate::data::{Data, of_key};
use crate::questions::relief::{MAP_WIDTH, exaggeration_words, extent};
use crate::questions::routes::maps::{DARK, LIGHT, closed, draw, ground, legend_track, track};
use crate::questions::sql::quoted;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot, WIDTH};
use crate::render::map::{Key, Map};
use crate::render::svg::{Paint, Stroke, Symbol};
use crate::render::{number as set, picture, thin};
use sastrugi_imaging::hillshade::exaggeration;
use sastrugi_numeric::{Grid, sums};
use sastrugi_schemas::tables::{FormationRow, FormationSampleRow, RouteRow};
use std::collections::{BTreeMap, BTreeSet};

/// Errors up to this share of the spacing are in range (Bayrak, 2008, section 5.3).
pub const IN_RANGE: f64 = 0.2;
/// Errors up to this share are tolerable (same section).
pub const TOLERABLE: f64 = 0.4;
/// Largest number of rows or columns of a relief.
const PIXELS: usize = 420;
/// Side of a picture of tracks, in spacings of the slots.
const WINDOW_SPACINGS: f64 = 14.0;
/// Height of a chart of errors, px.
const HEIGHT: f64 = 250.0;
/// Time intervals in such a chart.
const BINS: usize = 60;

/// A team at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    /// Time since the start, s.
    pub time_s: f64,
    /// Mean absolute depth error of its followers, m.
    pub depth_m: f64,
    /// Mean absolute width error, m.
    pub width_m: f64,
    /// Largest absolute error of any follower in either direction, m.
    pub worst_m: f64,
}

/// A run and its instants that have followers.
pub struct Run<'a> {
    /// Its row.
    pub row: &'a FormationRow,
    /// In order of time.
    pub instants: Vec<Instant>,
}

/// The runs with their instants; recordings are read terrain by terrain.
pub fn runs<'a>(data: &Data, rows: &[&'a FormationRow]) -> Result<Vec<Run<'a>>, ReportError> {
    let terrains: BTreeSet<&str> = rows.iter().map(|r| r.terrain_id.as_str()).collect();
    let mut runs = Vec::new();
    for terrain in terrains {
        let samples = data.files.formation_samples(terrain)?;
        let on = rows.iter().filter(|r| r.terrain_id == terrain);
        runs.extend(on.map(|row| Run { row, instants: instants(of_run(&samples, row)) }));
    }
    Ok(runs)
}

/// Samples of a run among those of a terrain.
pub fn of_run<'a>(samples: &'a [FormationSampleRow], run: &FormationRow) -> &'a [FormationSampleRow] {
    of_key(samples, |s| &s.run_id, &run.run_id)
}

fn instants(samples: &[FormationSampleRow]) -> Vec<Instant> {
    let follows =
        |s: &&FormationSampleRow| s.depth_error_m.is_finite() && s.width_error_m.is_finite() && s.time_s.is_finite();
    let mut at: BTreeMap<i64, Vec<&FormationSampleRow>> = BTreeMap::new();
    for sample in samples.iter().filter(|s| s.state != "lost").filter(follows) {
        at.entry(sample.sample).or_default().push(sample);
    }
    let instant = |followers: Vec<&FormationSampleRow>| {
        let mean =
            |of: fn(&FormationSampleRow) -> f64| sums::mean(&followers.iter().map(|s| of(s)).collect::<Vec<_>>());
        let worst = followers.iter().map(|s| s.depth_error_m.abs().max(s.width_error_m.abs())).fold(0.0, f64::max);
        Instant {
            time_s: followers[0].time_s,
            depth_m: mean(|s| s.depth_error_m.abs()),
            width_m: mean(|s| s.width_error_m.abs()),
            worst_m: worst,
        }
    };
    at.into_values().map(instant).collect()
}

/// Errors of several runs in one time interval: its middle, then mean, 5th and 95th percentile of depth and of width over the runs.
struct Bin {
    time_s: f64,
    runs: usize,
    depth: [f64; 3],
    width: [f64; 3],
}

/// Mean errors over time with bands over runs; `series` are instants with times from a common zero. `None` without instants.
pub fn errors(id: String, words: [String; 2], series: &[Vec<Instant>], time: &str, query: String) -> Option<Figure> {
    let bins = bins(series);
    let high = bins.iter().flat_map(|b| [b.depth[2], b.width[2]]).fold(0.0, f64::max);
    let (first, last) = (bins.first()?, bins.last()?);
    let styles = [Stroke::new(Paint::Series(0), 2.0), Stroke::new(Paint::Series(1), 2.0).dashed("6 3")];
    let entries: Vec<Entry> =
        ["depth", "width"].iter().zip(styles).map(|(n, s)| (Mark::Line(s), (*n).to_owned())).collect();
    let y = Axis::linear(0.0, if high > 0.0 { 1.05 * high } else { 1.0 });
    let mut plot = Plot::new(
        (WIDTH, HEIGHT),
        (Axis::linear(first.time_s, last.time_s), time),
        (y, "mean absolute error, m"),
        &entries,
    );
    let curves: [fn(&Bin) -> [f64; 3]; 2] = [|b| b.depth, |b| b.width];
    plot.clip(&format!("{id}-clip"));
    for (of, stroke) in curves.into_iter().zip(styles) {
        let upper = bins.iter().map(|b| (b.time_s, of(b)[2]));
        let lower = bins.iter().rev().map(|b| (b.time_s, of(b)[1]));
        let band = plot.place(upper.chain(lower));
        plot.svg.area(&band, stroke.paint, 0.16);
        plot.line(bins.iter().map(|b| (b.time_s, of(b)[0])), stroke);
    }
    if first.time_s < 0.0 {
        plot.line([(0.0, 0.0), (0.0, 1.05 * high)], Stroke::new(Paint::Muted, 1.4));
    }
    plot.svg.close();
    let largest = |of: fn(&Bin) -> f64| bins.iter().map(of).fold(0.0, f64::max);
    let description = format!(
        "Mean absolute errors over {time} from {:.0} to {:.0}; largest mean depth error {:.2} m, largest mean width error {:.2} m.",
        first.time_s,
        last.time_s,
        largest(|b| b.depth[0]),
        largest(|b| b.width[0])
    );
    let [title, caption] = words;
    Some(Figure { id, title, caption, description, svg: plot.svg, numbers: error_numbers(&bins, query) })
}

fn error_numbers(bins: &[Bin], query: String) -> Numbers {
    let columns = [
        ("time_s", "s"),
        ("runs", "1"),
        ("depth_error_m", "m"),
        ("depth_5_percent_m", "m"),
        ("depth_95_percent_m", "m"),
        ("width_error_m", "m"),
        ("width_5_percent_m", "m"),
        ("width_95_percent_m", "m"),
    ];
    let mut numbers = Numbers::computed(query, &columns);
    for bin in bins {
        let values = std::iter::once(bin.time_s).map(number).chain([crate::content::count(bin.runs)]);
        numbers.row(values.chain(bin.depth.into_iter().chain(bin.width).map(number)));
    }
    numbers
}

fn bins(series: &[Vec<Instant>]) -> Vec<Bin> {
    let times = || series.iter().flatten().map(|i| i.time_s).filter(|t| t.is_finite());
    let (low, high) = times().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)));
    if high <= low {
        return Vec::new();
    }
    let step = (high - low) / BINS as f64;
    // The last interval includes its upper end.
    let bin_of = |t: f64| (((t - low) / step) as usize).min(BINS - 1);
    let mut depth = vec![Vec::new(); BINS];
    let mut width = vec![Vec::new(); BINS];
    for run in series {
        for instants in run.chunk_by(|a, b| bin_of(a.time_s) == bin_of(b.time_s)) {
            let bin = bin_of(instants[0].time_s);
            depth[bin].push(sums::mean(&instants.iter().map(|i| i.depth_m).collect::<Vec<_>>()));
            width[bin].push(sums::mean(&instants.iter().map(|i| i.width_m).collect::<Vec<_>>()));
        }
    }
    let bin = |k: usize| {
        let middle = low + (k as f64 + 0.5) * step;
        Bin { time_s: middle, runs: depth[k].len(), depth: spread(&depth[k]), width: spread(&width[k]) }
    };
    (0..BINS).filter(|&k| !depth[k].is_empty()).map(bin).collect()
}

/// Mean, 5th and 95th percentile.
fn spread(values: &[f64]) -> [f64; 3] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    [sums::mean(values), sums::quantile_sorted(&sorted, 0.05), sums::quantile_sorted(&sorted, 0.95)]
}

/// Content of a picture of tracks.
pub struct Scene<'a> {
    /// Name of its files.
    pub id: String,
    /// Title.
    pub title: String,
    /// Run.
    pub run: &'a FormationRow,
    /// Time at which members are marked, s.
    pub time_s: f64,
    /// Member at the centre; the first one if it has no sample.
    pub member: i64,
    /// Meaning of the marks.
    pub marks: &'a str,
}

/// Tracks of a team around a place on the relief, with members marked at one time. `None` without relief or samples.
pub fn tracks(data: &Data, scene: Scene) -> Result<Option<Figure>, ReportError> {
    let Scene { id, title, run, time_s, member, marks } = scene;
    let all = data.files.formation_samples(&run.terrain_id)?;
    let samples = of_run(&all, run);
    let members: Vec<&[FormationSampleRow]> = samples.chunk_by(|a, b| a.member == b.member).collect();
    let now: Vec<&FormationSampleRow> = members.iter().filter_map(|m| nearest(m, time_s)).collect();
    let middle = now.iter().find(|s| s.member == member).or(now.first());
    let (Some(middle), Some(terrain)) = (middle, data.terrain(&run.terrain_id)) else { return Ok(None) };
    let of_run = |route: &&RouteRow| (&route.terrain_id, &route.route_id) == (&run.terrain_id, &run.route_id);
    let heights = match data.routes.iter().find(of_run) {
        Some(route) => ground(data, &terrain.path, route)?,
        None => data.files.grid(&terrain.path)?,
    };
    let Some(heights) = heights else { return Ok(None) };
    let spacing = if run.spacing_m > 0.0 { run.spacing_m } else { 10.0 };
    let grid = about(&heights, (middle.x_m, middle.y_m), WINDOW_SPACINGS * spacing);
    let Some(range) = grid.range() else { return Ok(None) };
    let factor = exaggeration(terrain.rms_slope);
    let entry = |s: &&FormationSampleRow| (Mark::Line(legend_track(index(s.member))), format!("member {}", s.member));
    let state = |lost: bool| now.iter().any(|s| (s.state == "lost") == lost);
    let ends = [(Symbol::Disc, marks, state(false)), (Symbol::Cross, "lost", state(true))];
    let ends = ends.into_iter().filter(|e| e.2).map(|e| (Mark::Symbol(e.0, Paint::Ink), e.1.to_owned()));
    let entries: Vec<Entry> = now.iter().map(entry).chain(ends).chain(closed(&grid)).collect();
    let mut map = Map::new(&picture::relief(&grid, range, factor, PIXELS)?, MAP_WIDTH, &Key::Entries(&entries));
    map.clip(&format!("{id}-clip"));
    for own in &members {
        let line: Vec<(f64, f64)> = own.iter().map(|s| (s.x_m, s.y_m)).collect();
        draw(&mut map, &thin::every(&line, 1500), track(index(own[0].member)));
    }
    for sample in &now {
        mark(&mut map, sample);
    }
    map.svg.close();
    let condition = format!("terrain_id = {} and run_id = {}", quoted(&run.terrain_id), quoted(&run.run_id));
    let columns = ["member", "time_s", "x_m", "y_m", "slot", "depth_error_m", "width_error_m", "state"];
    // The picture has all samples of the run; the numbers are those at the marked time.
    let numbers =
        Numbers { gives: crate::content::Gives::Input, ..Numbers::select(&condition, now.iter().copied(), &columns) };
    Ok(Some(Figure {
        id,
        title,
        caption: format!(
            "{} on {}, {} after its start.{}",
            run.run_id,
            run.terrain_id,
            set::with_unit(time_s, 3, "s"),
            exaggeration_words(factor)
        ),
        description: format!("Map of the tracks of {}, {}.", set::counted(members.len(), "member"), extent(&grid)),
        svg: map.svg,
        numbers,
    }))
}

/// Number of the colour of a member, which counts from 1.
fn index(member: i64) -> usize {
    usize::try_from(member - 1).unwrap_or(0)
}

fn nearest(samples: &[FormationSampleRow], time_s: f64) -> Option<&FormationSampleRow> {
    let known = samples.iter().filter(|s| s.x_m.is_finite() && s.y_m.is_finite());
    known.min_by(|a, b| (a.time_s - time_s).abs().total_cmp(&(b.time_s - time_s).abs()))
}

/// The part of a grid in a square around a point.
fn about(grid: &Grid, (x, y): (f64, f64), side_m: f64) -> Grid {
    let g = grid.geometry;
    let cells = |cell: f64, n: usize| ((side_m / cell) as usize).clamp(1, n);
    let (rows, cols) = (cells(g.cell[1], g.rows), cells(g.cell[0], g.cols));
    let first = |place: f64, size: usize, n: usize| ((place - 0.5 * size as f64).max(0.0) as usize).min(n - size);
    let col = first((x - g.origin[0]) / g.cell[0], cols, g.cols);
    let row = first(g.rows as f64 - (y - g.origin[1]) / g.cell[1], rows, g.rows);
    grid.window(row, col, rows, cols)
}

fn mark(map: &mut Map, sample: &FormationSampleRow) {
    let Some(at) = map.at(sample.x_m, sample.y_m) else { return };
    map.svg.disc(at, 6.0, LIGHT, 1.0);
    match sample.state.as_str() {
        "lost" => map.svg.symbol(Symbol::Cross, at, 4.2, DARK),
        _ => map.svg.disc(at, 4.4, track(index(sample.member)).paint, 1.0),
    }
}
