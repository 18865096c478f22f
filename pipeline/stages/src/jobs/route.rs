//! Stage `route`: plans paths from starts to goals on each terrain.

use super::dem as measured;
use super::mask::{self, Mask};
use super::rasters::Raster;
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield, common};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::operations::dem::input_error;
use crate::operations::drawn::Routes;
use crate::operations::place::{PLACE, Place};
use crate::operations::room::{self, Lack};
use crate::operations::roughness::settings;
use crate::operations::routes::{self, Given, Outcome as Found, Site, cells_of_ends, planning_cells};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::entry::joined;
use crate::study::{Entry, Expanded, StudyError, keys};
use sastrugi_mobility::registry;
use sastrugi_mobility::vehicle::Vehicle;
use sastrugi_navigation::SlopeCost;
use sastrugi_navigation::pairs::{Pair, PairParameters, check_size, draw_pairs};
use sastrugi_navigation::parameters::{Cost, RouteParameters, Search as Method};
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_schemas::Record;
use sastrugi_schemas::study::{RoughnessSection, RouteItem};
use sastrugi_schemas::tables::{RoutePointRow, RouteRow};
use sastrugi_schemas::{Kind, counted};
use sastrugi_store::{dem, digest, geojson};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "route";
/// The heights used for planning, with no data in cells that cannot be entered.
pub const GROUND: &str = "ground.tif";
/// Cells blocked by obstacles.
const BLOCKED: &str = "blocked.tif";
/// The planned routes, for teams.
const ROUTES: &str = "routes.json";
/// The planned routes, for the release.
const LINES: &str = "routes.geojson";

/// The search methods.
pub fn kinds() -> Vec<Kind> {
    let kind = |method: Method| {
        let (summary, source) = match method {
            Method::Grid => {
                ("A* over all cells", "Hart, Nilsson and Raphael (1968); costs after Bayrak (2008), section 3")
            }
            Method::Roadmap => (
                "A* over a roadmap of the cells where the ground changes",
                "Bayrak (2008), Algorithms 1 to 5, corrected",
            ),
            Method::ThetaStar => {
                ("straight legs at any angle over all cells", "Nash, Koenig and Tovey (2010), lazy Theta*")
            }
            Method::Anytime => (
                "weighted A* over all cells that keeps improving its path, up to a cost bound or a number of expansions",
                "Likhachev, Gordon and Thrun (2003)",
            ),
        };
        Kind { family: "route", kind: method.name(), summary, source, parameters: schema() }
    };
    Method::ALL.map(kind).into()
}

/// The parameters of the search and of drawn pairs in one schema.
fn schema() -> Value {
    keys::schema_of_both::<RouteParameters, PairParameters>()
}

/// A search with its settings, the same on every terrain.
struct RouteSearch {
    /// Id; routes are named `<id>-0001`.
    id: String,
    /// Swept parameters.
    variant: Option<String>,
    parameters: RouteParameters,
    vehicle: Option<Vehicle>,
    obstacles: Vec<Mask>,
    cost_raster: Option<Raster>,
    pairs: Pairs,
    roughness: RoughnessSection,
}

/// Starts and goals of the routes.
#[derive(Clone)]
enum Pairs {
    /// Given in the coordinates of the terrain, m.
    Given([[f64; 2]; 2]),
    /// Drawn on each terrain.
    Drawn { rules: PairParameters, count: usize },
}

impl Pairs {
    fn count(&self) -> usize {
        match self {
            Self::Given(_) => 1,
            Self::Drawn { count, .. } => *count,
        }
    }

    fn recipe(&self) -> Value {
        match self {
            Self::Given([start, goal]) => json!({ "start": start, "goal": goal }),
            Self::Drawn { rules, count } => json!({ "rules": rules, "count": count }),
        }
    }
}

/// Adds the items of `[[route]]`.
///
/// # Errors
/// An invalid item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    builder.each(STAGE, add_table)
}

