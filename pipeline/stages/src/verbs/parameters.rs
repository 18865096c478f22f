//! Parameters given on a command line or in a small TOML file, brought to the form that a study's items have.

use crate::error::Error;
use crate::study::keys;
use crate::study::text::{StudyText, value_to_json};
use sastrugi_mobility::registry::{CUSTOM, doubts};
use sastrugi_schemas::Kind;
use serde_json::{Map, Value};
use std::path::Path;

/// Sets `name=value` pairs (dotted names reach into tables); the value is TOML, a bare word is text.
///
/// # Errors
/// A pair without `=`, or a value that is not finite.
pub fn assign(params: &mut Value, pairs: &[String]) -> Result<(), Error> {
    for pair in pairs {
        let (name, text) = pair
            .split_once('=')
            .filter(|(name, _)| !name.trim().is_empty())
            .ok_or_else(|| Error::Usage(format!("`--set {pair}`: it takes name=value")))?;
        place(params, name.trim(), parse_value(pair, text.trim())?)?;
    }
    Ok(())
}

/// Keys of a vehicle file: those that are read, and those that `kinds` prints beside them.
const VEHICLE_KEYS: [&str; 8] = ["base", "parameters", "sources", "kind", "family", "summary", "source", "schema"];

/// The vehicle of a run: the name of a known one, or a vehicle file (`.toml`, or `.json` as `kinds` prints it). The table `parameters` of a file holds
/// those that differ from the vehicle named by `base` or `kind`, or all of them where neither is there.
///
/// # Errors
/// A file that cannot be read, is neither TOML nor JSON, or is not a vehicle file.
pub fn assign_vehicle(params: &mut Value, vehicle: &str) -> Result<(), Error> {
    let is = |ending: &str| vehicle.to_ascii_lowercase().ends_with(ending);
    if !is(".toml") && !is(".json") {
        return place(params, "vehicle", Value::from(vehicle));
    }
    let refused = |e: &dyn std::fmt::Display| Error::Usage(format!("{vehicle}: {e}"));
    let text =
        sastrugi_store::file::read_text(Path::new(vehicle)).map_err(|e| Error::Input(format!("{vehicle}: {e}")))?;
    let file: Value = if is(".json") {
        serde_json::from_str(&text).map_err(|e| refused(&e))?
    } else {
        StudyText::parse(&text).and_then(|text| text.to_json()).map_err(|e| refused(&e))?
    };
    // `kinds` lists what it prints.
    let file = match file.as_array().map(Vec::as_slice) {
        None => &file,
        Some([one]) => one,
        Some(several) => return Err(refused(&format!("holds {} vehicles; keep one of them", several.len()))),
    };
    let mut keys = file.as_object().into_iter().flat_map(Map::keys);
    if let Some(unknown) = keys.find(|key| !VEHICLE_KEYS.contains(&key.as_str())) {
        return Err(refused(&format!(
            "unknown key `{unknown}`; numbers of the vehicle stand in the table `parameters`"
        )));
    }
    let base = match file.get("base").or_else(|| file.get("kind")) {
        None => CUSTOM,
        Some(base) => base.as_str().ok_or_else(|| refused(&"`base` must be the name of a vehicle"))?,
    };
    match file.get("parameters") {
        Some(parameters @ Value::Object(_)) => {
            place(params, "vehicle", Value::from(base))?;
            place(params, "vehicle_changes", parameters.clone())
        }
        _ => Err(refused(&"missing table `parameters`")),
    }
}

/// Doubts about the vehicle of a run, a sentence each.
pub fn vehicle_doubts(params: &Value) -> Vec<String> {
    let changes = params["vehicle_changes"].as_object().cloned().unwrap_or_default();
    params["vehicle"].as_str().map(|kind| doubts(kind, &changes)).unwrap_or_default()
}

fn parse_value(pair: &str, text: &str) -> Result<Value, Error> {
    match text.parse::<toml_edit::Value>() {
        Ok(value) => value_to_json(&value).map_err(|e| Error::Usage(format!("`--set {pair}`: {e}"))),
        Err(_) => Ok(Value::String(text.to_owned())),
    }
}

fn place(params: &mut Value, dotted: &str, value: Value) -> Result<(), Error> {
    let mut at = params;
    for word in dotted.split('.') {
        let map = at.as_object_mut().ok_or_else(|| Error::Usage(format!("`{dotted}`: its parent is no table")))?;
        at = map.entry(word).or_insert_with(|| Value::Object(Map::new()));
    }
    *at = value;
    Ok(())
}

/// A JSON value as TOML.
///
/// # Errors
/// Nulls and integers beyond 64 bits, which TOML does not have.
pub fn to_toml(value: &Value) -> Result<toml_edit::Value, Error> {
    let refuse = || Error::Usage(format!("{value} has no TOML form"));
    Ok(match value {
        Value::Null => return Err(refuse()),
        Value::Bool(b) => (*b).into(),
        Value::String(s) => s.as_str().into(),
        Value::Number(n) => match n.as_i64() {
            Some(integer) => integer.into(),
            None => n.as_f64().filter(|_| n.is_f64()).ok_or_else(refuse)?.into(),
        },
        Value::Array(list) => list.iter().map(to_toml).collect::<Result<toml_edit::Array, _>>()?.into(),
        Value::Object(map) => {
            let pairs = map.iter().map(|(k, v)| Ok((k.as_str(), to_toml(v)?)));
            pairs.collect::<Result<toml_edit::InlineTable, Error>>()?.into()
        }
    })
}

/// A TOML file of parameters.
///
/// # Errors
/// A file that is missing, or not valid TOML.
pub fn read_file(path: &Path) -> Result<Value, Error> {
    let text = sastrugi_store::file::read_text(path).map_err(|e| Error::Input(format!("{}: {e}", path.display())))?;
    let name = path.display().to_string();
    let read = StudyText::parse(&text).and_then(|t| t.to_json());
    read.map_err(|error| Error::Study { name, text, refusals: error.into() })
}

/// Refuses parameters that a kind does not have.
///
/// # Errors
/// The first unknown parameter, with the nearest known one.
pub fn check(params: &Value, kind: &Kind) -> Result<(), Error> {
    check_schema(params, &kind.parameters, kind.kind)
}

/// Refuses keys that a schema does not have.
///
/// # Errors
/// The first unknown key, with the nearest known one.
pub fn check_schema(params: &Value, schema: &Value, of: &str) -> Result<(), Error> {
    let found = keys::find_unknown(params, schema);
    let Some(unknown) = found.first() else { return Ok(()) };
    let hint = match unknown.nearest() {
        Some(nearest) => format!("did you mean `{nearest}`?"),
        None => format!("it has {}", unknown.known.join(", ")),
    };
    Err(Error::Usage(format!("`{of}` has no parameter `{}`; {hint}", unknown.path.join("."))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn val_pairs() {
        let mut params = json!({});
        let pairs = ["a=1", "b.c=[1.5, 2]", "word=gaussian", "t=\"x y\"", "u={v=true}"].map(str::to_owned);
        assign(&mut params, &pairs).unwrap();
        assert_eq!(params, json!({"a": 1, "b": {"c": [1.5, 2]}, "word": "gaussian", "t": "x y", "u": {"v": true}}));
        assert!(assign(&mut params, &["x".to_owned()]).is_err());
        assert!(assign(&mut params, &["x=nan".to_owned()]).is_err());
        assert!(assign(&mut params, &["a.b=1".to_owned()]).is_err());
    }
}
