//! Tests and effect sizes: every pair of groups, and the trend over ordered groups.

use super::ALPHA;
use super::values::{Metric, Values, common_missions, means, share_pairs};
use crate::content::{Figure, Numbers, TableBlock, number, text};
use crate::data::Data;
use crate::questions::clusters::stream;
use crate::questions::sql;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_statistics::{Arrangements, Difference, Interval, Permutation, holm, permutation, trend};

/// Up to this many groups, every pair is compared; beyond, each group with the next.
const ALL_PAIRS_MAX: usize = 6;
/// Pairs drawn; all are in the table.
const PAIRS_DRAWN: usize = 6;
const SYMBOLS: [Symbol; 3] = [Symbol::Disc, Symbol::Square, Symbol::Triangle];

/// A test of one metric, with its effect size.
pub struct Verdict {
    pub metric: &'static str,
    pub unit: &'static str,
    /// `from to to`, or all groups in order.
    pub groups: String,
    /// Terrains of the groups, or their common blocks.
    pub of: String,
    pub test: Option<Permutation>,
    /// Adjusted over all tests of the page.
    pub adjusted: f64,
    pub size: Measure,
}

/// Effect size that goes with a test.
pub enum Measure {
    /// Of a pair of groups.
    Pair(Difference),
    /// Of a trend: correlation of order and value.
    Trend(Option<Interval>),
}

/// Settings of a test: its level, which sets the coverage of intervals, and how many tests are adjusted together.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    pub alpha: f64,
    pub tests: usize,
}

/// All tests of the metrics, adjusted as one family.
pub fn verdicts(data: &Data, metrics: &[Metric]) -> Vec<Verdict> {
    let known = |metric: &'_ Metric| metric.groups.iter().filter(|g| !g.means.is_empty()).count();
    let level = Level { alpha: ALPHA, tests: metrics.iter().map(|f| pairs(known(f)).len() + 1).sum() };
    let mut verdicts = Vec::new();
    for metric in metrics {
        let groups: Vec<&Values> = metric.groups.iter().filter(|g| !g.means.is_empty()).collect();
        verdicts
            .extend(pairs(groups.len()).into_iter().map(|(a, b)| pair(data, metric, [groups[a], groups[b]], level)));
        if groups.len() > 2 && ordered(&groups) {
            verdicts.push(over_groups(data, metric, &groups, level));
        }
    }
    let p: Vec<f64> = verdicts.iter().map(|v| v.test.map_or(f64::NAN, |t| t.p)).collect();
    verdicts.iter_mut().zip(holm(&p)).for_each(|(v, p)| v.adjusted = p);
    verdicts
}

fn pairs(groups: usize) -> Vec<(usize, usize)> {
    let reach = if groups > ALL_PAIRS_MAX { 1 } else { groups };
    (0..groups).flat_map(|a| (a + 1..groups.min(a + 1 + reach)).map(move |b| (a, b))).collect()
}

/// True where the labels of one run end in numbers, so that their order is one of size.
fn ordered(groups: &[&Values]) -> bool {
    let number = |g: &&Values| g.label.trim_start_matches(|c: char| !c.is_ascii_digit()).parse::<f64>().is_ok();
    groups.iter().all(|g| number(g) && g.run == groups[0].run)
}

/// The test of a pair of groups at a level, with intervals of the matching coverage.
pub fn pair(data: &Data, metric: &Metric, [from, to]: [&Values; 2], level: Level) -> Verdict {
    let groups = format!("{} to {}", from.name, to.name);
    let mut stream = stream(data, &groups, &format!("test {}", metric.column));
    let (coverage, draws) = (1.0 - level.alpha, permutation::draws(level.tests, level.alpha));
    let blocks = common_missions(&[from, to]);
    let (of, difference) = if blocks.is_empty() && !share_pairs(&[from, to]) {
        let (a, b) = (from.numbers(), to.numbers());
        let of = format!("{} + {} terrains", a.len(), b.len());
        (of, Difference::apart(&a, &b, coverage, draws, &mut stream))
    } else {
        let pairs = means(&blocks).into_iter().map(|b| [b[0], b[1]]);
        (of_blocks(&blocks), Difference::of_pairs(pairs, coverage, draws, &mut stream))
    };
    let (test, size) = (difference.test, Measure::Pair(difference));
    Verdict { metric: metric.name, unit: metric.unit, groups, of, test, adjusted: f64::NAN, size }
}

/// Number of blocks, and of their missions in each group.
fn of_blocks(blocks: &[Vec<Vec<f64>>]) -> String {
    let missions = blocks.iter().filter_map(|b| b.first()).map(Vec::len).sum();
    format!("{}, {}", set::counted(blocks.len(), "block"), set::counted(missions, "mission"))
}

