//! Outcomes of rovers, and how each is drawn; bars with counts.

use super::sets::Set;
use crate::content::{Figure, Numbers, count, text};
use crate::questions::outcome::Outcome;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows};
use crate::render::number as set_number;
use crate::render::svg::{Anchor, Paint, Stroke, Symbol, text_width};
use sastrugi_schemas::Cell;
use sastrugi_schemas::tables::RoverRow;

const fn outcome(word: &'static str, name: &'static str, symbol: Symbol, dash: &'static str) -> Outcome {
    Outcome { word, name, symbol, dash }
}

/// All outcomes; the last is for values that a newer program may write.
pub const ALL: [Outcome; 7] = [
    outcome("reached", "reached", Symbol::Disc, ""),
    outcome("distance_limit", "distance limit", Symbol::Diamond, "5 2 1 2 1 2"),
    outcome("cycle_limit", "cycle limit", Symbol::Square, "2 3"),
    outcome("lost", "lost", Symbol::Triangle, "7 3"),
    outcome("no_way", "no path known", Symbol::Cross, "9 3 2 3"),
    outcome("off_ground", "off the ground", Symbol::Ring, "4 4"),
    outcome("", "other", Symbol::Frame, "1 3"),
];
/// Colour of each outcome.
const PAINTS: [usize; 7] = [0, 4, 1, 2, 3, 5, 5];

/// Number of a rover's outcome in [`ALL`].
pub fn index(rover: &RoverRow) -> usize {
    ALL.iter().position(|o| o.word == rover.outcome).unwrap_or(ALL.len() - 1)
}

/// Colour of an outcome.
pub fn paint(index: usize) -> Paint {
    Paint::Outcome(PAINTS[index])
}

/// Track of an outcome on a picture, whose colours do not follow the theme.
pub fn track(index: usize) -> Stroke {
    Stroke::new(Paint::Fixed(crate::render::svg::OUTCOMES[PAINTS[index]]), 1.3).dashed(ALL[index].dash)
}

/// Rovers by outcome.
pub fn counts(set: &Set) -> [usize; ALL.len()] {
    let mut counts = [0; ALL.len()];
    set.rovers().for_each(|r| counts[index(r)] += 1);
    counts
}

/// A bar for each set.
pub fn figure(sets: &[Set]) -> Figure {
    let all: Vec<[usize; ALL.len()]> = sets.iter().map(counts).collect();
    let labels: Vec<RowLabel> = sets.iter().map(Set::label).collect();
    let kinds: Vec<usize> = (0..ALL.len()).filter(|&i| all.iter().any(|c| c[i] > 0)).collect();
    let legend: Vec<Entry> = kinds.iter().map(|&i| (Mark::Fill(paint(i)), ALL[i].name.to_owned())).collect();
    let mut rows = Rows::new(&labels, 46.0, (Axis::linear(0.0, 100.0), "share of the rovers, %"), &legend);
    all.iter().enumerate().for_each(|(row, c)| bar(&mut rows, row, c));
    let columns: Vec<(&str, &str)> =
        [("set", ""), ("rovers", "1")].into_iter().chain(kinds.iter().map(|&i| (ALL[i].name, "1"))).collect();
    let query =
        "select \"group\", stage_id, variant, outcome, count(*) as rovers from 'tables/rovers/*.parquet' group by all";
    let mut numbers = Numbers::computed(query, &columns);
    for (set, counts) in sets.iter().zip(&all) {
        let head: [Cell; 2] = [text(&set.name), count(set.count())];
        numbers.row(head.into_iter().chain(kinds.iter().map(|&i| count(counts[i]))));
    }
    Figure {
        id: "rover-outcomes".into(),
        title: "Outcomes of the rovers.".into(),
        caption: "Numbers in the bars are counts of rovers.".into(),
        description: describe(sets, &all),
        svg: rows.svg,
        numbers,
    }
}

fn bar(rows: &mut Rows, row: usize, counts: &[usize]) {
    let total = counts.iter().sum::<usize>().max(1) as f64;
    let y = rows.centre(row) - 13.0;
    let mut before = 0;
    for (i, &n) in counts.iter().enumerate().filter(|(_, n)| **n > 0) {
        let share = |n: usize| 100.0 * n as f64 / total;
        let (Some(from), Some(to)) = (rows.x.at(share(before)), rows.x.at(share(before + n))) else { return };
        rows.svg.rect((from, y), (to - from - 1.0, 26.0), paint(i), 1.0);
        let words = set_number::count(n);
        if text_width(&words, 12.0) < to - from - 4.0 {
            rows.svg.text_sized((0.5 * (from + to) - 0.5, y + 17.3), Anchor::Middle, Paint::Paper, 12.0, &words);
        }
        before += n;
    }
}

fn describe(sets: &[Set], all: &[[usize; ALL.len()]]) -> String {
    let set = |(s, c): (&Set, &[usize; ALL.len()])| {
        let parts = ALL.iter().zip(c).filter(|(_, n)| **n > 0).map(|(o, n)| format!("{n} {}", o.name));
        format!("{}: {}", s.name, parts.collect::<Vec<_>>().join(", "))
    };
    format!("Rovers by outcome. {}.", sets.iter().zip(all).map(set).collect::<Vec<_>>().join("; "))
}
