//! Derives an answer from a difference and its null distribution.

use super::{Answer, Comparison, Measure, NullSummary, Quantity};
use crate::fit::resampling::upper_p;
use sastrugi_numeric::sums;
use sastrugi_statistics::holm;

/// Draws of a difference under the null hypothesis that both sides are the same.
pub struct Null {
    pub kind: &'static str,
    pub draws: Vec<f64>,
    pub widened: f64,
}

impl Null {
    /// Signed draws, widened about their median.
    pub fn signed(draws: Vec<f64>, widened: f64) -> Self {
        let middle = sums::median(&draws);
        let draws = draws.into_iter().map(|d| middle + widened * (d - middle)).collect();
        Self { kind: "simulated surfaces", draws, widened }
    }

    /// Distances, widened.
    pub fn distances(draws: Vec<f64>, widened: f64) -> Self {
        Self { kind: "simulated surfaces", draws: draws.into_iter().map(|d| widened * d).collect(), widened }
    }

    /// Distances between blocks in any order, widened.
    pub fn arrangements(draws: Vec<f64>, widened: f64) -> Self {
        Self { kind: "arrangements of blocks", ..Self::distances(draws, widened) }
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

/// One quantity before adjustment for the number of quantities.
pub struct Finding {
    pub name: String,
    pub values: [Option<f64>; 2],
    pub measure: Measure,
    /// Bound on the absolute difference.
    pub bound: f64,
    /// Difference and null, or why there is none.
    pub known: Result<(f64, Null), String>,
    /// Subject of the sentence that states the result.
    pub words: String,
}

/// Answers for a family of findings.
pub fn decide(findings: Vec<Finding>, alpha: f64) -> Vec<Quantity> {
    let p: Vec<f64> =
        findings.iter().map(|f| f.known.as_ref().map_or(f64::NAN, |(d, n)| p_value(f.measure, *d, n))).collect();
    let adjusted = holm(&p);
    findings.into_iter().zip(p.iter().zip(&adjusted)).map(|(f, (&p, &q))| answer(f, p, q, alpha)).collect()
}

/// Share of draws at least as extreme. Signed draws are measured from their median, which allows smaller p-values with few draws
/// than doubling the smaller tail does.
fn p_value(measure: Measure, difference: f64, null: &Null) -> f64 {
    let middle = if measure == Measure::Distance { 0.0 } else { sums::median(&null.draws) };
    let sizes: Vec<f64> = null.draws.iter().map(|d| (d - middle).abs()).collect();
    upper_p((difference - middle).abs(), &sizes)
}

/// Interval of the true difference at level `1 - 2 alpha`; for a distance, by the triangle inequality, each end at `1 - alpha`.
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
        site: None,
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

/// The evidence for an answer.
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
            Answer::Same if self.adjusted <= self.alpha => format!("{found}: within {bounds}, though not equal ({p})"),
            Answer::Same => format!("{found}: within {bounds}"),
            Answer::Different => format!("{found}: equality is ruled out ({p})"),
            Answer::CannotTell => {
                format!("{found}: the interval extends beyond {bounds}, and equality is not ruled out ({p})")
            }
        }
    }
}

/// The overall answer: `different` if any quantity is, `same` if all are.
pub fn overall(quantities: &[Quantity]) -> (Answer, String) {
    let named = |answer: Answer| {
        let names: Vec<&str> = quantities.iter().filter(|q| q.answer == answer).map(|q| q.name.as_str()).collect();
        names.join(", ")
    };
    let (same, different, open) = (named(Answer::Same), named(Answer::Different), named(Answer::CannotTell));
    let rest = if open.is_empty() { String::new() } else { format!("; the data cannot decide {open}") };
    let agree = if same.is_empty() { String::new() } else { format!("; they are the same within bounds in {same}") };
    match (different.is_empty(), open.is_empty()) {
        (false, _) => (Answer::Different, format!("A and B differ in {different}{agree}{rest}")),
        (true, true) => (Answer::Same, format!("A and B are the same within the stated bounds in {same}")),
        (true, false) => {
            (Answer::CannotTell, format!("the data cannot tell whether A and B are the same in {open}{agree}"))
        }
    }
}

