//! How far missions got: cumulative incidence of each kind of failure, over the distance along the line.

use crate::content::{Block, Figure, Numbers, count, number, slug, text};
use crate::data::{Data, Group, Mission};
use crate::questions::clusters::{LEVEL, REPLICATES, numbered, replicates, stream, times};
use crate::questions::outcome;
use crate::questions::sql;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot, WIDTH};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke};
use sastrugi_statistics::{Ending, Incidence, Interval, bootstrap};

/// Causes of failure in the order of their numbers: name, and the outcome whose colour it has.
type Causes = [(&'static str, usize); 3];
const STUCK: (&str, usize) = ("stuck", 1);
const TIPPED: (&str, usize) = ("tipped", 2);
/// Steps of the distance at which bands are computed.
const STEPS: usize = 70;
/// Largest number of steps of a curve that are drawn one by one.
const STEPS_DRAWN_MAX: usize = 2000;
/// Largest number of groups drawn.
const GROUPS_MAX: usize = 12;
const HEIGHT: f64 = 260.0;

/// Curves of a group.
struct Curves<'a> {
    group: &'a Group<'a, Mission>,
    causes: Causes,
    incidence: Incidence,
    /// Interval of every cause at each of the [`STEPS`] + 1 distances; `None` where there are fewer than two clusters.
    bands: Vec<Vec<Option<Interval>>>,
}

/// Text, and one figure for each group with failures; empty when no distance is known.
pub fn blocks(data: &Data, groups: &[Group<Mission>]) -> Vec<Block> {
    let lengths = groups.iter().flat_map(|g| g.rows.iter().map(|m| length(m))).filter(|l| l.is_finite());
    let length = lengths.fold(0.0, f64::max);
    let drawn = &groups[..groups.len().min(GROUPS_MAX)];
    let causes = causes(groups);
    let all: Vec<Curves> = drawn.iter().map(|g| curves(data, g, causes, length)).collect();
    let top = all.iter().flat_map(tops).fold(0.0, f64::max);
    if length <= 0.0 {
        return Vec::new();
    }
    let heading = Block::Heading("Distance to failure".into());
    let fails = |group: &&Group<Mission>| outcome::counts(group.rows.iter().copied())[1..].iter().any(|n| *n > 0);
    let whole: Vec<String> = groups
        .iter()
        .filter(|g| !fails(g))
        .map(|g| format!("{} ({})", g.name, set::counted(g.rows.len(), "mission")))
        .collect();
    if whole.len() == groups.len() {
        return vec![heading, Block::Text("No mission failed.".into())];
    }
    let is_large = drawn.iter().any(|g| replicates(g.rows.len()) < REPLICATES);
    let fewer = if is_large { " (fewer in groups of more than 10 000 missions)" } else { "" };
    let of_bands = match all.iter().any(|c| c.bands.iter().flatten().any(Option::is_some)) {
        true => format!(
            " Bands are pointwise {} % intervals from {REPLICATES} bootstrap samples of whole terrains{fewer}.",
            set::fixed(100.0 * LEVEL, 0)
        ),
        false => " With one terrain in each group there are no bands.".to_owned(),
    };
    let words = format!(
        "The curves give the share of missions that have failed up to a distance along their line, by cause: competing risks, \
         by Aalen and Johansen's estimator (1978). Missions that reach the goal are censored there. Only missions that meet no \
         severe obstacle reach the goal, so metrics of successful missions describe the ground that lets vehicles pass.{of_bands}",
    );
    let figures = all.iter().filter(|c| top > 0.0 && fails(&c.group)).map(|c| figure(data, c, length, top)).collect();
    let mut blocks = vec![heading, Block::Text(words), Block::Figures(figures)];
    if !whole.is_empty() {
        blocks.push(Block::Text(format!("No failures in {}.", whole.join(", "))));
    }
    blocks
}

/// Stuck, tipped, and whatever else occurred: by its own name if it is one outcome, in the colour of the first of them.
fn causes(groups: &[Group<Mission>]) -> Causes {
    let counts = outcome::counts(groups.iter().flat_map(|g| g.rows.iter().copied()));
    let others: Vec<usize> = (0..outcome::ALL.len()).filter(|&kind| kind > TIPPED.1 && counts[kind] > 0).collect();
    let unknown = outcome::ALL.len() - 1;
    let other = match others[..] {
        [one] if one != unknown => (outcome::ALL[one].name, one),
        _ => ("other failure", others.first().copied().unwrap_or(unknown)),
    };
    [STUCK, TIPPED, other]
}

/// Length of a mission's line, m.
fn length(mission: &Mission) -> f64 {
    libm::hypot(mission.goal_x_m - mission.start_x_m, mission.goal_y_m - mission.start_y_m)
}

fn ending(mission: &Mission) -> Ending {
    let kind = outcome::index(mission);
    let own = [STUCK, TIPPED].iter().position(|c| c.1 == kind).unwrap_or(2);
    match kind {
        0 => Ending { at: length(mission), cause: None },
        _ => Ending { at: mission.progress_m, cause: Some(own) },
    }
}

fn curves<'a>(data: &Data, group: &'a Group<'a, Mission>, causes: Causes, length: f64) -> Curves<'a> {
    let items = group.rows.iter().map(|m| (m.terrain_id.as_str(), ending(m))).filter(|i| i.1.at.is_finite());
    let mut items: Vec<(&str, Ending)> = items.collect();
    items.sort_by(|a, b| a.1.at.total_cmp(&b.1.at));
    let incidence = Incidence::of_counted(items.iter().map(|i| (i.1, 1)), causes.len());
    let (clusters, items) = numbered(&items);
    let mut stream = stream(data, &group.name, "progress_m");
    let at: Vec<f64> = distances(length).collect();
    let redrawn =
        bootstrap::redraw(&[clusters], if clusters > 1 { replicates(items.len()) } else { 0 }, &mut stream, |drawn| {
            let times = times(&drawn[0], clusters);
            // Only the shares that are drawn: a curve has as many steps as there are failures.
            Incidence::shares_at(items.iter().map(|(c, ending)| (*ending, times[*c])), causes.len(), &at)
        });
    let band = |cause: usize, step: usize| {
        let values: Vec<f64> = redrawn.iter().map(|shares| shares[cause][step]).collect();
        Interval::percentile(incidence.share(cause, at[step]), &values, LEVEL)
    };
    let bands = (0..causes.len()).map(|k| (0..at.len()).map(|step| band(k, step)).collect()).collect();
    Curves { group, causes, incidence, bands }
}

fn distances(length: f64) -> impl Iterator<Item = f64> {
    (0..=STEPS).map(move |i| length * i as f64 / STEPS as f64)
}

/// The largest shares drawn.
fn tops(curves: &Curves) -> Vec<f64> {
    let ends = curves.bands.iter().flatten().flatten().map(|b| b.high);
    let curve = curves.incidence.shares.iter().filter_map(|s| s.last().copied());
    ends.chain(curve).collect()
}

fn figure(data: &Data, curves: &Curves, length: f64, top: f64) -> Figure {
    let id = slug(&format!("incidence-{}", curves.group.name));
    let occurs = |k: &usize| curves.incidence.shares[*k].last().is_some_and(|s| *s > 0.0);
    let causes: Vec<usize> = (0..curves.causes.len()).filter(occurs).collect();
    let stroke = |k: usize| stroke(k, curves.causes[k].1);
    let legend: Vec<Entry> = causes.iter().map(|&k| (Mark::Line(stroke(k)), curves.causes[k].0.to_owned())).collect();
    let x = (Axis::linear(0.0, length), "distance along the line, m");
    let y = (Axis::linear(0.0, 105.0 * top), "failed so far, %");
    let mut plot = Plot::new((WIDTH, HEIGHT), x, y, &legend);
    plot.clip(&format!("{id}-clip"));
    causes.iter().for_each(|&k| draw_band(&mut plot, &curves.bands[k], length, curves.causes[k].1));
    causes.iter().for_each(|&k| plot.line(steps(&curves.incidence, k, length), stroke(k)));
    plot.svg.close();
    let rows = curves.group.rows.len();
    Figure {
        id,
        title: format!("Group {}.", curves.group.name),
        caption: format!("Share of missions that have failed, by distance; {} in all.", set::counted(rows, "mission")),
        description: describe(curves, &causes, length),
        svg: plot.svg,
        numbers: numbers(data, curves, length),
    }
}

fn stroke(cause: usize, kind: usize) -> Stroke {
    // Long dashes where the track of a map has short ones: a step curve has little room for either.
    let dash = ["", "7 3", "2 3"][cause];
    Stroke::new(Paint::Outcome(kind), 2.0).dashed(dash)
}

/// The corners of a step curve, in per cent. Of very many steps, only the last one in each two-thousandth of the distance is drawn, at
/// its own place: the curve then lags by less than a pixel.
fn steps(incidence: &Incidence, cause: usize, length: f64) -> Vec<(f64, f64)> {
    let is_thinned = incidence.at.len() > STEPS_DRAWN_MAX;
    // Where all steps are drawn, each is a bin of its own.
    let bin = |at: f64| if is_thinned { (at / length * STEPS_DRAWN_MAX as f64).floor() } else { at };
    let mut drawn: Vec<(f64, f64)> = Vec::new();
    for (&at, &share) in incidence.at.iter().zip(&incidence.shares[cause]) {
        match drawn.last_mut() {
            // A step of another cause.
            Some(last) if share <= last.1 => {}
            None if share <= 0.0 => {}
            Some(last) if bin(last.0) == bin(at) => *last = (at, share),
            _ => drawn.push((at, share)),
        }
    }
    let mut points = vec![(0.0, 0.0)];
    let mut before = 0.0;
    for (at, share) in drawn {
        points.extend([(at, 100.0 * before), (at, 100.0 * share)]);
        before = share;
    }
    points.push((length, 100.0 * before));
    points
}

fn draw_band(plot: &mut Plot, bands: &[Option<Interval>], length: f64, kind: usize) {
    let known: Vec<(f64, Interval)> = distances(length).zip(bands).filter_map(|(x, b)| Some((x, (*b)?))).collect();
    let upper = known.iter().map(|(x, b)| (*x, 100.0 * b.high));
    let lower = known.iter().rev().map(|(x, b)| (*x, 100.0 * b.low));
    let outline = plot.place(upper.chain(lower));
    plot.svg.area(&outline, Paint::Outcome(kind), 0.16);
}

fn describe(curves: &Curves, causes: &[usize], length: f64) -> String {
    let part = |&k: &usize| {
        let share = |at: f64| set::percent(curves.incidence.share(k, at), 1);
        format!("{} {} halfway and {} at the end", curves.causes[k].0, share(0.5 * length), share(length))
    };
    let parts: Vec<String> = causes.iter().map(part).collect();
    let parts = if parts.is_empty() { "none".into() } else { parts.join("; ") };
    format!("Cumulative incidence of failures over the distance, group {}: {parts}.", curves.group.name)
}

fn numbers(data: &Data, curves: &Curves, length: f64) -> Numbers {
    let columns = [
        ("group", ""),
        ("failure", ""),
        ("distance_m", "m"),
        ("share", "1"),
        ("low", "1"),
        ("high", "1"),
        ("missions", "1"),
    ];
    let mut numbers = Numbers::computed(sql::compared(data), &columns);
    for (k, bands) in curves.bands.iter().enumerate() {
        for (at, band) in distances(length).zip(bands) {
            numbers.row([
                text(&curves.group.name),
                text(curves.causes[k].0),
                number(at),
                number(curves.incidence.share(k, at)),
                number(band.map_or(f64::NAN, |b| b.low)),
                number(band.map_or(f64::NAN, |b| b.high)),
                count(curves.group.rows.len()),
            ]);
        }
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A failure that is the only one of its kind has its name and colour; several share "other failure".
    #[test]
    fn val_other_failures_are_named() {
        let mut data = crate::tests::made_up::full(1, 24);
        data.missions.retain(|m| m.variant.is_none());
        let named = |data: &Data| causes(&data.mission_groups())[2];
        let fail = |data: &mut Data, k: usize, how: &str| data.missions[k].outcome = how.into();
        data.missions.iter_mut().for_each(|m| m.outcome = "success".into());
        assert_eq!(named(&data), ("other failure", 5));
        fail(&mut data, 0, "out_of_bounds");
        assert_eq!(named(&data), ("out of bounds", 3));
        fail(&mut data, 1, "timeout");
        assert_eq!(named(&data), ("other failure", 3));
    }

    /// The share that a drawn curve has at a distance.
    fn drawn(points: &[(f64, f64)], at: f64) -> f64 {
        points.iter().take_while(|point| point.0 <= at).last().map_or(0.0, |point| point.1 / 100.0)
    }

    /// Missions that fail within 1e-4 of the distance around 0.8 of it, by two causes in turn: up to 2000 steps are drawn exactly, more
    /// of them within one bin. Tolerance of shares 1e-12.
    #[test]
    fn val_many_steps_are_drawn_at_their_places() {
        let length = 50.0;
        for (missions, bin) in [(STEPS_DRAWN_MAX, 0.0), (3000, length / STEPS_DRAWN_MAX as f64)] {
            let offset = |i: usize| 1e-4 * (2.0 * i as f64 / (missions - 1) as f64 - 1.0);
            let ending = |i: usize| Ending { at: length * (0.8 + offset(i)), cause: Some(i % 2) };
            let endings: Vec<Ending> = (0..missions).map(ending).collect();
            let incidence = Incidence::of(&endings, 2);
            assert_eq!(incidence.at.len(), missions);
            for cause in 0..2 {
                let points = steps(&incidence, cause, length);
                assert!(points.len() <= 2 * STEPS_DRAWN_MAX + 4);
                assert!(points.is_sorted_by(|a, b| a.0 <= b.0 && a.1 <= b.1));
                for at in (0..=20_000).map(|i| length * f64::from(i) / 20_000.0) {
                    let (low, high) = (incidence.share(cause, at - bin), incidence.share(cause, at));
                    let share = drawn(&points, at);
                    assert!(low - 1e-12 <= share && share <= high + 1e-12, "{share} at {at}, not {low} to {high}");
                }
            }
        }
    }
}
