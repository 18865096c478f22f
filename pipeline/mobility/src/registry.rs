//! The list of vehicles.

use crate::vehicle::{
    HUSKY_A200, MATERIALS, Material, ROCKER_BOGIE_ROVER, SurfaceParameters, UGV_4X4, Vehicle, VehicleParameters,
};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::{Kind, ParameterError};
use serde_json::{Map, Value};
use toml_edit::{DocumentMut, Item};

/// One vehicle: its name, and its data file.
struct Entry {
    kind: &'static str,
    summary: &'static str,
    source: &'static str,
    data: &'static str,
}

const ENTRIES: [Entry; 3] = [
    Entry {
        kind: "husky_a200",
        summary: "Clearpath Husky A200: four driven wheels without suspension, steered by skidding",
        source: "public husky_description URDF and husky_control control.yaml (Clearpath Robotics); Majhor and Bos, section 2",
        data: HUSKY_A200,
    },
    Entry {
        kind: "ugv_4x4",
        summary: "generic car-sized 4x4: wheel motors, independent suspension, front wheels steered",
        source: "round numbers of the class, each marked as assumed or computed",
        data: UGV_4X4,
    },
    Entry {
        kind: "rocker_bogie_rover",
        summary: "generic six-wheel rover: rocker-bogie suspension, wheel motors, corner wheels steered",
        source: "Lindemann and Voorhees (2005) for wheels and wheelbase; the rest assumed or computed, as marked",
        data: ROCKER_BOGIE_ROVER,
    },
];

/// Every vehicle and every surface preset, with the JSON Schema of its parameters, their values and sources.
pub fn kinds() -> Vec<Kind> {
    ENTRIES.iter().map(Entry::describe).chain(MATERIALS.iter().map(surface)).collect()
}

fn surface(material: &Material) -> Kind {
    let mut parameters = schema_of::<SurfaceParameters>();
    if let (Value::Object(schema), Ok(friction)) = (&mut parameters, serde_json::to_value(material.friction)) {
        schema.insert("default".to_owned(), friction);
    }
    Kind { family: "surface", kind: material.name, summary: material.summary, source: material.source, parameters }
}

/// The vehicle `kind` with `changes`: those of its parameters that differ from the data file, nested as there.
///
/// # Errors
/// A [`ParameterError`] for an unknown vehicle, an unknown parameter, or a value out of range.
pub fn vehicle(kind: &str, changes: &Map<String, Value>) -> Result<Vehicle, ParameterError> {
    let entry = ENTRIES.iter().find(|e| e.kind == kind).ok_or_else(|| unknown(kind))?;
    let mut parameters = entry.section("parameters");
    merge(&mut parameters, changes);
    let parameters: VehicleParameters = read_parameters(&parameters).map_err(|e| e.within("vehicle_changes"))?;
    Vehicle::new(kind, parameters).map_err(|e| e.within("vehicle_changes"))
}

fn unknown(kind: &str) -> ParameterError {
    let known: Vec<String> = ENTRIES.iter().map(|e| format!("`{}`", e.kind)).collect();
    ParameterError::new("vehicle", format!("`{kind}` is no vehicle; the known ones are {}", known.join(", ")))
}

impl Entry {
    fn describe(&self) -> Kind {
        let mut parameters = schema_of::<VehicleParameters>();
        if let Value::Object(schema) = &mut parameters {
            schema.insert("default".to_owned(), self.section("parameters"));
            schema.insert("x-sources".to_owned(), self.section("sources"));
        }
        Kind { family: "vehicle", kind: self.kind, summary: self.summary, source: self.source, parameters }
    }

    /// A table of the data file; null when the file has none (a test reads every file).
    fn section(&self, name: &str) -> Value {
        let file = self.data.parse::<DocumentMut>().unwrap_or_default();
        file.get(name).map_or(Value::Null, from_toml)
    }
}

/// A TOML item as JSON. Data files hold numbers, words, arrays and tables.
fn from_toml(item: &Item) -> Value {
    match item {
        Item::Table(table) => Value::Object(table.iter().map(|(k, v)| (k.to_owned(), from_toml(v))).collect()),
        Item::Value(toml_edit::Value::Array(array)) => {
            Value::Array(array.iter().map(|v| from_toml(&Item::Value(v.clone()))).collect())
        }
        Item::Value(toml_edit::Value::Float(number)) => Value::from(*number.value()),
        Item::Value(toml_edit::Value::Integer(number)) => Value::from(*number.value()),
        Item::Value(toml_edit::Value::Boolean(yes)) => Value::from(*yes.value()),
        Item::Value(toml_edit::Value::String(word)) => Value::from(word.value().as_str()),
        _ => Value::Null,
    }
}

/// Lays `changes` over `base`, table by table.
fn merge(base: &mut Value, changes: &Map<String, Value>) {
    let Value::Object(base) = base else { return };
    for (key, change) in changes {
        match (base.get_mut(key), change) {
            (Some(below @ Value::Object(_)), Value::Object(change)) => merge(below, change),
            _ => {
                base.insert(key.clone(), change.clone());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dotted paths of all leaves.
    fn leaves(value: &Value, path: &str) -> Vec<String> {
        match value {
            Value::Object(map) => map.iter().flat_map(|(k, v)| leaves(v, &format!("{path}.{k}"))).collect(),
            _ => vec![path.to_owned()],
        }
    }

    #[test]
    fn val_every_vehicle_can_drive_and_every_number_has_a_source() {
        for entry in &ENTRIES {
            let (parameters, sources) = (entry.section("parameters"), entry.section("sources"));
            assert_eq!(leaves(&parameters, ""), leaves(&sources, ""), "{}", entry.kind);
            let vehicle = vehicle(entry.kind, &Map::new()).unwrap();
            assert_eq!(serde_json::to_value(vehicle.parameters()).unwrap(), parameters);
        }
    }

    #[test]
    fn val_kinds_show_values_and_sources() {
        let kinds = kinds();
        let husky = kinds.iter().find(|k| k.kind == "husky_a200").unwrap();
        assert_eq!(husky.parameters["default"]["wheels"]["radius_m"], 0.1651);
        assert!(husky.parameters["x-sources"]["wheels"]["radius_m"].is_string());
        assert!(vehicle("husky", &Map::new()).unwrap_err().message.contains("`husky_a200`"));
    }
}
