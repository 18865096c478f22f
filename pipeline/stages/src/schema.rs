//! JSON Schema of a study file (draft 2020-12), for validators and for completion and checks in editors.
//!
//! All definitions are at the root, named by their origin (`terrain`, `terrain.multifractal`, `terrain.multifractal.RawLayer`), so that
//! every reference can be resolved. Each kind of a section is one alternative, with all keys of its tables.

use crate::registry::{Form, SECTIONS, Section};
use sastrugi_mobility::registry::CUSTOM;
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::study::StudyHead;
use sastrugi_texture::covariance::Form as CovarianceForm;
use serde_json::{Map, Value, json};

/// Key of a table that names several kinds at once and accepts the keys of all of them.
const SEVERAL: &str = "methods";
/// Keys of a size, of which a table may have one.
const SIZES: [&str; 2] = ["size_m", "size_px"];
/// Key with the lists of values of swept parameters.
const SWEEP: &str = "sweep";

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
    add_names(&mut definitions);
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

/// Adds the names that the room of the envelopes does not know: those of covariance models and of vehicles.
fn add_names(definitions: &mut Map<String, Value>) {
    let fit = definitions.get_mut("texture.FitReference");
    if let Some(model) = fit.and_then(|fit| fit.pointer_mut("/anyOf/1/properties/model")) {
        model["pattern"] = format!("^{}$", CovarianceForm::pattern()).into();
    }
    let kinds = sastrugi_mobility::registry::kinds().into_iter().filter(|kind| kind.family == "vehicle");
    let mut names: Vec<Value> = kinds.map(|kind| json!({ "const": kind.kind, "description": kind.summary })).collect();
    let shipped = Value::Array(names.clone());
    names.push(json!({ "const": CUSTOM, "description": "a vehicle of which `vehicle_changes` holds all parameters" }));
    let all = Value::Array(names);
    for definition in definitions.values_mut() {
        let is_custom = definition.pointer("/properties/vehicle_changes").is_some();
        if let Some(vehicle) = definition.pointer_mut("/properties/vehicle") {
            vehicle["oneOf"] = if is_custom { all.clone() } else { shipped.clone() };
        }
    }
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
    let mut envelope = (section.envelope)();
    if let Some(sweep) = envelope.pointer_mut(&format!("/properties/{SWEEP}")) {
        // The values become words of ids.
        let value = json!({ "type": ["number", "string", "boolean"] });
        sweep["additionalProperties"] = json!({ "type": "array", "minItems": 1, "items": value });
    }
    let place = hoist(section.name, envelope, definitions);
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
        let swept = swept(&properties);
        definition["properties"] = Value::Object(envelope.clone().into_iter().chain(properties).collect());
        if envelope.contains_key(SWEEP) {
            definition["properties"][SWEEP]["propertyNames"] = swept;
        }
        if SIZES.iter().all(|key| definition["properties"].get(key).is_some()) {
            definition["not"] = json!({ "required": SIZES });
        }
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

/// The parameters that a sweep may name: keys of the kind, and those of tables below them.
fn swept(parameters: &Map<String, Value>) -> Value {
    let keys: Vec<&str> = parameters.keys().map(String::as_str).collect();
    json!({ "pattern": format!("^({})(\\..+)?$", keys.join("|")) })
}

/// The keys of a kind. None is required here, since a required key may come from a sweep.
fn parameters_of(kind: &Kind) -> Value {
    let mut parameters = kind.parameters.clone();
    if let Some(object) = parameters.as_object_mut() {
        ["required", "default"].into_iter().for_each(|key| drop(object.remove(key)));
        object.insert("title".to_owned(), kind.kind.into());
        object.insert("description".to_owned(), kind.description().into());
    }
    parameters
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::loaded::load_text;
    use crate::starting::STARTING;
    use crate::study::{StudyError, StudyText};
    use std::path::Path;

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

    /// Vehicles and covariance models are named, and only where they may be; a sweep names keys of its kind.
    #[test]
    fn val_names_are_listed() {
        let schema = study_schema();
        let property = |definition: &str, key: &str| &schema["$defs"][definition]["properties"][key];
        let vehicles = |definition: &str| -> Vec<&str> {
            let all = property(definition, "vehicle")["oneOf"].as_array().unwrap();
            all.iter().map(|vehicle| vehicle["const"].as_str().unwrap()).collect()
        };
        let shipped = ["husky_a200", "ugv_4x4", "rocker_bogie_rover"];
        assert_eq!((vehicles("route.grid"), vehicles("missions.routed")), (shipped.to_vec(), shipped.to_vec()));
        assert_eq!(vehicles("traverse.pure_pursuit"), [&shipped[..], &["custom"]].concat());
        let model = &schema["$defs"]["texture.FitReference"]["anyOf"][1]["properties"]["model"]["pattern"];
        assert!(model.as_str().unwrap().contains("(exponential|gaussian|"), "{model}");
        let swept = |definition: &str| property(definition, "sweep")["propertyNames"]["pattern"].as_str().unwrap();
        assert_eq!(
            swept("terrain.cascade"),
            r"^(size_m|size_px|cell_m|codimension|hurst_exponent|outer_scale_m|rms_height_m)(\..+)?$"
        );
        assert!(swept("texture.methods").contains("|packing|") && !swept("texture.fft_ma").contains("|packing|"));
    }

    /// Tables of a study that needs no files, by section; a line that is tested goes into the last of them.
    const TABLES: [(&str, &str); 10] = [
        ("terrain", "id = \"t\""),
        ("texture", "id = \"x\"\nfit = { model = \"exponential\", sigma_m = 0.03, range_m = 0.3 }"),
        (
            "image",
            "id = \"i\"\nsurface = \"t\"\nsweep.\"sun.azimuth_deg\" = [0.0, 120.0, 240.0]\n[[image]]\nid = \"j\"\nsurface = \"t\"",
        ),
        ("photoclinometry", "id = \"p\"\nimages = [\"i\"]"),
        ("missions", "id = \"m\"\nterrains = [\"t\"]"),
        ("traverse", "id = \"d\"\nmissions = \"m\""),
        ("route", "id = \"r\"\nterrains = [\"t\"]"),
        ("navigate", "id = \"n\"\nroute = \"r\""),
        ("rover", "id = \"v\"\nterrains = [\"t\"]\ncentre_m = [50.0, 50.0]"),
        ("roughness", ""),
    ];

    /// The study with `line` in the table of a section, of a kind.
    fn study_with(place: &Section, kind: Option<&str>, line: &str) -> String {
        let mut text = "[study]\nname = \"x\"\nseed = 3\ndate = \"2026-01-01\"\n".to_owned();
        for section in &SECTIONS {
            let Some((name, keys)) = TABLES.iter().find(|(name, _)| *name == section.name) else { continue };
            let heading = if section.form == Form::Table { format!("[{name}]") } else { format!("[[{name}]]") };
            let usual = match *name {
                "terrain" => Some("gap"),
                "rover" => Some("sojourner_like"),
                _ => None,
            };
            let here = section.name == place.name;
            let chosen = kind.filter(|_| here).or(usual);
            let selected = section.selector().zip(chosen).map(|(key, kind)| format!("{key} = \"{kind}\"\n"));
            let line = if here { line } else { "" };
            text += &format!("{heading}\n{}{keys}\n{line}\n", selected.unwrap_or_default());
        }
        text
    }

    /// The values nearest to the limits of a schema that it excludes, with their keys: those of a number, of the numbers of a list, and of the keys
    /// of a table. Tables that need other keys, and tables in lists, are left out.
    fn excluded(key: &str, schema: &Value, definitions: &Value) -> Vec<(String, Value)> {
        let below = |key: &str, schema: &Value| excluded(key, schema, definitions);
        if let Some(target) = schema["$ref"].as_str() {
            return below(key, &definitions[target.trim_start_matches("#/$defs/")]);
        }
        if let Some(choices) = schema["anyOf"].as_array() {
            return choices.iter().flat_map(|choice| below(key, choice)).collect();
        }
        if let Some(properties) = schema["properties"].as_object().filter(|_| schema["required"].is_null()) {
            return properties.iter().flat_map(|(name, schema)| below(&format!("{key}.{name}"), schema)).collect();
        }
        if let Some(items) = schema.get("items") {
            let length = schema["minItems"].as_u64().unwrap_or(1) as usize;
            let numbers = below(key, items).into_iter().filter(|(own, _)| own == key);
            return numbers.map(|(key, value)| (key, json!(vec![value; length]))).collect();
        }
        beyond(schema).into_iter().map(|value| (key.to_owned(), value)).collect()
    }

    /// The numbers next to the limits of a schema that it excludes.
    fn beyond(schema: &Value) -> Vec<Value> {
        let is_whole = match &schema["type"] {
            Value::Array(kinds) => kinds.contains(&json!("integer")),
            kind => kind == "integer",
        };
        let limit = |keyword: &str| schema[keyword].as_f64();
        let below = limit("minimum").map(|least| if is_whole { least - 1.0 } else { least.next_down() });
        let above = limit("maximum").map(|most| if is_whole { most + 1.0 } else { most.next_up() });
        let numbers = [below, above, limit("exclusiveMinimum"), limit("exclusiveMaximum")].into_iter().flatten();
        numbers.map(|number| if is_whole { json!(number as i64) } else { json!(number) }).collect()
    }

    /// The kinds of a section with their keys and those of the envelope, apart from kinds that need other tables; a section without kinds has its
    /// envelope.
    fn kinds_of<'s>(section: &Section, definitions: &'s Value) -> Vec<(Option<&'static str>, &'s Map<String, Value>)> {
        let of = |kind: Option<&'static str>| {
            let name = kind.map_or_else(|| section.name.to_owned(), |kind| format!("{}.{kind}", section.name));
            (kind.filter(|_| section.selector().is_some()), definitions[&name]["properties"].as_object().unwrap())
        };
        let alone = |kind: &&str| !["elaborate", "routed", "trail"].contains(kind);
        let kinds: Vec<_> =
            section.distinct_kinds().iter().map(|kind| kind.kind).filter(alone).map(|kind| of(Some(kind))).collect();
        if kinds.is_empty() { vec![of(None)] } else { kinds }
    }

    /// A study is refused for the number nearest to each limit of the schema that it excludes, with the key: the checks exclude no less than the
    /// schema.
    #[test]
    fn val_limits_are_those_of_the_checks() {
        let schema = study_schema();
        let definitions = &schema["$defs"];
        let mut keys = Vec::new();
        for section in SECTIONS.iter().filter(|section| TABLES.iter().any(|(name, _)| *name == section.name)) {
            for (kind, properties) in kinds_of(section, definitions) {
                for (key, value) in properties.iter().flat_map(|(key, schema)| excluded(key, schema, definitions)) {
                    let line = format!("{key} = {value}");
                    let place = format!("[[{}]] {kind:?}: {line}", section.name);
                    let found = load_text(&study_with(section, kind, &line), "study", Path::new(""));
                    let Err(Error::Study { refusals, .. }) = found else { panic!("{place} passes") };
                    let is_told = |error: &StudyError| error.message.contains(&format!("`{key}"));
                    assert!(refusals.0.iter().any(is_told), "{place}: {refusals}");
                    keys.push(key);
                }
            }
        }
        let nested = keys.iter().filter(|key| key.contains('.')).count();
        assert!(keys.len() > 500 && nested > 100, "{} {nested}", keys.len());
    }

    /// The study itself is valid.
    #[test]
    fn val_the_study_of_these_tests_is_valid() {
        let terrain = SECTIONS.iter().find(|section| section.name == "terrain").unwrap();
        assert!(load_text(&study_with(terrain, None, ""), "study", Path::new("")).is_ok());
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