fn add_table(builder: &mut Builder<'_>, entry: &Entry<'_>) -> Result<(), BuildError> {
    let (envelope, params): (RouteItem, Value) = entry.read()?;
    entry.check_keys::<RouteItem>(&params, &schema())?;
    let vehicle = envelope.vehicle.as_deref().map(|name| registry::vehicle(name, &Map::new()));
    let vehicle = vehicle.transpose().map_err(|e| entry.refuse(e))?;
    let expanded = entry.expand(&envelope.id, None, &envelope.sweep, &params)?;
    let searches = expanded.iter().map(|one| parameters_of(entry, &envelope, one)).collect::<Result<Vec<_>, _>>()?;
    let terrains = builder.families(entry, &envelope.terrains)?;
    let cost_raster = envelope.cost_raster.as_deref().map(|id| builder.surface(entry, "cost_raster", id));
    let cost_raster = cost_raster.transpose()?.map(Raster::from);
    let obstacles = mask::add_obstacles(builder, entry, &envelope)?;
    let mut family = Vec::new();
    for (one, search) in expanded.into_iter().zip(searches) {
        builder.claim(entry, STAGE, &one.id)?;
        let has_room = |field: &Heightfield, terrain: &Geometry| check_room(field, terrain, &search, vehicle.as_ref());
        room::check(builder, entry, &terrains, has_room)?;
        let (parameters, pairs) = search;
        let search = RouteSearch {
            id: one.id.clone(),
            variant: one.sweep,
            parameters,
            vehicle: vehicle.clone(),
            obstacles: obstacles.clone(),
            cost_raster: cost_raster.clone(),
            pairs,
            roughness: builder.study.roughness.clone(),
        };
        let routes = add_search(builder, &envelope, Arc::new(search), &terrains)?;
        family.extend(routes.iter().cloned());
        builder.routes.insert(one.id, routes);
    }
    builder.routes.insert(envelope.id, family);
    Ok(())
}

/// The parameters of a search, with its starts and goals.
fn parameters_of(
    entry: &Entry<'_>,
    envelope: &RouteItem,
    one: &Expanded,
) -> Result<(RouteParameters, Pairs), BuildError> {
    entry.check_keys::<RouteItem>(&one.params, &schema())?;
    let (parameters, rules): (RouteParameters, PairParameters) =
        keys::read_both(&one.params).map_err(|e| entry.refuse(e))?;
    parameters.check().map_err(|e| entry.refuse(e))?;
    let given = parameters.check_given(envelope.vehicle.is_some(), envelope.cost_raster.is_some());
    given.map_err(|e| entry.refuse(e))?;
    Ok((parameters, pairs(entry, envelope, rules)?))
}

/// Checks that a terrain has cells to plan on, and places for starts and goals.
fn check_room(
    field: &Heightfield,
    terrain: &Geometry,
    (parameters, pairs): &(RouteParameters, Pairs),
    vehicle: Option<&Vehicle>,
) -> Result<(), Lack> {
    let cells = planning_cells(terrain, parameters, vehicle)?;
    match pairs {
        // In the coordinates of its file, which may be degrees.
        Pairs::Given(_) if field.item.stage == measured::STAGE => Ok(()),
        Pairs::Given(ends_m) => cells_of_ends(&cells, *ends_m).map(drop).map_err(|why| Lack::new("", why)),
        Pairs::Drawn { rules, .. } => check_size(&cells, rules).map_err(|e| Lack::new(e.key(), format!("cannot {e}"))),
    }
}

fn pairs(entry: &Entry<'_>, envelope: &RouteItem, rules: PairParameters) -> Result<Pairs, StudyError> {
    rules.check().map_err(|e| entry.refuse(e))?;
    match (envelope.start, envelope.goal) {
        (Some(start), Some(goal)) if envelope.pairs.is_none() && rules == PairParameters::default() => {
            let finite = start.into_iter().chain(goal).all(f64::is_finite);
            let pair = finite.then_some(Pairs::Given([start, goal]));
            pair.ok_or_else(|| entry.error("start", "`start` and `goal` must be finite numbers"))
        }
        (Some(_), Some(_)) => Err(entry.error(
            "start",
            "`start` and `goal` cannot be combined with `pairs`, `distance_min_m` or `border_m`, which apply only to drawn pairs",
        )),
        (None, None) => match envelope.pairs.unwrap_or(1) {
            count @ 1..=RouteItem::PAIRS_MAX => Ok(Pairs::Drawn { rules, count: count as usize }),
            other => {
                Err(entry.error("pairs", format!("`pairs` is {other}; it must be 1 to {}", RouteItem::PAIRS_MAX)))
            }
        },
        (Some(_), None) => Err(entry.error("start", "`start` is given without `goal`; give both, or neither to draw them")),
        (None, Some(_)) => Err(entry.error("goal", "`goal` is given without `start`; give both, or neither to draw them")),
    }
}

