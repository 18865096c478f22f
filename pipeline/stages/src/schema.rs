//! JSON Schema of a study file.

use crate::registry::{Form, SECTIONS};
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::study::StudyHead;
use serde_json::{Value, json};

/// JSON Schema of a study file.
pub fn study_schema() -> Value {
    let mut properties = serde_json::Map::new();
    properties.insert("study".to_owned(), schema_of::<StudyHead>());
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
