//! Converts parameters from a command line or a small TOML file to the form they have in a study.

use crate::error::Error;
use crate::study::entry::{TABLES_MAX, is_too_deep};
use crate::study::keys;
use crate::study::text::{StudyText, value_to_json};
use sastrugi_mobility::registry::{CUSTOM, doubt_of_speed, doubts, vehicle};
use sastrugi_schemas::Kind;
use serde_json::{Map, Value};
use std::path::Path;

/// Sets `name=value` pairs (dotted names reach into tables); the value is TOML, a bare word is text.
///
/// # Errors
/// A pair without `=`, or a value that is not finite.
///
/// # Examples
/// ```
/// use sastrugi_stages::verbs::parameters::assign;
/// use serde_json::json;
///
/// # fn main() -> Result<(), sastrugi_stages::Error> {
/// let mut parameters = json!({ "size_px": [64, 64] });
/// let pairs = ["high.fractal_dimension=2.5", "size_px=[512, 256]", "phase=gaussian"].map(str::to_owned);
/// assign(&mut parameters, &pairs)?;
/// assert_eq!(
///     parameters,
///     json!({ "size_px": [512, 256], "high": { "fractal_dimension": 2.5 }, "phase": "gaussian" })
/// );
/// # Ok(())
/// # }
/// ```
pub fn assign(params: &mut Value, pairs: &[String]) -> Result<(), Error> {
    for pair in pairs {
        let (name, text) = pair
            .split_once('=')
            .filter(|(name, _)| !name.trim().is_empty())
            .ok_or_else(|| Error::Usage(format!("`--set {pair}`: expected name=value")))?;
        place(params, name.trim(), parse_value(pair, text.trim())?)?;
    }
    Ok(())
}

/// Key of a `[[traverse]]` that holds the values of a vehicle file.
const CHANGES: &str = "vehicle_changes";

/// Keys of a vehicle file: those that are read, and those that `kinds` prints in addition.
const VEHICLE_KEYS: [&str; 8] = ["base", "parameters", "sources", "kind", "family", "summary", "source", "schema"];

/// Sets the vehicle of a run: a known name, or a vehicle file (`.toml`, or `.json` as printed by `kinds`). The table `parameters` of the file
/// holds the values that differ from the vehicle named by `base` or `kind`, or all values if neither is given.
///
/// # Errors
/// A file that cannot be read, is neither TOML nor JSON, or is not a vehicle file; one that names an unknown vehicle.
pub fn assign_vehicle(params: &mut Value, vehicle: &str) -> Result<(), Error> {
    let is = |ending: &str| vehicle.to_ascii_lowercase().ends_with(ending);
    if !is(".toml") && !is(".json") {
        return place(params, "vehicle", Value::from(vehicle));
    }
    let refused = |e: &dyn std::fmt::Display| Error::Usage(format!("{vehicle}: {e}"));
    let text =
        sastrugi_store::file::read_text(Path::new(vehicle)).map_err(|e| Error::unreadable(Path::new(vehicle), &e))?;
    let file: Value = if is(".json") {
        serde_json::from_str(&text).map_err(|e| refused(&e))?
    } else {
        StudyText::parse(&text).and_then(|text| text.to_json()).map_err(|e| refused(&e))?
    };
    // `kinds` prints a list.
    let file = match file.as_array().map(Vec::as_slice) {
        None => &file,
        Some([one]) => one,
        Some(several) => return Err(refused(&format!("contains {} vehicles; keep one of them", several.len()))),
    };
    let (base, changes) = described(file).map_err(|e| refused(&e))?;
    place(params, "vehicle", Value::from(base))?;
    if changes.is_empty() { Ok(()) } else { place(params, CHANGES, Value::Object(changes)) }
}

