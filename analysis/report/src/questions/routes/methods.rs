//! Methods of the route searches of a release, and routes by group of terrains.

use crate::data::{Data, Natural, natural};
use crate::render::number as set;
use sastrugi_schemas::tables::RouteRow;
use std::collections::BTreeMap;

/// A way to search routes: a route stage, or a variant of one.
#[derive(Clone, Debug)]
pub struct Method {
    /// Id of the stage, with its variant.
    pub name: String,
    /// Search, threshold and neighbours in words.
    pub search: String,
    stage_id: String,
    variant: Option<String>,
    grid: bool,
    neighbours: i64,
    /// Terms that must agree for costs to be comparable: cost, vehicle, limits, width.
    terms: String,
}

impl Method {
    /// True for a route of this method.
    pub fn holds(&self, route: &RouteRow) -> bool {
        route.stage_id == self.stage_id && route.variant == self.variant
    }

    fn of(route: &RouteRow) -> Self {
        let variant = route.variant.as_ref().map_or_else(String::new, |v| format!(", {v}"));
        Self {
            name: format!("{}{variant}", route.stage_id),
            search: search(route),
            stage_id: route.stage_id.clone(),
            variant: route.variant.clone(),
            grid: route.method == "grid",
            neighbours: route.neighbours,
            terms: format!(
                "{} {:?} {} {} {}",
                route.cost, route.vehicle, route.max_up_deg, route.max_down_deg, route.width_m
            ),
        }
    }
}

/// The search in words, for example `roadmap without threshold, 4 neighbours`.
fn search(route: &RouteRow) -> String {
    let method = match route.method.as_str() {
        "roadmap" if route.threshold_m.is_finite() => {
            format!("roadmap, threshold {} m", set::plain(route.threshold_m, 3))
        }
        "roadmap" => "roadmap without threshold".to_owned(),
        "theta_star" => "Theta*".to_owned(),
        "anytime" => "anytime A*".to_owned(),
        other => other.to_owned(),
    };
    format!("{method}, {} neighbours", route.neighbours)
}

/// The methods of a release in natural order of their names; a stage's plain method precedes its variants.
pub fn methods(routes: &[RouteRow]) -> Vec<Method> {
    let mut methods: BTreeMap<(Natural, Option<Natural>), Method> = BTreeMap::new();
    for route in routes {
        let key = (natural(&route.stage_id), route.variant.as_deref().map(natural));
        methods.entry(key).or_insert_with(|| Method::of(route));
    }
    methods.into_values().collect()
}

/// The reference of a method: the grid search on the same terms, preferably with the same number of neighbours; without a grid search, the
/// first method on these terms. `None` for the reference itself.
pub fn reference(methods: &[Method], method: usize) -> Option<usize> {
    let own = methods.get(method)?;
    let comparable = methods.iter().enumerate().filter(|(_, m)| m.terms == own.terms && m.variant == own.variant);
    let best = comparable.min_by_key(|(i, m)| (!m.grid, m.neighbours != own.neighbours, *i))?.0;
    (best != method).then_some(best)
}

/// True for a route that was found.
pub fn found(route: &RouteRow) -> bool {
    route.outcome == "found"
}

/// Vertices over the cells that may be entered.
pub fn vertex_share(route: &RouteRow) -> f64 {
    route.vertices as f64 / route.free_cells as f64
}

/// Routes by label of their terrain, in natural order; `all` for those without a label.
pub fn groups(data: &Data) -> Vec<(String, Vec<&RouteRow>)> {
    let mut groups: BTreeMap<Natural, Vec<&RouteRow>> = BTreeMap::new();
    for route in &data.routes {
        groups.entry(natural(route.group.as_deref().unwrap_or("all"))).or_default().push(route);
    }
    groups.into_iter().map(|(key, routes)| (key.1, routes)).collect()
}

/// Geometric mean of positive values; NaN without any.
pub fn geometric_mean(values: impl Iterator<Item = f64>) -> f64 {
    let logs: Vec<f64> = values.filter(|v| *v > 0.0 && v.is_finite()).map(libm::log).collect();
    if logs.is_empty() { f64::NAN } else { libm::exp(sastrugi_numeric::sums::mean(&logs)) }
}
