//! Stage `traverse`: all missions of one terrain driven and recorded.

use super::dem::{HEIGHTS, input_error};
use super::{Estimate, ItemRef, Job, JobError, Outcome, Product, Rows, Work, missions, roughness};
use crate::registry::{BuildError, Builder, unknown_id};
use crate::revision::Room;
use crate::runner::graph::Node;
use rayon::prelude::*;
use sastrugi_mobility::metrics::{MissionLabels, mission_row, sample_rows};
use sastrugi_mobility::missions::{Difficulty, Mission};
use sastrugi_mobility::vehicle::{Ground, TraverseParameters, TraverseSettings, Vehicle, drive};
use sastrugi_numeric::Grid;
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::{StudyHead, TraverseItem};
use sastrugi_schemas::tables::{MissionRow, SampleRow};
use sastrugi_store::mcap::{MissionMcap, write_mission};
use sastrugi_store::parquet::{TableMetadata, TableWriter};
use sastrugi_store::{dem, digest};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Name of the stage.
pub const STAGE: &str = "traverse";
/// Samples of all missions.
pub const SAMPLES: &str = "samples.parquet";

/// The one kind of run.
pub fn kinds() -> Vec<Kind> {
    vec![Kind {
        family: "traverse",
        kind: "pure_pursuit",
        summary: "a vehicle follows each mission's line until the goal, tipping over, getting stuck, the edge, or time out",
        source: "Majhor and Bos, sections 2.3 and 2.4; model in docs/traversal.md",
        parameters: schema_of::<TraverseParameters>(),
    }]
}

struct TraverseJob {
    traverse: String,
    terrain: String,
    group: Option<String>,
    missions: ItemRef,
    heightfield: ItemRef,
    count: usize,
    seconds_each: f64,
    vehicle: Vehicle,
    settings: TraverseSettings,
    head: StudyHead,
}

/// The item that drives the missions of `traverse` on a heightfield.
fn item(traverse: &str, heightfield: &str) -> ItemRef {
    ItemRef::new(STAGE, &format!("{traverse}@{heightfield}"))
}

/// The heightfield of an item of this stage.
pub fn terrain_of(item_id: &str) -> &str {
    item_id.split_once('@').map_or(item_id, |(_, heightfield)| heightfield)
}

/// Adds the items of `[[traverse]]`.
///
/// # Errors
/// A wrong item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    for entry in builder.study.entries(STAGE)? {
        let (envelope, params): (TraverseItem, Value) = entry.read()?;
        entry.check_keys::<TraverseItem>(&params, &schema_of::<TraverseParameters>())?;
        builder.claim(&entry, STAGE, &envelope.id)?;
        let raw: TraverseParameters = read_parameters(&params).map_err(|e| entry.refuse(e))?;
        let (vehicle, settings) = raw.prepare().map_err(|e| entry.refuse(e))?;
        let Some(drawn) = builder.missions.get(&envelope.missions).cloned() else {
            return Err(unknown_id(&entry, "missions", &envelope.missions, builder.missions.keys()).into());
        };
        for heightfield in &drawn.heightfields {
            let Some(field) = builder.heightfields.get(heightfield).cloned() else { continue };
            let missions = missions::item(&envelope.missions, heightfield);
            let job = TraverseJob {
                traverse: envelope.id.clone(),
                terrain: heightfield.clone(),
                group: field.group.clone(),
                missions: missions.clone(),
                heightfield: field.item.clone(),
                count: drawn.count,
                seconds_each: drawn.length_m / raw.speed_m_s,
                vehicle: vehicle.clone(),
                settings: settings.clone(),
                head: builder.study.head.clone(),
            };
            let parents = vec![field.item.clone(), roughness::item(heightfield), missions];
            let item = item(&envelope.id, heightfield);
            builder.node(&entry, Node { item, parents, inputs: Vec::new(), stream: None, job: Box::new(job) })?;
        }
    }
    Ok(())
}

/// One mission driven: its rows and its recording's content hash.
struct Driven {
    file: String,
    release_path: String,
    content: String,
    messages: u64,
    row: MissionRow,
    samples: Vec<SampleRow>,
}

/// What all missions of a terrain share.
struct Site {
    ground: Ground,
    heights: Grid,
    heights_sha256: String,
    classes: Grid<u8>,
}

impl TraverseJob {
    fn site(&self, work: &Work<'_>) -> Result<Site, JobError> {
        let heights = dem::read(&work.parent(&self.heightfield, HEIGHTS)?).map_err(|e| input_error(&e))?;
        let path = work.parent(&roughness::item(&self.terrain), roughness::CLASSES_RAW)?;
        let classes = dem::read_classes(&path).map_err(|e| input_error(&e))?;
        let ground = Ground::new(&heights.grid, &self.vehicle).map_err(JobError::new)?;
        let heights_sha256 = digest::heights(&heights.grid);
        Ok(Site { ground, heights: heights.grid, heights_sha256, classes })
    }

