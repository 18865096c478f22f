//! Stage `missions`: straight missions drawn on the closed class map of each heightfield.

use super::dem::input_error;
use super::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work, roughness};
use crate::registry::{BuildError, Builder};
use crate::revision::Room;
use crate::runner::graph::Node;
use sastrugi_mobility::missions::{Mission, MissionParameters, MissionSettings, draw_missions};
use sastrugi_numeric::Streams;
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::MissionsItem;
use sastrugi_store::{atomic, dem};
use serde_json::{Value, json};
use std::path::Path;

/// Name of the stage.
pub const STAGE: &str = "missions";
/// Drawn missions.
const MISSIONS: &str = "missions.json";

/// The one kind of missions.
pub fn kinds() -> Vec<Kind> {
    vec![Kind {
        family: "missions",
        kind: "straight",
        summary: "straight lines of one length with random start and heading, start in low roughness, goal in low or semi",
        source: "Majhor and Bos, section 2.3",
        parameters: schema_of::<MissionParameters>(),
    }]
}

/// Missions that a traverse can refer to.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Heightfields they are drawn on.
    pub heightfields: Vec<String>,
    /// Missions on each.
    pub count: usize,
    /// Length, m.
    pub length_m: f64,
}

struct MissionsJob {
    heightfield: String,
    settings: MissionSettings,
    streams: Streams,
}

/// The item that draws the missions `missions` on a heightfield.
pub fn item(missions: &str, heightfield: &str) -> ItemRef {
    ItemRef::new(STAGE, &format!("{missions}@{heightfield}"))
}

/// Adds the items of `[[missions]]`.
///
/// # Errors
/// A wrong item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    for entry in builder.study.entries(STAGE)? {
        let (envelope, params): (MissionsItem, Value) = entry.read()?;
        entry.check_keys::<MissionsItem>(&params, &schema_of::<MissionParameters>())?;
        builder.claim(&entry, STAGE, &envelope.id)?;
        let raw: MissionParameters = read_parameters(&params).map_err(|e| entry.refuse(e))?;
        let settings = MissionSettings::try_from(raw).map_err(|e| entry.refuse(e))?;
        if envelope.terrains.is_empty() {
            return Err(entry.error("terrains", "`terrains` is empty; it names the heightfields to drive on").into());
        }
        let mut heightfields = Vec::new();
        for (k, id) in envelope.terrains.iter().enumerate() {
            heightfields.extend(builder.family(&entry, &format!("terrains.{k}"), id)?);
        }
        heightfields.sort();
        heightfields.dedup();
        for heightfield in &heightfields {
            let item = item(&envelope.id, heightfield);
            let streams = builder.streams(STAGE, &item.id, envelope.seed, 0);
            let stream = Some(streams.label());
            let job = MissionsJob { heightfield: heightfield.clone(), settings: settings.clone(), streams };
            let parents = vec![roughness::item(heightfield)];
            builder.node(&entry, Node { item, parents, inputs: Vec::new(), stream, job: Box::new(job) })?;
        }
        let drawn = Drawn { heightfields, count: settings.count(), length_m: settings.length_m() };
        builder.missions.insert(envelope.id, drawn);
    }
    Ok(())
}

impl Job for MissionsJob {
    fn recipe(&self) -> Value {
        json!({ "heightfield": self.heightfield, "missions": self.settings })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility]
    }

    fn memory_bytes(&self) -> u64 {
        128 << 20
    }

    fn estimate(&self) -> Estimate {
        Estimate { seconds: 0.02, bytes: 200.0 * self.settings.count() as f64 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let path = work.parent(&roughness::item(&self.heightfield), roughness::CLASSES)?;
        let classes = dem::read_classes(&path).map_err(|e| input_error(&e))?;
        let missions =
            draw_missions(&classes, &self.settings, &self.streams).map_err(|e| JobError::new(format!("cannot {e}")))?;
        let text = serde_json::to_vec(&missions).map_err(JobError::new)?;
        atomic::write(&work.output(MISSIONS), &text).map_err(JobError::new)?;
        Ok(Outcome { products: vec![Product::internal(MISSIONS)], ..Outcome::default() })
    }
}

/// The missions that an item drew.
///
/// # Errors
/// A file that cannot be read.
pub fn read(folder_file: &Path) -> Result<Vec<Mission>, JobError> {
    let bytes = std::fs::read(folder_file).map_err(JobError::new)?;
    serde_json::from_slice(&bytes).map_err(JobError::new)
}

/// Where the drawn missions are.
///
/// # Errors
/// When the item is no parent.
pub fn file(work: &Work<'_>, item: &ItemRef) -> Result<std::path::PathBuf, JobError> {
    work.parent(item, MISSIONS)
}
