//! Stage `missions`: straight missions drawn on the closed class map of each heightfield.

use super::dem::input_error;
use super::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work, roughness, terrain};
use crate::registry::{BuildError, Builder};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::Entry;
use sastrugi_mobility::missions::{Mission, MissionParameters, MissionSettings, draw_missions, worst_classes};
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::MissionsItem;
use sastrugi_store::{atomic, dem};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
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
    /// What is drawn on each heightfield.
    pub lines: Vec<Lines>,
    /// Missions on each.
    pub count: usize,
    /// Length, m.
    pub length_m: f64,
}

/// The missions of one heightfield.
#[derive(Clone, Debug)]
pub struct Lines {
    /// Heightfield.
    pub heightfield: String,
    /// Item that draws them.
    pub item: ItemRef,
    /// Name that the pair ids of the missions begin with.
    pub pair: String,
    /// Random streams are named by this: the heightfield, or what it shares with others.
    pub word: String,
}

/// Heightfields that share their missions.
struct Block {
    word: String,
    replicate: u64,
    /// Name that the pair ids begin with, where it is not that of the item.
    pair: Option<String>,
    heightfields: Vec<String>,
}

struct MissionsJob {
    /// One, or several of the same geometry.
    heightfields: Vec<String>,
    settings: MissionSettings,
    streams: Streams,
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
        let mut heightfields = BTreeSet::new();
        for (k, id) in envelope.terrains.iter().enumerate() {
            heightfields.extend(builder.family(&entry, &format!("terrains.{k}"), id)?);
        }
        let mut lines = Vec::new();
        for block in blocks(builder, &envelope.id, heightfields) {
            check_geometry(builder, &entry, &block.heightfields)?;
            let item = ItemRef::new(STAGE, &format!("{}@{}", envelope.id, block.word));
            let pair = block.pair.unwrap_or_else(|| item.id.clone());
            lines.extend(block.heightfields.iter().map(|heightfield| Lines {
                heightfield: heightfield.clone(),
                item: item.clone(),
                pair: pair.clone(),
                word: block.word.clone(),
            }));
            let streams = builder.streams(STAGE, &item.id, envelope.seed, block.replicate);
            let stream = Some(streams.label());
            let parents = block.heightfields.iter().map(|id| roughness::item(id)).collect();
            let job = MissionsJob { heightfields: block.heightfields, settings: settings.clone(), streams };
            builder.node(&entry, Node { item, parents, inputs: Vec::new(), stream, job: Box::new(job) })?;
        }
        let drawn = Drawn { lines, count: settings.count(), length_m: settings.length_m() };
        builder.missions.insert(envelope.id, drawn);
    }
    Ok(())
}

/// Every heightfield by itself; when replicates are paired, those with the same number together.
fn blocks(builder: &Builder<'_>, missions: &str, heightfields: BTreeSet<String>) -> Vec<Block> {
    let replicate =
        |id: &String| builder.heightfields.get(id).and_then(|f| f.replicate).filter(|_| builder.is_paired());
    let mut shared: BTreeMap<u64, Vec<String>> = BTreeMap::new();
    let mut blocks = Vec::new();
    for id in heightfields {
        match replicate(&id) {
            Some(number) => shared.entry(number).or_default().push(id),
            None => blocks.push(Block { word: id.clone(), replicate: 0, pair: None, heightfields: vec![id] }),
        }
    }
    blocks.extend(shared.into_iter().map(|(replicate, heightfields)| Block {
        word: terrain::common(replicate),
        replicate,
        pair: Some(format!("{missions}-{:04}", replicate + 1)),
        heightfields,
    }));
    blocks
}

/// Refuses heightfields with different cells in one block, as far as that is known before the run.
fn check_geometry(builder: &Builder<'_>, entry: &Entry<'_>, heightfields: &[String]) -> Result<(), BuildError> {
    let known: Vec<(&String, Geometry)> =
        heightfields.iter().filter_map(|id| Some((id, builder.heightfields.get(id)?.geometry?))).collect();
    let Some((first, geometry)) = known.first() else { return Ok(()) };
    match known.iter().find(|(_, other)| other != geometry) {
        Some((other, of_other)) => {
            let message = format!("`terrains`: {}", unlike((*first, geometry), (*other, of_other)));
            Err(entry.error("terrains", message).into())
        }
        None => Ok(()),
    }
}

/// The sentence on two heightfields that cannot share missions.
fn unlike((a, of_a): (&str, &Geometry), (b, of_b): (&str, &Geometry)) -> String {
    let cells = |g: &Geometry| format!("{} x {} cells of {} x {} m", g.rows, g.cols, g.cell[0], g.cell[1]);
    format!(
        "with `pairing = \"common\"` replicates with the same number share their missions, so their cells must be the same, \
         but \"{a}\" has {} and \"{b}\" {}; list them in [[missions]] of their own",
        cells(of_a),
        cells(of_b)
    )
}

impl Job for MissionsJob {
    fn recipe(&self) -> Value {
        json!({ "heightfields": self.heightfields, "missions": self.settings })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility]
    }

    fn memory_bytes(&self) -> u64 {
        // Class maps, whatever their number, two at a time.
        128 << 20
    }

    fn estimate(&self) -> Estimate {
        Estimate { seconds: 0.02 * self.heightfields.len() as f64, bytes: 200.0 * self.settings.count() as f64 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let classes = self.classes(work)?;
        let missions = draw_missions(&classes, &self.settings, &self.streams)
            .map_err(|e| JobError::input(format!("cannot {e}")))?;
        let text = serde_json::to_vec(&missions).map_err(JobError::new)?;
        atomic::write(&work.output(MISSIONS), &text).map_err(JobError::new)?;
        Ok(Outcome { products: vec![Product::internal(MISSIONS)], ..Outcome::default() })
    }
}

impl MissionsJob {
    /// The closed class map; of several heightfields the worst class in every cell.
    fn classes(&self, work: &Work<'_>) -> Result<Grid<u8>, JobError> {
        let read = |id: &String| {
            let path = work.parent(&roughness::item(id), roughness::CLASSES)?;
            dem::read_classes(&path).map_err(|e| input_error(&e))
        };
        let (first, others) = self.heightfields.split_first().ok_or_else(|| JobError::new("no heightfield"))?;
        let mut worst = read(first)?;
        for id in others {
            let classes = read(id)?;
            if !worst_classes(&mut worst, &classes) {
                return Err(JobError::new(unlike((first, &worst.geometry), (id, &classes.geometry))));
            }
        }
        Ok(worst)
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
