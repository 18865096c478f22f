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
    // The same streams as in the verb `compare`, so that both give the same answer.
    let streams = Streams::for_seed(0, releases::STREAMS);
    let settings = Settings { margin: MARGIN, alpha: ALPHA };
    let (quantities, alone) = releases::compare(&metrics(&other.data), &metrics(data), settings, &streams);
    let mut blocks = vec![Block::Text(introduction(other))];
    let only: Vec<String> = alone.concat();
    if !only.is_empty() {
        blocks.push(Block::Warning(format!("Not compared, because only one release has them: {}.", only.join("; "))));
    }
    if quantities.is_empty() {
        blocks.push(Block::Warning("The releases have no group in common.".into()));
        return Ok(blocks);
    }
    blocks.splice(0..0, [Block::Text(in_words(&quantities, &other.name))]);
    blocks.push(Block::Table(table(&quantities)));
    Ok(blocks)
}

fn metrics(data: &Data) -> Metrics {
    let mut metrics = Metrics::default();
    for row in &data.terrains {
        metrics.add_terrain(row, data.contents.get(&row.path).map(String::as_str));
    }
    data.missions.iter().for_each(|row| metrics.add_mission(row));
    metrics
}

/// Query for the rows from which the comparison is computed, in each of the releases.
const IN_EACH: &str =
    "select * from 'tables/terrains/*.parquet' left join 'tables/missions/*.parquet' using (terrain_id)";

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

/// Name and unit of a quantity: as on the page for missions, the column for terrains.
fn name(q: &Quantity) -> (&'static str, &'static str) {
    let of_missions = Statistic::ALL.into_iter().find(|s| q.table == "missions" && s.column() == q.name);
    of_missions.map_or((q.name, if q.unit == "1" { "" } else { q.unit }), words)
}

fn table(quantities: &[Quantity]) -> TableBlock {
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
    let mut numbers = Numbers::computed(IN_EACH, &columns).with_mixed_units();
    let or_nan = |v: Option<f64>| v.unwrap_or(f64::NAN);
    for q in quantities {
        let (name, unit) = name(q);
        let head = [text(name), text(&q.group), text(verdict(q)), text(unit)];
        let values = [q.a, q.b].into_iter().chain(q.shift.unwrap_or([f64::NAN; 3]));
        let tail = [q.p, q.p_adjusted, q.margin, q.p_equivalence].map(or_nan);
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
