//! Registry of vehicles and surface presets; every parameter of a run with its source.

use crate::vehicle::{
    HUSKY_A200, MATERIALS, Material, ROCKER_BOGIE_ROVER, SurfaceParameters, TraverseSettings, UGV_4X4, Vehicle,
    VehicleParameters,
};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::{Kind, ParameterError};
use serde_json::{Map, Value};
use toml_edit::{DocumentMut, Item};

/// One vehicle: its name and its data file.
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

/// Every vehicle and every surface preset, with the JSON Schema of its parameters, their values and their sources.
///
/// ```
/// use sastrugi_mobility::registry::kinds;
///
/// let kinds = kinds();
/// let husky = kinds.iter().find(|kind| kind.kind == "husky_a200").unwrap();
/// assert_eq!(husky.values().unwrap()["wheels"]["radius_m"], 0.1651);
/// assert!(kinds.iter().any(|kind| kind.family == "surface" && kind.kind == "ice"));
/// ```
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

/// A vehicle defined by the study: `vehicle_changes` holds all of its parameters.
pub const CUSTOM: &str = "custom";

/// The vehicle `kind` with `changes`: the parameters that differ from its data file, nested as in that file. A table with
/// another `kind` (of suspension or drive) replaces the whole table. For [`CUSTOM`], `changes` holds all parameters.
///
/// # Errors
/// A [`ParameterError`] for an unknown vehicle, an unknown or missing parameter, or a value out of range.
///
/// ```
/// use sastrugi_mobility::registry::vehicle;
/// use serde_json::{Map, json};
///
/// let husky = vehicle("husky_a200", &Map::new()).unwrap();
/// assert!((husky.wheelbase_m() - 0.512).abs() < 1e-12);
///
/// let longer = json!({ "wheels": { "axles_m": [0.4, -0.4] } });
/// let longer = vehicle("husky_a200", longer.as_object().unwrap()).unwrap();
/// assert!((longer.wheelbase_m() - 0.8).abs() < 1e-12);
///
/// let flat = json!({ "wheels": { "radius_m": 0.0 } });
/// let error = vehicle("husky_a200", flat.as_object().unwrap()).unwrap_err();
/// assert_eq!(error.key, "vehicle_changes.wheels.radius_m");
/// ```
pub fn vehicle(kind: &str, changes: &Map<String, Value>) -> Result<Vehicle, ParameterError> {
    let mut parameters = match ENTRIES.iter().find(|e| e.kind == kind) {
        Some(entry) => entry.section("parameters"),
        None if kind == CUSTOM => Value::Object(Map::new()),
        None => return Err(unknown(kind)),
    };
    merge(&mut parameters, changes);
    let parameters: VehicleParameters = read_parameters(&parameters).map_err(|e| e.within("vehicle_changes"))?;
    Vehicle::new(kind, parameters).map_err(|e| e.within("vehicle_changes"))
}

/// Warnings about a vehicle that [`vehicle`] accepts, one sentence each: parameters that are inconsistent with each other.
pub fn doubts(kind: &str, changes: &Map<String, Value>) -> Vec<String> {
    let base = vehicle(kind, &Map::new()).ok();
    let base = base.as_ref().map(Vehicle::parameters);
    vehicle(kind, changes).map(|changed| crate::vehicle::doubts(changed.parameters(), base)).unwrap_or_default()
}

/// A warning about a commanded speed that a vehicle does not reach.
///
/// ```
/// use sastrugi_mobility::registry::{doubt_of_speed, vehicle};
/// use serde_json::Map;
///
/// let husky = vehicle("husky_a200", &Map::new()).unwrap();
/// assert!(doubt_of_speed(&husky, 1.0).is_none());
/// assert!(doubt_of_speed(&husky, 3.0).unwrap().starts_with("speed_m_s is 3 m/s, but the vehicle reaches at most 1 m/s"));
/// ```
pub fn doubt_of_speed(vehicle: &Vehicle, speed_m_s: f64) -> Option<String> {
    let limit_m_s = vehicle.speed_limit_m_s();
    (speed_m_s > limit_m_s).then(|| {
        format!(
            "speed_m_s is {speed_m_s} m/s, but the vehicle reaches at most {limit_m_s} m/s (drive.speed_limit_m_s), so the results are \
             those of {limit_m_s} m/s"
        )
    })
}

