//! Stage `rover`: rovers that find their own way on each terrain.

use super::rover_designs;
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield, common};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Work};
use crate::operations::rovers::{self, Grounds, Oracle};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::entry::joined;
use crate::study::{Entry, StudyError, keys};
use rayon::prelude::*;
use sastrugi_mobility::rover::{Navigator, RoverParameters, SchoppersParameters, SojournerParameters, Start, Track};
use sastrugi_numeric::{Counter, Ground, Streams};
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::study::RoverItem;
use sastrugi_schemas::tables::{RoverRow, RoverSampleRow};
use sastrugi_schemas::{Kind, ParameterError};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "rover";
/// Distance between samples when none is given, m.
const SAMPLE_M: f64 = 0.5;
/// Rough time of a cycle, s.
const SECONDS_PER_CYCLE: f64 = 6e-5;

/// The navigators.
pub fn kinds() -> Vec<Kind> {
    let kind = |kind, summary, source| {
        let parameters = schema(kind).unwrap_or_else(schema_of::<RoverParameters>);
        Kind { family: STAGE, kind, summary, source, parameters }
    };
    vec![
        kind(
            Navigator::SOJOURNER,
            "20 ranges and a tilt: turns away from hazards, passes them, turns back to the goal",
            "JPL synthetic terrain environment, section 3; Mishkin et al. (1998)",
        ),
        kind(
            Navigator::SCHOPPERS,
            "four rectangles ahead, safe or unsafe by perfect sensing: keeps what is straight ahead safe",
            "JPL synthetic terrain environment, section 4",
        ),
    ]
}

/// Parameters of a navigator and of its trial, side by side; `None` for an unknown one.
fn schema(kind: &str) -> Option<Value> {
    match kind {
        Navigator::SOJOURNER => Some(keys::schema_of_both::<SojournerParameters, RoverParameters>()),
        Navigator::SCHOPPERS => Some(keys::schema_of_both::<SchoppersParameters, RoverParameters>()),
        _ => None,
    }
}

/// A navigator and its trial, checked.
///
/// # Errors
/// A wrong value; an unknown kind must have been refused.
pub fn prepare(kind: &str, params: &Value) -> Result<(Navigator, RoverParameters), ParameterError> {
    let (navigator, trial) = if kind == Navigator::SOJOURNER {
        let (own, trial) = keys::read_both(params)?;
        (Navigator::Sojourner(own), trial)
    } else {
        let (own, trial) = keys::read_both(params)?;
        (Navigator::Schoppers(own), trial)
    };
    navigator.check()?;
    RoverParameters::check(&trial)?;
    Ok((navigator, trial))
}

/// Who drives: the same on every terrain.
struct Trial {
    /// Id; rovers are named `<id>-0001`.
    id: String,
    /// Swept parameters.
    variant: Option<String>,
    navigator: Navigator,
    parameters: RoverParameters,
    sample_m: f64,
}

struct RoverJob {
    /// The same on every terrain, of which there may be many.
    trial: Arc<Trial>,
    terrain: String,
    field: Heightfield,
    streams: Streams,
}

/// Adds the items of `[[rover]]`.
///
/// # Errors
/// A wrong item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    for entry in builder.study.entries(STAGE)? {
        let (envelope, params): (RoverItem, Value) = entry.read()?;
        let Some(schema) = schema(&envelope.kind) else { return Err(unknown(&entry, &envelope.kind).into()) };
        let terrains = terrains(builder, &entry, &envelope.terrains)?;
        let sample_m = envelope.sample_m.unwrap_or(SAMPLE_M);
        ParameterError::not_negative("sample_m", sample_m).map_err(|e| entry.refuse(e))?;
        for one in entry.expand(&envelope.id, None, &envelope.sweep, &params)? {
            entry.check_keys::<RoverItem>(&one.params, &schema)?;
            builder.claim(&entry, STAGE, &one.id)?;
            let (navigator, parameters) = prepare(&envelope.kind, &one.params).map_err(|e| entry.refuse(e))?;
            rover_designs::add(builder, &entry, &envelope, &one, &terrains)?;
            let trial = Arc::new(Trial { id: one.id, variant: one.sweep, navigator, parameters, sample_m });
            terrains.iter().try_for_each(|terrain| add_one(builder, &entry, &envelope, &trial, terrain))?;
        }
    }
    Ok(())
}

fn unknown(entry: &Entry<'_>, kind: &str) -> StudyError {
    let known: Vec<String> = kinds().iter().map(|k| format!("`{}`", k.kind)).collect();
    entry.error("kind", format!("`{kind}` is not a navigator; the known ones are {}", known.join(", ")))
}

