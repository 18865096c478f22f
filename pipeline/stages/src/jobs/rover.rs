//! Stage `rover`: drives rovers, which find their own way with limited sensing, on each terrain.

use super::rover_designs;
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield, common};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, RowWriter, Work};
use crate::operations::planner;
use crate::operations::room;
use crate::operations::rovers::{self, Grounds, Oracle};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::entry::joined;
use crate::study::{Entry, Expanded, StudyError, keys};
use rayon::prelude::*;
use sastrugi_mobility::rover::{
    Navigator, PlannerEyes, PlannerMap, PlannerParameters, PlannerSensor, Recorder, RoverParameters,
    SchoppersParameters, SojournerParameters, Start, Surroundings, Track,
};
use sastrugi_numeric::{Counter, Ground, Streams};
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::study::{McapFlavour, RoverItem, StudyHead};
use sastrugi_schemas::tables::{RoverRow, RoverSampleRow};
use sastrugi_schemas::topics::RoverRecording;
use sastrugi_schemas::{Kind, ParameterError, counted};
use sastrugi_store::digest;
use sastrugi_store::mcap::{RoverMcap, TerrainView, bag_metadata, write_rover};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "rover";
/// Default distance between samples, m.
const SAMPLE_M: f64 = 0.5;
/// Default number of rovers recorded on each terrain.
const RECORD: u32 = 1;
/// Rovers that are driven before their samples are written: the samples of so many are in memory at once.
const ROVERS_AT_ONCE: usize = 32;
/// Memory of a sample, bytes.
const BYTES_PER_SAMPLE: f64 = 400.0;
/// Memory of a recorded cycle including its messages, bytes.
const BYTES_PER_RECORDED_CYCLE: u64 = 6000;
/// Steering rules of the two reactive navigators, which the planner does not have.
const RULES: [&str; 7] =
    ["bearing_tolerance_rad", "turn_noise_rad", "pass_m", "commit_m", "commit_growth", "commit_max_m", "progress_m"];
/// Approximate time of a cycle, s.
const SECONDS_PER_CYCLE: f64 = 1.1e-4;
/// Approximate time per square metre of a planetary world to find the path of a rover that knows the complete map, s.
const SECONDS_PER_KNOWN_M2: f64 = 8e-4;

/// The navigators.
pub fn kinds() -> Vec<Kind> {
    let kind = |kind, summary, source| {
        let parameters = schema(kind).unwrap_or_else(schema_of::<RoverParameters>);
        Kind { family: STAGE, kind, summary, source, parameters }
    };
    vec![
        kind(
            Navigator::SOJOURNER,
            "20 ranges and a tilt sensor: turns away from hazards, passes them and turns back to the goal",
            "JPL synthetic terrain environment, section 3; Mishkin et al. (1998)",
        ),
        kind(
            Navigator::SCHOPPERS,
            "four rectangles ahead, classified as safe or unsafe by perfect sensing: keeps the path straight ahead safe",
            "JPL synthetic terrain environment, section 4",
        ),
        kind(
            Navigator::PLANNER,
            "D* Lite on the map seen so far by the sensor of either of the other two: a baseline for them",
            "Koenig and Likhachev (2002); the rest is our choice",
        ),
    ]
}

/// Parameters of a navigator and of its trial in one schema; `None` if the navigator is unknown.
fn schema(kind: &str) -> Option<Value> {
    match kind {
        Navigator::SOJOURNER => Some(keys::schema_of_both::<SojournerParameters, RoverParameters>()),
        Navigator::SCHOPPERS => Some(keys::schema_of_both::<SchoppersParameters, RoverParameters>()),
        Navigator::PLANNER => Some(planner_schema()),
        _ => None,
    }
}