    fn drive(&self, work: &Work<'_>, site: &Site, mission: &Mission) -> Result<Driven, JobError> {
        let id = format!("{}-{:04}", self.traverse, mission.index + 1);
        let fail = |e: &dyn std::fmt::Display| JobError::new(format!("{id}: {e}"));
        let recording = drive(&site.ground, &self.vehicle, &self.settings, mission).map_err(|e| fail(&e))?;
        let release_path = format!("mcap/{}/{id}.mcap", self.terrain);
        let labels = MissionLabels {
            terrain_id: self.terrain.clone(),
            group: self.group.clone(),
            variant: None,
            pair_id: format!("{}-{:04}", self.missions.id, mission.index + 1),
            traverse_id: self.traverse.clone(),
            path: release_path.clone(),
        };
        let differentiator = self.settings.parameters().differentiator;
        let difficulty = Difficulty::along(&site.heights, &site.classes, mission, self.vehicle.wheelbase_m());
        let mut row = mission_row(&labels, mission, &difficulty, &recording, differentiator);
        row.mission_id.clone_from(&id);
        let mut samples = sample_rows(&self.terrain, mission, &recording, &site.classes);
        samples.iter_mut().for_each(|s| s.mission_id.clone_from(&id));
        let metadata = self.metadata(&row, &site.heights_sha256);
        let mcap = MissionMcap {
            recording: &recording,
            dem: &site.heights,
            classes: Some(&site.classes),
            start_m: mission.start_m,
            goal_m: mission.goal_m,
            epoch_ns: self.head.epoch_ns,
            metadata: &metadata,
        };
        let file = format!("{id}.mcap");
        let summary = write_mission(&work.output(&file), &mcap).map_err(|e| fail(&e))?;
        Ok(Driven { file, release_path, content: summary.content_sha256, messages: summary.messages, row, samples })
    }

    /// Records that a viewer of one file needs to know where it came from.
    fn metadata(&self, row: &MissionRow, heights_sha256: &str) -> BTreeMap<String, BTreeMap<String, String>> {
        let head = &self.head;
        let study = [("name", head.name.clone()), ("seed", head.seed.to_string()), ("license", head.license.clone())];
        let terrain = [("id", self.terrain.clone()), ("group", self.group.clone().unwrap_or_default())];
        let mission = [
            ("id", row.mission_id.clone()),
            ("start_m", format!("{} {}", row.start_x_m, row.start_y_m)),
            ("goal_m", format!("{} {}", row.goal_x_m, row.goal_y_m)),
        ];
        let parameters = serde_json::to_string(self.settings.parameters()).unwrap_or_default();
        let vehicle = [("name", row.vehicle.clone()), ("parameters", parameters)];
        let outcome = [("outcome", row.outcome.clone()), ("time_s", row.time_s.to_string())];
        let map = |pairs: &[(&str, String)]| pairs.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect();
        [
            ("study".to_owned(), map(&study)),
            ("terrain".to_owned(), map(&terrain)),
            ("mission".to_owned(), map(&mission)),
            ("vehicle".to_owned(), map(&vehicle)),
            ("outcome".to_owned(), map(&outcome)),
            ("hashes".to_owned(), map(&[("terrain_heights_sha256", heights_sha256.to_owned())])),
        ]
        .into()
    }

    /// Samples for the assembly, which writes them again with the study's metadata.
    fn write_samples(&self, work: &Work<'_>, driven: &mut [Driven]) -> Result<(), JobError> {
        let head = &self.head;
        let metadata = TableMetadata {
            study_sha256: String::new(),
            seed: head.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            license: head.license.clone(),
        };
        let mut writer = TableWriter::<SampleRow>::create(&work.output(SAMPLES), &metadata).map_err(JobError::new)?;
        for samples in driven.iter_mut().map(|d| std::mem::take(&mut d.samples)) {
            samples.iter().try_for_each(|row| writer.push(row)).map_err(JobError::new)?;
        }
        writer.finish().map(drop).map_err(JobError::new)
    }
}

impl Job for TraverseJob {
    fn recipe(&self) -> Value {
        let head = &self.head;
        json!({
            "traverse": self.settings.parameters(),
            "vehicle": self.vehicle.parameters(),
            "terrain": self.terrain,
            "group": self.group,
            "study": { "name": head.name, "seed": head.seed, "license": head.license, "epoch_ns": head.epoch_ns },
        })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility]
    }

    fn memory_bytes(&self) -> u64 {
        // Terrain, classes and pyramid once; samples of every mission: 20 Hz, some 300 bytes each.
        (256 << 20) + (self.count as f64 * self.seconds_each * 20.0 * 300.0) as u64
    }

    fn estimate(&self) -> Estimate {
        let driven_s = self.count as f64 * self.seconds_each;
        Estimate { seconds: 1e-3 * driven_s, bytes: 8e3 * driven_s }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let site = self.site(work)?;
        let missions = missions::read(&missions::file(work, &self.missions)?)?;
        let driven: Result<Vec<Driven>, JobError> =
            missions.par_iter().map(|mission| self.drive(work, &site, mission)).collect();
        let mut driven = driven?;
        self.write_samples(work, &mut driven)?;
        let mut products = vec![Product::internal(SAMPLES)];
        let mut rows = Rows::default();
        for d in driven {
            let product = Product::released(&d.file, d.release_path, Some(d.content));
            products.push(Product { records: Some(d.messages), ..product });
            rows.missions.push(d.row);
        }
        Ok(Outcome { products, rows, notes: site.ground.warnings().to_vec() })
    }
}
