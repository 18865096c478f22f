//! Whether a release differs from another one, group by group: by tests whose unit is the terrain.

use super::Question;
use super::clusters::{LEVEL, Pairing, REPLICATES};
use super::comparison::ALPHA;
use super::comparison::values::{self, Figure, Values};
use super::comparison::verdicts::Pair;
use crate::ReportError;
use crate::content::{Block, Numbers, TableBlock, number, text};
use crate::data::{Against, Data, Group};
use crate::render::number as set;
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::MissionRow;
use sastrugi_statistics::{holm, permutation};
use std::collections::{BTreeMap, BTreeSet};

/// Registry entry.
pub const QUESTION: Question =
    Question { id: "releases", name: "Other release", title: "Does this release differ from the other?", answer };

/// Margin of equivalence of success, percentage points.
const MARGIN_POINTS: f64 = 5.0;
/// Margin of equivalence of other figures, as a share of the other release's mean.
const MARGIN_SHARE: f64 = 0.05;

/// A figure of a group in both releases.
struct Compared {
    group: String,
    figure: &'static str,
    unit: &'static str,
    of: String,
    /// Means over terrains: of the other release, of this one.
    means: [f64; 2],
    margin: f64,
    pair: Pair,
    /// True where every terrain has the same value in both.
    equal: bool,
    adjusted: f64,
}

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let Some(other) = &data.against else { return Ok(Vec::new()) };
    let (here, there) = (data.mission_groups(), other.data.mission_groups());
    let names = |groups: &[Group<MissionRow>]| groups.iter().map(|g| g.name.clone()).collect::<BTreeSet<_>>();
    let common: BTreeSet<String> = names(&here).intersection(&names(&there)).cloned().collect();
    let only: Vec<String> = names(&here).symmetric_difference(&names(&there)).cloned().collect();
    let mut blocks = vec![Block::Text(introduction(other))];
    if !only.is_empty() {
        blocks.push(Block::Warning(format!("Groups in one release alone are not compared: {}.", only.join(", "))));
    }
    if common.is_empty() {
        blocks.push(Block::Warning("The releases have no group of missions in common.".into()));
        return Ok(blocks);
    }
    let mut compared = Vec::new();
    for name in &common {
        let member = |groups: &[Group<'_, MissionRow>]| groups.iter().position(|g| g.name == *name);
        let (Some(a), Some(b)) = (member(&there), member(&here)) else { continue };
        compared.extend(of_group(data, other, &there[a..=a], &here[b..=b]));
    }
    let p: Vec<f64> = compared.iter().map(|c| c.pair.test.map_or(f64::NAN, |t| t.p)).collect();
    compared.iter_mut().zip(holm(&p)).for_each(|(c, p)| c.adjusted = p);
    blocks.splice(0..0, [Block::Text(in_words(&compared, &other.name))]);
    blocks.push(Block::Table(table(&compared)));
    Ok(blocks)
}

/// Every figure of a group. Terrains are paired where both releases have the same ones.
fn of_group(data: &Data, other: &Against, there: &[Group<MissionRow>], here: &[Group<MissionRow>]) -> Vec<Compared> {
    let alone = Pairing::of_terrains();
    let same = heights(&other.data, there).is_some_and(|theirs| heights(data, here).is_some_and(|ours| ours == theirs));
    let (theirs, ours) = (values::figures(there, &alone), values::figures(here, &alone));
    theirs.iter().zip(&ours).filter_map(|(a, b)| compare(data, a, b, same)).collect()
}

fn compare(data: &Data, there: &Figure, here: &Figure, same_terrains: bool) -> Option<Compared> {
    let [from, to]: [&Values; 2] = [there.groups.first()?, here.groups.first()?];
    let (a, b) = (from.numbers(), to.numbers());
    if a.is_empty() || b.is_empty() {
        return None;
    }
    let means = [sums::mean(&a), sums::mean(&b)];
    let margin = if here.column == "success" { MARGIN_POINTS } else { MARGIN_SHARE * means[0].abs() };
    let item = format!("{} against other release", to.name);
    let pairs = || from.means.iter().filter_map(|(name, v)| Some([*v, *to.means.get(name)?]));
    let (of, pair, equal) = if same_terrains {
        let d = permutation::differences(pairs());
        let equal = d.iter().all(|d| *d == 0.0) && a.len() == b.len();
        (
            format!("{}, paired", set::counted(d.len(), "terrain")),
            Pair::of_differences(data, (&item, here.column), &d, ALPHA),
            equal,
        )
    } else {
        let pair = Pair::between(data, (&item, here.column), [&a, &b], ALPHA);
        (format!("{} + {} terrains", a.len(), b.len()), pair, false)
    };
    let (group, figure, unit) = (to.name.to_owned(), here.name, here.unit);
    Some(Compared { group, figure, unit, of, means, margin, pair, equal, adjusted: f64::NAN })
}

