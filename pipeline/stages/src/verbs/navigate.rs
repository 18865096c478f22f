//! `navigate`: plans a route over one DEM and writes it as a file, a picture, or a release that may include a team following it.

use super::reading::{Reading, read_as_it_is};
use super::traverse::{Place as ReleasePlace, document, given_file, with};
use crate::error::Error;
use crate::jobs::navigate;
use crate::jobs::route::STAGE;
use crate::operations::dem::to_metres;
use crate::operations::masks;
use crate::operations::place::Place;
use crate::operations::routes::{Given, Outcome, Site};
use crate::remote::check_file;
use crate::runner::progress::Progress;
use crate::studies::{RunRequest, RunSummary, run_text};
use sastrugi_mobility::registry;
use sastrugi_navigation::Route;
use sastrugi_navigation::parameters::RouteParameters;
use sastrugi_numeric::Grid;
use sastrugi_report::RoutePicture;
use sastrugi_roughness::rms_slope;
use sastrugi_schemas::kind::read_parameters;
use sastrugi_store::atomic;
use sastrugi_store::geojson;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// A request for a route.
pub struct Request<'a> {
    /// DEM.
    pub dem: &'a Path,
    /// Start, in the DEM's own coordinates.
    pub start: [f64; 2],
    /// Goal, in the DEM's own coordinates.
    pub goal: [f64; 2],
    /// Vehicle whose slope limits apply.
    pub vehicle: Option<&'a str>,
    /// Files of areas to avoid.
    pub obstacles: &'a [PathBuf],
    /// Parameters of the search.
    pub route: Value,
    /// Parameters of the team that follows the route; requires a release.
    pub team: Option<Value>,
}

/// Extensions of files that contain only a route.
const ROUTE_ENDINGS: [&str; 2] = ["geojson", "svg"];

/// True for outputs that contain only a route.
pub fn is_route_file(output: &Path) -> bool {
    let ending = output.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    ROUTE_ENDINGS.iter().any(|known| known.eq_ignore_ascii_case(ending))
}

/// Plans a route and writes it as GeoJSON, or as a picture (SVG). Returns its metrics.
///
/// # Errors
/// Wrong parameters, a DEM or obstacles that cannot be used, no route, or a file that cannot be written.
pub fn route(request: &Request<'_>, output: &Path) -> Result<Value, Error> {
    if request.team.is_some() {
        let message = format!("{}: a team is written as a release; name a folder with `-o DIR`", output.display());
        return Err(Error::Usage(message));
    }
    check_file(output)?;
    let parameters: RouteParameters = read_parameters(&request.route)?;
    parameters.check()?;
    parameters.check_given(request.vehicle.is_some(), false)?;
    let own = read_as_it_is(request.dem, &Reading::default())?;
    let place = Place::of(&own.dem.grid.geometry, &own.dem.grid.geometry);
    let crs = own.dem.info.crs.clone();
    let (dem, converted) = to_metres(own.dem);
    let given = given(request, &dem.grid, &place)?;
    let site = Site::new(&dem.grid, &parameters, &given)?;
    let geometry = dem.grid.geometry;
    let pair = site.pair([request.start, request.goal].map(|end| place.to_heights(end, &geometry)))?;
    let found = site.plan(&[pair])?;
    let route = match found.first() {
        Some(Outcome::Found(route)) => route,
        other => return Err(Error::Input(no_route(&site, other))),
    };
    let drawn = Drawn { site: &site, heights: &dem.grid, given: &given, route, metrics: metrics(&site, route) };
    if output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("svg")) {
        let picture = drawn.picture(request.dem)?;
        atomic::write(output, picture.as_bytes()).map_err(|e| Error::at(output, e))?;
    } else {
        let own = |[x, y, z]: [f64; 3]| {
            let [x, y] = place.from_heights([x, y], &geometry);
            [x, y, z]
        };
        let positions = site.points(&route.smoothed).into_iter().map(own).collect();
        let line = geojson::Route { positions, properties: drawn.metrics.clone() };
        geojson::write_routes(output, Some(&crs), &[line]).map_err(Error::io)?;
    }
    let notes: Vec<String> = own.notes.into_iter().chain(converted).collect();
    Ok(json!({ "file": output.display().to_string(), "route": drawn.metrics, "notes": notes }))
}

