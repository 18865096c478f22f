//! Hypotheses that the study declares: each with its estimate, its test, and what came of the claim.

use super::values::{self, Figure, Values};
use super::verdicts::{self, Measure, Verdict};
use crate::content::{Block, Numbers, TableBlock, number, text};
use crate::data::{Data, Group};
use crate::questions::clusters::Pairing;
use crate::render::number as set;
use sastrugi_schemas::study::{Direction, HypothesisItem, HypothesisTest};
use sastrugi_schemas::tables::MissionRow;
use sastrugi_statistics::{Interval, holm};
use std::collections::BTreeSet;

/// A hypothesis after its test.
struct Tested<'a> {
    claim: &'a HypothesisItem,
    words: String,
    of: String,
    /// What the estimate is.
    what: &'static str,
    estimate: Option<Interval>,
    p: f64,
    /// Over the family.
    adjusted: f64,
    /// True when no data of this many terrains could have supported the claim.
    hopeless: bool,
}

/// The table of the hypotheses; nothing when the study declares none.
pub fn blocks<'a>(data: &'a Data, groups: &'a [Group<'a, MissionRow>], pairing: &Pairing<'a>) -> Vec<Block> {
    if data.study.hypotheses.is_empty() {
        return Vec::new();
    }
    let mut tested: Vec<Tested> = data.study.hypotheses.iter().map(|h| test(data, h, groups, pairing)).collect();
    adjust(&mut tested);
    vec![
        Block::Heading("Declared before the run: confirmatory".into()),
        Block::Text(in_words(&tested)),
        Block::Table(table(&tested)),
        Block::Text(introduction(data)),
    ]
}

fn test<'a>(
    data: &Data,
    claim: &'a HypothesisItem,
    groups: &'a [Group<'a, MissionRow>],
    pairing: &Pairing<'a>,
) -> Tested<'a> {
    let figure = values::figure(claim.statistic, groups, pairing);
    let words = claim_in_words(claim, &figure);
    let untested = Tested {
        claim,
        words,
        of: String::new(),
        what: "",
        estimate: None,
        p: f64::NAN,
        adjusted: f64::NAN,
        hopeless: true,
    };
    let named = |name: &String| figure.groups.iter().find(|g| g.name == name.as_str() && !g.means.is_empty());
    let Some(members) = claim.groups.iter().map(named).collect::<Option<Vec<&Values>>>() else { return untested };
    let Verdict { of, test, size, .. } = match members[..] {
        [from, to] => verdicts::pair(data, &figure, [from, to], claim.alpha),
        _ => verdicts::over_groups(data, &figure, &members, claim.alpha),
    };
    let by_test = test.map_or(f64::NAN, |t| t.p);
    // Of two arrangements, one the mirror of the other, both are as extreme.
    let hopeless = test.is_none_or(|t| t.exact && 2.0 / t.arrangements as f64 > claim.alpha);
    match (size, claim.margin) {
        (Measure::Trend { interval, .. }, _) => {
            Tested { of, what: "rank correlation", estimate: interval, p: by_test, hopeless, ..untested }
        }
        (Measure::Pair { effect, .. }, None) => {
            Tested { of, what: "shift", estimate: effect.map(|e| e.shift), p: by_test, hopeless, ..untested }
        }
        (Measure::Pair { difference, .. }, Some(margin)) => {
            let p = difference.map_or(f64::NAN, |d| d.equivalence_p(margin));
            let estimate = difference.map(|d| d.interval(1.0 - 2.0 * claim.alpha));
            let hopeless = members.iter().any(|g| g.means.len() < 2);
            Tested { of, what: "difference of means", estimate, p, hopeless, ..untested }
        }
    }
}

/// Holm's adjustment within each family.
fn adjust(tested: &mut [Tested]) {
    let families: BTreeSet<&str> = tested.iter().map(|t| t.claim.family.as_str()).collect();
    for family in families {
        let members: Vec<usize> = (0..tested.len()).filter(|&k| tested[k].claim.family == family).collect();
        let p: Vec<f64> = members.iter().map(|&k| tested[k].p).collect();
        members.iter().zip(holm(&p)).for_each(|(&k, adjusted)| tested[k].adjusted = adjusted);
    }
}