/// Parameters of the planner: the body and sensor parameters of both navigators, without their rules.
fn planner_schema() -> Value {
    let mut schema = keys::schema_of_both::<SojournerParameters, RoverParameters>();
    let [mut others, own] = [schema_of::<SchoppersParameters>(), schema_of::<PlannerMap>()];
    let Some(all) = schema["properties"].as_object_mut() else { return schema };
    for (key, mut other) in others["properties"].as_object_mut().map(std::mem::take).unwrap_or_default() {
        match all.get_mut(&key) {
            Some(one) if one["default"] != other["default"] => {
                let said = one["description"].as_str().unwrap_or_default().trim_end_matches('.');
                one["description"] = json!(format!("{said}; {} with rectangles.", other["default"]));
            }
            Some(_) => {}
            None => {
                all.insert(key, other.take());
            }
        }
    }
    all.retain(|key, _| !RULES.contains(&key.as_str()));
    all.extend(own["properties"].as_object().cloned().unwrap_or_default());
    if let Some(more) = own["$defs"].as_object().cloned() {
        match schema["$defs"].as_object_mut() {
            Some(defs) => defs.extend(more),
            None => schema["$defs"] = Value::Object(more),
        }
    }
    schema
}

/// Every parameter of a navigator under its name in the study. For the planner, the rules of the navigator whose sensor it uses are left out.
pub fn parameters(navigator: &Navigator) -> Value {
    let mut all = json!(navigator);
    if let (Navigator::Planner(_), Some(map)) = (navigator, all.as_object_mut()) {
        map.retain(|key, _| !RULES.contains(&key.as_str()));
    }
    all
}

/// Refuses navigator keys that do not apply to a planner: rules, and parameters of the other sensor.
fn check_planner_keys(params: &Value) -> Result<(), ParameterError> {
    let [rays, rectangles] = [schema_of::<SojournerParameters>(), schema_of::<SchoppersParameters>()]
        .map(|schema| keys::properties(&schema));
    let sees_rectangles = params["sensor"] == json!(PlannerSensor::Rectangles);
    let (own, other, kind, sensor) = match sees_rectangles {
        true => (&rectangles, &rays, Navigator::SOJOURNER, "rectangles"),
        false => (&rays, &rectangles, Navigator::SCHOPPERS, "rays"),
    };
    for key in params.as_object().into_iter().flat_map(|map| map.keys()) {
        if RULES.contains(&key.as_str()) {
            let message = "is a rule of the reactive navigators; `planner` searches for its path instead";
            return Err(ParameterError::new(key, message));
        }
        if other.contains(key) && !own.contains(key) {
            let message = format!("is a parameter of `{kind}`; a `planner` with sensor = \"{sensor}\" does not use it");
            return Err(ParameterError::new(key, message));
        }
    }
    Ok(())
}

/// The planner with the body and the sensor of a navigator.
fn read_planner(params: &Value) -> Result<(Navigator, RoverParameters), ParameterError> {
    let (rest, map): (Value, PlannerMap) = keys::read_both(params)?;
    let (eyes, trial) = match map.sensor {
        PlannerSensor::Rays => keys::read_both(&rest).map(|(own, trial)| (PlannerEyes::Rays(own), trial)),
        PlannerSensor::Rectangles => keys::read_both(&rest).map(|(own, trial)| (PlannerEyes::Rectangles(own), trial)),
    }?;
    let parameters = PlannerParameters { eyes, map, mind: planner::policy };
    parameters.check()?;
    RoverParameters::check(&trial)?;
    planner::check(&parameters, &trial)?;
    Ok((Navigator::Planner(parameters), trial))
}

/// A navigator and its trial, checked.
///
/// # Errors
/// A value out of range. The caller must already have refused unknown kinds.
pub fn prepare(kind: &str, params: &Value) -> Result<(Navigator, RoverParameters), ParameterError> {
    let (navigator, trial) = match kind {
        Navigator::SOJOURNER => keys::read_both(params).map(|(own, trial)| (Navigator::Sojourner(own), trial)),
        Navigator::PLANNER => read_planner(params),
        _ => keys::read_both(params).map(|(own, trial)| (Navigator::Schoppers(own), trial)),
    }?;
    navigator.check()?;
    RoverParameters::check(&trial)?;
    trial.check_apart(navigator.task(&trial).goal_tolerance_m)?;
    Ok((navigator, trial))
}

/// A navigator and its settings, the same on every terrain.
struct Trial {
    /// Id; rovers are named `<id>-0001`.
    id: String,
    /// Swept parameters.
    variant: Option<String>,
    navigator: Navigator,
    parameters: RoverParameters,
    sample_m: f64,
    /// Number of rovers recorded, counted from the first.
    record: usize,
    head: StudyHead,
}

