//! Hypotheses declared in the study: each with its estimate, its test and its verdict.

use super::values::{self, Metric, Values};
use super::verdicts::{self, Level, Measure, Verdict};
use crate::content::{Block, Numbers, TableBlock, number, text};
use crate::data::{Data, Group, Mission};
use crate::questions::clusters::Pairing;
use crate::questions::sql;
use crate::render::number as set;
use sastrugi_schemas::study::{Direction, HypothesisItem, HypothesisTest};
use sastrugi_statistics::{Difference, Interval, holm};
use std::collections::BTreeSet;

/// Claims named in a sentence; the table has all.
const NAMED_MAX: usize = 4;

/// A hypothesis after its test.
struct Tested<'a> {
    claim: &'a HypothesisItem,
    words: String,
    /// Terrains or blocks compared; empty where a group has no missions with the metric.
    of: String,
    /// What the estimate measures.
    what: &'static str,
    /// Its unit as set in text; empty for a correlation.
    unit: &'static str,
    estimate: Option<Interval>,
    /// Direction of the effect, by its sign.
    way: f64,
    p: f64,
    /// Holm-adjusted p within the family.
    adjusted: f64,
    /// Smallest p that any data from this many terrains could give.
    least_p: f64,
    /// The same, adjusted within the family.
    least_adjusted: f64,
    /// For equivalence: p against a difference of at most the margin.
    beyond_p: f64,
    /// Claims in the family.
    family: usize,
}

/// Verdicts on the hypotheses; empty when the study declares none.
pub fn blocks<'a>(data: &'a Data, groups: &'a [Group<'a, Mission>], pairing: &Pairing<'a>) -> Vec<Block> {
    if data.study.hypotheses.is_empty() {
        return Vec::new();
    }
    let tested = tested(data, groups, pairing);
    vec![
        Block::Heading("Declared before the run: confirmatory".into()),
        Block::Result(sentence(&tested)),
        Block::Table(table(data, &tested)),
        Block::Text(introduction(data)),
    ]
}

/// The number of supported, unsupported and undecided claims, and each claim with its verdict, in a sentence.
fn sentence(tested: &[Tested]) -> String {
    let mut claims: Vec<String> =
        tested.iter().take(NAMED_MAX).map(|t| format!("\"{}\" ({})", t.words, t.verdict())).collect();
    if tested.len() > NAMED_MAX {
        claims.push(format!("and {} more", set::count(tested.len() - NAMED_MAX)));
    }
    format!("{}: {}.", in_words(tested).trim_end_matches('.'), claims.join("; "))
}

/// Every hypothesis with its test, adjusted over its family.
fn tested<'a>(data: &'a Data, groups: &'a [Group<'a, Mission>], pairing: &Pairing<'a>) -> Vec<Tested<'a>> {
    let claims = &data.study.hypotheses;
    let family = |of: &HypothesisItem| claims.iter().filter(|h| h.family == of.family).count();
    let mut tested: Vec<Tested> = claims.iter().map(|h| test(data, h, family(h), groups, pairing)).collect();
    adjust(&mut tested);
    tested
}

fn test<'a>(
    data: &Data,
    claim: &'a HypothesisItem,
    family: usize,
    groups: &'a [Group<'a, Mission>],
    pairing: &Pairing<'a>,
) -> Tested<'a> {
    let metric = values::metric(claim.statistic, groups, pairing);
    let untested = Tested {
        claim,
        words: claim_in_words(claim, &metric),
        of: String::new(),
        what: "",
        unit: "",
        estimate: None,
        way: f64::NAN,
        p: f64::NAN,
        adjusted: f64::NAN,
        least_p: f64::NAN,
        least_adjusted: f64::NAN,
        beyond_p: f64::NAN,
        family,
    };
    let of_run = |g: &&Values| claim.traverse.is_none() || g.run == claim.traverse.as_deref();
    let named =
        |name: &String| metric.groups.iter().filter(of_run).find(|g| g.label == name.as_str() && !g.means.is_empty());
    let Some(members) = claim.groups.iter().map(named).collect::<Option<Vec<&Values>>>() else { return untested };
    let level = Level { alpha: claim.alpha, tests: family };
    let Verdict { of, test, size, .. } = match members[..] {
        [from, to] => verdicts::pair(data, &metric, [from, to], level),
        _ => verdicts::over_groups(data, &metric, &members, level),
    };
    let p = test.map_or(f64::NAN, |t| t.p);
    let least_p = test.map_or(f64::NAN, |t| t.least_p);
    let tested = Tested { of, p, least_p, ..untested };
    let unit = of_difference(metric.unit);
    match (size, claim.margin) {
        (Measure::Trend(estimate), _) => {
            let way = estimate.map_or(f64::NAN, |i| i.estimate);
            Tested { what: "rank correlation", estimate, way, ..tested }
        }
        (Measure::Pair(difference), None) => {
            let estimate = difference.effect.map(|e| e.shift);
            Tested { what: "shift", unit, estimate, way: difference.way(), ..tested }
        }
        (Measure::Pair(Difference { means, .. }), Some(margin)) => {
            // With one terrain in a group, no data have a standard error: no p below 1 is possible.
            let least_p = if means.is_some() { 0.0 } else { test.map_or(f64::NAN, |_| 1.0) };
            let p = means.map_or(least_p, |d| d.equivalence_p(margin));
            let beyond_p = means.map_or(f64::NAN, |d| d.beyond_p(margin));
            let estimate = means.map(|d| d.interval(1.0 - 2.0 * claim.alpha));
            Tested { what: "difference of means", unit, estimate, p, beyond_p, least_p, ..tested }
        }
    }
}

