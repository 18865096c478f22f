//! The list of stages, and how a study becomes a graph of items.

use crate::hypotheses;
use crate::jobs::{self, ItemRef, Job};
use crate::runner::graph::{Graph, InputFile, Node};
use crate::splits::{self, Splits};
use crate::study::{Entry, Study, StudyError};
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_schemas::Kind;
use sastrugi_schemas::fit::Source;
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::study::{self as envelope, Pairing};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// One section of a study, `[[name]]`, and the stage behind it.
struct Section {
    name: &'static str,
    /// JSON Schema of the envelope.
    envelope: fn() -> Value,
    /// Kinds whose parameters stand beside the envelope's keys.
    kinds: fn() -> Vec<Kind>,
    /// Adds the section's items to the graph.
    add: fn(&mut Builder<'_>) -> Result<(), BuildError>,
}

/// Sections in the order in which they may refer to one another.
const SECTIONS: [Section; 7] = [
    Section { name: "dem", envelope: schema_of::<envelope::DemItem>, kinds: Vec::new, add: jobs::dem::add },
    Section {
        name: "terrain",
        envelope: schema_of::<envelope::TerrainItem>,
        kinds: sastrugi_terrain::kinds,
        add: jobs::terrain::add,
    },
    Section { name: "fit", envelope: schema_of::<envelope::FitItem>, kinds: jobs::fit::kinds, add: jobs::fit::add },
    Section {
        name: "texture",
        envelope: schema_of::<envelope::TextureItem>,
        kinds: jobs::texture::kinds,
        add: jobs::texture::add,
    },
    Section {
        name: "missions",
        envelope: schema_of::<envelope::MissionsItem>,
        kinds: jobs::missions::kinds,
        add: jobs::missions::add,
    },
    Section {
        name: "traverse",
        envelope: schema_of::<envelope::TraverseItem>,
        kinds: jobs::traverse::kinds,
        add: jobs::traverse::add,
    },
    Section {
        name: hypotheses::SECTION,
        envelope: schema_of::<envelope::HypothesisItem>,
        kinds: Vec::new,
        add: hypotheses::check,
    },
];

/// Endings that files of the release have beside an id.
const RESERVED: [&str; 5] = ["raw", "metric", "background", "residual", "mask"];

/// Names of the sections that are arrays of tables.
pub fn section_names() -> Vec<&'static str> {
    SECTIONS.iter().map(|s| s.name).collect()
}

/// Every generator, fit, covariance model, method, mission rule, run, vehicle.
pub fn kinds() -> Vec<Kind> {
    let models = sastrugi_texture::kinds().into_iter().filter(|k| k.family == "covariance");
    SECTIONS.iter().flat_map(|s| (s.kinds)()).chain(models).chain(sastrugi_mobility::registry::kinds()).collect()
}

/// JSON Schema of a study file.
pub fn study_schema() -> Value {
    let mut properties = serde_json::Map::new();
    properties.insert("study".to_owned(), schema_of::<envelope::StudyHead>());
    properties.insert("roughness".to_owned(), schema_of::<envelope::RoughnessSection>());
    for section in &SECTIONS {
        let kinds: Vec<Value> = (section.kinds)()
            .into_iter()
            .map(|k| json!({ "title": k.kind, "description": k.summary, "parameters": k.parameters }))
            .collect();
        let items = json!({ "envelope": (section.envelope)(), "kinds": kinds });
        properties.insert(section.name.to_owned(), json!({ "type": "array", "items": items_schema(&items) }));
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "sastrugi study",
        "type": "object",
        "required": ["study"],
        "additionalProperties": false,
        "properties": properties,
    })
}

/// An item's keys: the envelope's and those of any of the section's kinds.
fn items_schema(parts: &Value) -> Value {
    let mut item = parts["envelope"].clone();
    let mut definitions = item.get("$defs").cloned().unwrap_or_else(|| json!({}));
    let mut choices = Vec::new();
    for kind in parts["kinds"].as_array().into_iter().flatten() {
        if let Some(more) = kind["parameters"].get("$defs").and_then(Value::as_object) {
            more.iter().for_each(|(k, v)| definitions[k] = v.clone());
        }
        choices.push(json!({
            "title": kind["title"],
            "description": kind["description"],
            "properties": kind["parameters"]["properties"],
        }));
    }
    if let Some(object) = item.as_object_mut() {
        object.remove("additionalProperties");
        object.remove("$schema");
        object.insert("$defs".to_owned(), definitions);
        if !choices.is_empty() {
            object.insert("anyOf".to_owned(), Value::Array(choices));
        }
    }
    item
}

