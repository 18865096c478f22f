//! Tests and sizes of the differences: every pair of groups, and the trend over ordered groups.

use super::values::{Figure, Values, common_blocks};
use super::{ALPHA, draws};
use crate::content::{Figure as Drawing, Numbers, TableBlock, count, number, text};
use crate::data::Data;
use crate::questions::clusters::{REPLICATES, stream};
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_statistics::{Effect, Interval, MeanDifference, Permutation, cluster_interval, holm, permutation, trend};

/// Groups of which every pair is compared; of more, each with the next.
const ALL_PAIRS_MAX: usize = 6;
/// Pairs that are drawn; all are in the table.
const PAIRS_DRAWN: usize = 6;
const SYMBOLS: [Symbol; 3] = [Symbol::Disc, Symbol::Square, Symbol::Triangle];

/// A test of one figure, with the size of what it tests.
pub struct Verdict {
    pub figure: &'static str,
    pub unit: &'static str,
    /// Groups from and to, or all in order.
    pub groups: String,
    /// Terrains of the groups, or their common blocks.
    pub of: String,
    pub test: Option<Permutation>,
    /// Adjusted over all tests of the page.
    pub adjusted: f64,
    pub size: Measure,
}

/// What is measured beside a test.
pub enum Measure {
    /// A pair: the effect, and the difference of means.
    Pair { effect: Option<Effect>, difference: Option<MeanDifference> },
    /// A trend: correlation of order and value.
    Trend { correlation: f64, interval: Option<Interval> },
}

/// Test of two samples of terrains, with sizes of their difference.
pub struct Pair {
    pub test: Option<Permutation>,
    pub effect: Option<Effect>,
    pub difference: Option<MeanDifference>,
}

impl Pair {
    /// Of samples that were drawn apart. Streams are named by what is compared and the figure.
    pub fn between(data: &Data, (item, column): (&str, &str), [from, to]: [&[f64]; 2], alpha: f64) -> Self {
        let [mut labels, mut redraws] = ["test", "effect"].map(|of| stream(data, item, &format!("{of} {column}")));
        Self {
            test: permutation::rank_sum(from, to, draws(from.len() + to.len()), &mut labels),
            effect: Effect::between(from, to, REPLICATES, 1.0 - alpha, &mut redraws),
            difference: MeanDifference::between(from, to),
        }
    }

    /// Of pairs, from their differences.
    pub fn of_differences(data: &Data, (item, column): (&str, &str), differences: &[f64], alpha: f64) -> Self {
        let [mut labels, mut redraws] = ["test", "effect"].map(|of| stream(data, item, &format!("{of} {column}")));
        Self {
            test: permutation::signed_rank(differences, draws(2 * differences.len()), &mut labels),
            effect: Effect::of_pairs(differences, REPLICATES, 1.0 - alpha, &mut redraws),
            difference: MeanDifference::of_pairs(differences),
        }
    }
}