/// Holm's adjustment within each family.
fn adjust(tested: &mut [Tested]) {
    let families: BTreeSet<&str> = tested.iter().map(|t| t.claim.family.as_str()).collect();
    for family in families {
        let members: Vec<usize> = (0..tested.len()).filter(|&k| tested[k].claim.family == family).collect();
        let over = |p: fn(&Tested) -> f64| holm(&members.iter().map(|&k| p(&tested[k])).collect::<Vec<_>>());
        // Holm's adjusted p rises with every p of the family, so the smallest p values give the smallest adjusted p.
        let (adjusted, least) = (over(|t| t.p), over(|t| t.least_p));
        for ((k, adjusted), least) in members.into_iter().zip(adjusted).zip(least) {
            (tested[k].adjusted, tested[k].least_adjusted) = (adjusted, least);
        }
    }
}

fn claim_in_words(claim: &HypothesisItem, metric: &Metric) -> String {
    let way = match claim.direction {
        Some(Direction::Rises) => "rises",
        Some(Direction::Falls) => "falls",
        None if claim.test == HypothesisTest::Trend => "rises or falls",
        None => "differs",
    };
    let words = match (claim.test, claim.margin) {
        (HypothesisTest::Trend, _) => format!("{} {way} over {}", metric.name, claim.groups.join(", ")),
        (_, Some(margin)) => {
            let margin = set::before_unit(&set::plain(margin, 4), of_difference(metric.unit));
            format!("{}: {} differ by less than {margin}", metric.name, claim.groups.join(" and "))
        }
        _ if claim.direction.is_none() => format!("{} {way} between {}", metric.name, claim.groups.join(" and ")),
        _ => format!("{} {way} from {}", metric.name, claim.groups.join(" to ")),
    };
    claim.traverse.as_ref().map_or_else(|| words.clone(), |run| format!("{words} ({run})"))
}

/// Unit of the difference of two values in a unit.
fn of_difference(unit: &'static str) -> &'static str {
    if unit == "%" { "points" } else { unit }
}

/// Verdict on a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Supported,
    Equivalent,
    NotSupported,
    Opposite,
    Apart,
    CannotTell,
    NoMissions,
    NoPairs,
    TooFew,
}

impl Outcome {
    const fn words(self) -> &'static str {
        match self {
            Self::Supported => "supported",
            Self::Equivalent => "equivalent within the margin",
            Self::NotSupported => "not supported",
            Self::Opposite => "not supported: the effect has the opposite direction",
            Self::Apart => "not supported: the groups differ by more than the margin",
            Self::CannotTell => "cannot tell",
            Self::NoMissions => "cannot tell: a group has no missions with this metric",
            Self::NoPairs => "cannot tell: no paired missions have this metric in every group",
            Self::TooFew => "cannot tell: too few terrains",
        }
    }

    const fn holds(self) -> bool {
        matches!(self, Self::Supported | Self::Equivalent)
    }

    const fn is_open(self) -> bool {
        matches!(self, Self::CannotTell | Self::NoMissions | Self::NoPairs | Self::TooFew)
    }
}

