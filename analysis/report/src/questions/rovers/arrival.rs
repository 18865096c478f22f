//! Distance to arrival: the share of rovers that have arrived by a distance, and the distance by which a given share
//! has arrived.

use super::sets::{Set, reached};
use crate::content::{Block, Figure, Numbers, TableBlock, count, number, slug, text};
use crate::questions::clusters::LEVEL;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot, WIDTH};
use crate::render::number as set_number;
use crate::render::svg::{Paint, Stroke};
use crate::render::thin;
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::RoverRow;
use sastrugi_statistics::Ending;
use sastrugi_statistics::incidence::clustered::{Clustered, Step};

/// Shares whose distance is tabulated.
const SHARES: [f64; 4] = [0.5, 0.8, 0.9, 0.95];
/// Curves in one frame.
const CURVES_MAX: usize = 6;
/// Steps of a curve that are drawn and listed.
const STEPS_MAX: usize = 300;
/// Axes that span more than this factor are logarithmic.
const LOG_FROM: f64 = 5.0;
const HEIGHT: f64 = 300.0;
const DASHES: [&str; 6] = ["", "7 3", "2 3", "9 3 2 3", "5 2 1 2 1 2", "1 4"];
/// Query for the rows from which curves are computed.
const QUERY: &str = "select terrain_id, rover_id, \"group\", stage_id, variant, outcome, distance_m, straight_m from 'tables/rovers/*.parquet'";

/// A set and its curve.
struct Curve<'a> {
    set: &'a Set<'a>,
    arrived: Clustered,
}

/// Text, figures and the table of budgets.
pub fn blocks(sets: &[Set]) -> Vec<Block> {
    let curves: Vec<Curve> = sets.iter().map(curve).collect();
    let mut stages: Vec<&[Curve]> = curves.chunk_by(|a, b| a.set.stage == b.set.stage).collect();
    stages.retain(|s| s.iter().any(|c| !c.arrived.steps.is_empty()));
    let figures: Vec<Figure> = stages.iter().map(|s| figure(&s[..s.len().min(CURVES_MAX)])).collect();
    let words = format!(
        "A distance budget is the distance within which a given share of the rovers arrives. A rover that stops at a limit, or at the end of the known ground, \
         would have driven on, so its distance is censored; one that is lost or knows of no path never arrives. Curves are Aalen and Johansen's (1978), which \
         without lost rovers are one minus Kaplan and Meier's (1958). Bands are pointwise {} % intervals by Korn and Graubard (1998), with the jackknife variance \
         between worlds. The interval of a budget holds the distances at which the band reaches the share (Brookmeyer and Crowley, 1982).",
        set_number::fixed(100.0 * LEVEL, 0)
    );
    let mut blocks = vec![Block::Heading("Distance budget".into()), Block::Text(words)];
    if !figures.is_empty() {
        blocks.push(Block::Figures(figures));
    }
    blocks.push(Block::Table(budgets(&curves)));
    blocks
}

/// How a rover's drive ended, for the estimate of arrival.
fn ending(rover: &RoverRow) -> Ending {
    let cause = match rover.outcome.as_str() {
        _ if reached(rover) => Some(0),
        "lost" | "no_way" => Some(1),
        _ => None,
    };
    Ending { at: rover.distance_m, cause }
}

fn curve<'a>(set: &'a Set<'a>) -> Curve<'a> {
    let worlds: Vec<Vec<Ending>> = set.worlds.iter().map(|w| w.rovers.iter().map(|r| ending(r)).collect()).collect();
    Curve { set, arrived: Clustered::of(&worlds, 2, LEVEL) }
}

fn figure(curves: &[Curve]) -> Figure {
    let first = curves[0].set;
    let id = slug(&format!("rover-arrival-{}", first.stage));
    let rovers = || curves.iter().flat_map(|c| c.set.rovers());
    let straight = rovers().map(|r| r.straight_m).fold(f64::INFINITY, f64::min);
    let longest = rovers().map(|r| r.distance_m).filter(|d| d.is_finite()).fold(straight, f64::max);
    let entry = |(k, c): (usize, &Curve)| (Mark::Line(stroke(k, c.set)), c.set.name.clone());
    let legend: Vec<Entry> = curves.iter().enumerate().map(entry).collect();
    let ends = (0.9 * straight, 1.05 * longest);
    let axis = if ends.1 > LOG_FROM * ends.0 { Axis::log(ends.0, ends.1) } else { Axis::linear(ends.0, ends.1) };
    let x = (axis, "distance driven, m");
    let mut plot = Plot::new((WIDTH, HEIGHT), x, (Axis::linear(0.0, 102.0), "arrived, %"), &legend);
    plot.clip(&format!("{id}-clip"));
    let edges = curves.iter().filter(|c| has_band(c)).count() > 1;
    curves.iter().enumerate().for_each(|(k, c)| draw_band(&mut plot, c, longest, edges.then(|| stroke(k, c.set))));
    curves.iter().enumerate().for_each(|(k, c)| {
        let line = corners(c, longest, |s| s.share);
        plot.line(std::iter::once((0.5 * straight, 0.0)).chain(line), stroke(k, c.set));
    });
    plot.svg.close();
    Figure {
        id,
        title: format!("Arrival of {} rovers.", first.navigator()),
        caption: format!(
            "The straight distance is {} m.{}{}",
            set_number::plain(straight, 3),
            if axis.is_log() { " The scale of the distance is logarithmic." } else { "" },
            if edges { " Bands end at thin lines in the style of their curve." } else { "" }
        ),
        description: describe(curves),
        svg: plot.svg,
        numbers: numbers(curves),
    }
}