impl Comparison {
    /// True if any quantity is different.
    pub fn differs(&self) -> bool {
        self.answer == Answer::Different
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn null(draws: &[f64]) -> Null {
        Null { kind: "by hand", draws: draws.to_vec(), widened: 1.0 }
    }

    fn finding(measure: Measure, bound: f64, known: Result<(f64, Null), String>) -> Finding {
        Finding { name: "x".to_owned(), values: [None, None], measure, bound, known, words: "the x".to_owned() }
    }

    /// By hand. Signed draws 1 to 5 have the median 3: a difference of 4.5 is 1.5 from it, which 1 and 5 exceed: (2 + 1) / 6. Of distances 1 to
    /// 5, 3.5 is exceeded by 4 and 5. Quantiles at 25 and 75 % are 2 and 4.
    #[test]
    fn val_p_and_interval_by_hand() {
        let null = null(&[4.0, 1.0, 5.0, 2.0, 3.0]);
        assert_eq!(p_value(Measure::LogRatio, 4.5, &null), 3.0 / 6.0);
        assert_eq!(p_value(Measure::LogRatio, 1.5, &null), 3.0 / 6.0);
        assert_eq!(p_value(Measure::Distance, 3.5, &null), 3.0 / 6.0);
        assert_eq!(p_value(Measure::Distance, 9.0, &null), 1.0 / 6.0);
        assert_eq!(interval(Measure::LogRatio, 10.0, &null, 0.25), [6.0, 8.0]);
        assert_eq!(interval(Measure::Distance, 10.0, &null, 0.25), [6.0, 14.0]);
        assert_eq!(interval(Measure::Distance, 1.0, &null, 0.25), [0.0, 5.0]);
    }

    /// Widening keeps the median of signed draws and scales their distances from it; distances are scaled themselves.
    #[test]
    fn val_widening() {
        assert_eq!(Null::signed(vec![1.0, 2.0, 4.0], 3.0).draws, [-1.0, 2.0, 8.0]);
        assert_eq!(Null::distances(vec![1.0, 2.0, 4.0], 3.0).draws, [3.0, 6.0, 12.0]);
    }

    /// Each answer by a difference of 0.3 with a null of 99 draws between -0.1 and 0.1: `same` if the bound is wide, `different` if it is
    /// narrow, `cannot tell` within the null and a narrow bound, or if there is no null. p = 1/100 is adjusted for the three known.
    #[test]
    fn val_answers() {
        let draws: Vec<f64> = (-49..=49).map(|k| 0.1 * f64::from(k) / 49.0).collect();
        let quantities = decide(
            vec![
                finding(Measure::LogRatio, 0.5, Ok((0.3, null(&draws)))),
                finding(Measure::LogRatio, 0.05, Ok((0.3, null(&draws)))),
                finding(Measure::LogRatio, 0.05, Ok((0.02, null(&draws)))),
                finding(Measure::LogRatio, 0.05, Err("no interval".to_owned())),
            ],
            0.05,
        );
        let answers: Vec<Answer> = quantities.iter().map(|q| q.answer).collect();
        assert_eq!(answers, [Answer::Same, Answer::Different, Answer::CannotTell, Answer::CannotTell]);
        assert_eq!((quantities[0].p, quantities[0].p_adjusted), (Some(0.01), Some(0.03)));
        assert!(quantities[3].p.is_none() && quantities[3].why == "no interval");
        assert!(quantities[1].why.contains("equality is ruled out") && quantities[2].why.contains("extends beyond"));
        assert_eq!(overall(&quantities).0, Answer::Different);
        assert_eq!((overall(&quantities[..1]).0, overall(&quantities[2..]).0), (Answer::Same, Answer::CannotTell));
        // An upper end just beyond the bound is not within it.
        let reach = quantities[2].interval.unwrap()[1];
        let with_bound = |bound: f64| {
            let one = finding(Measure::LogRatio, bound, Ok((0.02, null(&draws))));
            decide(vec![one], 0.05)[0].answer
        };
        assert_eq!((with_bound(reach), with_bound(0.999 * reach)), (Answer::Same, Answer::CannotTell));
    }
}
