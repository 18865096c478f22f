//! Mixed logistic model of success with a random intercept per terrain.

use super::few_terrains;
use crate::content::{Block, Numbers, TableBlock, count, number, text};
use crate::data::{Data, Group, Mission};
use crate::questions::clusters::{LEVEL, Pairing};
use crate::questions::outcome::successful;
use crate::questions::sql;
use sastrugi_schemas::Cell;
use sastrugi_statistics::mixed_logistic::{Fit, Missions};
use sastrugi_statistics::normal;
use std::collections::BTreeMap;

const WORDS: &str = "Logistic regression of the success of each mission, with a random intercept per terrain that is normal on the \
log-odds scale and shared by the missions on the terrain. Odds ratios compare missions on terrains that are otherwise alike. \
Intervals are Wald's. Tests are likelihood-ratio tests against the model without the term and are not part of Holm's adjustment.";
const FEW_TERRAINS: &str = "With fewer than about ten terrains in a group, intervals are too short and p is too small; the tests of \
terrains above hold for any number.";
const OF_BLOCKS: &str = "Terrains of one block are treated as independent, which makes intervals wider than necessary.";

/// The table and its explanation; a sentence instead where there is no estimate.
pub fn blocks(data: &Data, groups: &[Group<Mission>], pairing: &Pairing) -> Vec<Block> {
    let notes = [(pairing.is_common(), OF_BLOCKS), (few_terrains(groups).is_some(), FEW_TERRAINS)];
    let words = notes.iter().filter(|n| n.0).fold(WORDS.to_owned(), |words, (_, note)| format!("{words} {note}"));
    let mut blocks = vec![Block::Heading("Odds of success".into()), Block::Text(words)];
    blocks.push(table(data, groups).map_or_else(|| Block::Text(without_estimate(groups).into()), Block::Table));
    blocks
}

fn without_estimate(groups: &[Group<Mission>]) -> &'static str {
    let one_outcome = |g: &Group<Mission>| g.rows.iter().all(|m| successful(m) == successful(g.rows[0]));
    if groups.iter().any(one_outcome) {
        "The model has no finite estimate here: in at least one group, all missions or none succeeded."
    } else {
        "The model has no finite estimate here: the data do not separate the variance between terrains from that between missions."
    }
}

fn table(data: &Data, groups: &[Group<Mission>]) -> Option<TableBlock> {
    let null = fit(groups, |_| vec![1.0])?;
    let full = fit(groups, |g| std::iter::once(1.0).chain((1..groups.len()).map(|k| unit(k == g))).collect())?;
    let columns = [
        ("term", ""),
        ("odds ratio", ""),
        ("low", ""),
        ("high", ""),
        ("coefficient", "1"),
        ("standard error", "1"),
        ("χ²", ""),
        ("degrees of freedom", ""),
        ("p", ""),
    ];
    let counts = "terrain_id, count(*) filter (where outcome = 'success') as successes, count(*) as missions";
    let query = format!("{} group by all", sql::missions(data, counts, None));
    let mut numbers = Numbers::computed(query, &columns);
    for (g, group) in groups.iter().enumerate().skip(1) {
        let weights: Vec<f64> = (0..groups.len()).map(|k| unit(k == g)).collect();
        let term = format!("{} versus {}", group.name, groups[0].name);
        numbers.row(odds(&term, full.contrast(&weights)).into_iter().chain([Cell::Null, Cell::Null, Cell::Null]));
    }
    numbers.row(std::iter::once(text("all groups")).chain(vec![Cell::Null; 5]).chain(ratio(&full, &null)));
    if let Some(trend) = fit(groups, |g| vec![1.0, g as f64]).filter(|_| groups.len() > 2) {
        numbers.row(
            odds("trend, per group in order", trend.contrast(&[0.0, 1.0])).into_iter().chain(ratio(&trend, &null)),
        );
    }
    let scatter = [number(full.deviation), number(full.deviation_error)];
    let scatter =
        [text("between terrains (standard deviation)"), Cell::Null, Cell::Null, Cell::Null].into_iter().chain(scatter);
    numbers.row(scatter.chain(vec![Cell::Null; 3]));
    let caption = "Mixed logistic model of success (exploratory)".into();
    Some(TableBlock { id: "comparison-model".into(), caption, numbers })
}

fn unit(one: bool) -> f64 {
    f64::from(u8::from(one))
}

/// The model with these covariates of each group.
fn fit(groups: &[Group<Mission>], covariates: impl Fn(usize) -> Vec<f64>) -> Option<Fit> {
    let mut terrains: BTreeMap<&str, BTreeMap<usize, (f64, f64)>> = BTreeMap::new();
    for (g, group) in groups.iter().enumerate() {
        for mission in &group.rows {
            let (goals, all) = terrains.entry(&mission.terrain_id).or_default().entry(g).or_default();
            *goals += unit(successful(mission));
            *all += 1.0;
        }
    }
    let missions = |(g, (successes, trials)): (&usize, &(f64, f64))| Missions {
        covariates: covariates(*g),
        successes: *successes,
        trials: *trials,
    };
    Fit::of(&terrains.values().map(|t| t.iter().map(missions).collect()).collect::<Vec<_>>())
}

/// Term, odds ratio with its interval, coefficient with its standard error.
fn odds(term: &str, (coefficient, error): (f64, f64)) -> [Cell; 6] {
    let reach = normal::quantile(0.5 * (1.0 + LEVEL)) * error;
    let ratio = |log_odds: f64| number(libm::exp(log_odds));
    let ends = [ratio(coefficient), ratio(coefficient - reach), ratio(coefficient + reach)];
    let [estimate, low, high] = ends;
    [text(term), estimate, low, high, number(coefficient), number(error)]
}

/// Likelihood ratio against a simpler model: chi-square, degrees of freedom, p.
fn ratio(fit: &Fit, simpler: &Fit) -> [Cell; 3] {
    let (chi2, freedom, p) = fit.against(simpler);
    [number(chi2), count(freedom), number(p)]
}