struct RoverJob {
    /// Shared by all terrains, of which there may be many.
    trial: Arc<Trial>,
    terrain: String,
    field: Heightfield,
    streams: Streams,
}

/// Adds the items of `[[rover]]`.
///
/// # Errors
/// An invalid item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    builder.each(STAGE, add_table)
}

fn add_table(builder: &mut Builder<'_>, entry: &Entry<'_>) -> Result<(), BuildError> {
    let (envelope, params): (RoverItem, Value) = entry.read()?;
    let Some(schema) = schema(&envelope.kind) else { return Err(unknown(entry, &envelope.kind).into()) };
    let check_keys = |params: &Value| -> Result<(), BuildError> {
        // Checked first because its message explains why a planner does not accept keys of the other navigators.
        if envelope.kind == Navigator::PLANNER {
            check_planner_keys(params).map_err(|e| entry.refuse(e))?;
        }
        Ok(entry.check_keys::<RoverItem>(params, &schema)?)
    };
    check_keys(&params)?;
    let sample_m = envelope.sample_m.unwrap_or(SAMPLE_M);
    let record = envelope.record.unwrap_or(RECORD) as usize;
    ParameterError::not_negative("sample_m", sample_m).map_err(|e| entry.refuse(e))?;
    let prepared = |one: &Expanded| -> Result<_, BuildError> {
        check_keys(&one.params)?;
        Ok(prepare(&envelope.kind, &one.params).map_err(|e| entry.refuse(e))?)
    };
    let expanded = entry.expand(&envelope.id, None, &envelope.sweep, &params)?;
    let trials = expanded.iter().map(prepared).collect::<Result<Vec<_>, _>>()?;
    let terrains = builder.families(entry, &envelope.terrains)?;
    for (one, (navigator, parameters)) in expanded.into_iter().zip(trials) {
        builder.claim(entry, STAGE, &one.id)?;
        room::check(builder, entry, &terrains, rovers::room_for(&parameters))?;
        rover_designs::add(builder, entry, &envelope, &one, &terrains)?;
        let (id, variant, head) = (one.id, one.sweep, builder.study.head.clone());
        let trial = Arc::new(Trial { id, variant, navigator, parameters, sample_m, record, head });
        terrains.iter().try_for_each(|terrain| add_one(builder, entry, &envelope, &trial, terrain))?;
    }
    Ok(())
}

fn unknown(entry: &Entry<'_>, kind: &str) -> StudyError {
    let known: Vec<String> = kinds().iter().map(|k| format!("`{}`", k.kind)).collect();
    entry.error("kind", format!("`{kind}` is not a navigator; known navigators: {}", known.join(", ")))
}

/// Adds the rovers on one terrain.
fn add_one(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    envelope: &RoverItem,
    trial: &Arc<Trial>,
    terrain: &str,
) -> Result<(), StudyError> {
    let Some(field) = builder.heightfields.get(terrain).cloned() else { return Ok(()) };
    Grounds::check(&field, &trial.parameters).map_err(|e| entry.refuse(e))?;
    let streams = streams(builder, envelope, terrain, &field);
    let item = ItemRef::new(STAGE, &format!("{}@{terrain}", trial.id));
    let (parents, stream) = (vec![field.item.clone()], Some(streams.label()));
    let job = RoverJob { trial: Arc::clone(trial), terrain: terrain.to_owned(), field, streams };
    builder.node(Node { item, parents, inputs: Vec::new(), stream, job: Box::new(job) })
}

/// Streams of starts and noise on a terrain. They are named after the table without its swept part, so that every value of a sweep and
/// every perturbed design shares them.
pub fn streams(builder: &Builder<'_>, envelope: &RoverItem, terrain: &str, field: &Heightfield) -> Streams {
    let shared = builder.shared(field);
    let word = shared.map_or_else(|| terrain.to_owned(), common);
    builder.streams(STAGE, &format!("{}@{word}", envelope.id), envelope.seed, shared.unwrap_or(0))
}