/// The test of a trend at a level, with an interval of the matching coverage.
pub fn over_groups(data: &Data, metric: &Metric, groups: &[&Values], level: Level) -> Verdict {
    let mut stream = stream(data, "trend", &format!("test {}", metric.column));
    let (coverage, draws) = (1.0 - level.alpha, permutation::draws(level.tests, level.alpha));
    let blocks = common_missions(groups);
    let (of, test, correlation) = if blocks.is_empty() && !share_pairs(groups) {
        let values: Vec<Vec<f64>> = groups.iter().map(|g| g.numbers()).collect();
        let counts = values.iter().map(|v| v.len().to_string()).collect::<Vec<_>>().join(" + ");
        let test = trend::of_groups(&values, draws, &mut stream);
        (format!("{counts} terrains"), test, trend::correlation_of_groups(&values, coverage))
    } else {
        let of = of_blocks(&blocks);
        let blocks = means(&blocks);
        (of, trend::of_blocks(&blocks, draws, &mut stream), trend::correlation_of_blocks(&blocks, coverage))
    };
    let groups = groups.iter().map(|g| g.name).collect::<Vec<_>>().join(", ");
    let size = Measure::Trend(correlation);
    Verdict { metric: metric.name, unit: metric.unit, groups, of, test, adjusted: f64::NAN, size }
}

/// How many tests are significant, in a sentence.
pub fn in_words(verdicts: &[Verdict]) -> String {
    let known = verdicts.iter().filter(|v| v.test.is_some()).count();
    let found = |v: &&Verdict| v.adjusted <= ALPHA;
    let left: Vec<String> = verdicts
        .iter()
        .filter(|v| v.test.is_some() && !found(v))
        .map(|v| format!("{} ({})", v.metric, v.groups))
        .collect();
    let without = match left.len() {
        0 => String::new(),
        n if n > 6 => " A test that is not significant does not show that there is no difference.".to_owned(),
        _ => format!(" No difference was detected in {}, which does not show that there is none.", left.join("; ")),
    };
    let level = set::fixed(100.0 * ALPHA, 0);
    let adjusted = format!("significant at {level} % after Holm's adjustment over all tests");
    let tests = set::count(known);
    match (verdicts.iter().filter(found).count(), known) {
        (0, 1) => format!("The only test is not significant at {level} %.{without}"),
        (1, 1) => format!("The only test is significant at {level} %."),
        (0, _) => format!("None of the {tests} tests is {adjusted}.{without}"),
        (1, _) => format!("1 of {tests} tests is {adjusted}.{without}"),
        (n, _) if n == known => format!("All {tests} tests are {adjusted}."),
        (n, _) => format!("{} of {tests} tests are {adjusted}.{without}", set::count(n)),
    }
}

/// Every pair of groups: test, shift, delta, margin.
pub fn table_of_pairs(data: &Data, verdicts: &[Verdict]) -> TableBlock {
    let columns = [
        ("metric", ""),
        ("unit", ""),
        ("groups", ""),
        ("compared", ""),
        ("shift", ""),
        ("shift, low", ""),
        ("shift, high", ""),
        ("delta", ""),
        ("delta, low", ""),
        ("delta, high", ""),
        ("p", ""),
        ("p, Holm", ""),
        ("equivalent within", ""),
    ];
    let mut numbers = Numbers::computed(sql::compared(data), &columns).with_mixed_units();
    for v in verdicts {
        let Measure::Pair(Difference { effect, means, .. }) = &v.size else { continue };
        let margin = means.map_or(f64::NAN, |d| d.smallest_margin(ALPHA));
        let ends = |i: Option<Interval>| i.map_or([f64::NAN; 3], |i| [i.estimate, i.low, i.high]).map(number);
        let head = [text(v.metric), text(v.unit), text(&v.groups), text(&v.of)];
        let tail = [number(v.test.map_or(f64::NAN, |t| t.p)), number(v.adjusted), number(margin)];
        let sizes = ends(effect.map(|e| e.shift)).into_iter().chain(ends(effect.map(|e| e.delta)));
        numbers.row(head.into_iter().chain(sizes).chain(tail));
    }
    TableBlock { id: "comparison".into(), caption: "Pairs of groups (exploratory)".into(), numbers }
}