fn add_search(
    builder: &mut Builder<'_>,
    envelope: &RouteItem,
    search: Arc<RouteSearch>,
    terrains: &BTreeSet<String>,
) -> Result<Vec<Routes>, StudyError> {
    let mut all = Vec::new();
    for terrain in terrains {
        let Some(field) = builder.heightfields.get(terrain).cloned() else { continue };
        let shared = builder.shared(&field);
        let word = shared.map_or_else(|| terrain.clone(), common);
        let streams = builder.streams(STAGE, &format!("pairs@{word}"), envelope.seed, shared.unwrap_or(0));
        let stream = matches!(search.pairs, Pairs::Drawn { .. }).then(|| streams.label());
        let item = ItemRef::new(STAGE, &format!("{}@{terrain}", search.id));
        let masks = search.obstacles.iter().map(|mask| mask.item.clone());
        let parents = [field.item.clone()]
            .into_iter()
            .chain(masks)
            .chain(search.cost_raster.as_ref().map(|raster| raster.item.clone()))
            .collect();
        let job = RouteJob { search: Arc::clone(&search), terrain: terrain.clone(), field, word, streams };
        builder.node(Node { item: item.clone(), parents, inputs: Vec::new(), stream, job: Box::new(job) })?;
        let RouteSearch { id, variant, parameters, pairs, .. } = &*search;
        all.push(Routes {
            search: id.clone(),
            variant: variant.clone(),
            parameters: parameters.clone(),
            terrain: terrain.clone(),
            item,
            count: pairs.count(),
        });
    }
    Ok(all)
}

struct RouteJob {
    /// Shared by all terrains, of which there may be many.
    search: Arc<RouteSearch>,
    terrain: String,
    field: Heightfield,
    /// Names the stream of drawn pairs: the terrain, or a word shared by terrains with common draws.
    word: String,
    streams: Streams,
}

/// Approximate time of some searches on one terrain, s: its ground, and for each search the cells that it visits, or, if its legs have any
/// angle, the lines of sight from them.
fn seconds(method: Method, cells: f64, searches: f64) -> f64 {
    let each = match method {
        Method::ThetaStar => 2e-9 * cells * cells.sqrt(),
        Method::Grid | Method::Roadmap | Method::Anytime => 1.5e-8 * cells,
    };
    3e-7 * cells + each * searches
}

impl RouteSearch {
    /// The ground of a terrain prepared for this search, with its heights.
    ///
    /// # Errors
    /// Inputs that cannot be used.
    fn site(&self, field: &Heightfield, work: &Work<'_>) -> Result<(Site, dem::Dem), JobError> {
        let read = dem::read(&work.parent(&field.item, HEIGHTS)?).map_err(input_error)?;
        let factors = self.cost_raster.as_ref().map(|raster| raster.read(work));
        let mut given = Given {
            vehicle: self.vehicle.clone(),
            factors: factors.transpose()?.map(|dem| dem.grid),
            thresholds: settings(&self.roughness)?.thresholds,
            ..Given::default()
        };
        mask::add_marked(&mut given, &read.grid.geometry, &field.item, &self.obstacles, work)?;
        Ok((Site::new(&read.grid, &self.parameters, &given)?, read))
    }

    /// Everything that determines the routes on a terrain.
    fn recipe(&self) -> Value {
        json!({
            "parameters": self.parameters,
            "vehicle": self.vehicle.as_ref().map(Vehicle::parameters),
            "obstacles": self.obstacles.iter().map(|mask| &mask.source.sha256).collect::<Vec<_>>(),
            "cost_raster": self.cost_raster.as_ref().map(|raster| &raster.item),
            "pairs": self.pairs.recipe(),
            "roughness": (self.parameters.cost == Cost::Class).then_some(&self.roughness),
        })
    }

