//! The logistic model of success with an intercept of the terrain.

use crate::content::{Block, Numbers, TableBlock, count, number, text};
use crate::data::Group;
use crate::questions::clusters::{LEVEL, Pairing};
use crate::questions::outcome::successful;
use sastrugi_schemas::Cell;
use sastrugi_schemas::tables::MissionRow;
use sastrugi_statistics::mixed_logistic::{Fit, Missions};
use sastrugi_statistics::normal;
use std::collections::BTreeMap;

const WORDS: &str = "The odds of success, mission by mission, with an intercept of the terrain that is normal on the logarithmic \
scale: missions on one terrain share it. Odds ratios compare missions on terrains that are alike otherwise; intervals are Wald's, \
tests compare likelihoods with those of a model without the term.";
const OF_BLOCKS: &str = "Terrains of one block are taken as independent, which makes intervals wider than need be.";

/// The table and what it is; a sentence where there is no estimate.
pub fn blocks(groups: &[Group<MissionRow>], pairing: &Pairing) -> Vec<Block> {
    let words = if pairing.is_common() { format!("{WORDS} {OF_BLOCKS}") } else { WORDS.into() };
    let mut blocks = vec![Block::Heading("Odds of success".into()), Block::Text(words)];
    match table(groups) {
        Some(table) => blocks.push(Block::Table(table)),
        None => blocks.push(Block::Text(
            "The model has no finite estimate here: in a group every mission succeeded, or none did.".into(),
        )),
    }
    blocks
}

fn table(groups: &[Group<MissionRow>]) -> Option<TableBlock> {
    let null = fit(groups, |_| vec![1.0])?;
    let full = fit(groups, |g| std::iter::once(1.0).chain((1..groups.len()).map(|k| unit(k == g))).collect())?;
    let columns = [
        ("term", ""),
        ("odds ratio", ""),
        ("low", ""),
        ("high", ""),
        ("coefficient", ""),
        ("standard error", ""),
        ("χ²", ""),
        ("degrees of freedom", ""),
        ("p", ""),
    ];
    let query = "tables/missions, plain run: outcome = 'success' by group and terrain";
    let mut numbers = Numbers::new(query, &columns).with_mixed_units();
    for (g, group) in groups.iter().enumerate().skip(1) {
        let weights: Vec<f64> = (0..groups.len()).map(|k| unit(k == g)).collect();
        let term = format!("{} against {}", group.name, groups[0].name);
        numbers.row(odds(&term, full.contrast(&weights)).into_iter().chain([Cell::Null, Cell::Null, Cell::Null]));
    }
    numbers.row(std::iter::once(text("groups, all")).chain(vec![Cell::Null; 5]).chain(ratio(&full, &null)));
    if let Some(trend) = fit(groups, |g| vec![1.0, g as f64]).filter(|_| groups.len() > 2) {
        numbers.row(
            odds("per group, in their order", trend.contrast(&[0.0, 1.0])).into_iter().chain(ratio(&trend, &null)),
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
fn fit(groups: &[Group<MissionRow>], covariates: impl Fn(usize) -> Vec<f64>) -> Option<Fit> {
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

/// Term, odds ratio with its interval, coefficient with its error.
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
