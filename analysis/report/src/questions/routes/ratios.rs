//! Ratios of cost and effort of a method to those of its reference, between the same starts and goals.

use super::TERRAINS_MIN;
use super::methods::{Method, found, geometric_mean, groups, reference};
use crate::content::{Numbers, TableBlock, count, number, text};
use crate::data::Data;
use crate::questions::clusters::{Clusters, LEVEL, stream};
use sastrugi_schemas::tables::RouteRow;
use sastrugi_statistics::Interval;
use std::collections::{BTreeMap, BTreeSet};

/// Two routes between the same ends.
#[derive(Clone, Debug)]
pub struct Pair {
    /// Terrain of both.
    pub terrain_id: String,
    /// Smoothed cost over that of the reference.
    pub cost: f64,
    /// Expansions over those of the reference.
    pub expansions: f64,
}

/// A method compared with its reference on the terrains of a group.
#[derive(Clone, Debug)]
pub struct Ratio {
    /// Label of the terrains.
    pub group: String,
    /// Number of the method.
    pub method: usize,
    /// Number of the reference.
    pub reference: usize,
    /// Names of both.
    pub names: [String; 2],
    /// Pairs that both found.
    pub pairs: Vec<Pair>,
    /// Interval of the geometric mean of the cost ratio, where there are enough terrains.
    pub cost: Option<Interval>,
    /// The same for the expansions.
    pub expansions: Option<Interval>,
}

impl Ratio {
    /// Number of terrains of the pairs.
    pub fn terrains(&self) -> usize {
        self.pairs.iter().map(|p| p.terrain_id.as_str()).collect::<BTreeSet<_>>().len()
    }

    fn interval(&self, data: &Data, figure: &str, of: fn(&Pair) -> f64) -> Option<Interval> {
        let items: Vec<(&str, f64)> = self.pairs.iter().map(|p| (p.terrain_id.as_str(), of(p))).collect();
        let mut stream = stream(data, &self.group, &format!("route {figure} {}", self.names.join(" ")));
        let mean = |pooled: &[Vec<f64>]| geometric_mean(pooled[0].iter().copied());
        (self.terrains() >= TERRAINS_MIN).then(|| Clusters::new(&[items]).interval(&mut stream, LEVEL, mean)).flatten()
    }
}

/// Every method with its reference, in every group in which both found a route between the same ends.
pub fn ratios(data: &Data, methods: &[Method]) -> Vec<Ratio> {
    let mut ratios = Vec::new();
    for (group, routes) in groups(data) {
        for method in 0..methods.len() {
            let Some(reference) = reference(methods, method) else { continue };
            let pairs = pairs(&routes, &methods[method], &methods[reference]);
            let names = [method, reference].map(|m| methods[m].name.clone());
            let ratio = Ratio { group: group.clone(), method, reference, names, pairs, cost: None, expansions: None };
            let cost = ratio.interval(data, "cost", |p| p.cost);
            let expansions = ratio.interval(data, "expansions", |p| p.expansions);
            ratios.push(Ratio { cost, expansions, ..ratio });
        }
    }
    ratios.retain(|r| !r.pairs.is_empty());
    ratios
}

fn pairs(routes: &[&RouteRow], method: &Method, reference: &Method) -> Vec<Pair> {
    let of = |r: &&&RouteRow| found(r) && reference.holds(r);
    let beside: BTreeMap<(&str, &str), &RouteRow> =
        routes.iter().filter(of).map(|r| ((r.terrain_id.as_str(), r.pair_id.as_str()), *r)).collect();
    let pair = |r: &&RouteRow| {
        let other = beside.get(&(r.terrain_id.as_str(), r.pair_id.as_str()))?;
        Some(Pair {
            terrain_id: r.terrain_id.clone(),
            cost: r.smoothed_cost_m / other.smoothed_cost_m,
            expansions: r.expansions as f64 / other.expansions as f64,
        })
    };
    let usable = |p: &Pair| p.cost.is_finite() && p.cost > 0.0;
    routes.iter().filter(|r| found(r) && method.holds(r)).filter_map(pair).filter(usable).collect()
}

/// True if any ratio has an interval.
pub fn have_intervals(ratios: &[Ratio]) -> bool {
    ratios.iter().any(|r| r.cost.is_some() || r.expansions.is_some())
}

/// Means, intervals and extremes of both ratios; without the columns of intervals if none has one.
pub fn table(ratios: &[Ratio]) -> TableBlock {
    let columns = [
        ("group", ""),
        ("method", ""),
        ("reference", ""),
        ("pairs", "1"),
        ("terrains", "1"),
        ("smoothed cost", "1"),
        ("low", "1"),
        ("high", "1"),
        ("smallest", "1"),
        ("largest", "1"),
        ("expansions", "1"),
        ("low", "1"),
        ("high", "1"),
    ];
    let is_shown = |name: &str| have_intervals(ratios) || !matches!(name, "low" | "high");
    let shown: Vec<bool> = columns.iter().map(|c| is_shown(c.0)).collect();
    let columns: Vec<(&str, &str)> = columns.into_iter().filter(|c| is_shown(c.0)).collect();
    let query = "select \"group\", terrain_id, pair_id, stage_id, variant, outcome, smoothed_cost_m, expansions from 'tables/routes/*.parquet'";
    let mut numbers = Numbers::computed(query, &columns);
    for r in ratios {
        let end = |i: &Option<Interval>, of: fn(&Interval) -> f64| number(i.as_ref().map_or(f64::NAN, of));
        let costs = || r.pairs.iter().map(|p| p.cost);
        let cells = [
            text(&r.group),
            text(&r.names[0]),
            text(&r.names[1]),
            count(r.pairs.len()),
            count(r.terrains()),
            number(geometric_mean(costs())),
            end(&r.cost, |i| i.low),
            end(&r.cost, |i| i.high),
            number(costs().fold(f64::INFINITY, f64::min)),
            number(costs().fold(f64::NEG_INFINITY, f64::max)),
            number(geometric_mean(r.pairs.iter().map(|p| p.expansions))),
            end(&r.expansions, |i| i.low),
            end(&r.expansions, |i| i.high),
        ];
        numbers.row(cells.into_iter().zip(&shown).filter(|(_, shown)| **shown).map(|(cell, _)| cell));
    }
    TableBlock {
        id: "route-ratios".into(),
        caption: "Ratios to the reference between the same starts and goals".into(),
        numbers,
    }
}
