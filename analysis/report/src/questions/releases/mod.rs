//! Does a release differ from another? Compared quantity by quantity.

use super::Question;
use super::clusters::LEVEL;
use super::comparison::ALPHA;
use super::comparison::values::words;
use crate::ReportError;
use crate::content::{Block, Numbers, TableBlock, number, text};
use crate::data::{Against, Data};
use crate::releases::{self, MARGIN, Metrics, Quantity, Settings};
use crate::render::number as set;
use sastrugi_numeric::Streams;
use sastrugi_schemas::study::Statistic;

/// Registry entry.
pub const QUESTION: Question =
    Question { id: "releases", name: "Other release", title: "Does this release differ from the other?", answer };

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let Some(other) = &data.against else { return Ok(Vec::new()) };
    let (quantities, alone) = compare(data, other);
    let mut blocks = vec![Block::Text(introduction(other))];
    let only: Vec<String> = alone.concat();
    if !only.is_empty() {
        blocks.push(Block::Warning(format!("Not compared, because only one release has them: {}.", only.join("; "))));
    }
    if quantities.is_empty() {
        blocks.push(Block::Warning("The releases have no group in common.".into()));
        return Ok(blocks);
    }
    blocks.splice(0..0, [Block::Result(in_words(&quantities, &other.name))]);
    blocks.push(Block::Table(table(&quantities, in_each(data, &other.data))));
    Ok(blocks)
}

/// Every quantity that both releases have, and the groups that only one has.
fn compare(data: &Data, other: &Against) -> (Vec<Quantity>, [Vec<String>; 2]) {
    // The same streams as in the verb `compare`, so that both give the same answer.
    let streams = Streams::for_seed(0, releases::STREAMS);
    let settings = Settings { margin: MARGIN, alpha: ALPHA };
    releases::compare(&metrics(&other.data), &metrics(data), settings, &streams)
}

fn metrics(data: &Data) -> Metrics {
    let mut metrics = Metrics::default();
    for row in &data.terrains {
        metrics.add_terrain(row, data.contents.get(&row.path).map(String::as_str));
    }
    data.missions.iter().for_each(|row| metrics.add_mission(row));
    metrics
}

/// Query for the rows from which the comparison is computed, in each of the releases; one without missions has no table of them.
fn in_each(data: &Data, other: &Data) -> &'static str {
    if data.missions.is_empty() || other.missions.is_empty() {
        return "select * from 'tables/terrains/*.parquet'";
    }
    "select * from 'tables/terrains/*.parquet' left join 'tables/missions/*.parquet' using (terrain_id)"
}

/// All verdicts, from same to different.
const VERDICTS: [&str; 5] =
    ["the same values", "equivalent within the margin", "differs, by less than the margin", "differs", "cannot tell"];

fn verdict(q: &Quantity) -> &'static str {
    let below = |p: Option<f64>| p.is_some_and(|p| p <= ALPHA);
    let [same, equivalent, within, differs, open] = VERDICTS;
    match (below(q.p_adjusted), below(q.p_equivalence)) {
        _ if q.equal => same,
        (true, true) => within,
        (true, false) => differs,
        (false, true) => equivalent,
        (false, false) => open,
    }
}

fn in_words(quantities: &[Quantity], other: &str) -> String {
    let adjectives =
        ["identical", "equivalent within the margin", "different by less than the margin", "different", "undecided"];
    let part = |(word, adjective): (&str, &str)| {
        let n = quantities.iter().filter(|q| verdict(q) == word).count();
        (n > 0).then(|| format!("{} {} {adjective}", set::count(n), if n == 1 { "is" } else { "are" }))
    };
    let parts: Vec<String> = VERDICTS.into_iter().zip(adjectives).filter_map(part).collect();
    format!("Of {} with {other}, {}.", set::counted(quantities.len(), "comparison"), parts.join(", "))
}

fn introduction(other: &Against) -> String {
    let theirs = &other.data;
    format!(
        "The other release is {} (study {}, {}, hash of the study {}). Differences are this release minus the other. Every terrain counts \
         once, with the mean over its missions (success: all missions; other metrics: successful missions only). Terrains are compared in \
         pairs (signed-rank tests) if every terrain of the smaller group has the same heights in both releases, by the hash of its content, \
         or the same random draws under the same id; otherwise as independent samples (rank-sum tests). The shift is Hodges and Lehmann's; its \
         {} % interval holds the shifts that the test would not reject if there were no ties. p values are from permutations, with Holm's \
         adjustment over all tests of this section. The equivalence margin is {} percentage points for success and class shares, and {} % of \
         the other release's mean for everything else, at {} % (two one-sided t tests of means, not adjusted). sastrugi compare gives the same \
         numbers, but counts differences below the margin as the same. Exploratory, unless both were set before the runs.",
        other.name,
        theirs.study.name,
        theirs.version,
        theirs.study_sha256,
        set::fixed(100.0 * LEVEL, 0),
        set::fixed(100.0 * MARGIN, 0),
        set::fixed(100.0 * MARGIN, 0),
        set::fixed(100.0 * ALPHA, 0),
    )
}

