//! Kinds (generators, models, vehicles, methods): how a registry describes an entry, and how an entry refuses its
//! parameters.

use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// One entry of a registry.
#[derive(Clone, Debug, Serialize)]
pub struct Kind {
    /// The room's word for what it is: `terrain`, `texture`, `vehicle`, `fit` ...
    pub family: &'static str,
    /// Name in `kind = "..."`.
    pub kind: &'static str,
    /// One sentence.
    pub summary: &'static str,
    /// Author, year, equation or table.
    pub source: &'static str,
    /// JSON Schema of the parameters: names, types, defaults, and descriptions with units.
    pub parameters: Value,
}

impl Kind {
    /// Values of the parameters as a whole, nested as they are: of a vehicle or a surface.
    pub fn values(&self) -> Option<&Value> {
        self.parameters.get("default")
    }

    /// Source of each of these values, nested as they are.
    pub fn sources(&self) -> Option<&Value> {
        self.parameters.get("x-sources")
    }
}

/// A parameter that was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{message}", if key.is_empty() { String::new() } else { format!("`{key}` ") })]
pub struct ParameterError {
    /// Dotted path of the parameter below its item (`layers.2.fractal_dimension`); empty for the item as a whole.
    pub key: String,
    /// What is wrong, with the value, and what would be right.
    pub message: String,
}

impl ParameterError {
    /// An error at `key`.
    pub fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into() }
    }

    /// The last word of the key.
    fn name(&self) -> &str {
        self.key.rsplit('.').next().unwrap_or_default()
    }

    /// True when it says that a required key is not there.
    pub fn is_missing(&self, key: &str) -> bool {
        self.message == format!("missing field `{key}`")
    }

    /// The same error seen from one level up.
    pub fn within(self, parent: &str) -> Self {
        let key = if self.key.is_empty() { parent.to_owned() } else { format!("{parent}.{}", self.key) };
        Self { key, ..self }
    }

    /// `Ok` when the value is finite and above zero.
    pub fn positive(key: &str, value: f64) -> Result<f64, Self> {
        if value.is_finite() && value > 0.0 {
            Ok(value)
        } else {
            Err(Self::new(key, format!("is {}; it must be a finite number above 0", shown(value))))
        }
    }

    /// `Ok` when the value is finite and not negative.
    pub fn not_negative(key: &str, value: f64) -> Result<f64, Self> {
        if value.is_finite() && value >= 0.0 {
            Ok(value)
        } else {
            Err(Self::new(key, format!("is {}; it must be a finite number, 0 or above", shown(value))))
        }
    }

    /// `Ok` when the value lies between the bounds, which are excluded.
    pub fn between(key: &str, value: f64, low: f64, high: f64) -> Result<f64, Self> {
        if value > low && value < high {
            Ok(value)
        } else {
            Err(Self::new(key, format!("is {}; it must lie above {low} and below {high}", shown(value))))
        }
    }
}