fn stroke(number: usize, set: &Set) -> Stroke {
    Stroke::new(Paint::Series(set.index), 2.0).dashed(DASHES[number % DASHES.len()])
}

/// Steps that are drawn, always including the last one.
fn drawn(curve: &Curve) -> Vec<Step> {
    thin::every(&curve.arrived.steps, STEPS_MAX)
}

/// Corners of a step curve, in per cent.
fn corners(curve: &Curve, end: f64, of: impl Fn(&Step) -> f64) -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    let mut before = 0.0;
    for step in drawn(curve) {
        let share = 100.0 * of(&step);
        points.extend([(step.at, before), (step.at, share)]);
        before = share;
    }
    points.push((end, before));
    points
}

fn has_band(curve: &Curve) -> bool {
    !curve.arrived.steps.is_empty() && curve.arrived.steps.iter().all(|s| s.interval.is_some())
}

/// The band of a curve. Several lie over each other: they are paler, so that no dark block hides the curves, and end at thin lines of their own.
fn draw_band(plot: &mut Plot, curve: &Curve, end: f64, edge: Option<Stroke>) {
    if !has_band(curve) {
        return;
    }
    let upper = corners(curve, end, |s| s.interval.map_or(f64::NAN, |i| i.high));
    let lower = corners(curve, end, |s| s.interval.map_or(f64::NAN, |i| i.low));
    let outline = plot.place(upper.iter().chain(lower.iter().rev()).copied());
    plot.svg.area(&outline, Paint::Series(curve.set.index), if edge.is_some() { 0.05 } else { 0.14 });
    for (stroke, line) in edge.into_iter().flat_map(|stroke| [(stroke, &upper), (stroke, &lower)]) {
        plot.line(line.iter().copied(), Stroke { width: 0.8, ..stroke }.faint(0.7));
    }
}

fn describe(curves: &[Curve]) -> String {
    let part = |c: &Curve| {
        let half = c.arrived.distance(0.5).estimate;
        let half = half.map_or_else(|| "not reached".into(), |m| set_number::with_unit(m, 3, "m"));
        let all = c.arrived.steps.last().map_or(0.0, |s| s.share);
        format!("{}: half by {half}, {} in the end", c.set.name, set_number::percent(all, 0))
    };
    format!(
        "Share of rovers that have arrived by a distance. {}.",
        curves.iter().map(part).collect::<Vec<_>>().join("; ")
    )
}

fn numbers(curves: &[Curve]) -> Numbers {
    let columns = [("set", ""), ("distance_m", "m"), ("arrived", "1"), ("low", "1"), ("high", "1"), ("under_way", "1")];
    let mut numbers = Numbers::computed(QUERY, &columns);
    for curve in curves {
        for step in drawn(curve) {
            numbers.row([
                text(&curve.set.name),
                number(step.at),
                number(step.share),
                number(step.interval.map_or(f64::NAN, |i| i.low)),
                number(step.interval.map_or(f64::NAN, |i| i.high)),
                count(step.at_risk),
            ]);
        }
    }
    numbers
}

fn budgets(curves: &[Curve]) -> TableBlock {
    let columns = [
        ("set", ""),
        ("arrival", "%"),
        ("budget", "m"),
        ("low", "m"),
        ("high", "m"),
        ("over the straight line", "1"),
        ("note", ""),
    ];
    let mut numbers = Numbers::computed(QUERY, &columns);
    for curve in curves {
        let straight = sums::mean(&curve.set.rovers().map(|r| r.straight_m).collect::<Vec<_>>());
        let limit = curve.set.rovers().map(|r| r.distance_limit_m).fold(f64::NEG_INFINITY, f64::max);
        for share in SHARES {
            let budget = curve.arrived.distance(share);
            let known = |v: Option<f64>| number(v.unwrap_or(f64::NAN));
            let note = match (budget.estimate, budget.high) {
                (None, _) => format!("not reached within {}", set_number::with_unit(limit, 4, "m")),
                (Some(_), None) if curve.set.worlds.len() > 1 => "no upper limit".into(),
                _ => String::new(),
            };
            numbers.row([
                text(&curve.set.name),
                number(100.0 * share),
                known(budget.estimate),
                known(budget.low),
                known(budget.high),
                number(budget.estimate.map_or(f64::NAN, |m| m / straight)),
                text(note),
            ]);
        }
    }
    TableBlock {
        id: "rover-budgets".into(),
        caption: "Distance budget by probability of arrival, with 95 % intervals over worlds".into(),
        numbers,
    }
}