/// One parameter of a run: its path, its value as JSON and its source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Number {
    /// Dotted path; vehicle parameters start with `vehicle.`.
    pub parameter: String,
    /// Value as JSON.
    pub value: String,
    /// Source of a vehicle or surface parameter; absent where the study sets the value, and for settings of the run.
    pub source: Option<String>,
}

/// Every parameter of a run, defaults included: first the vehicle's, named as in its data file, then those of the run.
pub fn numbers(vehicle: &Vehicle, settings: &TraverseSettings) -> Vec<Number> {
    let entry = ENTRIES.iter().find(|e| e.kind == vehicle.name());
    let section = |name: &str| entry.map_or(Value::Null, |e| e.section(name));
    let (defaults, sources) = (section("parameters"), section("sources"));
    let of_vehicle = |(path, value): (String, Value)| {
        let pointer = path.replace('.', "/");
        let untouched = defaults.pointer(&pointer).is_some_and(|v| same(v, &value));
        let source = sources.pointer(&pointer).and_then(Value::as_str).filter(|_| untouched);
        Number { parameter: format!("vehicle{path}"), value: value.to_string(), source: source.map(str::to_owned) }
    };
    let preset = settings.parameters().surface.preset.source();
    let with_source = |number: Number| match number.parameter.as_str() {
        "surface.preset" => Number { source: Some(preset.to_owned()), ..number },
        _ => number,
    };
    let json = |value: Result<Value, _>| value.unwrap_or(Value::Null);
    let mut run = json(serde_json::to_value(settings.parameters()));
    if let Value::Object(run) = &mut run {
        // The vehicle's parameters are listed above, with the changes applied.
        run.retain(|key, _| key != "vehicle" && key != "vehicle_changes");
    }
    let of_vehicle = leaves(&json(serde_json::to_value(vehicle.parameters())), "").into_iter().map(of_vehicle);
    of_vehicle.chain(stated("", &run).into_iter().map(with_source)).collect()
}

/// Settings without a source: all non-null leaves of a JSON value, by dotted path below `prefix`.
pub fn stated(prefix: &str, value: &Value) -> Vec<Number> {
    let number = |(path, value): (String, Value)| Number {
        parameter: path.trim_start_matches('.').to_owned(),
        value: value.to_string(),
        source: None,
    };
    leaves(value, prefix).into_iter().map(number).collect()
}

/// Dotted paths and values of all non-null leaves.
fn leaves(value: &Value, path: &str) -> Vec<(String, Value)> {
    match value {
        Value::Object(map) => map.iter().flat_map(|(k, v)| leaves(v, &format!("{path}.{k}"))).collect(),
        Value::Null => Vec::new(),
        _ => vec![(path.to_owned(), value.clone())],
    }
}

/// Equality by numerical value: 1 equals 1.0.
fn same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b)),
        _ => a == b || a.as_f64().is_some_and(|a| Some(a) == b.as_f64()),
    }
}

fn unknown(kind: &str) -> ParameterError {
    let known: Vec<String> = ENTRIES.iter().map(|e| format!("`{}`", e.kind)).collect();
    let known = known.join(", ");
    let message = format!("is `{kind}`; it must be one of {known}, or `custom` with all of its parameters");
    ParameterError::new("vehicle", message)
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

    /// A table of the data file; null if it is missing (a test reads every file).
    fn section(&self, name: &str) -> Value {
        let file = self.data.parse::<DocumentMut>().unwrap_or_default();
        file.get(name).map_or(Value::Null, from_toml)
    }
}

