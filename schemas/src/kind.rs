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

    #[test]
    fn val_numbers_in_messages_are_short() {
        let text = [0.0, -3.25, 1e300, -2.5e-12, f64::INFINITY].map(shown);
        assert_eq!(text, ["0", "-3.25", "1e300", "-2.5e-12", "inf"]);
    }
}