    /// Peak working memory on a terrain, bytes.
    fn memory_bytes(&self, field: &Heightfield) -> u64 {
        // Polygons of all files are kept, and are part of what reading a file takes.
        let obstacles: u64 = self.obstacles.iter().map(|file| file.reading_bytes).sum();
        let selection = if self.obstacles.is_empty() { 0 } else { mask::selection_bytes(field) };
        // Heights twice, masks, factors, clearance; the search's costs, parents and marks.
        let factors = self.cost_raster.as_ref().map_or(0, |raster| raster.bytes);
        (64 << 20) + 150 * field.cells + factors + obstacles + selection
    }
}

/// The routes and the properties of their ground that teams need, except its heights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedRoutes {
    /// Steepest climb and descent, degrees.
    pub limits_deg: [f64; 2],
    /// Cost of slopes.
    pub slope: SlopeCost,
    /// Outer rings of the obstacles that are polygons, in the coordinates of the heights, m.
    pub obstacles: Vec<Vec<[f64; 2]>>,
    /// The routes in order.
    pub routes: Vec<PlannedRoute>,
}

/// A route as teams and missions use it, in the coordinates of the heights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedRoute {
    /// Number of its pair, from 0.
    pub index: usize,
    /// The smoothed path with heights, m; empty if none was found.
    pub points_m: Vec<[f64; 3]>,
    /// The path found by the search, before smoothing, m.
    pub searched_m: Vec<[f64; 3]>,
}

/// The routes that an item planned.
///
/// # Errors
/// When the item is not a parent, or its file cannot be read.
pub fn read(work: &Work<'_>, item: &ItemRef) -> Result<PlannedRoutes, JobError> {
    let path = work.parent(item, ROUTES)?;
    let bytes = std::fs::read(&path).map_err(|e| JobError::at(&path, e))?;
    serde_json::from_slice(&bytes).map_err(JobError::new)
}

/// Id of a route: the id of its search and its number.
pub fn route_id(search: &str, index: usize) -> String {
    format!("{search}-{:04}", index + 1)
}

impl RouteJob {
    fn pairs(&self, site: &Site, place: &Place) -> Result<Vec<Pair>, JobError> {
        match &self.search.pairs {
            Pairs::Given(ends) => {
                let geometry = site.map().heights().geometry;
                Ok(vec![site.pair(ends.map(|end| place.to_heights(end, &geometry)))?])
            }
            Pairs::Drawn { rules, count } => draw_pairs(site.map(), rules, *count, &self.streams)
                .map_err(|e| JobError::input(format!("failed to {e}"))),
        }
    }

    /// Given pairs are identified by terrain and coordinates, drawn pairs by their draw.
    fn pair_id(&self, pair: &Pair, index: usize) -> String {
        match &self.search.pairs {
            Pairs::Given([[x0, y0], [x1, y1]]) => format!("{}:{x0},{y0}:{x1},{y1}", self.terrain),
            Pairs::Drawn { .. } => format!("{}-{:04}.{}", self.word, index + 1, pair.draws),
        }
    }

    fn row(&self, site: &Site, free_cells: usize, (index, pair): (usize, &Pair), found: &Found) -> RouteRow {
        let search = &*self.search;
        let parameters = &search.parameters;
        let ([start_x_m, start_y_m], [goal_x_m, goal_y_m]) =
            (site.map().position_m(pair.start), site.map().position_m(pair.goal));
        let [max_up_deg, max_down_deg] = site.map().limits().degrees();
        let route = found.route();
        let of = |value: fn(&sastrugi_navigation::Route) -> f64| route.map_or(f64::NAN, value);
        let count = |value: fn(&sastrugi_navigation::Route) -> usize| route.map_or(0, value) as i64;
        let degrees = |slope: f64| libm::atan(slope).to_degrees();
        let (dx, dy) = (goal_x_m - start_x_m, goal_y_m - start_y_m);
        let points = route.map(|route| site.points(&route.smoothed)).unwrap_or_default();
        RouteRow {
            terrain_id: self.terrain.clone(),
            route_id: route_id(&search.id, index),
            group: self.field.group.clone(),
            variant: joined(self.field.variant.as_deref(), search.variant.as_deref()),
            pair_id: self.pair_id(pair, index),
            stage_id: search.id.clone(),
            method: parameters.method.name().to_owned(),
            neighbours: parameters.neighbours.into(),
            threshold_m: parameters.threshold_m.filter(|_| parameters.method == Method::Roadmap).unwrap_or(f64::NAN),
            cost: parameters.cost.name().to_owned(),
            vehicle: search.vehicle.as_ref().map(|vehicle| vehicle.name().to_owned()),
            max_up_deg,
            max_down_deg,
            width_m: parameters.width_m.unwrap_or(f64::NAN),
            start_x_m,
            start_y_m,
            goal_x_m,
            goal_y_m,
            straight_m: (dx * dx + dy * dy).sqrt(),
            outcome: found.name().to_owned(),
            free_cells: free_cells as i64,
            vertices: count(|route| route.vertices),
            edges: count(|route| route.edges),
            repaired: count(|route| route.repaired),
            expansions: route.map_or(0, |route| route.expansions) as i64,
            search_cost_m: of(|route| route.search_cost),
            cost_bound: of(|route| route.cost_ratio_max.unwrap_or(f64::NAN)),
            path_cost_m: of(|route| route.path_score.cost),
            smoothed_cost_m: of(|route| route.smoothed_score.cost),
            path_points: count(|route| route.path.len()),
            smoothed_points: count(|route| route.smoothed.len()),
            length_m: routes::distances_m(&points).last().copied().unwrap_or(f64::NAN),
            ground_length_m: of(|route| route.smoothed_score.length_m),
            steepest_up_deg: degrees(of(|route| route.smoothed_score.steepest[0])),
            steepest_down_deg: degrees(of(|route| route.smoothed_score.steepest[1])),
            path: route.map(|_| self.release_path()),
        }
    }