/// Approximate cost of the rovers of a trial on one terrain.
pub fn estimate(parameters: &RoverParameters) -> Estimate {
    // Assumes a path twice as long as the straight line, at 10 cycles per metre.
    let cycles = 20.0 * parameters.straight_m() * f64::from(parameters.rovers);
    Estimate { seconds: SECONDS_PER_CYCLE * cycles, bytes: 40.0 * cycles / 10.0 }
}

/// The results of one rover: its row, its samples, and its recording, which is already on disk.
struct Driven {
    row: RoverRow,
    samples: Vec<RoverSampleRow>,
    products: Vec<Product>,
}

impl RoverJob {
    /// Drives a rover from its start; the first ones are recorded.
    fn drive(
        &self,
        work: &Work<'_>,
        ground: &impl Ground,
        number: usize,
        (start, oracle): (&Start, Oracle),
        noise: Counter,
    ) -> Result<Driven, JobError> {
        let trial = &self.trial;
        let task = trial.navigator.task(&trial.parameters);
        let mut policy = trial.navigator.policy();
        let mut track = Track::new(ground, &task, trial.sample_m);
        let mut recorder = (number < trial.record).then(|| Recorder::new(&task));
        let key = noise.at(number as i64);
        let drive = sastrugi_mobility::rover::drive(ground, &task, policy.as_mut(), start, key, |cycle| {
            track.add(cycle);
            recorder.iter_mut().for_each(|recorder| recorder.add(cycle, start.goal_m));
        });
        let tracked = track.finish();
        let (mut samples, metrics) = (tracked.samples, tracked.metrics);
        let rover_id = format!("{}-{:04}", trial.id, number + 1);
        for sample in &mut samples {
            sample.terrain_id.clone_from(&self.terrain);
            sample.rover_id.clone_from(&rover_id);
        }
        let note = rovers::note(&drive, &task);
        let recording = recorder.map(|recorder| recorder.finish(&drive, tracked.states, note.as_deref()));
        // A rover that ends before its first cycle leaves nothing to record.
        let recording = recording.filter(|recording| !recording.cycles.is_empty());
        let mut row = RoverRow {
            terrain_id: self.terrain.clone(),
            rover_id,
            group: self.field.group.clone(),
            variant: joined(self.field.variant.as_deref(), trial.variant.as_deref()),
            split: None,
            stage_id: trial.id.clone(),
            navigator: trial.navigator.kind().to_owned(),
            start_x_m: start.start_m[0],
            start_y_m: start.start_m[1],
            start_heading_deg: start.heading_rad.to_degrees(),
            goal_x_m: start.goal_m[0],
            goal_y_m: start.goal_m[1],
            straight_m: drive.straight_m,
            outcome: drive.ending.name().to_owned(),
            distance_m: drive.distance_m,
            residual_m: drive.residual_m,
            efficiency: drive.efficiency(),
            efficiency_half_limit: drive.efficiency_at_half(task.distance_limit_m),
            distance_limit_m: task.distance_limit_m,
            oracle_m: oracle.length_m(),
            oracle: oracle.name().to_owned(),
            time_s: drive.time_s,
            cycles: drive.cycles.into(),
            turns: drive.turns.into(),
            turned_deg: drive.turned_rad.to_degrees(),
            reversals: drive.reversals.into(),
            hazards: drive.hazards.into(),
            contacts: drive.contacts.anywhere.into(),
            centre_contacts: drive.contacts.on_centre_line.into(),
            clearance_m: task.clearance_m,
            max_tilt_deg: drive.tilt_max_rad.to_degrees(),
            max_pitch_deg: metrics.max_pitch_rad.to_degrees(),
            max_roll_deg: metrics.max_roll_rad.to_degrees(),
            rms_pitch_rate_deg_s: metrics.rms_pitch_rate_rad_s.to_degrees(),
            rms_roll_rate_deg_s: metrics.rms_roll_rate_rad_s.to_degrees(),
            note,
            path: None,
        };
        let products = match recording {
            Some(recording) => self.write_recording(work, ground, start, &recording, &mut row)?,
            None => Vec::new(),
        };
        Ok(Driven { row, samples, products })
    }