/// Why a study has no graph.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The study is wrong.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// An input file is missing or cannot be read.
    #[error("{0}")]
    Input(String),
}

/// A heightfield that other items can refer to.
#[derive(Clone, Debug)]
pub struct Heightfield {
    /// The item that makes it; its file is `heights.tif`.
    pub item: ItemRef,
    /// Label for statistics.
    pub group: Option<String>,
    /// What differs from other heightfields of the group.
    pub variant: Option<String>,
    /// Position among the replicates of its item, from 0; measured DEMs have none.
    pub replicate: Option<u64>,
    /// Generator, method or file format.
    pub kind: String,
    /// Full parameters.
    pub parameters: Value,
    /// Words of its random streams.
    pub stream: Option<String>,
    /// Its path in the release.
    pub release_path: String,
    /// Number of cells; for a measured DEM whose file does not state it, as many as it may hold.
    pub cells: u64,
    /// Smaller side of a cell, m, where it is known before the run.
    pub cell_m: Option<f64>,
    /// Shape and place, where they are known before the run.
    pub geometry: Option<Geometry>,
}

/// A graph under construction, with what later sections refer to.
pub struct Builder<'a> {
    /// The study.
    pub study: &'a Study,
    /// Heightfields by id.
    pub heightfields: BTreeMap<String, Heightfield>,
    /// Ids that an id in the study stands for (its replicates and sweeps).
    pub families: BTreeMap<String, Vec<String>>,
    /// Ids of fits.
    pub fits: Vec<String>,
    /// Missions by id: what is drawn on which heightfields.
    pub missions: BTreeMap<String, jobs::missions::Drawn>,
    /// Where each input file goes in the release.
    pub inputs: Vec<InputPlace>,
    ids: BTreeMap<String, &'static str>,
    graph: Graph,
}

/// An input file and its place in the release.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputPlace {
    /// Path of the key that names it in the study.
    pub key: Vec<String>,
    /// Path in the release.
    pub release_path: String,
}

impl Builder<'_> {
    /// Takes an id; ids are unique in a study, across sections.
    ///
    /// # Errors
    /// When it is taken.
    pub fn claim(&mut self, entry: &Entry<'_>, section: &'static str, id: &str) -> Result<(), StudyError> {
        let ending = id.rsplit_once('.').map_or("", |(_, ending)| ending);
        if RESERVED.contains(&ending) || sastrugi_terrain::MAPS.iter().any(|map| map.name == ending) {
            return Err(
                entry.error("id", format!("the id \"{id}\" ends in .{ending}, which names files of the release"))
            );
        }
        match self.ids.insert(id.to_owned(), section) {
            None => Ok(()),
            Some(other) => {
                let message = format!("the id \"{id}\" is taken by an item of [[{other}]]; ids are unique in a study");
                Err(entry.error("id", message))
            }
        }
    }

    /// Streams of an item: the study's, or those of its explicit seed.
    pub fn streams(&self, stage: &str, id: &str, seed: Option<u64>, replicate: u64) -> Streams {
        match seed {
            Some(seed) => Streams::for_seed(seed.wrapping_add(replicate), stage),
            None => Streams::for_item(self.study.head.seed, stage, id),
        }
    }

    /// True when replicates with the same number share their random draws.
    pub fn is_paired(&self) -> bool {
        self.study.head.pairing == Pairing::Common
    }

    /// The items that are there so far.
    pub fn nodes(&self) -> &[Node] {
        self.graph.nodes()
    }

    /// Names a family of ids, to which references resolve.
    ///
    /// # Errors
    /// When another family has that name.
    pub fn name_family(&mut self, entry: &Entry<'_>, name: &str, ids: Vec<String>) -> Result<(), StudyError> {
        match self.families.insert(name.to_owned(), ids) {
            None => Ok(()),
            Some(_) => Err(entry.error("id", format!("the id \"{name}\" is taken; ids are unique in a study"))),
        }
    }

    /// Adds an item to the graph.
    ///
    /// # Errors
    /// When a parent is missing: a stage registered out of order.
    pub fn node(&mut self, entry: &Entry<'_>, node: Node) -> Result<(), StudyError> {
        let name = node.item.to_string();
        if self.graph.add(node) {
            Ok(())
        } else {
            Err(entry.error("", format!("{name} cannot be placed in the graph")))
        }
    }

    /// Registers a heightfield under its id, with the item that describes and classifies it.
    ///
    /// # Errors
    /// As [`Self::node`].
    pub fn heightfield(&mut self, entry: &Entry<'_>, id: &str, field: Heightfield) -> Result<(), StudyError> {
        let job = jobs::roughness::RoughnessJob::new(id, &field, &self.study.roughness);
        let node = Node {
            item: ItemRef::new(jobs::roughness::STAGE, id),
            parents: vec![field.item.clone()],
            inputs: Vec::new(),
            stream: None,
            job: Box::new(job) as Box<dyn Job>,
        };
        self.heightfields.insert(id.to_owned(), field);
        self.node(entry, node)
    }

    /// The heightfield that a key names.
    ///
    /// # Errors
    /// An id that no earlier heightfield has.
    pub fn surface(&self, entry: &Entry<'_>, key: &str, id: &str) -> Result<&Heightfield, StudyError> {
        self.heightfields.get(id).ok_or_else(|| unknown_id(entry, key, id, self.heightfields.keys()))
    }

    /// What a fit file says of its source: the measured file, or the generated heightfield's path in the release.
    pub fn source_of(&self, id: &str, field: &Heightfield) -> Source {
        let input = self.graph.find(&field.item).and_then(|p| self.graph.node(p).inputs.first());
        let window = field.parameters.get("window").and_then(|w| serde_json::from_value(w.clone()).ok());
        match input {
            Some(input) => Source {
                file: format!("{id}.{}", field.kind),
                sha256: input.sha256.clone(),
                window,
                ..Source::default()
            },
            None => Source { file: field.release_path.clone(), ..Source::default() },
        }
    }

    /// The ids that a reference stands for.
    ///
    /// # Errors
    /// An id that no earlier item has.
    pub fn family(&self, entry: &Entry<'_>, key: &str, id: &str) -> Result<Vec<String>, StudyError> {
        if self.heightfields.contains_key(id) {
            return Ok(vec![id.to_owned()]);
        }
        self.families.get(id).cloned().ok_or_else(|| unknown_id(entry, key, id, self.families.keys()))
    }
}