/// Content of the heights that a group drives on, by terrain; `None` where the release does not state it.
fn heights<'a>(data: &'a Data, groups: &'a [Group<MissionRow>]) -> Option<BTreeMap<&'a str, &'a str>> {
    let ids: BTreeSet<&str> = groups.iter().flat_map(|g| &g.rows).map(|m| m.terrain_id.as_str()).collect();
    ids.into_iter().map(|id| Some((id, data.contents.get(&data.terrain(id)?.path)?.as_str()))).collect()
}

impl Compared {
    fn equivalence_p(&self) -> f64 {
        self.pair.difference.map_or(f64::NAN, |d| d.equivalence_p(self.margin))
    }

    fn verdict(&self) -> &'static str {
        match (self.adjusted <= ALPHA, self.equivalence_p() <= ALPHA) {
            _ if self.equal => "the same values",
            (true, true) => "differs, by less than the margin",
            (true, false) => "differs",
            (false, true) => "equivalent within the margin",
            (false, false) => "cannot tell",
        }
    }
}

fn in_words(compared: &[Compared], other: &str) -> String {
    let words = [
        "the same values",
        "equivalent within the margin",
        "differs, by less than the margin",
        "differs",
        "cannot tell",
    ];
    let part = |word: &&str| {
        let n = compared.iter().filter(|c| c.verdict() == *word).count();
        (n > 0).then(|| format!("{word}: {}", set::count(n)))
    };
    let parts: Vec<String> = words.iter().filter_map(part).collect();
    format!("{} of groups beside those of {other}: {}.", set::counted(compared.len(), "figure"), parts.join("; "))
}

fn introduction(other: &Against) -> String {
    let theirs = &other.data;
    format!(
        "The other release is {} (study {}, {}, hash of the study {}). Differences are this release less the other. Every terrain counts \
         once, by the mean of its missions (success: of all; other figures: of the successful ones). Terrains are paired where both \
         releases drive on the same heights under the same ids (by the hash of their content): signed-rank tests; elsewhere \
         they are independent: rank-sum tests. The shift is Hodges and Lehmann's with {} % intervals over terrains \
         ({REPLICATES} redraws). p by permutation, Holm over all tests of this section. Equivalent means: within a margin of {} points of success, \
         {} % of the other's mean for other figures, at {} % (two one-sided t tests of means, not adjusted). Exploratory, unless both were set \
         before the runs.",
        other.name,
        theirs.study.name,
        theirs.version,
        theirs.study_sha256,
        set::fixed(100.0 * LEVEL, 0),
        set::fixed(MARGIN_POINTS, 0),
        set::fixed(100.0 * MARGIN_SHARE, 0),
        set::fixed(100.0 * ALPHA, 0),
    )
}

fn table(compared: &[Compared]) -> TableBlock {
    let columns = [
        ("figure", ""),
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
    let query = "tables/missions of both releases, plain run: mean by terrain and group";
    let mut numbers = Numbers::new(query, &columns).with_mixed_units();
    for c in compared {
        let shift = c.pair.effect.map_or([f64::NAN; 3], |e| [e.shift.estimate, e.shift.low, e.shift.high]);
        let head = [text(c.figure), text(&c.group), text(c.verdict()), text(c.unit)];
        let p = c.pair.test.map_or(f64::NAN, |t| t.p);
        let tail = [p, c.adjusted, c.margin, c.equivalence_p()].map(number);
        numbers
            .row(head.into_iter().chain(c.means.map(number)).chain(shift.map(number)).chain(tail).chain([text(&c.of)]));
    }
    TableBlock { id: "releases".into(), caption: "This release against the other".into(), numbers }
}
