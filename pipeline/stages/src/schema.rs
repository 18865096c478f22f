//! JSON Schema of a study file (draft 2020-12), for validators and for completion and checks in editors.
//!
//! All definitions are at the root, named by their origin (`terrain`, `terrain.multifractal`, `terrain.multifractal.RawLayer`), so that
//! every reference can be resolved. Each kind of a section is one alternative, with all keys of its tables.

use crate::registry::{Form, SECTIONS, Section};
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::study::StudyHead;
use serde_json::{Map, Value, json};

/// Key of a table that names several kinds at once and accepts the keys of all of them.
const SEVERAL: &str = "methods";

/// Title of the schema, by which a file that holds one is recognised.
const TITLE: &str = "sastrugi study";

/// JSON Schema of a study file.
///
/// ```
/// let schema = sastrugi_stages::schema::study_schema();
/// assert_eq!(schema["required"], serde_json::json!(["study"]));
/// // A section is a list of tables, one for each item.
/// assert_eq!(schema["properties"]["terrain"]["type"], "array");
/// ```
pub fn study_schema() -> Value {
    let mut definitions = Map::new();
    let mut properties = Map::new();
    properties.insert("study".to_owned(), hoist("study", schema_of::<StudyHead>(), &mut definitions));
    for section in &SECTIONS {
        let table = table(section, &mut definitions);
        let section_schema = match section.form {
            Form::Table => table,
            Form::Array => json!({ "type": "array", "items": table }),
        };
        properties.insert(section.name.to_owned(), section_schema);
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": TITLE,
        "description": "A study: what is measured, generated, fitted, synthesised, driven and tested.",
        "type": "object",
        "required": ["study"],
        "additionalProperties": false,
        "properties": properties,
        "$defs": definitions,
    })
}

/// True for the text of a schema that this or an earlier version wrote: only such a file may be replaced without asking.
///
/// ```
/// use sastrugi_stages::schema::{is_own, study_schema};
///
/// assert!(is_own(study_schema().to_string().as_bytes()));
/// assert!(!is_own(br#"{ "title": "another study" }"#) && !is_own(b"notes"));
/// ```
pub fn is_own(text: &[u8]) -> bool {
    serde_json::from_slice::<Value>(text).is_ok_and(|schema| schema["title"] == TITLE)
}

/// Moves a schema and its definitions to the root; returns the reference that replaces it.
fn hoist(name: &str, mut schema: Value, definitions: &mut Map<String, Value>) -> Value {
    if let Some(object) = schema.as_object_mut() {
        object.remove("$schema");
        let own = object.remove("$defs");
        for (inner, mut definition) in own.and_then(|d| d.as_object().cloned()).unwrap_or_default() {
            rename(&mut definition, name);
            definitions.insert(format!("{name}.{inner}"), definition);
        }
    }
    rename(&mut schema, name);
    definitions.insert(name.to_owned(), schema);
    reference(name)
}

fn reference(name: &str) -> Value {
    json!({ "$ref": format!("#/$defs/{name}") })
}

/// Adapts references to the root.
fn rename(schema: &mut Value, name: &str) {
    match schema {
        Value::Object(map) => map.iter_mut().for_each(|(key, value)| match value {
            Value::String(target) if key == "$ref" => *target = target.replace("#/$defs/", &format!("#/$defs/{name}.")),
            _ => rename(value, name),
        }),
        Value::Array(list) => list.iter_mut().for_each(|value| rename(value, name)),
        _ => {}
    }
}