/// The trend of every metric.
pub fn table_of_trends(data: &Data, verdicts: &[Verdict]) -> TableBlock {
    let columns = [
        ("metric", ""),
        ("groups", ""),
        ("compared", ""),
        ("correlation", ""),
        ("low", ""),
        ("high", ""),
        ("p", ""),
        ("p, Holm", ""),
        ("arrangements", ""),
    ];
    let mut numbers = Numbers::computed(sql::compared(data), &columns).with_mixed_units();
    for v in verdicts {
        let Measure::Trend(correlation) = &v.size else { continue };
        let ends = correlation.map_or([f64::NAN; 3], |i| [i.estimate, i.low, i.high]);
        numbers.row([
            text(v.metric),
            text(&v.groups),
            text(&v.of),
            number(ends[0]),
            number(ends[1]),
            number(ends[2]),
            number(v.test.map_or(f64::NAN, |t| t.p)),
            number(v.adjusted),
            v.test.map_or(sastrugi_schemas::Cell::Null, |t| text(arrangements(t))),
        ]);
    }
    TableBlock { id: "comparison-trend".into(), caption: "Trend over the groups (exploratory)".into(), numbers }
}

fn arrangements(test: Permutation) -> String {
    match test.arrangements {
        Arrangements::All(n) => format!("all {}", set::count(n)),
        Arrangements::Drawn(n) => format!("{} drawn", set::count(n)),
        Arrangements::Normal => "normal".into(),
    }
}

/// Cliff's delta of every metric and pair with its interval; `None` where no pair has one.
pub fn drawing(data: &Data, metrics: &[Metric], verdicts: &[Verdict]) -> Option<Figure> {
    let known = |v: &Verdict| match &v.size {
        Measure::Pair(Difference { effect: Some(effect), .. }) => Some((v.metric, v.groups.clone(), effect.delta)),
        _ => None,
    };
    let deltas: Vec<(&str, String, Interval)> = verdicts.iter().filter_map(known).collect();
    let mut pairs: Vec<&str> = Vec::new();
    for (_, pair, _) in &deltas {
        if !pairs.contains(&pair.as_str()) && pairs.len() < PAIRS_DRAWN {
            pairs.push(pair);
        }
    }
    let label = |f: &Metric| match f.name.strip_prefix("RMS ") {
        Some(name) => RowLabel { name: name.into(), detail: "RMS".into() },
        None => RowLabel { name: f.name.into(), detail: String::new() },
    };
    let labels: Vec<RowLabel> = metrics.iter().map(label).collect();
    let mark = |k: usize| (SYMBOLS[k % SYMBOLS.len()], Paint::Series(k));
    let legend: Vec<Entry> =
        pairs.iter().enumerate().map(|(k, p)| (Mark::Symbol(mark(k).0, mark(k).1), (*p).to_owned())).collect();
    let step = 11.0;
    let height = 22.0 + step * pairs.len() as f64;
    let mut rows = Rows::new(&labels, height, (Axis::linear(-1.05, 1.05), "Cliff's delta"), &legend);
    rows.vertical(0.0, labels.len());
    for (metric, pair, delta) in &deltas {
        let row = metrics.iter().position(|f| f.name == *metric);
        let (Some(row), Some(k)) = (row, pairs.iter().position(|p| p == pair)) else { continue };
        let y = rows.centre(row) + step * (k as f64 - 0.5 * (pairs.len() - 1) as f64);
        if let (Some(from), Some(to)) = (rows.x.clamped(delta.low), rows.x.clamped(delta.high)) {
            rows.svg.segment((from, y), (to, y), Stroke::new(mark(k).1, 1.8));
        }
        if let Some(x) = rows.x.at(delta.estimate) {
            rows.svg.symbol(mark(k).0, (x, y), 3.6, mark(k).1);
        }
    }
    let mut numbers = Numbers::computed(
        sql::compared(data),
        &[("metric", ""), ("groups", ""), ("delta", "1"), ("low", "1"), ("high", "1")],
    );
    for (metric, pair, delta) in &deltas {
        let ends = [delta.estimate, delta.low, delta.high].map(number);
        numbers.row([text(*metric), text(pair)].into_iter().chain(ends));
    }
    let part = |(metric, pair, delta): &(&str, String, Interval)| {
        format!("{metric}, {pair}: {}", set::fixed(delta.estimate, 2))
    };
    let parts: Vec<String> = deltas.iter().take(8).map(part).collect();
    (!deltas.is_empty()).then(|| Figure {
        id: "comparison-deltas".into(),
        title: "How often one group exceeds the other.".into(),
        caption:
            "1: every terrain of the second group (or its member of every block) is above the first; −1: below; 0: as \
                  often above as below. Lines are 95 % intervals."
                .into(),
        description: format!("Cliff's delta of pairs of groups, from −1 to 1. {}.", parts.join("; ")),
        svg: rows.svg,
        numbers,
    })
}
