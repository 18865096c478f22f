//! Missions along the trail of a terrain.

use super::{MISSIONS, STAGE};
use crate::builder::{BuildError, Builder, Heightfield};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::jobs::terrain;
use crate::operations::drawn::{Drawn, Lines};
use crate::operations::room::{self, Lack};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::Entry;
use sastrugi_mobility::missions::{Mission, Polyline};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::MissionsItem;
use sastrugi_schemas::{Kind, ParameterError, counted};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::sync::Arc;

/// Assumed length of a trail before it is known, m.
const LENGTH_GUESS_M: f64 = 100.0;

/// The trail to follow, and its direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TrailParameters {
    /// Name of the trail: `trail`, or `trail-2` ... if a terrain has several.
    pub trail: String,
    /// Follow it from its end to its beginning.
    pub backwards: bool,
}

impl Default for TrailParameters {
    fn default() -> Self {
        Self { trail: "trail".to_owned(), backwards: false }
    }
}

/// Description of this kind of missions.
pub fn kind() -> Kind {
    Kind {
        family: "missions",
        kind: "trail",
        summary: "the trail of a terrain from end to end: one mission on each terrain",
        source: "trails: docs/papers/mavs.md; followed by pure pursuit (Coulter, 1992)",
        parameters: schema_of::<TrailParameters>(),
    }
}

struct TrailJob {
    terrain: ItemRef,
    parameters: TrailParameters,
}

/// Adds the items of one table.
///
/// # Errors
/// An invalid item.
pub fn add(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    envelope: &MissionsItem,
    params: &Value,
) -> Result<(), BuildError> {
    for (key, given) in [("of", envelope.of.is_some()), ("seed", envelope.seed.is_some())] {
        if given {
            return Err(entry.error(key, format!("`{key}` does not apply to missions along a trail")).into());
        }
    }
    entry.check_keys::<MissionsItem>(params, &schema_of::<TrailParameters>())?;
    let parameters: TrailParameters = read_parameters(params).map_err(|e: ParameterError| entry.refuse(e))?;
    let ids = builder.families(entry, &envelope.terrains)?;
    room::check(builder, entry, &ids, |field, _| check_trail(field, &parameters.trail))?;
    let (mut lines, rules) = (Vec::new(), Arc::new(json!(parameters)));
    for heightfield in ids {
        let item = ItemRef::new(STAGE, &format!("{}@{heightfield}", envelope.id));
        let terrain = ItemRef::new(terrain::STAGE, &heightfield);
        let parents = vec![terrain.clone()];
        let job = TrailJob { terrain, parameters: parameters.clone() };
        builder.node(Node { item: item.clone(), parents, inputs: Vec::new(), stream: None, job: Box::new(job) })?;
        lines.push(Arc::new(Lines {
            pairs: item.id.clone(),
            item,
            word: heightfield.clone(),
            rules: Arc::clone(&rules),
            shared: None,
            heightfield,
        }));
    }
    builder.missions.insert(envelope.id.clone(), Drawn { lines, count: 1, length_m: LENGTH_GUESS_M });
    Ok(())
}

/// Checks that a surface has a trail of this name.
fn check_trail(field: &Heightfield, trail: &str) -> Result<(), Lack> {
    let count = if field.item.stage == terrain::STAGE { trails(&field.parameters) } else { 0 };
    if count == 0 {
        return Err(Lack::new("terrains", "there is no trail; name a terrain of kind `compose` with a trail"));
    }
    if number(trail).is_none_or(|number| number > count) {
        return Err(Lack::new("trail", format!("there is no \"{trail}\", only {}", counted(count, "trail"))));
    }
    Ok(())
}

/// Number of trails that a terrain may have: those that the parameters of its kind name at any depth, since trails of most operands are kept.
fn trails(parameters: &Value) -> usize {
    match parameters {
        Value::Object(map) => {
            let own = map.get("operation").is_some_and(|operation| operation == "trail");
            usize::from(own) + map.values().map(trails).sum::<usize>()
        }
        Value::Array(values) => values.iter().map(trails).sum(),
        _ => 0,
    }
}

/// Number of a trail by its name, from 1; `None` for a name that no trail has.
fn number(name: &str) -> Option<usize> {
    match name.strip_prefix("trail")? {
        "" => Some(1),
        rest => {
            rest.strip_prefix('-')?.parse::<usize>().ok().filter(|number| *number > 1 && rest == format!("-{number}"))
        }
    }
}

impl Job for TrailJob {
    fn recipe(&self) -> Value {
        json!({ "terrain": self.terrain, "trail": self.parameters })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility]
    }

    fn memory_bytes(&self) -> u64 {
        1 << 20
    }

    fn estimate(&self) -> Estimate {
        Estimate { seconds: 0.01, bytes: 1e5 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let lines = terrain::lines(work, &self.terrain)?;
        let TrailParameters { trail, backwards } = &self.parameters;
        let Some(line) = lines.iter().find(|line| line.name == *trail) else {
            let names: Vec<&str> = lines.iter().map(|line| line.name.as_str()).collect();
            let has = if names.is_empty() { "has none".to_owned() } else { format!("has {}", names.join(", ")) };
            return Err(JobError::input(format!("{} has no trail \"{trail}\"; it {has}", self.terrain.id)));
        };
        let mut points: Vec<[f64; 2]> = line.points_m.iter().map(|&[x, y, _]| [x, y]).collect();
        if *backwards {
            points.reverse();
        }
        let line = Polyline::new(&points).map_err(|e| JobError::new(format!("failed to {e}")))?;
        let text = serde_json::to_vec(&[Mission::along(0, line)]).map_err(JobError::new)?;
        work.write(MISSIONS, &text)?;
        Ok(Outcome { products: vec![Product::internal(MISSIONS)], ..Outcome::default() })
    }
}
