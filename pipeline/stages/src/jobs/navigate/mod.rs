//! Stage `navigate`: leads teams in formation along the routes of each terrain.

mod recorded;

use super::route::{self, PlannedRoute, PlannedRoutes};
use crate::builder::{BuildError, Builder, Heightfield, common, unknown_id};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, RowWriter, Work};
use crate::operations::dem::input_error;
use crate::operations::drawn::Routes;
use crate::operations::place::{PLACE, Place};
use crate::operations::room::{self, Lack};
use crate::operations::routes::distances_m;
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::entry::joined;
use crate::study::{Entry, Expanded, StudyError};
use rayon::prelude::*;
use recorded::{Recorder, recording};
use sastrugi_navigation::formation::draws::draw;
use sastrugi_navigation::formation::parameters::Shape;
use sastrugi_navigation::formation::{Outcome as Ended, Team, TeamError, TeamGround, TeamParameters};
use sastrugi_navigation::vertices::Vertices;
use sastrugi_navigation::{CostModel, Ground, Method, SlopeLimits, TravelMap};
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::{McapFlavour, NavigateItem, StudyHead};
use sastrugi_schemas::tables::{FormationEventRow, FormationRow, FormationSampleRow};
use sastrugi_schemas::topics::TeamRecording;
use sastrugi_schemas::{Kind, counted};
use sastrugi_store::mcap::{TeamMcap, TerrainView, bag_metadata, write_team};
use sastrugi_store::{dem, digest};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "navigate";
/// Maximum number of roadmap vertices in a recording; of more, only every second, third, ... is recorded.
const VERTICES_MAX: usize = 5000;
/// Runs that are led before their samples are written: the samples of so many are in memory at once.
const RUNS_AT_ONCE: usize = 8;
/// Memory of a sample of one member: its state, its row, and the message being written, bytes.
const BYTES_PER_SAMPLE: f64 = 600.0;

/// The formations.
pub fn kinds() -> Vec<Kind> {
    let kind = |shape: Shape| {
        let summary = match shape {
            Shape::Column => "members one behind the other",
            Shape::Line => "members side by side",
            Shape::Wedge => "members staggered back from the leader on both sides",
            Shape::Custom => "members in slots given by the study",
        };
        let source = "Bayrak (2008), Algorithms 6 to 9, corrected";
        Kind { family: "formation", kind: shape.name(), summary, source, parameters: schema_of::<TeamParameters>() }
    };
    Shape::ALL.map(kind).into()
}

/// A team with its settings, the same on every terrain.
struct Lead {
    /// Id; runs are named `<id>-0001-01`.
    id: String,
    /// Swept parameters.
    variant: Option<String>,
    parameters: TeamParameters,
    /// Number of runs along each route.
    count: u32,
    head: StudyHead,
}

struct NavigateJob {
    /// Shared by all terrains, of which there may be many.
    lead: Arc<Lead>,
    routes: Routes,
    field: Heightfield,
    streams: Streams,
}

/// Adds the items of `[[navigate]]`.
///
/// # Errors
/// An invalid item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    builder.each(STAGE, add_table)
}

fn add_table(builder: &mut Builder<'_>, entry: &Entry<'_>) -> Result<(), BuildError> {
    let (envelope, params): (NavigateItem, Value) = entry.read()?;
    entry.check_keys::<NavigateItem>(&params, &schema_of::<TeamParameters>())?;
    let count = envelope.count.unwrap_or(1);
    if !(1..=NavigateItem::COUNT_MAX).contains(&count) {
        let message = format!("`count` is {count}; it must be 1 to {}", NavigateItem::COUNT_MAX);
        return Err(entry.error("count", message).into());
    }
    let expanded = entry.expand(&envelope.id, None, &envelope.sweep, &params)?;
    let teams = expanded.iter().map(|one| parameters_of(entry, one)).collect::<Result<Vec<_>, _>>()?;
    let Some(routes) = builder.routes.get(&envelope.route).cloned() else {
        return Err(unknown_id(entry, "route", &envelope.route, builder.routes.keys()).into());
    };
    one_search(entry, &routes)?;
    for (one, parameters) in expanded.into_iter().zip(teams) {
        builder.claim(entry, STAGE, &one.id)?;
        let terrains = routes.iter().map(|one| &one.terrain);
        room::doubt(builder, entry, terrains, |_, terrain| check_room(&parameters, terrain));
        let lead =
            Arc::new(Lead { id: one.id, variant: one.sweep, parameters, count, head: builder.study.head.clone() });
        routes.iter().try_for_each(|routes| add_one(builder, &envelope, &lead, routes))?;
    }
    Ok(())
}