/// All tests of the figures, adjusted as one family.
pub fn verdicts(data: &Data, figures: &[Figure]) -> Vec<Verdict> {
    let mut verdicts = Vec::new();
    for figure in figures {
        let groups: Vec<&Values> = figure.groups.iter().filter(|g| !g.means.is_empty()).collect();
        verdicts
            .extend(pairs(groups.len()).into_iter().map(|(a, b)| pair(data, figure, [groups[a], groups[b]], ALPHA)));
        if groups.len() > 2 && ordered(&groups) {
            verdicts.push(over_groups(data, figure, &groups, ALPHA));
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

/// True where labels end in numbers: their order is then one of size, not of names.
fn ordered(groups: &[&Values]) -> bool {
    let number = |g: &&Values| g.name.trim_start_matches(|c: char| !c.is_ascii_digit()).parse::<f64>().is_ok();
    groups.iter().all(number)
}

/// The test of a pair of groups at a level, and intervals of the coverage that goes with it.
pub fn pair(data: &Data, figure: &Figure, [from, to]: [&Values; 2], alpha: f64) -> Verdict {
    let groups = format!("{} to {}", from.name, to.name);
    let blocks = common_blocks(&[from, to]);
    let (of, pair) = if blocks.is_empty() {
        let (a, b) = (from.numbers(), to.numbers());
        (format!("{} + {} terrains", a.len(), b.len()), Pair::between(data, (&groups, figure.column), [&a, &b], alpha))
    } else {
        let d = permutation::differences(blocks.iter().map(|b| [b[0], b[1]]));
        (set::counted(d.len(), "block"), Pair::of_differences(data, (&groups, figure.column), &d, alpha))
    };
    let Pair { test, effect, difference } = pair;
    let size = Measure::Pair { effect, difference };
    Verdict { figure: figure.name, unit: figure.unit, groups, of, test, adjusted: f64::NAN, size }
}

/// The test of a trend at a level, and an interval of the coverage that goes with it.
pub fn over_groups(data: &Data, figure: &Figure, groups: &[&Values], alpha: f64) -> Verdict {
    let mut labels = stream(data, "trend", &format!("test {}", figure.column));
    let mut redraws = stream(data, "trend", &format!("effect {}", figure.column));
    let blocks = common_blocks(groups);
    let (of, test, correlation, interval) = if blocks.is_empty() {
        let values: Vec<Vec<f64>> = groups.iter().map(|g| g.numbers()).collect();
        let sizes: Vec<usize> = values.iter().map(Vec::len).collect();
        let drawn = |drawn: &[Vec<usize>]| {
            let taken = |(g, v): (&Vec<f64>, &Vec<usize>)| v.iter().map(|&k| g[k]).collect();
            trend::correlation_of_groups(&values.iter().zip(drawn).map(taken).collect::<Vec<_>>())
        };
        let interval = cluster_interval(&sizes, REPLICATES, 1.0 - alpha, &mut redraws, drawn);
        let counts = sizes.iter().map(usize::to_string).collect::<Vec<_>>().join(" + ");
        let test = trend::of_groups(&values, draws(sizes.iter().sum()), &mut labels);
        (format!("{counts} terrains"), test, trend::correlation_of_groups(&values), interval)
    } else {
        let drawn = |drawn: &[Vec<usize>]| {
            trend::correlation_of_blocks(&drawn[0].iter().map(|&k| blocks[k].clone()).collect::<Vec<_>>())
        };
        let interval = cluster_interval(&[blocks.len()], REPLICATES, 1.0 - alpha, &mut redraws, drawn);
        let test = trend::of_blocks(&blocks, draws(groups.len() * blocks.len()), &mut labels);
        (set::counted(blocks.len(), "block"), test, trend::correlation_of_blocks(&blocks), interval)
    };
    let groups = groups.iter().map(|g| g.name).collect::<Vec<_>>().join(", ");
    let size = Measure::Trend { correlation, interval };
    Verdict { figure: figure.name, unit: figure.unit, groups, of, test, adjusted: f64::NAN, size }
}

/// How many tests find something, in a sentence.
pub fn in_words(verdicts: &[Verdict]) -> String {
    let known = verdicts.iter().filter(|v| v.test.is_some()).count();
    let found = |v: &&Verdict| v.adjusted <= ALPHA;
    let left: Vec<String> = verdicts
        .iter()
        .filter(|v| v.test.is_some() && !found(v))
        .map(|v| format!("{} ({})", v.figure, v.groups))
        .collect();
    let without = match left.len() {
        0 => String::new(),
        n if n > 6 => format!(" {n} do not."),
        _ => format!(" No difference was found in {}, which does not show that there is none.", left.join("; ")),
    };
    format!(
        "Of {}, {} stay at or below {} % after Holm's adjustment over all of them.{without}",
        set::counted(known, "test"),
        set::count(verdicts.iter().filter(found).count()),
        set::fixed(100.0 * ALPHA, 0)
    )
}

/// Every pair of groups: test, shift, delta, margin.
pub fn table_of_pairs(verdicts: &[Verdict]) -> TableBlock {
    let columns = [
        ("figure", ""),
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
    let query = "tables/missions, plain run: mean by terrain (or block); success over all missions, others over successful ones";
    let mut numbers = Numbers::new(query, &columns).with_mixed_units();
    for v in verdicts {
        let Measure::Pair { effect, difference } = &v.size else { continue };
        let margin = difference.map_or(f64::NAN, |d| d.smallest_margin(ALPHA));
        let ends = |i: Option<Interval>| i.map_or([f64::NAN; 3], |i| [i.estimate, i.low, i.high]).map(number);
        let head = [text(v.figure), text(v.unit), text(&v.groups), text(&v.of)];
        let tail = [number(v.test.map_or(f64::NAN, |t| t.p)), number(v.adjusted), number(margin)];
        let sizes = ends(effect.map(|e| e.shift)).into_iter().chain(ends(effect.map(|e| e.delta)));
        numbers.row(head.into_iter().chain(sizes).chain(tail));
    }
    TableBlock { id: "comparison".into(), caption: "Pairs of groups (exploratory)".into(), numbers }
}

/// The trend of every figure.
pub fn table_of_trends(verdicts: &[Verdict]) -> TableBlock {
    let columns = [
        ("figure", ""),
        ("groups", ""),
        ("compared", ""),
        ("correlation", ""),
        ("low", ""),
        ("high", ""),
        ("p", ""),
        ("p, Holm", ""),
        ("arrangements", ""),
    ];
    let query = "tables/missions, plain run: mean by terrain (or block) of every group";
    let mut numbers = Numbers::new(query, &columns).with_mixed_units();
    for v in verdicts {
        let Measure::Trend { correlation, interval } = &v.size else { continue };
        numbers.row([
            text(v.figure),
            text(&v.groups),
            text(&v.of),
            number(*correlation),
            number(interval.map_or(f64::NAN, |i| i.low)),
            number(interval.map_or(f64::NAN, |i| i.high)),
            number(v.test.map_or(f64::NAN, |t| t.p)),
            number(v.adjusted),
            v.test.map_or(sastrugi_schemas::Cell::Null, |t| count(t.arrangements)),
        ]);
    }
    TableBlock { id: "comparison-trend".into(), caption: "Trend over the groups (exploratory)".into(), numbers }
}

/// Cliff's delta of every figure and pair with its interval; `None` where no pair has one.
pub fn drawing(figures: &[Figure], verdicts: &[Verdict]) -> Option<Drawing> {
    let known = |v: &Verdict| match &v.size {
        Measure::Pair { effect: Some(effect), .. } => Some((v.figure, v.groups.clone(), effect.delta)),
        _ => None,
    };
    let deltas: Vec<(&str, String, Interval)> = verdicts.iter().filter_map(known).collect();
    let mut pairs: Vec<&str> = Vec::new();
    for (_, pair, _) in &deltas {
        if !pairs.contains(&pair.as_str()) && pairs.len() < PAIRS_DRAWN {
            pairs.push(pair);
        }
    }
    let label = |f: &Figure| match f.name.strip_prefix("RMS ") {
        Some(name) => RowLabel { name: name.into(), detail: "RMS".into() },
        None => RowLabel { name: f.name.into(), detail: String::new() },
    };
    let labels: Vec<RowLabel> = figures.iter().map(label).collect();
    let mark = |k: usize| (SYMBOLS[k % SYMBOLS.len()], Paint::Series(k));
    let legend: Vec<Entry> =
        pairs.iter().enumerate().map(|(k, p)| (Mark::Symbol(mark(k).0, mark(k).1), (*p).to_owned())).collect();
    let step = 11.0;
    let height = 22.0 + step * pairs.len() as f64;
    let mut rows = Rows::new(&labels, height, (Axis::linear(-1.05, 1.05), "Cliff's delta"), &legend);
    rows.vertical(0.0, labels.len());
    for (figure, pair, delta) in &deltas {
        let row = figures.iter().position(|f| f.name == *figure);
        let (Some(row), Some(k)) = (row, pairs.iter().position(|p| p == pair)) else { continue };
        let y = rows.centre(row) + step * (k as f64 - 0.5 * (pairs.len() - 1) as f64);
        if let (Some(from), Some(to)) = (rows.x.clamped(delta.low), rows.x.clamped(delta.high)) {
            rows.svg.segment((from, y), (to, y), Stroke::new(mark(k).1, 1.8));
        }
        if let Some(x) = rows.x.at(delta.estimate) {
            rows.svg.symbol(mark(k).0, (x, y), 3.6, mark(k).1);
        }
    }
    let mut numbers = Numbers::new(
        "tables/missions, plain run: mean by terrain (or block), by pair of groups",
        &[("figure", ""), ("groups", ""), ("delta", "1"), ("low", "1"), ("high", "1")],
    );
    for (figure, pair, delta) in &deltas {
        let ends = [delta.estimate, delta.low, delta.high].map(number);
        numbers.row([text(*figure), text(pair)].into_iter().chain(ends));
    }
    let part = |(figure, pair, delta): &(&str, String, Interval)| {
        format!("{figure}, {pair}: {}", set::fixed(delta.estimate, 2))
    };
    let parts: Vec<String> = deltas.iter().take(8).map(part).collect();
    (!deltas.is_empty()).then(|| Drawing {
        id: "comparison-deltas".into(),
        title: "How often one group is above the other.".into(),
        caption:
            "1: every terrain of the second group (or its member of every block) is above the first, −1: below, 0: as \
                  often above as below. Lines are 95 % intervals."
                .into(),
        description: format!("Cliff's delta of pairs of groups, between −1 and 1. {}.", parts.join("; ")),
        svg: rows.svg,
        numbers,
    })
}
