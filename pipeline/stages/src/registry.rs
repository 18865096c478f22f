//! The list of stages, and how a study becomes a graph of items.

use crate::builder::{BuildError, Builder, InputPlace};
use crate::hypotheses;
use crate::jobs;
use crate::runner::graph::Graph;
use crate::splits::{self, Splits};
use crate::study::Study;
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::study as envelope;
use serde_json::{Value, json};

/// One section of a study, and the stage behind it.
struct Section {
    name: &'static str,
    form: Form,
    /// JSON Schema of the envelope.
    envelope: fn() -> Value,
    /// Kinds whose parameters stand beside the envelope's keys.
    kinds: fn() -> Vec<Kind>,
    /// Adds the section's items to the graph.
    add: fn(&mut Builder<'_>) -> Result<(), BuildError>,
}

/// How a section is written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    /// `[name]`, once: settings of a stage whose items follow from those of others.
    Table,
    /// `[[name]]`, once for each item.
    Array,
}

/// Sections in the order in which they may refer to one another.
const SECTIONS: [Section; 8] = [
    Section {
        name: "dem",
        form: Form::Array,
        envelope: schema_of::<envelope::DemItem>,
        kinds: Vec::new,
        add: jobs::dem::add,
    },
    Section {
        name: "terrain",
        form: Form::Array,
        envelope: schema_of::<envelope::TerrainItem>,
        kinds: sastrugi_terrain::kinds,
        add: jobs::terrain::add,
    },
    Section {
        name: "fit",
        form: Form::Array,
        envelope: schema_of::<envelope::FitItem>,
        kinds: jobs::fit::kinds,
        add: jobs::fit::add,
    },
    Section {
        name: "texture",
        form: Form::Array,
        envelope: schema_of::<envelope::TextureItem>,
        kinds: jobs::texture::kinds,
        add: jobs::texture::add,
    },
    Section {
        name: "roughness",
        form: Form::Table,
        envelope: schema_of::<envelope::RoughnessSection>,
        kinds: Vec::new,
        add: jobs::roughness::add,
    },
    Section {
        name: "missions",
        form: Form::Array,
        envelope: schema_of::<envelope::MissionsItem>,
        kinds: jobs::missions::kinds,
        add: jobs::missions::add,
    },
    Section {
        name: "traverse",
        form: Form::Array,
        envelope: schema_of::<envelope::TraverseItem>,
        kinds: jobs::traverse::kinds,
        add: jobs::traverse::add,
    },
    Section {
        name: hypotheses::SECTION,
        form: Form::Array,
        envelope: schema_of::<envelope::HypothesisItem>,
        kinds: Vec::new,
        add: hypotheses::check,
    },
];

/// Names of the sections beside `[study]`.
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
    for section in &SECTIONS {
        if section.form == Form::Table {
            properties.insert(section.name.to_owned(), (section.envelope)());
            continue;
        }
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
    let mut builder = Builder::new(study);
    for section in &SECTIONS {
        (section.add)(&mut builder)?;
    }
    let splits = splits::draw(study, &builder.heightfields, &builder.graph)?;
    Ok(Plan { graph: builder.graph, inputs: builder.inputs, splits })
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