/// The parameters of a team.
fn parameters_of(entry: &Entry<'_>, one: &Expanded) -> Result<TeamParameters, BuildError> {
    entry.check_keys::<NavigateItem>(&one.params, &schema_of::<TeamParameters>())?;
    let parameters: TeamParameters = read_parameters(&one.params).map_err(|e| entry.refuse(e))?;
    parameters.check().map_err(|e| entry.refuse(e))?;
    Ok(parameters)
}

/// Checks that a terrain has room for the formation of a team in some direction. Without it the team runs all the same, but never in formation.
fn check_room(team: &TeamParameters, terrain: &Geometry) -> Result<(), Lack> {
    let formation_m = team.formation()?.diameter_m();
    let [width_m, height_m] = terrain.size();
    let terrain_m = (width_m * width_m + height_m * height_m).sqrt();
    if formation_m <= terrain_m {
        return Ok(());
    }
    let why = format!(
        "two members of the formation are {formation_m:.1} m apart, but the diagonal of the terrain is {terrain_m:.1} m, so it is compressed \
         everywhere: use a smaller spacing, fewer members or a larger terrain"
    );
    Err(Lack::new("spacing_m", why))
}

/// Refuses the id of a swept route, which refers to several searches.
fn one_search(entry: &Entry<'_>, routes: &[Routes]) -> Result<(), StudyError> {
    let Some(other) = routes.iter().find(|one| one.search != routes[0].search) else { return Ok(()) };
    let message = format!(
        "`route` names a swept item; name one of its searches, such as \"{}\" or \"{}\"",
        routes[0].search, other.search
    );
    Err(entry.error("route", message))
}

/// Adds the runs over one terrain.
fn add_one(
    builder: &mut Builder<'_>,
    envelope: &NavigateItem,
    lead: &Arc<Lead>,
    routes: &Routes,
) -> Result<(), StudyError> {
    let terrain = &routes.terrain;
    let Some(field) = builder.heightfields.get(terrain).cloned() else { return Ok(()) };
    let shared = builder.shared(&field);
    let word = shared.map_or_else(|| terrain.clone(), common);
    // Named after the table without its swept part, so that every value of a sweep has the same draws.
    let streams = builder.streams(STAGE, &format!("{}@{word}", envelope.id), envelope.seed, shared.unwrap_or(0));
    let draws = lead.parameters.drawn_losses + lead.parameters.drawn_obstacles > 0;
    let stream = draws.then(|| streams.label());
    let item = ItemRef::new(STAGE, &format!("{}@{terrain}", lead.id));
    let parents = vec![field.item.clone(), routes.item.clone()];
    let job = NavigateJob { lead: Arc::clone(lead), routes: routes.clone(), field, streams };
    builder.node(Node { item, parents, inputs: Vec::new(), stream, job: Box::new(job) })
}

/// Data shared by all runs on a terrain.
struct Site<'a> {
    ground: &'a TeamGround<'a>,
    planned: &'a PlannedRoutes,
    vertices_m: &'a [[f64; 3]],
    view: &'a TerrainView<'a>,
    heights_sha256: &'a str,
    place: Place,
}

/// The results of one run: its rows, and its recording, which is already on disk.
struct Led {
    products: Vec<Product>,
    row: FormationRow,
    samples: Vec<FormationSampleRow>,
    events: Vec<FormationEventRow>,
}

impl NavigateJob {
    fn run_id(&self, route: usize, run: u32) -> String {
        format!("{}-{:04}-{:02}", self.lead.id, route + 1, run + 1)
    }

