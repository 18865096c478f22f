//! Stage `rover_designs`: drives the perturbed designs of a rover stage, one item per trajectory and terrain.

use super::perturbation::{Design, Perturbation};
use super::rover::{self, prepare};
use super::rover_effects;
use crate::builder::{Builder, HEIGHTS, Heightfield};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Work};
use crate::operations::rovers::{self, Grounds};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::entry::joined;
use crate::study::{Entry, Expanded, StudyError};
use rayon::prelude::*;
use sastrugi_mobility::rover::{self as kernel, Drive, Ending, RoverParameters, Start};
use sastrugi_numeric::{Counter, Ground, Streams, sums};
use sastrugi_schemas::study::RoverItem;
use sastrugi_schemas::tables::RoverDesignRow;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "rover_designs";

/// A trial and its perturbed designs, the same on every terrain.
pub struct Trial {
    /// Id of the rover stage.
    pub id: String,
    /// Its navigator.
    pub kind: String,
    /// Swept parameters.
    pub variant: Option<String>,
    /// The unperturbed trial, with the number of rovers of a design.
    pub parameters: RoverParameters,
    /// The designs.
    pub perturbation: Perturbation,
}

struct DesignsJob {
    trial: Arc<Trial>,
    terrain: String,
    field: Heightfield,
    /// Index of the trajectory.
    number: usize,
    streams: Streams,
}

/// Adds the perturbed designs of a rover stage and their effects, if the study has `perturb`.
///
/// # Errors
/// Settings that yield no design.
pub fn add(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    envelope: &RoverItem,
    one: &Expanded,
    terrains: &BTreeSet<String>,
) -> Result<(), StudyError> {
    let Some(settings) = &envelope.perturb else { return Ok(()) };
    // Named after the table without its swept part, so that every value of a sweep has the same trajectories.
    let streams = builder.streams(STAGE, &envelope.id, envelope.seed, 0);
    let perturbation =
        Perturbation::new(&envelope.kind, &one.params, settings, &streams).map_err(|e| entry.refuse(e))?;
    let (_, parameters) = prepare(&envelope.kind, &one.params).map_err(|e| entry.refuse(e))?;
    let parameters = RoverParameters { rovers: perturbation.rovers, ..parameters };
    let (id, kind, variant) = (one.id.clone(), envelope.kind.clone(), one.sweep.clone());
    let trial = Arc::new(Trial { id, kind, variant, parameters, perturbation });
    let mut items = Vec::new();
    for terrain in terrains {
        let Some(field) = builder.heightfields.get(terrain).cloned() else { continue };
        for number in 0..trial.perturbation.trajectories.len() {
            let item = ItemRef::new(STAGE, &format!("{}@{terrain}@{:03}", trial.id, number + 1));
            let streams = rover::streams(builder, envelope, terrain, &field);
            let (parents, stream) = (vec![field.item.clone()], Some(streams.label()));
            items.push(rover_effects::Source { item: item.clone(), terrain: terrain.clone(), number });
            let (trial, terrain, field) = (Arc::clone(&trial), terrain.clone(), field.clone());
            let job = Box::new(DesignsJob { trial, terrain, field, number, streams });
            builder.node(Node { item, parents, inputs: Vec::new(), stream, job })?;
        }
    }
    rover_effects::add(builder, envelope, trial, items)
}

impl DesignsJob {
    fn designs(&self) -> &[Design] {
        &self.trial.perturbation.trajectories[self.number].designs
    }

    /// Drives the rovers of all designs, design by design.
    fn drives<G: Ground>(&self, view: impl Fn() -> G + Sync, starts: &[Start], noise: Counter) -> Vec<Drive> {
        let designs = self.designs();
        let one = |n: usize| {
            let (design, k) = (&designs[n / starts.len()], n % starts.len());
            let task = design.navigator.task(&design.parameters);
            let mut policy = design.navigator.policy();
            kernel::drive(&view(), &task, policy.as_mut(), &starts[k], noise.at(k as i64), |_| {})
        };
        (0..designs.len() * starts.len()).into_par_iter().map(one).collect()
    }

    /// The row of a design, from the drives of its rovers.
    fn row(&self, step: usize, design: &Design, drives: &[Drive]) -> RoverDesignRow {
        let Trial { id, variant, perturbation, .. } = &*self.trial;
        let moved = step.checked_sub(1).map(|before| perturbation.trajectories[self.number].order[before]);
        let count = |f: fn(&Drive) -> bool| drives.iter().filter(|d| f(d)).count() as i64;
        let mean = |f: fn(&Drive) -> f64| sums::mean(&drives.iter().map(f).collect::<Vec<_>>());
        RoverDesignRow {
            stage_id: id.clone(),
            terrain_id: self.terrain.clone(),
            trajectory: self.number as i64 + 1,
            step: step as i64,
            group: self.field.group.clone(),
            variant: joined(self.field.variant.as_deref(), variant.as_deref()),
            split: None,
            parameter: moved.map(|k| perturbation.perturbed[k].name.clone()),
            factors: perturbation.factors_json(design),
            rovers: drives.len() as i64,
            arrived: count(Drive::reached),
            efficiency: mean(Drive::counted_efficiency),
            distance_m: mean(|d| d.distance_m),
            at_limit: count(|d| matches!(d.ending, Ending::DistanceLimit | Ending::CycleLimit)),
        }
    }
}

impl Job for DesignsJob {
    fn recipe(&self) -> Value {
        let designs = self.designs().iter();
        json!({
            "navigator": self.trial.kind,
            "designs": designs.map(|d| json!([rover::parameters(&d.navigator), d.parameters.noise, d.factors])).collect::<Vec<_>>(),
            "trial": self.trial.parameters,
            "trajectory": self.number + 1,
            "id": self.trial.id,
            "variant": joined(self.field.variant.as_deref(), self.trial.variant.as_deref()),
            "terrain": self.terrain,
            "group": self.field.group,
            // The world extends beyond the heights of the item.
            "world": [*self.field.parameters, json!(self.field.stream())],
        })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility, Room::Navigation, Room::Terrain, Room::Roughness, Room::Statistics]
    }

    fn memory_bytes(&self) -> u64 {
        Grounds::memory_bytes(&self.field)
    }

    fn estimate(&self) -> Estimate {
        let designs = self.designs().len() as f64;
        Estimate { seconds: designs * rover::estimate(&self.trial.parameters).seconds, bytes: 1e3 * designs }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let parameters = &self.trial.parameters;
        let heights = work.parent(&self.field.item, HEIGHTS)?;
        let (grounds, starts) = Grounds::new(&self.field, &heights, parameters, &self.streams)?;
        let noise = Counter::new(&mut self.streams.stream("noise"));
        let drives = match &grounds {
            Grounds::World(world) => self.drives(|| world.view(), &starts, noise),
            Grounds::Grid(grid) => self.drives(|| grid, &starts, noise),
        };
        let of_designs = self.designs().iter().zip(drives.chunks(starts.len().max(1))).enumerate();
        let notes = rovers::redrawn(parameters, &self.streams, &starts).into_iter().collect();
        let mut outcome = Outcome { notes, ..Outcome::default() };
        outcome.write_rows(work, of_designs.map(|(step, (design, drives))| self.row(step, design, drives)))?;
        Ok(outcome)
    }
}