fn terrains(builder: &Builder<'_>, entry: &Entry<'_>, named: &[String]) -> Result<BTreeSet<String>, StudyError> {
    if named.is_empty() {
        return Err(entry.error("terrains", "`terrains` is empty; it names the terrains to drive on"));
    }
    let mut ids = BTreeSet::new();
    for (k, id) in named.iter().enumerate() {
        ids.extend(builder.family(entry, &format!("terrains.{k}"), id)?);
    }
    Ok(ids)
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

/// Streams of starts and noise on a terrain. Named by the table, not by the swept part, so that every value of a sweep and every perturbed
/// design has the same ones.
pub fn streams(builder: &Builder<'_>, envelope: &RoverItem, terrain: &str, field: &Heightfield) -> Streams {
    let shared = field.replicate.filter(|_| builder.is_paired() && field.geometry.is_some());
    let word = shared.map_or_else(|| terrain.to_owned(), common);
    builder.streams(STAGE, &format!("{}@{word}", envelope.id), envelope.seed, shared.unwrap_or(0))
}

/// Rough cost of the rovers of a trial on one terrain.
pub fn estimate(parameters: &RoverParameters) -> Estimate {
    // A way twice as long as the straight one, 10 cycles a metre.
    let cycles = 20.0 * parameters.straight_m() * f64::from(parameters.rovers);
    Estimate { seconds: SECONDS_PER_CYCLE * cycles, bytes: 40.0 * cycles / 10.0 }
}

/// One rover: its row and its samples.
struct Driven {
    row: RoverRow,
    samples: Vec<RoverSampleRow>,
}

impl RoverJob {
    /// Drives a rover from its start.
    fn drive(&self, ground: &impl Ground, number: usize, start: &Start, noise: Counter, oracle: Oracle) -> Driven {
        let trial = &self.trial;
        let task = trial.navigator.task(&trial.parameters);
        let mut policy = trial.navigator.policy();
        let mut track = Track::new(ground, &task, trial.sample_m);
        let key = noise.at(number as i64);
        let drive = sastrugi_mobility::rover::drive(ground, &task, policy.as_mut(), start, key, |c| track.add(c));
        let (mut samples, metrics) = track.finish();
        let rover_id = format!("{}-{:04}", trial.id, number + 1);
        for sample in &mut samples {
            sample.terrain_id.clone_from(&self.terrain);
            sample.rover_id.clone_from(&rover_id);
        }
        let row = RoverRow {
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
            note: rovers::note(&drive, &task),
            path: None,
        };
        Driven { row, samples }
    }
}

/// Sentences on rovers that did not arrive.
fn notes(rows: &[Driven]) -> Vec<String> {
    let endings = [
        ("lost", "stopped where they wrongly believed the goal to be"),
        ("no_way", "knew of no way on"),
        ("distance_limit", "drove as far as they may"),
        ("cycle_limit", "took as many cycles as they may"),
        ("off_ground", "came to the end of the ground that is known"),
    ];
    let note = |(name, words): (&str, &str)| {
        let count = rows.iter().filter(|d| d.row.outcome == name).count();
        (count > 0).then(|| format!("{count} of {} rovers {words}", rows.len()))
    };
    endings.into_iter().filter_map(note).collect()
}

impl Job for RoverJob {
    fn recipe(&self) -> Value {
        json!({
            "navigator": self.trial.navigator.kind(),
            "parameters": self.trial.navigator,
            "trial": self.trial.parameters,
            "sample_m": self.trial.sample_m,
            "id": self.trial.id,
            "variant": joined(self.field.variant.as_deref(), self.trial.variant.as_deref()),
            "terrain": self.terrain,
            "group": self.field.group,
            // The world goes on beyond the heights of the item.
            "world": [self.field.parameters.clone(), json!(self.field.stream())],
        })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility, Room::Navigation, Room::Terrain, Room::Roughness]
    }

    fn memory_bytes(&self) -> u64 {
        Grounds::memory_bytes(&self.field)
    }

    fn estimate(&self) -> Estimate {
        estimate(&self.trial.parameters)
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let parameters = &self.trial.parameters;
        let starts = parameters.starts(&self.streams);
        let noise = Counter::new(&mut self.streams.stream("noise"));
        let grounds = Grounds::new(&self.field, &work.parent(&self.field.item, HEIGHTS)?, parameters, &starts)?;
        let oracles = rovers::oracles(&grounds, &self.trial.navigator.task(parameters), &starts)?;
        let one = |(k, start): (usize, &Start)| match &grounds {
            Grounds::World(world) => self.drive(&world.view(), k, start, noise, oracles[k]),
            Grounds::Grid(grid) => self.drive(grid, k, start, noise, oracles[k]),
        };
        let mut driven: Vec<Driven> = starts.par_iter().enumerate().map(one).collect();
        let mut outcome = Outcome { products: Vec::new(), notes: notes(&driven) };
        outcome.write_rows(work, driven.iter_mut().flat_map(|d| std::mem::take(&mut d.samples)))?;
        outcome.write_rows(work, driven.into_iter().map(|d| d.row))?;
        Ok(outcome)
    }
}