    /// Leads the team along a route and records it.
    fn lead(&self, work: &Work<'_>, site: &Site<'_>, route: &PlannedRoute, run: u32) -> Result<Led, JobError> {
        let id = self.run_id(route.index, run);
        let fail = |e: JobError| e.reworded(|words| format!("{id}: {words}"));
        let parameters = self.drawn(site, route, run).map_err(|e| fail(JobError::new(e)))?;
        let waypoints_m: Vec<[f64; 2]> = route.points_m.iter().map(|&[x, y, _]| [x, y]).collect();
        let mut recorder = Recorder::new(site.ground.ground().map, &parameters);
        let row = self.row(&id, route, &parameters);
        let mut team = match Team::new(site.ground, &parameters, &waypoints_m) {
            Ok(team) => team,
            Err(TeamError::NoRoom { .. }) => {
                let row = FormationRow { outcome: "no_room".to_owned(), ..row };
                return Ok(Led { products: Vec::new(), row, samples: Vec::new(), events: Vec::new() });
            }
            Err(TeamError::Parameter(error)) => return Err(fail(JobError::new(error))),
            Err(error) => return Err(fail(JobError::new(format!("failed to {error}")))),
        };
        let outcome = team.run(|team| recorder.sample(team)).map_err(|e| fail(JobError::new(e)))?;
        let recording = recording(&team, &recorder, site, route);
        let row = self.filled(row, &team, outcome, &recording);
        let products = self.write(work, site, route, (&row, &parameters), &recording).map_err(fail)?;
        let samples = recorded::sample_rows(&self.routes.terrain, &id, &recorder, &recording);
        let events = recorded::event_rows(&self.routes.terrain, &id, &recording);
        Ok(Led { products, row, samples, events })
    }

    /// The parameters with the losses and obstacles of a run, in the coordinates of the heights.
    fn drawn(&self, site: &Site<'_>, route: &PlannedRoute, run: u32) -> Result<TeamParameters, TeamError> {
        let mut parameters = self.lead.parameters.clone();
        let geometry = &site.ground.ground().map.heights().geometry;
        let points = parameters.obstacles.iter_mut().flat_map(|obstacle| &mut obstacle.points_m);
        points.for_each(|point| *point = site.place.to_heights(*point, geometry));
        let line: Vec<[f64; 2]> = route.points_m.iter().map(|&[x, y, _]| [x, y]).collect();
        let members = parameters.formation()?.slots().len() as u32;
        let streams = self.streams.child(&format!("{:04}-{:02}", route.index + 1, run + 1));
        Ok(draw(&parameters, &line, members, &streams))
    }

    /// The columns of a run that are known before it starts.
    fn row(&self, id: &str, route: &PlannedRoute, parameters: &TeamParameters) -> FormationRow {
        let members = parameters.formation().map_or(0, |formation| formation.slots().len());
        FormationRow {
            terrain_id: self.routes.terrain.clone(),
            run_id: id.to_owned(),
            group: self.field.group.clone(),
            variant: joined(
                joined(self.field.variant.as_deref(), self.routes.variant.as_deref()).as_deref(),
                self.lead.variant.as_deref(),
            ),
            route_id: route::route_id(&self.routes.search, route.index),
            stage_id: self.lead.id.clone(),
            formation: parameters.formation.name().to_owned(),
            members: members as i64,
            spacing_m: parameters.pattern_spacing_m(),
            route_length_m: distances_m(&route.points_m).last().copied().unwrap_or(f64::NAN),
            sample_rate_hz: parameters.sample_rate_hz,
            ..FormationRow::without_run()
        }
    }

