//! Outcomes by group: stacked bars with their counts.

use crate::content::{Figure, Numbers, count, text};
use crate::data::{Data, Group, Mission};
use crate::questions::outcome::{self, ALL};
use crate::questions::sql;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows};
use crate::render::number as set;
use crate::render::svg::{Anchor, Paint, text_width};
use sastrugi_schemas::Cell;

/// One bar per group.
pub fn stacked(data: &Data, groups: &[Group<Mission>]) -> Figure {
    let counts: Vec<[usize; ALL.len()]> = groups.iter().map(|g| outcome::counts(g.rows.iter().copied())).collect();
    let label = |g: &Group<Mission>| RowLabel { name: g.name.clone(), detail: format!("n = {}", g.rows.len()) };
    let labels: Vec<RowLabel> = groups.iter().map(label).collect();
    let occurs = |i: usize| counts.iter().any(|c| c[i] > 0);
    let kinds: Vec<usize> = (0..ALL.len()).filter(|&i| occurs(i)).collect();
    let legend: Vec<Entry> = kinds.iter().map(|&i| (Mark::Fill(Paint::Outcome(i)), ALL[i].name.to_owned())).collect();
    let mut rows = Rows::new(&labels, 46.0, (Axis::linear(0.0, 100.0), "share of the missions, %"), &legend);
    counts.iter().enumerate().for_each(|(row, c)| bar(&mut rows, row, c));
    Figure {
        id: "outcomes".into(),
        title: "Outcomes.".into(),
        caption: "Numbers in the bars are counts of missions.".into(),
        description: describe(groups, &counts),
        svg: rows.svg,
        numbers: numbers(data, groups, &counts, &kinds),
    }
}

fn bar(rows: &mut Rows, row: usize, counts: &[usize]) {
    let total = counts.iter().sum::<usize>().max(1) as f64;
    let y = rows.centre(row) - 13.0;
    let mut before = 0;
    for (i, &n) in counts.iter().enumerate().filter(|(_, n)| **n > 0) {
        let share = |n: usize| 100.0 * n as f64 / total;
        let (Some(from), Some(to)) = (rows.x.at(share(before)), rows.x.at(share(before + n))) else { return };
        rows.svg.rect((from, y), (to - from - 1.5, 26.0), Paint::Outcome(i), 1.0);
        let words = set::count(n);
        if text_width(&words, 12.0) < to - from - 4.0 {
            rows.svg.text_sized((0.5 * (from + to) - 0.7, y + 17.3), Anchor::Middle, Paint::Paper, 12.0, &words);
        }
        before += n;
    }
}

fn describe(groups: &[Group<Mission>], counts: &[[usize; ALL.len()]]) -> String {
    let group = |(g, c): (&Group<Mission>, &[usize; ALL.len()])| {
        let parts = ALL.iter().zip(c).filter(|(_, n)| **n > 0).map(|(o, n)| format!("{n} {}", o.name));
        format!("group {}: {}", g.name, parts.collect::<Vec<_>>().join(", "))
    };
    format!("Missions by outcome. {}.", groups.iter().zip(counts).map(group).collect::<Vec<_>>().join("; "))
}

fn numbers(data: &Data, groups: &[Group<Mission>], counts: &[[usize; ALL.len()]], kinds: &[usize]) -> Numbers {
    let names = kinds.iter().map(|&i| (ALL[i].name, "1"));
    let columns: Vec<(&str, &str)> = [("group", ""), ("missions", "1")].into_iter().chain(names).collect();
    let query = format!("{} group by all", sql::missions(data, "outcome, count(*)", None));
    let mut numbers = Numbers::new(query, &columns);
    for (group, counts) in groups.iter().zip(counts) {
        let cells = kinds.iter().map(|&i| count(counts[i]));
        let head: [Cell; 2] = [text(&group.name), count(group.rows.len())];
        numbers.row(head.into_iter().chain(cells));
    }
    numbers
}