/// A number for a message: as a person writes it, with an exponent where it would be hundreds of digits.
pub fn shown(value: f64) -> String {
    let size = value.abs();
    if size.is_finite() && size != 0.0 && !(1e-9..1e15).contains(&size) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// JSON Schema of a parameter type.
pub fn schema_of<T: JsonSchema>() -> Value {
    schemars::schema_for!(T).to_value()
}

/// Reads raw parameters from JSON (the form every study item and `--set` is brought to).
///
/// # Errors
/// A [`ParameterError`] that names the key that does not fit.
pub fn read_parameters<T: DeserializeOwned>(value: &Value) -> Result<T, ParameterError> {
    serde_path_to_error::deserialize(value).map_err(|e| {
        let key = dotted(e.path());
        ParameterError::new(key, e.into_inner().to_string())
    })
}

/// Reads parameters as [`read_parameters`] does, with every value of the wrong type refused and not the first alone.
///
/// # Errors
/// The keys that do not fit, at least one.
pub fn read_all<T: DeserializeOwned>(mut value: Value) -> Result<T, Vec<ParameterError>> {
    let mut refused = Vec::new();
    loop {
        match read_parameters(&value) {
            Ok(read) if refused.is_empty() => return Ok(read),
            Ok(_) => return Err(refused),
            Err(error) => {
                // Other elements of a list would move to other positions: the list goes as a whole.
                let words = error.key.split('.').filter(|word| !word.is_empty());
                let path: Vec<String> =
                    words.take_while(|word| word.parse::<usize>().is_err()).map(str::to_owned).collect();
                // A required key that was taken out for its type is not missing.
                let known = refused.iter().any(|e: &ParameterError| error.is_missing(e.name()));
                if !known {
                    refused.push(error);
                }
                if known || !remove(&mut value, &path) {
                    return Err(refused);
                }
            }
        }
    }
}

/// Takes out what lies at a path of names; false when nothing lies there.
pub fn remove(value: &mut Value, path: &[String]) -> bool {
    let Some((last, parents)) = path.split_last() else { return false };
    let parent = parents.iter().try_fold(value, |at, word| below(at, word));
    parent.and_then(Value::as_object_mut).is_some_and(|map| map.remove(last).is_some())
}

/// What a table has under a key, or a list at a position.
fn below<'a>(value: &'a mut Value, word: &str) -> Option<&'a mut Value> {
    match value {
        Value::Object(map) => map.get_mut(word),
        Value::Array(list) => list.get_mut(word.parse::<usize>().ok()?),
        _ => None,
    }
}

/// The path with a dot before every name and index, as the keys of a study are written.
fn dotted(path: &serde_path_to_error::Path) -> String {
    use serde_path_to_error::Segment;
    let step = |segment: &Segment| match segment {
        Segment::Seq { index } => Some(index.to_string()),
        Segment::Map { key } => Some(key.clone()),
        Segment::Enum { variant } => Some(variant.clone()),
        Segment::Unknown => None,
    };
    path.iter().filter_map(step).collect::<Vec<_>>().join(".")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;
    use serde_json::json;

    #[derive(Debug, Deserialize)]
    struct Layers {
        #[serde(rename = "layers")]
        _layers: Vec<[f64; 2]>,
    }

    #[test]
    fn val_keys_have_dots_before_names_and_numbers() {
        let key = |value: Value| read_parameters::<Layers>(&value).unwrap_err().key;
        assert_eq!(key(json!({"layers": [[1.0, 2.0], [1.0, "x"]]})), "layers.1.1");
        assert_eq!(key(json!({"layers": 5})), "layers");
        assert_eq!(key(json!({})), "");
    }

    #[derive(Debug, Deserialize)]
    struct Item {
        #[serde(rename = "id")]
        _id: String,
        #[serde(default, rename = "count")]
        _count: u32,
        #[serde(default, rename = "window")]
        _window: Vec<f64>,
    }

    #[test]
    fn val_all_wrong_values_are_told() {
        let keys = |value: Value| -> Vec<String> {
            let mut keys: Vec<String> =
                read_all::<Item>(value).err().unwrap_or_default().into_iter().map(|e| e.key).collect();
            // JSON objects keep their order or sort their keys, by a feature of serde_json that other crates choose.
            keys.sort();
            keys
        };
        assert_eq!(keys(json!({"id": "a", "count": 3, "window": [1.0]})), Vec::<String>::new());
        assert_eq!(keys(json!({"id": "a", "count": -1, "window": ["x", 2.0, "y"]})), ["count", "window.0"]);
        assert_eq!(keys(json!({"id": 5, "count": "x"})), ["count", "id"]);
        assert_eq!(keys(json!({"count": 1})), [""]);
        assert_eq!(keys(json!([])), [""]);
    }

    #[test]
    fn val_numbers_in_messages_are_short() {
        let text = [0.0, -3.25, 1e300, -2.5e-12, f64::INFINITY].map(shown);
        assert_eq!(text, ["0", "-3.25", "1e300", "-2.5e-12", "inf"]);
    }
}