    fn filled(&self, row: FormationRow, team: &Team<'_>, outcome: Ended, recording: &TeamRecording) -> FormationRow {
        let metrics = team.metrics();
        let [depth_error_m, width_error_m] = metrics.mean_errors_m();
        let [worst_depth_error_m, worst_width_error_m] = metrics.worst_errors_m();
        let [in_range, tolerable] = metrics.shares();
        let count = metrics.driven_m.len() as f64;
        let least_m = metrics.least_separation_m;
        let stuck_member = match outcome {
            Ended::Stuck { member } => Some(member.into()),
            Ended::Arrived | Ended::Timeout => None,
        };
        FormationRow {
            lost: row.members - team.formation().slots().len() as i64,
            outcome: outcome.name().to_owned(),
            stuck_member,
            time_s: team.time_s(),
            path_length_m: metrics.driven_m.iter().sum::<f64>() / count,
            depth_error_m,
            width_error_m,
            worst_depth_error_m,
            worst_width_error_m,
            in_range,
            tolerable,
            least_separation_m: if least_m.is_finite() { least_m } else { f64::NAN },
            waits: metrics.waits as i64,
            dodges: metrics.dodges as i64,
            squeezed: metrics.squeezed as i64,
            obstacle_contacts: metrics.contacts as i64,
            replans: metrics.replans as i64,
            samples: recording.members.first().map_or(0, |member| member.states.len()) as i64,
            path: Some(self.release_path(&row.run_id)),
            ..row
        }
    }

    fn release_path(&self, id: &str) -> String {
        match self.lead.head.mcap {
            McapFlavour::Viewer => format!("mcap/{}/{id}.mcap", self.routes.terrain),
            McapFlavour::Ros2 => format!("mcap/{}/{id}/{id}.mcap", self.routes.terrain),
        }
    }

    fn write(
        &self,
        work: &Work<'_>,
        site: &Site<'_>,
        route: &PlannedRoute,
        (row, parameters): (&FormationRow, &TeamParameters),
        recording: &TeamRecording,
    ) -> Result<Vec<Product>, JobError> {
        let end = |point: Option<&[f64; 3]>| point.map_or([f64::NAN; 2], |&[x, y, _]| [x, y]);
        let metadata = self.metadata(row, parameters, site.heights_sha256);
        let team = TeamMcap {
            flavour: self.lead.head.mcap,
            recording,
            terrain: site.view,
            start_m: end(route.points_m.first()),
            goal_m: end(route.points_m.last()),
            epoch_ns: self.lead.head.epoch_ns,
            metadata: &metadata,
        };
        let (id, terrain) = (&row.run_id, &self.routes.terrain);
        let file = format!("{id}.mcap");
        let summary = write_team(&work.output(&file), &team).map_err(JobError::io)?;
        let mut products = Vec::new();
        if self.lead.head.mcap == McapFlavour::Ros2 {
            let (bag, place) = (format!("{id}.metadata.yaml"), format!("mcap/{terrain}/{id}/metadata.yaml"));
            work.write(&bag, bag_metadata(&file, &summary).as_bytes())?;
            products.push(Product::released(&bag, place, None));
        }
        let recorded = Product::released(&file, self.release_path(id), Some(summary.content_sha256));
        products.push(Product { records: Some(summary.messages), ..recorded });
        Ok(products)
    }

    /// Metadata that states the origin of a recording that is read on its own.
    fn metadata(
        &self,
        row: &FormationRow,
        parameters: &TeamParameters,
        heights_sha256: &str,
    ) -> BTreeMap<String, BTreeMap<String, String>> {
        let head = &self.lead.head;
        let study = [("name", head.name.clone()), ("seed", head.seed.to_string()), ("license", head.license.clone())];
        let terrain = [("id", row.terrain_id.clone()), ("group", row.group.clone().unwrap_or_default())];
        let team = [
            ("id", row.run_id.clone()),
            ("route", row.route_id.clone()),
            ("parameters", serde_json::to_string(parameters).unwrap_or_default()),
        ];
        let outcome = [("outcome", row.outcome.clone()), ("time_s", row.time_s.to_string())];
        let map = |pairs: &[(&str, String)]| pairs.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect();
        [
            ("study".to_owned(), map(&study)),
            ("terrain".to_owned(), map(&terrain)),
            ("team".to_owned(), map(&team)),
            ("outcome".to_owned(), map(&outcome)),
            ("hashes".to_owned(), map(&[("terrain_heights_sha256", heights_sha256.to_owned())])),
        ]
        .into()
    }

