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
            Err(Self::new(key, format!("is {value}; it must be a finite number above 0")))
        }
    }

    /// `Ok` when the value is finite and not negative.
    pub fn not_negative(key: &str, value: f64) -> Result<f64, Self> {
        if value.is_finite() && value >= 0.0 {
            Ok(value)
        } else {
            Err(Self::new(key, format!("is {value}; it must be a finite number, 0 or above")))
        }
    }

    /// `Ok` when the value lies strictly between the bounds.
    pub fn between(key: &str, value: f64, low: f64, high: f64) -> Result<f64, Self> {
        if value > low && value < high {
            Ok(value)
        } else {
            Err(Self::new(key, format!("is {value}; it must lie between {low} and {high}")))
        }
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
        let path = e.path().to_string();
        let key = if path == "." { String::new() } else { path };
        ParameterError::new(key, e.into_inner().to_string())
    })
}
