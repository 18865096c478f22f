//! From a difference and its null to an answer.

use super::{Answer, Comparison, Measure, NullSummary, Quantity};
use crate::fit::resampling::upper_p;
use sastrugi_numeric::sums;
use sastrugi_statistics::holm;

/// Draws of a difference when both sides are the same.
pub struct Null {
    pub kind: &'static str,
    pub draws: Vec<f64>,
    pub widened: f64,
}

impl Null {
    /// Signed draws, widened about their middle.
    pub fn signed(draws: Vec<f64>, widened: f64) -> Self {
        let middle = sums::median(&draws);
        let draws = draws.into_iter().map(|d| middle + widened * (d - middle)).collect();
        Self { kind: "simulated surfaces", draws, widened }
    }

    /// Distances, widened.
    pub fn distances(draws: Vec<f64>, widened: f64) -> Self {
        Self { kind: "simulated surfaces", draws: draws.into_iter().map(|d| widened * d).collect(), widened }
    }

    fn quantile(&self, q: f64) -> f64 {
        let mut sorted = self.draws.clone();
        sorted.sort_by(f64::total_cmp);
        sums::quantile_sorted(&sorted, q)
    }

    fn summary(&self) -> NullSummary {
        NullSummary {
            kind: self.kind,
            draws: self.draws.len(),
            mean: sums::mean(&self.draws),
            standard_deviation: sums::variance(&self.draws).sqrt(),
            widened: self.widened,
        }
    }
}

/// What is known of one quantity before the family is looked at.
pub struct Finding {
    pub name: String,
    pub values: [Option<f64>; 2],
    pub measure: Measure,
    /// Bound on the absolute difference.
    pub bound: f64,
    /// Difference and null, or why there is none.
    pub known: Result<(f64, Null), String>,
    /// What a sentence calls the values.
    pub words: String,
}

/// Answers for a family of findings.
pub fn decide(findings: Vec<Finding>, alpha: f64) -> Vec<Quantity> {
    let p: Vec<f64> =
        findings.iter().map(|f| f.known.as_ref().map_or(f64::NAN, |(d, n)| p_value(f.measure, *d, n))).collect();
    let adjusted = holm(&p);
    findings.into_iter().zip(p.iter().zip(&adjusted)).map(|(f, (&p, &q))| answer(f, p, q, alpha)).collect()
}

/// Share of draws at least as far out: signed ones from their middle, which leaves smaller p-values to few draws than
/// doubling the smaller tail does.
fn p_value(measure: Measure, difference: f64, null: &Null) -> f64 {
    let middle = if measure == Measure::Distance { 0.0 } else { sums::median(&null.draws) };
    let sizes: Vec<f64> = null.draws.iter().map(|d| (d - middle).abs()).collect();
    upper_p((difference - middle).abs(), &sizes)
}

/// Interval of the true difference at level `1 - 2 alpha`; of a distance by the triangle inequality, each end at `1 - alpha`.
fn interval(measure: Measure, difference: f64, null: &Null, alpha: f64) -> [f64; 2] {
    match measure {
        Measure::LogRatio => [difference - null.quantile(1.0 - alpha), difference - null.quantile(alpha)],
        Measure::Distance => {
            let reach = null.quantile(1.0 - alpha);
            [(difference - reach).max(0.0), difference + reach]
        }
    }
}

fn answer(finding: Finding, p: f64, adjusted: f64, alpha: f64) -> Quantity {
    let Finding { name, values: [a, b], measure, bound, known, words } = finding;
    let unknown = Quantity {
        name,
        a,
        b,
        measure,
        difference: None,
        interval: None,
        bound,
        p: None,
        p_adjusted: None,
        null: None,
        answer: Answer::CannotTell,
        why: String::new(),
    };
    let (difference, null) = match known {
        Ok(known) => known,
        Err(why) => return Quantity { why, ..unknown },
    };
    let interval = interval(measure, difference, &null, alpha);
    let within = interval[0] >= -bound && interval[1] <= bound;
    let answer = match (within, adjusted <= alpha) {
        (true, _) => Answer::Same,
        (false, true) => Answer::Different,
        (false, false) => Answer::CannotTell,
    };
    let why = Reason { measure, answer, difference, interval, bound, p, adjusted, alpha }.sentence(&words);
    Quantity {
        difference: Some(difference),
        interval: Some(interval),
        p: Some(p),
        p_adjusted: Some(adjusted),
        null: Some(null.summary()),
        answer,
        why,
        ..unknown
    }
}

/// What an answer rests on.
struct Reason {
    measure: Measure,
    answer: Answer,
    difference: f64,
    interval: [f64; 2],
    bound: f64,
    p: f64,
    adjusted: f64,
    alpha: f64,
}

impl Reason {
    fn sentence(&self, words: &str) -> String {
        let ([low, high], bound, difference) = (self.interval, self.bound, self.difference);
        let (found, bounds) = match self.measure {
            Measure::LogRatio => {
                let [d, low, high, least, most] = [difference, low, high, -bound, bound].map(libm::exp);
                let found = format!("{words} B/A is {d:.3}, between {low:.3} and {high:.3}");
                (found, format!("the bounds {least:.3} to {most:.3}"))
            }
            Measure::Distance => {
                let found = format!("{words} is {difference:.3}, between {low:.3} and {high:.3}");
                (found, format!("the bound {bound:.3}"))
            }
        };
        let p = format!("p = {:.3}, {:.3} after Holm", self.p, self.adjusted);
        match self.answer {
            Answer::Same if self.adjusted <= self.alpha => format!("{found}: inside {bounds}, though not equal ({p})"),
            Answer::Same => format!("{found}: inside {bounds}"),
            Answer::Different => format!("{found}: equality is ruled out ({p})"),
            Answer::CannotTell => {
                format!("{found}: this reaches beyond {bounds}, and equality is not ruled out ({p})")
            }
        }
    }
}

/// The whole from its parts: `different` when any is, `same` when all are.
pub fn overall(quantities: &[Quantity]) -> (Answer, String) {
    let named = |answer: Answer| {
        let names: Vec<&str> = quantities.iter().filter(|q| q.answer == answer).map(|q| q.name.as_str()).collect();
        names.join(", ")
    };
    let (same, different, open) = (named(Answer::Same), named(Answer::Different), named(Answer::CannotTell));
    let rest = if open.is_empty() { String::new() } else { format!("; the data cannot tell {open}") };
    let agree = if same.is_empty() { String::new() } else { format!("; the same within bounds in {same}") };
    match (different.is_empty(), open.is_empty()) {
        (false, _) => (Answer::Different, format!("A and B differ in {different}{agree}{rest}")),
        (true, true) => (Answer::Same, format!("A and B are the same within the stated bounds in {same}")),
        (true, false) => {
            (Answer::CannotTell, format!("the data cannot tell whether A and B are the same in {open}{agree}"))
        }
    }
}

impl Comparison {
    /// True when any quantity is different.
    pub fn differs(&self) -> bool {
        self.answer == Answer::Different
    }
}