/// A quantity of terrains as on the rest of the page: its column, name, unit, and the factor into that unit.
type OfTerrain = (&'static str, &'static str, &'static str, f64);
const OF_TERRAINS: [OfTerrain; 7] = [
    ("relief_m", "relief", "m", 1.0),
    ("rms_height_m", "RMS height", "m", 1.0),
    ("rms_slope", "RMS slope", "", 1.0),
    ("share_low", "share of class low", "%", 100.0),
    ("share_semi", "share of class semi", "%", 100.0),
    ("share_high", "share of class high", "%", 100.0),
    ("psd_slope", "PSD slope", "", 1.0),
];

/// Name of a quantity, its unit and the factor into that unit, as on the rest of the page.
fn name(q: &Quantity) -> (&'static str, &'static str, f64) {
    let of_missions = Statistic::ALL.into_iter().find(|s| q.table == "missions" && s.column() == q.name);
    let of_terrains = OF_TERRAINS.into_iter().find(|of| q.table == "terrains" && of.0 == q.name);
    match (of_missions.map(words), of_terrains) {
        (Some((name, unit)), _) => (name, unit, 1.0),
        (None, Some((_, name, unit, factor))) => (name, unit, factor),
        (None, None) => (q.name, if q.unit == "1" { "" } else { q.unit }, 1.0),
    }
}

fn table(quantities: &[Quantity], query: &str) -> TableBlock {
    let columns = [
        ("quantity", ""),
        ("group", ""),
        ("verdict", ""),
        ("unit", ""),
        ("other", ""),
        ("this", ""),
        ("shift", ""),
        ("low", ""),
        ("high", ""),
        ("p", ""),
        ("p, Holm", ""),
        ("margin", ""),
        ("p, equivalence", ""),
        ("compared", ""),
    ];
    let mut numbers = Numbers::computed(query, &columns).with_mixed_units();
    let or_nan = |v: Option<f64>| v.unwrap_or(f64::NAN);
    for q in quantities {
        let (name, unit, factor) = name(q);
        let head = [text(name), text(&q.group), text(verdict(q)), text(unit)];
        let shift = q.shift.unwrap_or([f64::NAN; 3]);
        let values = [q.a, q.b].into_iter().chain(shift).map(move |value| factor * value);
        let margin = q.margin.map(|margin| factor * margin);
        let tail = [q.p, q.p_adjusted, margin, q.p_equivalence].map(or_nan);
        let of = match (q.paired, q.left_out) {
            (true, [0, 0]) => format!("{}, paired", set::counted(q.terrains[0], "terrain")),
            (true, [a, b]) => {
                format!("{}, paired; {a} and {b} left out", set::counted(q.terrains[0], "terrain"))
            }
            (false, _) => format!("{} + {} terrains", q.terrains[0], q.terrains[1]),
        };
        numbers.row(head.into_iter().chain(values.chain(tail).map(number)).chain([text(of)]));
    }
    TableBlock { id: "releases".into(), caption: "This release compared with the other".into(), numbers }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_schemas::Cell;

    /// Releases with missions and without: the query names only tables that both have. Quantities of terrains have words, and shares are in per cent, as
    /// the text says; no column is named as in the table.
    #[test]
    fn val_quantities_have_words_and_queries_can_run() {
        let against = |with_missions: bool| {
            let mut other = crate::tests::made_up::full(3, 24);
            other.terrains.iter_mut().for_each(|t| t.share_low *= 0.5);
            if !with_missions {
                other.missions.clear();
            }
            let mut data = crate::tests::made_up::full(3, 24);
            data.against = Some(Against { name: "other".into(), data: Box::new(other) });
            let blocks = answer(&data).unwrap();
            let table =
                blocks.into_iter().find_map(|b| if let Block::Table(table) = b { Some(table.numbers) } else { None });
            table.unwrap()
        };
        let [with, without] = [true, false].map(against);
        assert!(with.query.contains("tables/missions") && !without.query.contains("tables/missions"));
        let named = |numbers: &Numbers, name: &str| numbers.rows.iter().filter(|row| row[0] == text(name)).count();
        assert_eq!([named(&with, "efficiency"), named(&without, "efficiency")].map(|n| n > 0), [true, false]);
        assert!(with.rows.iter().all(|row| !matches!(&row[0], Cell::Text(name) if name.contains('_'))));
        let low = with.rows.iter().find(|row| row[0] == text("share of class low")).unwrap();
        assert_eq!((&low[3], &low[11]), (&text("%"), &number(5.0)), "{low:?}");
        let (Cell::F64(other), Cell::F64(this)) = (&low[4], &low[5]) else { panic!("{low:?}") };
        assert!(*this > 1.0 && (2.0 * other - this).abs() < 1e-9, "{other} {this}");
    }
}