/// A TOML item as JSON. Data files hold numbers, strings, arrays and tables.
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

/// True when both have a `kind` and the two differ.
fn kinds_differ(base: &Value, change: &Map<String, Value>) -> bool {
    base.get("kind").zip(change.get("kind")).is_some_and(|(old, new)| old != new)
}

/// Merges `changes` into `base`, table by table.
fn merge(base: &mut Value, changes: &Map<String, Value>) {
    let Value::Object(base) = base else { return };
    for (key, change) in changes {
        match (base.get_mut(key), change) {
            (Some(below @ Value::Object(_)), Value::Object(change)) if !kinds_differ(below, change) => {
                merge(below, change);
            }
            _ => {
                base.insert(key.clone(), change.clone());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::TraverseParameters;

    #[test]
    fn val_every_vehicle_can_drive_and_every_number_has_a_source() {
        for entry in &ENTRIES {
            let (parameters, sources) = (entry.section("parameters"), entry.section("sources"));
            let paths = |v: &Value| leaves(v, "").into_iter().map(|(path, _)| path).collect::<Vec<_>>();
            assert_eq!(paths(&parameters), paths(&sources), "{}", entry.kind);
            let vehicle = vehicle(entry.kind, &Map::new()).unwrap();
            assert_eq!(serde_json::to_value(vehicle.parameters()).unwrap(), parameters);
        }
    }

    /// Every parameter of a run has its source, unless the study changed it.
    #[test]
    fn val_numbers_of_a_run() {
        let mut parameters = TraverseParameters::default();
        parameters.vehicle_changes.insert("drive".to_owned(), serde_json::json!({"torque_limit_n_m": 30}));
        let (vehicle, settings) = parameters.prepare().unwrap();
        let all = numbers(&vehicle, &settings);
        let of = |name: &str| all.iter().find(|n| n.parameter == name).map(|n| (n.value.as_str(), n.source.is_some()));
        assert_eq!(of("vehicle.wheels.radius_m"), Some(("0.1651", true)));
        assert_eq!(of("vehicle.drive.torque_limit_n_m"), Some(("30.0", false)));
        assert_eq!(of("controller.lookahead_m"), Some(("1.536", false)));
        assert_eq!(of("surface.wheel_friction"), Some(("1.0", false)));
        assert_eq!(of("surface.preset"), Some(("\"study\"", true)));
        assert_eq!(of("vehicle_changes.drive.torque_limit_n_m"), None);
    }

    /// A custom vehicle equals the shipped one with the same parameters; a drive of another kind replaces the table.
    #[test]
    fn val_custom_vehicles() {
        let Value::Object(all) = ENTRIES[1].section("parameters") else { panic!() };
        let own = vehicle(CUSTOM, &all).unwrap();
        assert_eq!((own.name(), own.parameters()), ("custom", vehicle("ugv_4x4", &Map::new()).unwrap().parameters()));
        assert!(vehicle(CUSTOM, &Map::new()).unwrap_err().message.contains("missing field"));
        let drive = [("drive".to_owned(), all["drive"].clone())].into_iter().collect();
        let mixed = vehicle("husky_a200", &drive).unwrap();
        let shipped = vehicle("husky_a200", &Map::new()).unwrap();
        assert_eq!(mixed.parameters().drive, own.parameters().drive);
        assert_eq!(mixed.parameters().wheels, shipped.parameters().wheels);
    }

    #[test]
    fn val_kinds_show_values_and_sources() {
        let kinds = kinds();
        let husky = kinds.iter().find(|k| k.kind == "husky_a200").unwrap();
        assert_eq!(husky.values().unwrap()["wheels"]["radius_m"], 0.1651);
        assert!(husky.sources().unwrap()["wheels"]["radius_m"].is_string());
        assert!(vehicle("husky", &Map::new()).unwrap_err().message.contains("`husky_a200`"));
    }
}