    /// Vertices of the roadmap on which the routes were searched, thinned; empty for other methods.
    fn vertices_m(&self, map: &TravelMap) -> Result<Vec<[f64; 3]>, JobError> {
        let [dx, dy] = map.cell_m();
        let settings = self.routes.parameters.settings(dx.max(dy)).map_err(JobError::new)?;
        let Method::Roadmap(vertices) = settings.method else { return Ok(Vec::new()) };
        let vertices = Vertices::of(map, settings.neighbourhood, &vertices, &[]);
        let marked = (0..map.len() as u32).filter(|node| vertices.marks[*node as usize]);
        let every = vertices.count().div_ceil(VERTICES_MAX).max(1);
        let point = |node: u32| {
            let [x, y] = map.position_m(node);
            [x, y, map.height_m(node)]
        };
        Ok(marked.step_by(every).map(point).collect())
    }
}

/// Approximate time of some runs over one terrain, s: its ground, the steps of the members along the way of each run, and with sensing the
/// searches for detours.
fn seconds(cells: f64, runs: f64, members: f64, senses: bool) -> f64 {
    let along = 6e-6 * members + if senses { 1.5e-4 } else { 0.0 };
    0.01 + 2.5e-7 * cells + along * cells.sqrt() * runs
}

impl NavigateJob {
    /// Number of samples of a run, of all members together. Stuck teams stop long before their time limit, so that three diagonals of the terrain and ten
    /// minutes are hardly exceeded.
    fn samples_each(&self) -> f64 {
        let Lead { parameters, .. } = &*self.lead;
        let [width_m, height_m] =
            self.field.expected.map_or([(self.field.cells as f64).sqrt(); 2], |place| place.size());
        let diagonal_m = (width_m * width_m + height_m * height_m).sqrt();
        let driven_s = 3.0 * diagonal_m / parameters.speed_m_s + 600.0;
        let members = parameters.formation().map_or(0, |formation| formation.slots().len());
        parameters.time_limit_s(diagonal_m).min(driven_s) * parameters.sample_rate_hz * members as f64
    }
}