/// The error for a reference to nothing.
pub fn unknown_id<'s>(entry: &Entry<'_>, key: &str, id: &str, known: impl Iterator<Item = &'s String>) -> StudyError {
    let known: Vec<&str> = known.map(String::as_str).collect();
    let nearest = crate::study::keys::nearest(id, known.iter().copied()).map(|n| format!("did you mean \"{n}\"?"));
    let list = if known.is_empty() { "there are none".to_owned() } else { format!("there are {}", known.join(", ")) };
    entry
        .error(key, format!("`{key}` names \"{id}\", which no item before it has"))
        .with_help(Some(nearest.unwrap_or(list)))
}

/// A study's items.
pub struct Plan {
    /// The graph.
    pub graph: Graph,
    /// Where input files go in the release.
    pub inputs: Vec<InputPlace>,
    /// Which terrains are for training, validation and test.
    pub splits: Splits,
}

/// Builds the graph of a study. Input files are hashed, nothing else is read.
///
/// # Errors
/// The first thing that is wrong with the study, or an input file that cannot be read.
pub fn build(study: &Study) -> Result<Plan, BuildError> {
    let mut builder = Builder {
        study,
        heightfields: BTreeMap::new(),
        families: BTreeMap::new(),
        fits: Vec::new(),
        missions: BTreeMap::new(),
        inputs: Vec::new(),
        ids: BTreeMap::new(),
        graph: Graph::default(),
    };
    for section in &SECTIONS {
        (section.add)(&mut builder)?;
    }
    let splits = splits::draw(study, &builder.heightfields, &builder.graph)?;
    Ok(Plan { graph: builder.graph, inputs: builder.inputs, splits })
}

/// An input file: its length in bytes, and its hash.
///
/// # Errors
/// A file that is missing or cannot be read.
pub fn input_file(path: PathBuf) -> Result<(u64, InputFile), BuildError> {
    match sastrugi_store::digest::of_file(&path) {
        Ok((bytes, sha256)) => Ok((bytes, InputFile { path, sha256 })),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            Err(BuildError::Input(format!("{}: no such file", path.display())))
        }
        Err(e) => Err(BuildError::Input(format!("{}: {e}", path.display()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::keys::properties;

    /// A key of an envelope would never reach a generator.
    #[test]
    fn val_no_parameter_has_the_name_of_an_envelope_key() {
        for section in &SECTIONS {
            let envelope = properties(&(section.envelope)());
            for kind in (section.kinds)() {
                let own = properties(&kind.parameters);
                let shared: Vec<&String> = own.iter().filter(|key| envelope.contains(key)).collect();
                assert!(shared.is_empty(), "[[{}]] {}: {shared:?}", section.name, kind.kind);
            }
        }
    }
}