    fn release_path(&self) -> String {
        format!("route/{}/{}.geojson", self.terrain, self.search.id)
    }

    /// Writes the routes as GeoJSON in the coordinates of the terrain's own file, if there are any.
    fn write_lines(
        &self,
        work: &Work<'_>,
        read: &dem::Dem,
        place: &Place,
        (planned, rows): (&[PlannedRoute], &[RouteRow]),
    ) -> Result<Option<Product>, JobError> {
        let geometry = &read.grid.geometry;
        let own = |&[x, y, z]: &[f64; 3]| {
            let [x, y] = place.from_heights([x, y], geometry);
            [x, y, z]
        };
        let line = |(route, row): (&PlannedRoute, &RouteRow)| geojson::Route {
            positions: route.points_m.iter().map(own).collect(),
            properties: row.to_json().as_object().cloned().unwrap_or_default(),
        };
        let lines: Vec<geojson::Route> =
            planned.iter().zip(rows).filter(|(route, _)| !route.points_m.is_empty()).map(line).collect();
        if lines.is_empty() {
            return Ok(None);
        }
        let crs = Some(&read.info.crs).filter(|_| !place.was_converted(geometry));
        geojson::write_routes(&work.output(LINES), crs, &lines).map_err(JobError::io)?;
        Ok(Some(Product::released(LINES, self.release_path(), None)))
    }

    /// Writes the cells blocked by obstacles, if there are any.
    fn write_blocked(&self, work: &Work<'_>, site: &Site, read: &dem::Dem) -> Result<Option<Product>, JobError> {
        let Some(blocked) = site.blocked_cells() else { return Ok(None) };
        dem::write_classes(&work.output(BLOCKED), &blocked, &read.info.crs).map_err(JobError::io)?;
        let path = format!("route/{}/{}.blocked.tif", self.terrain, self.search.id);
        Ok(Some(Product::released(BLOCKED, path, Some(digest::classes(&blocked)))))
    }

    fn points(&self, planned: &[PlannedRoute]) -> Vec<RoutePointRow> {
        let of_route = |route: &PlannedRoute| {
            let forms = [("searched", &route.searched_m), ("smoothed", &route.points_m)];
            forms.into_iter().flat_map(|(form, points)| self.of_form(route.index, form, points)).collect::<Vec<_>>()
        };
        planned.iter().flat_map(of_route).collect()
    }

    fn of_form(&self, index: usize, form: &str, points: &[[f64; 3]]) -> Vec<RoutePointRow> {
        let row = |(point, (&[x_m, y_m, z_m], distance_m)): (usize, (&[f64; 3], f64))| RoutePointRow {
            terrain_id: self.terrain.clone(),
            route_id: route_id(&self.search.id, index),
            form: form.to_owned(),
            point: point as i64,
            x_m,
            y_m,
            z_m,
            distance_m,
        };
        points.iter().zip(routes::distances_m(points)).enumerate().map(row).collect()
    }
}