impl Job for NavigateJob {
    fn recipe(&self) -> Value {
        let head = &self.lead.head;
        json!({
            "team": self.lead.parameters,
            "id": self.lead.id,
            "count": self.lead.count,
            "variant": joined(self.routes.variant.as_deref(), self.lead.variant.as_deref()),
            "terrain": self.routes.terrain,
            "terrain_variant": self.field.variant,
            "group": self.field.group,
            "routes": self.routes.item,
            "study": { "name": head.name, "seed": head.seed, "license": head.license, "epoch_ns": head.epoch_ns, "mcap": head.mcap },
        })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Navigation]
    }

    fn memory_bytes(&self) -> u64 {
        // Heights, steps, components and the search for a detour; the cells seen by each run, and its search; samples of the current runs.
        let seen = self.lead.parameters.sensing_radius_m.map_or(0, |_| 60 * rayon::current_num_threads() as u64);
        let runs = self.routes.count.saturating_mul(self.lead.count as usize);
        let samples = at_once().min(runs) as f64 * self.samples_each() * BYTES_PER_SAMPLE;
        ((128 << 20) + (60 + seen) * self.field.cells).saturating_add(samples as u64)
    }

    fn estimate(&self) -> Estimate {
        let runs = self.routes.count as f64 * f64::from(self.lead.count);
        let Lead { parameters, .. } = &*self.lead;
        let members = parameters.formation().map_or(0, |formation| formation.slots().len());
        let cells = self.field.cells as f64;
        let seconds = seconds(cells, runs, members as f64, parameters.sensing_radius_m.is_some());
        Estimate { seconds, bytes: 2e3 * cells.sqrt() * runs }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let planned = route::read(work, &self.routes.item)?;
        let heights = dem::read(&work.parent(&self.routes.item, route::GROUND)?).map_err(input_error)?.grid;
        let copy: Grid = heights.clone();
        let [up_deg, down_deg] = planned.limits_deg;
        let limits = SlopeLimits::new(up_deg, down_deg).map_err(JobError::new)?;
        let map = TravelMap::new(heights, limits).map_err(JobError::new)?;
        let costs = CostModel::new(planned.slope, None, &map).map_err(JobError::new)?;
        let ground = TeamGround::new(Ground { map: &map, costs: &costs, clearance: None });
        let site = Site {
            ground: &ground,
            planned: &planned,
            vertices_m: &self.vertices_m(&map)?,
            view: &TerrainView::new(&copy, None).map_err(JobError::new)?,
            heights_sha256: &digest::heights(&copy),
            place: Place::read(&work.parent(&self.field.item, PLACE)?, &copy.geometry)?,
        };
        let found = planned.routes.iter().filter(|route| route.points_m.len() > 1);
        let mut runs: Vec<(&PlannedRoute, u32)> =
            found.flat_map(|route| (0..self.lead.count).map(move |run| (route, run))).collect();
        // Ids sort as text: -100 comes before -99.
        runs.sort_by_cached_key(|(route, run)| self.run_id(route.index, *run));
        let (mut samples, mut events) = (RowWriter::new(work), RowWriter::new(work));
        let (mut products, mut rows) = (Vec::new(), Vec::with_capacity(runs.len()));
        for runs in runs.chunks(at_once()) {
            let led: Result<Vec<Led>, JobError> =
                runs.par_iter().map(|&(route, run)| self.lead(work, &site, route, run)).collect();
            for led in led? {
                products.extend(led.products);
                samples.push(led.samples)?;
                events.push(led.events)?;
                rows.push(led.row);
            }
        }
        let mut outcome = Outcome { products, notes: notes(&rows, &planned) };
        samples.finish(&mut outcome)?;
        events.finish(&mut outcome)?;
        outcome.write_rows(work, rows)?;
        Ok(outcome)
    }
}

/// Runs that are led at once, at least one for each thread.
fn at_once() -> usize {
    RUNS_AT_ONCE.max(rayon::current_num_threads())
}

/// Notes on runs that did not arrive, and on pairs without a route.
fn notes(rows: &[FormationRow], planned: &PlannedRoutes) -> Vec<String> {
    let missing = planned.routes.iter().filter(|route| route.points_m.is_empty()).count();
    let count = |outcome: &str| rows.iter().filter(|row| row.outcome == outcome).count();
    let (pairs, teams) = (counted(planned.routes.len(), "start-goal pair"), counted(rows.len(), "team"));
    let notes = [
        (missing, format!("{missing} of {pairs} had no route for a team to follow")),
        (count("stuck"), format!("{} of {teams} got stuck", count("stuck"))),
        (count("timeout"), format!("{} of {teams} ran out of time", count("timeout"))),
        (count("no_room"), format!("{} of {teams} found no room at the start", count("no_room"))),
    ];
    notes.into_iter().filter(|(count, _)| *count > 0).map(|(_, note)| note).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Processor seconds of teams over the hills of `init navigate`, mean of three formations, least of two or three runs on one thread.
    #[test]
    fn val_estimates_are_within_a_factor_of_two_of_measured_times() {
        for (cells, runs, members, senses, measured_s) in [
            (2.5e5, 2.0, 4.0, false, 0.094),
            (2.5e5, 8.0, 2.0, false, 0.145),
            (2.5e5, 8.0, 4.0, false, 0.176),
            (2.5e5, 8.0, 8.0, false, 0.308),
            (1e6, 2.0, 4.0, false, 0.254),
            (1e6, 8.0, 4.0, false, 0.370),
            (2.5e5, 2.0, 4.0, true, 0.215),
            (2.5e5, 8.0, 4.0, true, 0.539),
            (2.5e5, 8.0, 4.0, true, 0.970),
        ] {
            let ratio = seconds(cells, runs, members, senses) / measured_s;
            assert!((0.5..2.0).contains(&ratio), "{cells} cells, {runs} runs, {members} members, {senses}: {ratio}");
        }
    }
}