fn given(request: &Request<'_>, heights: &Grid, place: &Place) -> Result<Given, Error> {
    let vehicle = request.vehicle.map(|name| registry::vehicle(name, &Map::new())).transpose()?;
    let mut given = Given { vehicle, ..Given::default() };
    for path in request.obstacles {
        let (polygons, cells) = masks::obstacles(&heights.geometry, place, path)?;
        given.polygons.extend(polygons);
        given.add_blocked(cells);
    }
    Ok(given)
}

/// Message for a start and goal without a route.
fn no_route(site: &Site, outcome: Option<&Outcome>) -> String {
    let [up, down] = site.map().limits().degrees();
    match outcome {
        Some(Outcome::Budget) => {
            "no route found within `expansions_max`; raise it, or raise `suboptimality`".to_owned()
        }
        _ => format!(
            "no route from start to goal with slopes of at most {up:.1} degrees uphill and {down:.1} downhill; raise \
             `max_up_deg` and `max_down_deg`, or allow 8 neighbours"
        ),
    }
}

/// The metrics of a route, by name.
fn metrics(site: &Site, route: &Route) -> Map<String, Value> {
    let degrees = |slope: f64| libm::atan(slope).to_degrees();
    let score = &route.smoothed_score;
    let points = site.points(&route.smoothed);
    let metrics = json!({
        "length_m": crate::operations::routes::distances_m(&points).last(),
        "ground_length_m": score.length_m,
        "cost_m": score.cost,
        "searched_cost_m": route.path_score.cost,
        "steepest_up_deg": degrees(score.steepest[0]),
        "steepest_down_deg": degrees(score.steepest[1]),
        "points": route.smoothed.len(),
        "vertices": route.vertices,
        "expansions": route.expansions,
    });
    metrics.as_object().cloned().unwrap_or_default()
}

struct Drawn<'a> {
    site: &'a Site,
    heights: &'a Grid,
    given: &'a Given,
    route: &'a Route,
    metrics: Map<String, Value>,
}

impl Drawn<'_> {
    fn picture(&self, dem: &Path) -> Result<String, Error> {
        let metric = |name: &str| self.metrics.get(name).and_then(Value::as_f64).unwrap_or(f64::NAN);
        let words = format!(
            "{:.0} m in plan, cost {:.0} m, steepest climb {:.1} degrees, steepest descent {:.1} degrees",
            metric("length_m"),
            metric("cost_m"),
            metric("steepest_up_deg"),
            metric("steepest_down_deg")
        );
        let rings = self.given.polygons.iter().filter_map(|polygon| polygon.rings().first().cloned());
        let picture = RoutePicture {
            heights: self.heights,
            rms_slope: rms_slope(self.heights),
            searched: &self.site.points(&self.route.path),
            smoothed: &self.site.points(&self.route.smoothed),
            obstacles: &rings.collect::<Vec<_>>(),
            title: &format!("Route over {}", dem.file_name().unwrap_or_default().to_string_lossy()),
            words: &words,
        };
        picture.svg().map_err(Error::failed)
    }
}

/// Plans a route over a DEM, simulates a team along it if requested, and writes a release with tables, GeoJSON, recordings and report.
///
/// # Errors
/// As [`crate::studies::run`]; also a DEM on which no route can be planned.
pub fn release(
    request: &Request<'_>,
    date: &str,
    place: &ReleasePlace<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, Error> {
    let dem = given_file(request.dem)?;
    let obstacles = request.obstacles.iter().map(|path| given_file(path)).collect::<Result<Vec<_>, _>>()?;
    let mut search = json!({ "id": "route", "terrains": ["dem"], "start": request.start, "goal": request.goal });
    if !obstacles.is_empty() {
        search["obstacles"] = json!(obstacles);
    }
    if let Some(vehicle) = request.vehicle {
        search["vehicle"] = json!(vehicle);
    }
    let team = |team: &Value| -> Result<_, Error> {
        Ok((navigate::STAGE, with(json!({ "id": "team", "route": "route" }), team)?))
    };
    let team: Option<(&str, Value)> = request.team.as_ref().map(team).transpose()?;
    let route = (STAGE, with(search, &request.route)?);
    let sections = [("dem", json!({ "id": "dem", "file": dem })), route].into_iter().chain(team);
    let head = json!({ "name": "navigate", "seed": 0, "date": date });
    let text = document(&head, &json!({}), sections)?;
    let ReleasePlace { output, work, replace, limits } = *place;
    let purpose = if request.team.is_some() { navigate::STAGE } else { STAGE };
    let run = RunRequest { output, work, part: None, purpose: Some(purpose), replace, limits };
    run_text(&text, Path::new(""), &run, progress)
}