/// A table of a section: the keys of the envelope and of its kind.
fn table(section: &Section, definitions: &mut Map<String, Value>) -> Value {
    let place = hoist(section.name, (section.envelope)(), definitions);
    let envelope = definitions.get(section.name).and_then(|e| e["properties"].as_object()).cloned().unwrap_or_default();
    let (selector, kinds) = (section.selector(), section.distinct_kinds());
    let mut own: Vec<(String, Map<String, Value>)> = Vec::new();
    for kind in &kinds {
        let name = format!("{}.{}", section.name, kind.kind);
        hoist(&name, parameters_of(kind), definitions);
        let properties = definitions.get(&name).and_then(|k| k["properties"].as_object()).cloned().unwrap_or_default();
        own.push((name, properties));
    }
    let side_by_side = envelope.contains_key(SEVERAL).then(|| {
        let all = own.iter().flat_map(|(_, properties)| properties.clone()).collect();
        let name = format!("{}.{SEVERAL}", section.name);
        definitions.insert(name.clone(), json!({ "title": SEVERAL, "required": [SEVERAL] }));
        (name, all)
    });
    let mut choices = Vec::new();
    for (name, properties) in own.into_iter().chain(side_by_side) {
        let Some(definition) = definitions.get_mut(&name) else { continue };
        let title = definition["title"].clone();
        definition["properties"] = Value::Object(envelope.clone().into_iter().chain(properties).collect());
        if let Some(key) = selector.filter(|_| title != SEVERAL) {
            definition["properties"][key] = json!({ "const": title });
        }
        // In every alternative, not next to them: editors that support only earlier drafts of JSON Schema ignore `unevaluatedProperties`.
        definition["additionalProperties"] = Value::Bool(false);
        choices.push(reference(&name));
    }
    if let Some(envelope) =
        definitions.get_mut(section.name).and_then(Value::as_object_mut).filter(|_| !choices.is_empty())
    {
        envelope.remove("additionalProperties");
        envelope.insert("anyOf".to_owned(), Value::Array(choices));
    }
    place
}

/// The keys of a kind. None is required here, since a required key may come from a sweep.
fn parameters_of(kind: &Kind) -> Value {
    let mut parameters = kind.parameters.clone();
    if let Some(object) = parameters.as_object_mut() {
        ["required", "default"].into_iter().for_each(|key| drop(object.remove(key)));
        object.insert("title".to_owned(), kind.kind.into());
        object.insert("description".to_owned(), format!("{} Source: {}", kind.summary, kind.source).into());
    }
    parameters
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::starting::STARTING;
    use crate::study::StudyText;

    /// Every `$ref` in a value.
    fn references<'a>(value: &'a Value, found: &mut Vec<&'a str>) {
        match value {
            Value::Object(map) => map.iter().for_each(|(key, value)| match value.as_str() {
                Some(target) if key == "$ref" => found.push(target),
                _ => references(value, found),
            }),
            Value::Array(list) => list.iter().for_each(|value| references(value, found)),
            _ => {}
        }
    }

    #[test]
    fn val_every_reference_resolves() {
        let schema = study_schema();
        let mut found = Vec::new();
        references(&schema, &mut found);
        assert!(found.len() > 50, "{}", found.len());
        for target in found {
            assert!(target.strip_prefix('#').is_some_and(|path| schema.pointer(path).is_some()), "{target}");
        }
    }

    /// Each kind of a section is one alternative, which accepts the keys of the envelope and its own, and no others.
    #[test]
    fn val_kinds_are_alternatives() {
        let schema = study_schema();
        let definitions = &schema["$defs"];
        let section = SECTIONS.iter().find(|section| section.name == "terrain").unwrap();
        let choices = definitions["terrain"]["anyOf"].as_array().unwrap();
        assert_eq!(choices.len(), (section.kinds)().len());
        for kind in (section.kinds)() {
            let name = format!("terrain.{}", kind.kind);
            assert!(choices.contains(&reference(&name)), "{name}");
            let table = &definitions[&name];
            assert_eq!(
                (&table["additionalProperties"], &table["properties"]["kind"]["const"]),
                (&false.into(), &kind.kind.into())
            );
            for key in ["id", "count", "sweep"] {
                assert!(table["properties"].get(key).is_some(), "{name}: {key}");
            }
        }
        assert!(definitions["terrain.multifractal"]["properties"].get("high").is_some());
        assert!(definitions["terrain.gap"]["properties"].get("high").is_none());
    }

    /// The sections of the starting studies are those of the schema.
    #[test]
    fn val_starting_studies_have_known_sections() {
        let schema = study_schema();
        for starting in STARTING {
            let study = StudyText::parse(starting.text).unwrap().to_json().unwrap();
            let sections = study.as_object().unwrap();
            assert!(sections.contains_key("study") && sections.len() > 1, "{}", starting.name);
            for section in sections.keys() {
                assert!(schema["properties"].get(section).is_some(), "{}: {section}", starting.name);
            }
        }
    }
}