    /// Writes a recording and stores its path in the row.
    fn write_recording(
        &self,
        work: &Work<'_>,
        ground: &impl Ground,
        start: &Start,
        recording: &RoverRecording,
        row: &mut RoverRow,
    ) -> Result<Vec<Product>, JobError> {
        let (head, id) = (&self.trial.head, row.rover_id.clone());
        let fail = |e: JobError| e.reworded(|words| format!("{id}: {words}"));
        let around = Surroundings::of(ground, recording, [start.start_m, start.goal_m]);
        let classes = rovers::ground_codes(&around);
        let terrain = TerrainView::new(&around.heights, Some(&classes)).map_err(|e| fail(JobError::new(e)))?;
        let mcap = RoverMcap {
            flavour: head.mcap,
            recording,
            terrain: &terrain,
            start_m: start.start_m,
            goal_m: start.goal_m,
            epoch_ns: head.epoch_ns,
            metadata: &self.metadata(row, &digest::heights(&around.heights)),
        };
        let file = format!("{id}.mcap");
        let summary = write_rover(&work.output(&file), &mcap).map_err(|e| fail(JobError::io(e)))?;
        let mut products = Vec::new();
        let release_path = match head.mcap {
            McapFlavour::Viewer => format!("mcap/{}/{file}", self.terrain),
            McapFlavour::Ros2 => format!("mcap/{}/{id}/{file}", self.terrain),
        };
        if head.mcap == McapFlavour::Ros2 {
            let (bag, place) = (format!("{id}.metadata.yaml"), format!("mcap/{}/{id}/metadata.yaml", self.terrain));
            work.write(&bag, bag_metadata(&file, &summary).as_bytes()).map_err(fail)?;
            products.push(Product::released(&bag, place, None));
        }
        row.path = Some(release_path.clone());
        let recorded = Product::released(&file, release_path, Some(summary.content_sha256));
        products.push(Product { records: Some(summary.messages), ..recorded });
        Ok(products)
    }

    /// Metadata that states the origin of a recording that is read on its own.
    fn metadata(&self, row: &RoverRow, heights_sha256: &str) -> BTreeMap<String, BTreeMap<String, String>> {
        let head = &self.trial.head;
        let study = [("name", head.name.clone()), ("seed", head.seed.to_string()), ("license", head.license.clone())];
        let terrain = [("id", self.terrain.clone()), ("group", self.field.group.clone().unwrap_or_default())];
        let rover = [
            ("id", row.rover_id.clone()),
            ("start_m", format!("{} {}", row.start_x_m, row.start_y_m)),
            ("goal_m", format!("{} {}", row.goal_x_m, row.goal_y_m)),
        ];
        let parameters = parameters(&self.trial.navigator).to_string();
        let trial = serde_json::to_string(&self.trial.parameters).unwrap_or_default();
        let navigator = [("name", row.navigator.clone()), ("parameters", parameters), ("trial", trial)];
        let outcome = [
            ("outcome", row.outcome.clone()),
            ("time_s", row.time_s.to_string()),
            ("distance_m", row.distance_m.to_string()),
            ("efficiency", row.efficiency.to_string()),
        ];
        let map = |pairs: &[(&str, String)]| pairs.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect();
        [
            ("study".to_owned(), map(&study)),
            ("terrain".to_owned(), map(&terrain)),
            ("rover".to_owned(), map(&rover)),
            ("navigator".to_owned(), map(&navigator)),
            ("outcome".to_owned(), map(&outcome)),
            ("hashes".to_owned(), map(&[("drawn_heights_sha256", heights_sha256.to_owned())])),
        ]
        .into()
    }
}

/// Rovers that are driven at once, at least one for each thread.
fn at_once() -> usize {
    ROVERS_AT_ONCE.max(rayon::current_num_threads())
}

/// Notes on rovers that did not reach their goal.
fn notes(rows: &[RoverRow]) -> Vec<String> {
    let endings = [
        ("lost", "stopped at a place wrongly taken for the goal"),
        ("no_way", "found no way forward"),
        ("distance_limit", "reached the distance limit"),
        ("cycle_limit", "reached the cycle limit"),
        ("off_ground", "reached the edge of the known ground"),
    ];
    let note = |(name, words): (&str, &str)| {
        let count = rows.iter().filter(|row| row.outcome == name).count();
        (count > 0).then(|| format!("{count} of {} {words}", counted(rows.len(), "rover")))
    };
    endings.into_iter().filter_map(note).collect()
}