/// Content of a vehicle file: the name of a vehicle, and the values that differ from it.
fn described(file: &Value) -> Result<(&str, Map<String, Value>), String> {
    let mut keys = file.as_object().into_iter().flat_map(Map::keys);
    if let Some(unknown) = keys.find(|key| !VEHICLE_KEYS.contains(&key.as_str())) {
        return Err(format!("unknown key `{unknown}`; values of the vehicle belong in the table `parameters`"));
    }
    let base = ["base", "kind"].into_iter().find_map(|key| Some((key, file.get(key)?)));
    let changes = match file.get("parameters") {
        Some(Value::Object(changes)) => changes.clone(),
        Some(_) => return Err("`parameters` must be a table".to_owned()),
        None if base.is_some() => Map::new(),
        None => return Err("missing table `parameters`; without `base` it must give all values".to_owned()),
    };
    let (key, name) = match base {
        None => ("base", CUSTOM),
        Some((key, name)) => (key, name.as_str().ok_or_else(|| format!("`{key}` must be the name of a vehicle"))?),
    };
    check_vehicle((key, name), &changes)?;
    Ok((name, changes))
}

/// Refuses the base and the values of a vehicle file by the names that they have in it.
fn check_vehicle((key, base): (&str, &str), changes: &Map<String, Value>) -> Result<(), String> {
    let Err(error) = vehicle(base, changes) else { return Ok(()) };
    let message = error.to_string();
    Err(if error.key.starts_with(CHANGES) {
        message.replacen(CHANGES, "parameters", 1).replacen("` missing field `", "` lacks `", 1)
    } else {
        message.replacen("`vehicle`", &format!("`{key}`"), 1)
    })
}

/// Warnings about the vehicle of a run, one sentence each.
pub fn vehicle_doubts(params: &Value) -> Vec<String> {
    let Some(kind) = params["vehicle"].as_str() else { return Vec::new() };
    let changes = params[CHANGES].as_object().cloned().unwrap_or_default();
    let of_speed = || doubt_of_speed(&vehicle(kind, &changes).ok()?, params["speed_m_s"].as_f64()?);
    doubts(kind, &changes).into_iter().chain(of_speed()).collect()
}

fn parse_value(pair: &str, text: &str) -> Result<Value, Error> {
    match text.parse::<toml_edit::Value>() {
        Ok(value) => value_to_json(&value).map_err(|e| Error::Usage(format!("`--set {pair}`: {e}"))),
        Err(_) => Ok(Value::String(text.to_owned())),
    }
}

fn place(params: &mut Value, dotted: &str, value: Value) -> Result<(), Error> {
    if is_too_deep(dotted) {
        return Err(Error::Usage(format!(
            "a key is nested more than {TABLES_MAX} tables deep; no parameter is that deep"
        )));
    }
    let mut at = params;
    for word in dotted.split('.') {
        let map = at.as_object_mut().ok_or_else(|| Error::Usage(format!("`{dotted}`: its parent is not a table")))?;
        at = map.entry(word).or_insert_with(|| Value::Object(Map::new()));
    }
    *at = value;
    Ok(())
}

/// A JSON value as TOML.
///
/// # Errors
/// Nulls and integers beyond 64 bits, which do not exist in TOML.
///
/// ```
/// use sastrugi_stages::verbs::parameters::to_toml;
/// use serde_json::json;
///
/// assert_eq!(to_toml(&json!([1, 2.5])).map(|value| value.to_string()).ok().as_deref(), Some("[1, 2.5]"));
/// assert!(to_toml(&json!(null)).is_err());
/// ```
pub fn to_toml(value: &Value) -> Result<toml_edit::Value, Error> {
    let refuse = || Error::Usage(format!("{value} cannot be written as TOML"));
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
    let text = sastrugi_store::file::read_text(path).map_err(|e| Error::unreadable(path, &e))?;
    let name = path.display().to_string();
    let read = StudyText::parse(&text).and_then(|t| t.to_json());
    read.map_err(|error| Error::Study { name, text, refusals: error.into() })
}

/// Refuses unknown parameters of a kind.
///
/// # Errors
/// The first unknown parameter, with the nearest known one.
pub fn check(params: &Value, kind: &Kind) -> Result<(), Error> {
    check_schema(params, &kind.parameters, kind.kind)
}

