//! Limits of parameters in their JSON Schema, for `#[schemars(transform = ...)]` at a field: the counterparts of the checks of
//! [`ParameterError`](crate::ParameterError) and of ranges, so that an editor refuses what a run refuses.
//!
//! The limit of a list applies to each of its numbers. A limit that depends on another parameter has no counterpart; for whole numbers,
//! use schemars' own `range`.
//!
//! ```
//! use sastrugi_schemas::kind::schema_of;
//! use sastrugi_schemas::limits;
//! use schemars::JsonSchema;
//!
//! #[derive(JsonSchema)]
//! struct Crater {
//!     #[schemars(transform = limits::positive)]
//!     radii_m: [f64; 2],
//!     #[schemars(transform = limits::between(0.0, 1.0))]
//!     depth_ratio: Option<f64>,
//! }
//!
//! let schema = schema_of::<Crater>();
//! assert_eq!(schema["properties"]["radii_m"]["items"]["exclusiveMinimum"], 0.0);
//! assert_eq!(schema["properties"]["depth_ratio"]["exclusiveMaximum"], 1.0);
//! ```

use schemars::Schema;
use serde_json::{Map, Value};

/// A keyword of JSON Schema with its number.
type Limit = (&'static str, f64);

/// Above 0, as checked by [`ParameterError::positive`](crate::ParameterError::positive).
pub fn positive(schema: &mut Schema) {
    limit(schema, &[("exclusiveMinimum", 0.0)]);
}

/// 0 or above, as checked by [`ParameterError::not_negative`](crate::ParameterError::not_negative).
pub fn not_negative(schema: &mut Schema) {
    limit(schema, &[("minimum", 0.0)]);
}

/// Above `low` and below `high`, as checked by [`ParameterError::between`](crate::ParameterError::between).
pub fn between(low: f64, high: f64) -> impl FnMut(&mut Schema) {
    move |schema: &mut Schema| limit(schema, &[("exclusiveMinimum", low), ("exclusiveMaximum", high)])
}

/// From `least` to `most`, as `least..=most`.
pub fn within(least: f64, most: f64) -> impl FnMut(&mut Schema) {
    move |schema: &mut Schema| limit(schema, &[("minimum", least), ("maximum", most)])
}

/// At least `least` and below `high`, as `least..high`.
pub fn half_open(least: f64, high: f64) -> impl FnMut(&mut Schema) {
    move |schema: &mut Schema| limit(schema, &[("minimum", least), ("exclusiveMaximum", high)])
}

/// Above `low`, up to `most`.
pub fn above(low: f64, most: f64) -> impl FnMut(&mut Schema) {
    move |schema: &mut Schema| limit(schema, &[("exclusiveMinimum", low), ("maximum", most)])
}

fn limit(schema: &mut Schema, limits: &[Limit]) {
    if let Some(schema) = schema.as_object_mut() {
        limit_numbers(schema, limits);
    }
}

/// Limits the number that a schema describes, or those of the lists and alternatives below it. Infinity is no limit.
fn limit_numbers(schema: &mut Map<String, Value>, limits: &[Limit]) {
    if is_number(schema.get("type")) {
        for (keyword, bound) in limits.iter().filter(|(_, bound)| bound.is_finite()) {
            schema.insert((*keyword).to_owned(), (*bound).into());
        }
        return;
    }
    if let Some(items) = schema.get_mut("items").and_then(Value::as_object_mut) {
        limit_numbers(items, limits);
    }
    let choices = schema.get_mut("anyOf").and_then(Value::as_array_mut).into_iter().flatten();
    choices.filter_map(Value::as_object_mut).for_each(|choice| limit_numbers(choice, limits));
}

/// Whether a `type` is that of a number, also if the number may be absent.
fn is_number(kind: Option<&Value>) -> bool {
    let is = |kind: &Value| kind == "number" || kind == "integer";
    match kind {
        Some(Value::Array(kinds)) => kinds.iter().any(is),
        Some(kind) => is(kind),
        None => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kind::schema_of;
    use crate::limits;
    use schemars::JsonSchema;

    #[derive(JsonSchema)]
    #[serde(untagged)]
    #[schemars(transform = limits::positive)]
    #[expect(dead_code, reason = "only its schema is used")]
    enum Side {
        Square(f64),
        Oblong([f64; 2]),
    }

    #[derive(JsonSchema)]
    #[expect(dead_code, reason = "only its schema is used")]
    struct Limited {
        #[schemars(transform = limits::not_negative)]
        height_m: Option<f64>,
        #[schemars(transform = limits::above(0.0, 1.0))]
        shares: Option<[f64; 3]>,
        #[schemars(transform = limits::between(1.0, f64::INFINITY))]
        ratio: f64,
        #[schemars(transform = limits::half_open(0.0, 90.0))]
        angle_deg: f64,
        #[schemars(transform = limits::within(-1.0, 2.0))]
        factor: f64,
        #[schemars(transform = limits::positive)]
        name: String,
    }

    /// Numbers, numbers that may be absent, lists of them, and alternatives have their limits; JSON has no infinity, and text no limit.
    #[test]
    fn val_limits_of_numbers_and_lists() {
        let schema = schema_of::<Limited>();
        let limits_at = |schema: &Value, path: &str| {
            let of = schema.pointer(path).unwrap();
            let keywords = ["minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum"];
            keywords.map(|keyword| of.get(keyword).and_then(Value::as_f64))
        };
        let of = |key: &str| limits_at(&schema, &format!("/properties/{key}"));
        assert_eq!(of("height_m"), [Some(0.0), None, None, None]);
        assert_eq!((of("shares"), of("shares/items")), ([None; 4], [None, Some(0.0), Some(1.0), None]));
        assert_eq!(of("ratio"), [None, Some(1.0), None, None]);
        assert_eq!(of("angle_deg"), [Some(0.0), None, None, Some(90.0)]);
        assert_eq!(of("factor"), [Some(-1.0), None, Some(2.0), None]);
        assert_eq!(of("name"), [None; 4]);
        let side = schema_of::<Side>();
        for path in ["/anyOf/0", "/anyOf/1/items"] {
            assert_eq!(limits_at(&side, path), [None, Some(0.0), None, None]);
        }
    }
}