impl Job for RoverJob {
    fn recipe(&self) -> Value {
        json!({
            "navigator": self.trial.navigator.kind(),
            "parameters": parameters(&self.trial.navigator),
            "trial": self.trial.parameters,
            "sample_m": self.trial.sample_m,
            "id": self.trial.id,
            "variant": joined(self.field.variant.as_deref(), self.trial.variant.as_deref()),
            "terrain": self.terrain,
            "group": self.field.group,
            "record": self.trial.record,
            "study": (self.trial.record > 0).then(|| {
                let head = &self.trial.head;
                json!({ "name": head.name, "seed": head.seed, "license": head.license, "epoch_ns": head.epoch_ns, "mcap": head.mcap })
            }),
            // The world extends beyond the heights of the item.
            "world": [*self.field.parameters, json!(self.field.stream())],
        })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility, Room::Navigation, Room::Terrain, Room::Roughness]
    }

    fn memory_bytes(&self) -> u64 {
        let task = self.trial.navigator.task(&self.trial.parameters);
        let recorded_at_once = self.trial.record.min(rayon::current_num_threads()) as u64;
        let recordings = recorded_at_once * u64::from(task.cycle_limit) * BYTES_PER_RECORDED_CYCLE;
        let maps = match self.trial.navigator {
            Navigator::Planner(_) => rayon::current_num_threads() as u64 * planner::memory_bytes(),
            _ => 0,
        };
        // Without a spacing every cycle is a sample.
        let samples_each = (task.distance_limit_m / self.trial.sample_m).min(f64::from(task.cycle_limit));
        let samples = at_once().min(self.trial.parameters.rovers as usize) as f64 * samples_each * BYTES_PER_SAMPLE;
        let oracles = rovers::oracle_bytes(&self.trial.parameters);
        (Grounds::memory_bytes(&self.field) + recordings + maps).saturating_add(samples as u64).saturating_add(oracles)
    }

    fn estimate(&self) -> Estimate {
        let driven = estimate(&self.trial.parameters);
        // The world is generated around all starts and goals.
        let side_m = 2.0 * self.trial.parameters.straight_m();
        let is_world = self.field.kind == sastrugi_terrain::planetary::KIND;
        let known = if is_world { SECONDS_PER_KNOWN_M2 * side_m * side_m } else { 0.0 };
        Estimate { seconds: driven.seconds + known, ..driven }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let parameters = &self.trial.parameters;
        let heights = work.parent(&self.field.item, HEIGHTS)?;
        let (grounds, starts) = Grounds::new(&self.field, &heights, parameters, &self.streams)?;
        let noise = Counter::new(&mut self.streams.stream("noise"));
        let oracles = rovers::oracles(&grounds, &self.trial.navigator.task(parameters), &starts)?;
        let one = |(k, start): (usize, &Start)| match &grounds {
            Grounds::World(world) => self.drive(work, &world.view(), k, (start, oracles[k]), noise),
            Grounds::Grid(grid) => self.drive(work, grid, k, (start, oracles[k]), noise),
        };
        let numbered: Vec<(usize, &Start)> = starts.iter().enumerate().collect();
        let mut samples = RowWriter::new(work);
        let (mut products, mut rows) = (Vec::new(), Vec::with_capacity(starts.len()));
        for numbered in numbered.chunks(at_once()) {
            let driven: Result<Vec<Driven>, JobError> = numbered.par_iter().copied().map(one).collect();
            for driven in driven? {
                products.extend(driven.products);
                samples.push(driven.samples)?;
                rows.push(driven.row);
            }
        }
        let mut outcome = Outcome { products, notes: notes(&rows) };
        outcome.notes.extend(rovers::redrawn(parameters, &self.streams, &starts));
        samples.finish(&mut outcome)?;
        outcome.write_rows(work, rows)?;
        Ok(outcome)
    }
}