impl Job for RouteJob {
    fn recipe(&self) -> Value {
        json!({
            "search": self.search.recipe(),
            "id": self.search.id,
            "variant": joined(self.field.variant.as_deref(), self.search.variant.as_deref()),
            "terrain": self.terrain,
            "group": self.field.group,
        })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Navigation, Room::Roughness, Room::Mobility]
    }

    fn memory_bytes(&self) -> u64 {
        self.search.memory_bytes(&self.field)
    }

    fn estimate(&self) -> Estimate {
        let cells = self.field.cells as f64;
        let searches = self.search.pairs.count() as f64;
        let seconds = seconds(self.search.parameters.method, cells, searches);
        Estimate { seconds, bytes: 200.0 * cells.sqrt() * searches }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let (site, read) = self.search.site(&self.field, work)?;
        let place = Place::read(&work.parent(&self.field.item, PLACE)?, &read.grid.geometry)?;
        let pairs = self.pairs(&site, &place)?;
        let found = site.plan(&pairs)?;
        let planned = |(index, found): (usize, &Found)| {
            let points = |nodes: fn(&sastrugi_navigation::Route) -> &Vec<u32>| {
                found.route().map(|route| site.points(nodes(route))).unwrap_or_default()
            };
            PlannedRoute { index, points_m: points(|route| &route.smoothed), searched_m: points(|route| &route.path) }
        };
        let routes: Vec<PlannedRoute> = found.iter().enumerate().map(planned).collect();
        let free_cells = site.free_cells();
        let numbered = pairs.iter().enumerate().zip(&found);
        let rows: Vec<RouteRow> = numbered.map(|(pair, found)| self.row(&site, free_cells, pair, found)).collect();
        dem::write(&work.output(GROUND), &site.open_ground(), &read.info.crs, &Default::default())
            .map_err(JobError::io)?;
        let points = self.points(&routes);
        let planned = PlannedRoutes {
            limits_deg: site.map().limits().degrees(),
            slope: site.ground().costs.slope(),
            obstacles: site.rings().to_vec(),
            routes,
        };
        work.write(ROUTES, &serde_json::to_vec(&planned).map_err(JobError::new)?)?;
        let mut products = vec![Product::internal(ROUTES), Product::internal(GROUND)];
        products.extend(self.write_lines(work, &read, &place, (&planned.routes, &rows))?);
        products.extend(self.write_blocked(work, &site, &read)?);
        let mut outcome = Outcome { products, notes: notes(&rows) };
        outcome.write_rows(work, points)?;
        outcome.write_rows(work, rows)?;
        Ok(outcome)
    }
}

/// A note on pairs without a route.
fn notes(rows: &[RouteRow]) -> Vec<String> {
    let without = rows.iter().filter(|row| row.outcome != "found").count();
    let note = format!("{without} of {} had no route within the limits", counted(rows.len(), "start-goal pair"));
    (without > 0).then_some(note).into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Processor seconds of routes over the hills of `init navigate`, least of two or three runs on one thread, by cells and searches.
    #[test]
    fn val_estimates_are_within_a_factor_of_two_of_measured_times() {
        for (method, cells, searches, measured_s) in [
            (Method::Roadmap, 2.5e5, 2.0, 0.072),
            (Method::Roadmap, 2.5e5, 8.0, 0.086),
            (Method::Roadmap, 1e6, 2.0, 0.253),
            (Method::Roadmap, 1e6, 8.0, 0.256),
            (Method::Grid, 2.5e5, 2.0, 0.078),
            (Method::Grid, 2.5e5, 8.0, 0.098),
            (Method::Grid, 1e6, 8.0, 0.312),
            (Method::Anytime, 2.5e5, 8.0, 0.118),
            (Method::ThetaStar, 2.5e5, 2.0, 0.554),
            (Method::ThetaStar, 2.5e5, 8.0, 1.448),
            (Method::ThetaStar, 1e6, 8.0, 16.9),
        ] {
            let ratio = seconds(method, cells, searches) / measured_s;
            assert!((0.5..2.0).contains(&ratio), "{method:?}, {cells} cells, {searches} searches: {ratio}");
        }
    }
}