impl Tested<'_> {
    fn outcome(&self) -> Outcome {
        let found = self.adjusted <= self.claim.alpha;
        match self.claim.margin {
            Some(_) if found => Outcome::Equivalent,
            _ if found => self.direction(),
            _ if self.of.is_empty() => Outcome::NoMissions,
            _ if self.p.is_nan() => Outcome::NoPairs,
            _ if self.least_adjusted > self.claim.alpha => Outcome::TooFew,
            // Bonferroni's adjustment over the family.
            Some(_) if self.beyond_p * self.family as f64 <= self.claim.alpha => Outcome::Apart,
            Some(_) => Outcome::CannotTell,
            None => Outcome::NotSupported,
        }
    }

    /// The verdict with its reason: the p that decided, or what kept it from deciding.
    fn verdict(&self) -> String {
        let words = self.outcome().words();
        match self.outcome() {
            Outcome::Supported | Outcome::Equivalent | Outcome::NotSupported | Outcome::CannotTell => {
                format!("{words}, adjusted p {}", set::significant(self.adjusted, 2))
            }
            _ => words.to_owned(),
        }
    }

    /// Whether a significant difference has the claimed direction.
    fn direction(&self) -> Outcome {
        let right = match self.claim.direction {
            None => true,
            Some(Direction::Rises) => self.way > 0.0,
            Some(Direction::Falls) => self.way < 0.0,
        };
        if right { Outcome::Supported } else { Outcome::Opposite }
    }
}

fn in_words(tested: &[Tested]) -> String {
    let of = |is: fn(Outcome) -> bool| tested.iter().filter(|t| is(t.outcome())).count();
    let (holds, open) = (of(Outcome::holds), of(Outcome::is_open));
    let fails = tested.len() - holds - open;
    match (tested.len(), holds, open) {
        (1, 1, _) => return "One hypothesis was declared; the data support it.".to_owned(),
        (1, _, 1) => return "One hypothesis was declared; the data cannot decide it.".to_owned(),
        (1, ..) => return "One hypothesis was declared; the data do not support it.".to_owned(),
        (n, 0, 0) => return format!("None of the {} declared hypotheses is supported.", set::count(n)),
        _ => {}
    }
    let be = |n: usize| format!("{} {}", set::count(n), if n == 1 { "is" } else { "are" });
    let parts = [
        (holds, format!("{} supported", be(holds))),
        (fails, format!("{} not supported", be(fails))),
        (open, format!("{} undecided", be(open))),
    ];
    let stated: Vec<String> = parts.into_iter().filter(|(n, _)| *n > 0).map(|(_, words)| words).collect();
    format!("Of {} declared hypotheses, {}.", set::count(tested.len()), stated.join(", "))
}

fn introduction(data: &Data) -> String {
    format!(
        "The hypotheses are declared as [[hypothesis]] in study.toml. Its SHA-256 is {}; the manifest and every table carry this \
         hash, which would change with any claim, margin or level. Tests and units are those of the exploratory part: every \
         terrain (or block of paired terrains) counts once. Holm's adjustment is made within each family. A claim is supported if \
         its adjusted p is at or below its level and the estimate has the claimed direction, if one is claimed. p is two-sided. \
         Intervals are not adjusted; their coverage is 1 − α, or 1 − 2 α for equivalence (two one-sided t tests). \"Too few \
         terrains\" means that no data from this many terrains could have supported the claim after adjustment.",
        data.study_sha256
    )
}

fn table(data: &Data, tested: &[Tested]) -> TableBlock {
    let columns = [
        ("claim", ""),
        ("verdict", ""),
        ("estimate", ""),
        ("low", ""),
        ("high", ""),
        ("measure", ""),
        ("p", ""),
        ("p, Holm", ""),
        ("level", ""),
        ("family", ""),
        ("compared", ""),
        ("id", ""),
    ];
    let mut numbers = Numbers::computed(sql::compared(data), &columns).with_mixed_units();
    for t in tested {
        let ends = t.estimate.map_or([f64::NAN; 3], |i| [i.estimate, i.low, i.high]).map(number);
        let head = [text(&t.words), text(t.outcome().words())];
        let tail = [
            text([t.what, t.unit].into_iter().filter(|words| !words.is_empty()).collect::<Vec<_>>().join(", ")),
            number(t.p),
            number(t.adjusted),
            number(t.claim.alpha),
            text(&t.claim.family),
            text(&t.of),
            text(&t.claim.id),
        ];
        numbers.row(head.into_iter().chain(ends).chain(tail));
    }
    TableBlock { id: "hypotheses".into(), caption: "Hypotheses of the study (confirmatory)".into(), numbers }
}
