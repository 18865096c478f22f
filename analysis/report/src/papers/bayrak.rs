//! Published values of A. G. Bayrak's thesis (2008): Tables 5.1 to 5.5.

use crate::data::Data;
use sastrugi_schemas::tables::RouteRow;
use serde::Deserialize;

const BAYRAK: &str = include_str!("bayrak.json");

/// The values. Lengths are in map units, one cell.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thesis {
    /// Author.
    pub author: String,
    /// Year.
    pub year: u32,
    /// Title.
    pub title: String,
    /// Distance between neighbouring slots of its formations.
    pub spacing: f64,
    /// Its maps, by the label of our group of the same kind.
    pub maps: Vec<PublishedMap>,
    /// Errors of its teams.
    pub formations: Vec<PublishedTeam>,
}

/// A map and the routes on it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedMap {
    /// `plain 500`, `very rough 2000`, `measured`.
    pub group: String,
    /// Cells.
    pub cells: u64,
    /// Where it is printed.
    pub origin: String,
    /// `grid`, `hdt2`, `hdt5`, `nohdt`.
    pub methods: Vec<PublishedRoute>,
}

/// A route: one row of Tables 5.1 to 5.4.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedRoute {
    /// Method.
    pub method: String,
    /// Vertices.
    pub vertices: u64,
    /// Cost of the path found by A*.
    pub searched_cost: f64,
    /// Cost of the smoothed path.
    pub smoothed_cost: f64,
}

/// A team of four: one row of Table 5.5, its three followers.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedTeam {
    /// Map.
    pub group: String,
    /// `column`, `line`, `wedge`.
    pub formation: String,
    /// Mean absolute errors in depth.
    pub depth_errors: Vec<f64>,
    /// Mean absolute errors in width.
    pub width_errors: Vec<f64>,
}

/// The thesis, if a group of the release's routes or teams has the label of one of its maps.
pub fn applicable(data: &Data) -> Option<Thesis> {
    let thesis: Thesis = serde_json::from_str(BAYRAK).ok()?;
    let routes = data.routes.iter().filter_map(|r| r.group.as_deref());
    let mut labels = routes.chain(data.formations.iter().filter_map(|f| f.group.as_deref()));
    labels.any(|label| thesis.map(label).is_some()).then_some(thesis)
}

/// The thesis' name for the method of a route (four neighbours, slope cost); `None` for methods that it does not have.
pub fn method(route: &RouteRow) -> Option<&'static str> {
    let plain = route.neighbours == 4 && route.cost == "slope" && route.variant.is_none();
    match route.method.as_str() {
        _ if !plain => None,
        "grid" => Some("grid"),
        "roadmap" if route.threshold_m == 2.0 => Some("hdt2"),
        "roadmap" if route.threshold_m == 5.0 => Some("hdt5"),
        "roadmap" if route.threshold_m.is_nan() => Some("nohdt"),
        _ => None,
    }
}

/// A label without its size: `very rough 500` has the kind `very rough`.
pub fn kind(label: &str) -> &str {
    label.trim_end_matches(|c: char| c.is_ascii_digit() || c == ' ')
}

impl Thesis {
    /// The map with a label.
    pub fn map(&self, label: &str) -> Option<&PublishedMap> {
        self.maps.iter().find(|m| m.group == label)
    }

    /// Smallest and largest share of vertices without threshold on maps of the same kind, %.
    pub fn share_band(&self, label: &str) -> Option<(f64, f64)> {
        self.map(label)?;
        let share = |m: &PublishedMap| Some(100.0 * m.route("nohdt")?.vertices as f64 / m.cells as f64);
        let shares = self.maps.iter().filter(|m| kind(&m.group) == kind(label)).filter_map(share);
        let band = shares.fold((f64::INFINITY, 0.0_f64), |(low, high), s| (low.min(s), high.max(s)));
        (band.1 > 0.0).then_some(band)
    }
}

impl PublishedMap {
    /// The route of a method.
    pub fn route(&self, method: &str) -> Option<&PublishedRoute> {
        self.methods.iter().find(|r| r.method == method)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten maps with four methods, twelve teams with three followers; shares and extremes as in section 5.2 and Table 5.5.
    #[test]
    fn val_the_thesis_is_complete() {
        let thesis: Thesis = serde_json::from_str(BAYRAK).unwrap();
        assert_eq!((thesis.maps.len(), thesis.formations.len()), (10, 12));
        assert!(thesis.maps.iter().all(|m| m.methods.len() == 4 && m.route("grid").unwrap().vertices == m.cells));
        assert!(thesis.formations.iter().all(|f| f.depth_errors.len() == 3 && f.width_errors.len() == 3));
        let (low, high) = thesis.share_band("very rough 500").unwrap();
        assert!((low - 2.47755).abs() < 1e-9 && (high - 3.9216).abs() < 1e-9, "{low} {high}");
        let ends = |of: fn(&PublishedTeam) -> &Vec<f64>| {
            let all = || thesis.formations.iter().flat_map(of);
            (all().copied().fold(f64::INFINITY, f64::min), all().copied().fold(0.0, f64::max))
        };
        assert_eq!(ends(|f| &f.depth_errors), (1.10, 3.99));
        assert_eq!(ends(|f| &f.width_errors), (0.18, 2.59));
        assert_eq!(kind("very rough 500"), "very rough");
        let worst = |method: &str| {
            let ratio =
                |m: &PublishedMap| m.route(method).unwrap().smoothed_cost / m.route("grid").unwrap().smoothed_cost;
            thesis.maps.iter().map(ratio).fold(0.0, f64::max)
        };
        // From the text: HDT 2 costs at most 2.1 % more than the grid, NoHDT up to 34 % more.
        assert!((worst("hdt2") - 1.0202).abs() < 1e-3 && (worst("nohdt") - 1.3441).abs() < 1e-3);
    }
}
