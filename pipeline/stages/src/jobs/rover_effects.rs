//! Stage `rover_effects`: ranks the parameters of a navigator by their effects, estimated from the perturbed designs.

use super::rover_designs::Trial;
use crate::builder::Builder;
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Work};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::StudyError;
use sastrugi_numeric::{Streams, sums};
use sastrugi_schemas::study::RoverItem;
use sastrugi_schemas::tables::{RoverDesignRow, RoverEffectRow};
use sastrugi_statistics::Interval;
use sastrugi_statistics::morris::{Importance, elementary_effects, screen};
use sastrugi_store::parquet::read_table;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "rover_effects";
/// Number of redraws for an interval.
const REDRAWS: usize = 2000;
/// Coverage of the intervals.
const LEVEL: f64 = 0.95;
/// Measures by which designs are compared, sorted by name.
const MEASURES: [Measure; 3] = [
    Measure { name: "arrival", unit: "1", of: |row| row.arrived as f64 / row.rovers as f64 },
    Measure { name: "distance_m", unit: "m", of: |row| row.distance_m },
    Measure { name: "efficiency", unit: "1", of: |row| row.efficiency },
];

struct Measure {
    name: &'static str,
    unit: &'static str,
    of: fn(&RoverDesignRow) -> f64,
}

/// An item with the designs of one trajectory on one terrain.
#[derive(Clone)]
pub struct Source {
    /// The item.
    pub item: ItemRef,
    /// The terrain.
    pub terrain: String,
    /// Index of the trajectory.
    pub number: usize,
}

struct EffectsJob {
    trial: Arc<Trial>,
    /// Items of every group of terrains, by label and swept parameters; sorted by terrain, then by trajectory.
    groups: BTreeMap<[String; 2], Vec<Source>>,
    streams: Streams,
}

/// Adds the item that computes effects from the designs of a rover stage.
///
/// # Errors
/// When it cannot be added to the graph.
pub fn add(
    builder: &mut Builder<'_>,
    envelope: &RoverItem,
    trial: Arc<Trial>,
    sources: Vec<Source>,
) -> Result<(), StudyError> {
    let mut groups: BTreeMap<[String; 2], Vec<Source>> = BTreeMap::new();
    let parents = sources.iter().map(|source| source.item.clone()).collect();
    for source in sources {
        let Some(field) = builder.heightfields.get(&source.terrain) else { continue };
        let label = field.group.clone().unwrap_or_else(|| field.kind.clone());
        groups.entry([label, field.variant.clone().unwrap_or_default()]).or_default().push(source);
    }
    let item = ItemRef::new(STAGE, &trial.id);
    let streams = builder.streams(STAGE, &trial.id, envelope.seed, 0);
    let stream = Some(streams.label());
    let job = Box::new(EffectsJob { trial, groups, streams });
    builder.node(Node { item, parents, inputs: Vec::new(), stream, job })
}

/// Outputs of the designs: by trajectory, world and step.
type Outputs = Vec<Vec<Vec<f64>>>;

impl EffectsJob {
    /// Rows of a group's designs, source by source.
    fn rows(&self, work: &Work<'_>, sources: &[Source]) -> Result<Vec<Vec<RoverDesignRow>>, JobError> {
        let file = format!("{}.parquet", <RoverDesignRow as sastrugi_schemas::Record>::TABLE.name);
        let one = |source: &Source| read_table(&work.parent(&source.item, &file)?).map_err(JobError::io);
        sources.iter().map(one).collect()
    }

    /// A measure of every design of a group.
    fn outputs(&self, sources: &[Source], rows: &[Vec<RoverDesignRow>], measure: &Measure) -> Outputs {
        let mut outputs: Outputs = vec![Vec::new(); self.trial.perturbation.trajectories.len()];
        for (source, rows) in sources.iter().zip(rows) {
            outputs[source.number].push(rows.iter().map(measure.of).collect());
        }
        outputs
    }

    /// Effects by parameter, trajectory and world.
    fn effects(&self, outputs: &Outputs) -> Vec<Vec<Vec<f64>>> {
        let perturbation = &self.trial.perturbation;
        let mut effects = vec![vec![Vec::new(); outputs.len()]; perturbation.perturbed.len()];
        for (t, (trajectory, worlds)) in perturbation.trajectories.iter().zip(outputs).enumerate() {
            let points: Vec<Vec<f64>> = trajectory.designs.iter().map(|design| design.factors.clone()).collect();
            for values in worlds {
                let of = elementary_effects(&points, &trajectory.order, values);
                of.into_iter().enumerate().for_each(|(k, effect)| effects[k][t].push(effect));
            }
        }
        effects
    }