fn claim_in_words(claim: &HypothesisItem, figure: &Figure) -> String {
    let way = match claim.direction {
        Some(Direction::Rises) => "rises",
        Some(Direction::Falls) => "falls",
        None if claim.test == HypothesisTest::Trend => "rises or falls",
        None => "differs",
    };
    match (claim.test, claim.margin) {
        (HypothesisTest::Trend, _) => format!("{} {way} over {}", figure.name, claim.groups.join(", ")),
        (_, Some(margin)) => {
            let unit = if figure.unit == "%" { "points" } else { figure.unit };
            let ends = claim.groups.join(" and ");
            format!("{}: {ends} differ by less than {} {unit}", figure.name, set::plain(margin, 4))
                .trim_end()
                .to_owned()
        }
        _ => format!("{} {way} from {}", figure.name, claim.groups.join(" to ")),
    }
}

/// What came of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Supported,
    Equivalent,
    NotSupported,
    Opposite,
    Apart,
    CannotTell,
    TooFew,
}

impl Outcome {
    const fn words(self) -> &'static str {
        match self {
            Self::Supported => "supported",
            Self::Equivalent => "equivalent within the margin",
            Self::NotSupported => "not supported",
            Self::Opposite => "not supported: it goes the other way",
            Self::Apart => "not supported: they differ by more than the margin",
            Self::CannotTell => "cannot tell",
            Self::TooFew => "cannot tell: too few terrains",
        }
    }

    const fn holds(self) -> bool {
        matches!(self, Self::Supported | Self::Equivalent)
    }

    const fn is_open(self) -> bool {
        matches!(self, Self::CannotTell | Self::TooFew)
    }
}

impl Tested<'_> {
    fn outcome(&self) -> Outcome {
        let found = self.adjusted <= self.claim.alpha;
        match self.claim.margin {
            Some(_) if found => Outcome::Equivalent,
            _ if found => self.direction(),
            _ if self.hopeless => Outcome::TooFew,
            Some(margin) if self.estimate.is_some_and(|i| i.low >= margin || i.high <= -margin) => Outcome::Apart,
            Some(_) => Outcome::CannotTell,
            None => Outcome::NotSupported,
        }
    }

    /// Whether a difference that was found goes where the claim says.
    fn direction(&self) -> Outcome {
        let estimate = self.estimate.map_or(f64::NAN, |i| i.estimate);
        let right = match self.claim.direction {
            None => true,
            Some(Direction::Rises) => estimate > 0.0,
            Some(Direction::Falls) => estimate < 0.0,
        };
        if right { Outcome::Supported } else { Outcome::Opposite }
    }
}

fn in_words(tested: &[Tested]) -> String {
    let of = |is: fn(Outcome) -> bool| tested.iter().filter(|t| is(t.outcome())).count();
    let (holds, open) = (of(Outcome::holds), of(Outcome::is_open));
    let claims = if tested.len() == 1 { "claim".into() } else { format!("{} claims", set::count(tested.len())) };
    format!(
        "Of the {claims} that the study declares, {} hold{}, {} not supported, and {} cannot be told.",
        set::count(holds),
        if holds == 1 { "s" } else { "" },
        match tested.len() - holds - open {
            1 => "1 is".into(),
            n => format!("{} are", set::count(n)),
        },
        set::count(open),
    )
}

fn introduction(data: &Data) -> String {
    format!(
        "Declared as [[hypothesis]] in study.toml, whose SHA-256 is {}: with another claim, margin or level this hash, which the \
         manifest and every table carry, would be another. Tests and units are those of the exploratory part: every terrain (or \
         block of paired terrains) counts once. Holm's adjustment is over the hypotheses of a family; a claim holds when its \
         adjusted p is at or below its level and, where it says which way, the estimate goes that way. p is two-sided. Intervals \
         have the coverage that goes with the level: 1 − α, for equivalence (two one-sided t tests) 1 − 2 α.",
        data.study_sha256
    )
}

fn table(tested: &[Tested]) -> TableBlock {
    let columns = [
        ("claim", ""),
        ("verdict", ""),
        ("estimate", ""),
        ("low", ""),
        ("high", ""),
        ("of what", ""),
        ("p", ""),
        ("p, Holm", ""),
        ("level", ""),
        ("family", ""),
        ("compared", ""),
        ("id", ""),
    ];
    let query = "study.toml [[hypothesis]]; tables/missions, plain run: mean by terrain (or block)";
    let mut numbers = Numbers::new(query, &columns).with_mixed_units();
    for t in tested {
        let ends = t.estimate.map_or([f64::NAN; 3], |i| [i.estimate, i.low, i.high]).map(number);
        let head = [text(&t.words), text(t.outcome().words())];
        let tail = [
            text(t.what),
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