/// Refuses keys that are not in a schema.
///
/// # Errors
/// The first unknown key, with the nearest known one.
pub fn check_schema(params: &Value, schema: &Value, of: &str) -> Result<(), Error> {
    let found = keys::find_unknown(params, schema);
    let Some(unknown) = found.first() else { return Ok(()) };
    let hint = match unknown.nearest() {
        Some(nearest) => format!("did you mean `{nearest}`?"),
        None => format!("known: {}", unknown.known.join(", ")),
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
        for (pair, words) in [
            ("x", "`--set x`: expected name=value"),
            ("=1", "expected name=value"),
            ("x=nan", "`--set x=nan`: the number is not finite"),
            ("x=2026-01-01", "dates must be written as text"),
            ("a.b=1", "`a.b`: its parent is not a table"),
            (&format!("{}x=1", "d.".repeat(100_000)), "a key is nested more than 100 tables deep"),
        ] {
            let error = assign(&mut params, &[pair.to_owned()]).unwrap_err();
            assert!(matches!(&error, Error::Usage(message) if message.contains(words)), "{pair}: {error}");
        }
    }

    /// Vehicles by name and by file: what belongs to the vehicle goes below `vehicle_changes`.
    #[test]
    fn val_vehicles() {
        let mut params = json!({ "speed_m_s": 1.0 });
        assign_vehicle(&mut params, "husky_a200").unwrap();
        assert_eq!(params, json!({ "speed_m_s": 1.0, "vehicle": "husky_a200" }));
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            let mut params = json!({});
            assign_vehicle(&mut params, &path.to_string_lossy()).map(|()| params).map_err(|e| e.to_string())
        };
        let based = file("a.toml", "base = \"ugv_4x4\"\n[parameters.drive]\nspeed_limit_m_s = 0.8\n").unwrap();
        assert_eq!(based, json!({ "vehicle": "ugv_4x4", "vehicle_changes": { "drive": { "speed_limit_m_s": 0.8 } } }));
        // `kinds --json` prints a list of one; a base without changes is that vehicle.
        let printed = file("b.JSON", "[{ \"kind\": \"ugv_4x4\", \"parameters\": {} }]").unwrap();
        assert_eq!(printed, json!({ "vehicle": "ugv_4x4" }));
        assert_eq!(file("base.toml", "base = \"ugv_4x4\"\n").unwrap(), json!({ "vehicle": "ugv_4x4" }));
        for (name, text, words) in [
            ("d.toml", "base = 5\n[parameters]\n", "`base` must be the name of a vehicle"),
            ("e.toml", "summary = \"mine\"\n", "missing table `parameters`; without `base`"),
            ("j.toml", "base = \"ugv_4x4\"\nparameters = 5\n", "`parameters` must be a table"),
            ("k.toml", "base = \"ugv\"\n", "k.toml: `base` is `ugv`; it must be one of `husky_a200`, "),
            ("l.json", "{ \"kind\": \"mine\", \"parameters\": {} }", "l.json: `kind` is `mine`; it must be one of "),
            ("f.toml", "mass_kg = 5\n", "unknown key `mass_kg`"),
            ("g.json", "[{}, {}]", "contains 2 vehicles"),
            // Without a base, all values are the file's own, and none may be missing.
            ("c.toml", "[parameters]\n", "`parameters` lacks `"),
            (
                "h.toml",
                "base = \"ugv_4x4\"\n[parameters.wheels]\nradius_m = -0.1\n",
                "`parameters.wheels.radius_m` is -0.1",
            ),
            (
                "i.toml",
                "base = \"ugv_4x4\"\n[parameters.wheels]\nradius = 0.1\n",
                "has the unknown key `radius`; known: ",
            ),
        ] {
            let error = file(name, text).unwrap_err();
            assert!(error.contains(words) && error.contains(name), "{name}: {error}");
        }
    }

    #[test]
    fn val_unknown_parameters_have_a_hint() {
        let kinds = sastrugi_terrain::kinds();
        let gap = kinds.iter().find(|kind| kind.kind == "gap").unwrap();
        assert!(check(&json!({ "size_px": [64, 64] }), gap).is_ok());
        let error = check(&json!({ "size_pxx": [64, 64] }), gap).unwrap_err().to_string();
        assert_eq!(error, "`gap` has no parameter `size_pxx`; did you mean `size_px`?");
    }
}