    /// Rows of a measure of a group, by parameter.
    fn measured(&self, [group, variant]: &[String; 2], measure: &Measure, outputs: &Outputs) -> Vec<RoverEffectRow> {
        let perturbation = &self.trial.perturbation;
        // One stream for all measures, so that they share the same redraws.
        let mut stream = self.streams.stream(&format!("redraws {group} {variant}"));
        let found = screen(&self.effects(outputs), REDRAWS, LEVEL, &mut stream);
        let all: Vec<f64> = outputs.iter().flatten().flatten().copied().collect();
        let rank = |i: &Importance| 1 + found.iter().filter(|other| other.mu_star > i.mu_star).count();
        let end = |interval: Option<Interval>, of: fn(&Interval) -> f64| interval.as_ref().map_or(f64::NAN, of);
        let row = |(perturbed, i): (&super::perturbation::Perturbed, &Importance)| RoverEffectRow {
            stage_id: self.trial.id.clone(),
            group: group.clone(),
            variant: variant.clone(),
            measure: measure.name.to_owned(),
            parameter: perturbed.name.clone(),
            rank: rank(i) as i64,
            base: perturbed.base,
            unit: perturbed.unit().to_owned(),
            measure_unit: measure.unit.to_owned(),
            measure_mean: sums::mean(&all),
            mu: i.mu,
            mu_low: end(i.mu_interval, |i| i.low),
            mu_high: end(i.mu_interval, |i| i.high),
            mu_star: i.mu_star,
            mu_star_low: end(i.mu_star_interval, |i| i.low),
            mu_star_high: end(i.mu_star_interval, |i| i.high),
            sigma: i.sigma,
            mu_star_noise: i.noise,
            share: perturbation.settings.share,
            levels: perturbation.settings.levels.into(),
            trajectories: outputs.len() as i64,
            worlds: outputs.first().map_or(0, Vec::len) as i64,
            rovers: perturbation.rovers.into(),
        };
        perturbation.perturbed.iter().zip(&found).map(row).collect()
    }

    /// Notes for readers of the effects.
    fn notes(&self) -> Vec<String> {
        let perturbation = &self.trial.perturbation;
        let mut notes: Vec<String> =
            perturbation.left_out.iter().map(|reason| format!("not perturbed: {reason}")).collect();
        for ([group, variant], sources) in &self.groups {
            let worlds = sources.iter().map(|s| &s.terrain).collect::<BTreeSet<_>>().len();
            let of = if variant.is_empty() { group.clone() } else { format!("{group} with {variant}") };
            if worlds < 2 {
                notes
                    .push(format!("effects in {of} have no intervals: they need two worlds or more, but there is one"));
            }
        }
        if perturbation.trajectories.len() < 2 {
            notes.push("effects have neither intervals nor sigma: they need two trajectories or more".to_owned());
        }
        notes
    }

    fn designs(&self) -> f64 {
        let of_trajectory = self.trial.perturbation.perturbed.len() + 1;
        (of_trajectory * self.groups.values().map(Vec::len).sum::<usize>()) as f64
    }
}

impl Job for EffectsJob {
    fn recipe(&self) -> Value {
        let perturbation = &self.trial.perturbation;
        let parameters: Vec<Value> =
            perturbation.perturbed.iter().map(|p| json!([p.name, p.base, p.factors])).collect();
        let groups: Vec<Value> = self
            .groups
            .iter()
            .map(|(group, sources)| json!([group, sources.iter().map(|s| s.item.id.clone()).collect::<Vec<_>>()]))
            .collect();
        json!({
            "id": self.trial.id,
            "perturb": perturbation.settings,
            "rovers": perturbation.rovers,
            "parameters": parameters,
            "left_out": perturbation.left_out,
            "groups": groups,
        })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility, Room::Statistics]
    }

    fn memory_bytes(&self) -> u64 {
        // A row holds the factors of all parameters as text.
        (self.designs() * (300.0 + 40.0 * self.trial.perturbation.perturbed.len() as f64)) as u64
    }

    fn estimate(&self) -> Estimate {
        // Measured: 1 ns per effect and redraw.
        let seconds = 1e-9 * self.designs() * REDRAWS as f64 * MEASURES.len() as f64;
        Estimate { seconds, bytes: 300.0 * self.trial.perturbation.perturbed.len() as f64 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let mut effects = Vec::new();
        for (group, sources) in &self.groups {
            let rows = self.rows(work, sources)?;
            for measure in &MEASURES {
                effects.extend(self.measured(group, measure, &self.outputs(sources, &rows, measure)));
            }
        }
        let mut outcome = Outcome { products: Vec::new(), notes: self.notes() };
        outcome.write_rows(work, effects)?;
        Ok(outcome)
    }
}
