//! Unknown keys: found against the JSON Schema of a parameter type, before anything reads the values.

use sastrugi_schemas::ParameterError;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// A key that no parameter has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownKey {
    /// Path of the key, from the checked value down.
    pub path: Vec<String>,
    /// Keys that would be right there, in the schema's order.
    pub known: Vec<String>,
}

impl UnknownKey {
    /// The unknown key itself.
    pub fn key(&self) -> &str {
        self.path.last().map_or("", String::as_str)
    }

    /// The known key that is nearest in spelling, if one is near.
    pub fn nearest(&self) -> Option<&str> {
        nearest(self.key(), self.known.iter().map(String::as_str))
    }
}

/// The candidate nearest to `word` in spelling, if it is near at all (Jaro and Winkler's similarity above 0.75).
pub fn nearest<'a>(word: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    candidates
        .map(|c| (strsim::jaro_winkler(word, c), c))
        .filter(|(similarity, _)| *similarity > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, c)| c)
}

/// Names of the properties that a schema describes.
pub fn properties(schema: &Value) -> Vec<String> {
    objects(schema, schema).iter().flat_map(|o| o.keys().cloned()).collect()
}

/// Schema of the parameters of two kernels that stand side by side in one table.
pub fn schema_of_both<A: JsonSchema, B: JsonSchema>() -> Value {
    let (mut schema, second) = (schema_of::<A>(), schema_of::<B>());
    for part in ["properties", "$defs"] {
        let Some(more) = second[part].as_object().cloned() else { continue };
        match schema[part].as_object_mut() {
            Some(all) => all.extend(more),
            None => schema[part] = Value::Object(more),
        }
    }
    schema
}

/// Reads the parameters of two kernels that stand side by side in one table.
///
/// # Errors
/// The first wrong value.
pub fn read_both<A, B>(params: &Value) -> Result<(A, B), ParameterError>
where
    A: DeserializeOwned,
    B: DeserializeOwned + JsonSchema,
{
    let names = properties(&schema_of::<B>());
    let (second, first): (Map<_, _>, Map<_, _>) =
        params.as_object().cloned().unwrap_or_default().into_iter().partition(|(key, _)| names.contains(key));
    Ok((read_parameters(&Value::Object(first))?, read_parameters(&Value::Object(second))?))
}

/// The first unknown key of `value`, depth first.
pub fn find_unknown(value: &Value, schema: &Value) -> Option<UnknownKey> {
    search(value, schema, schema, &mut Vec::new())
}

fn search(value: &Value, schema: &Value, root: &Value, path: &mut Vec<String>) -> Option<UnknownKey> {
    match value {
        Value::Object(map) => search_object(map, schema, root, path),
        Value::Array(list) => {
            let item = alternatives(schema, root).into_iter().find_map(|s| s.get("items"))?;
            list.iter().enumerate().find_map(|(i, v)| below(path, i.to_string(), |path| search(v, item, root, path)))
        }
        _ => None,
    }
}

fn search_object(map: &Map<String, Value>, schema: &Value, root: &Value, path: &mut Vec<String>) -> Option<UnknownKey> {
    let objects = objects(schema, root);
    if objects.is_empty() {
        return None;
    }
    map.iter().find_map(|(key, value)| {
        below(path, key.clone(), |path| match objects.iter().find_map(|o| o.get(key)) {
            Some(inner) => search(value, inner, root, path),
            None => {
                Some(UnknownKey { path: path.clone(), known: objects.iter().flat_map(|o| o.keys().cloned()).collect() })
            }
        })
    })
}

fn below<T>(path: &mut Vec<String>, segment: String, f: impl FnOnce(&mut Vec<String>) -> T) -> T {
    path.push(segment);
    let result = f(path);
    path.pop();
    result
}

/// The `properties` of a schema and of everything it refers to or chooses from.
fn objects<'a>(schema: &'a Value, root: &'a Value) -> Vec<&'a Map<String, Value>> {
    alternatives(schema, root).into_iter().filter_map(|s| s.get("properties")?.as_object()).collect()
}

/// The schema itself, with references followed and choices opened.
fn alternatives<'a>(schema: &'a Value, root: &'a Value) -> Vec<&'a Value> {
    if let Some(target) = schema.get("$ref").and_then(Value::as_str).and_then(|r| r.strip_prefix('#')) {
        return root.pointer(target).map_or_else(Vec::new, |s| alternatives(s, root));
    }
    let choices = ["anyOf", "oneOf", "allOf"].iter().filter_map(|k| schema.get(k)?.as_array()).flatten();
    let mut all: Vec<&Value> = choices.flat_map(|s| alternatives(s, root)).collect();
    all.push(schema);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemars::JsonSchema;
    use serde_json::json;

    #[derive(JsonSchema)]
    #[expect(dead_code, reason = "only its schema is used")]
    struct Layer {
        sigma_px: f64,
    }
    #[derive(JsonSchema)]
    #[expect(dead_code, reason = "only its schema is used")]
    struct Outer {
        low: Layer,
        optional: Option<Layer>,
        list: Vec<Layer>,
        cell_m: f64,
    }

    #[test]
    fn val_unknown_keys_at_every_depth() {
        let schema = sastrugi_schemas::kind::schema_of::<Outer>();
        let unknown = |v: Value| find_unknown(&v, &schema).map(|u| (u.path.join("."), u.nearest().map(str::to_owned)));
        assert_eq!(unknown(json!({"low": {"sigma_px": 1}, "cell_m": 2})), None);
        assert_eq!(unknown(json!({"cel_m": 2})), Some(("cel_m".into(), Some("cell_m".into()))));
        assert_eq!(unknown(json!({"low": {"sigma": 1}})), Some(("low.sigma".into(), Some("sigma_px".into()))));
        assert_eq!(unknown(json!({"optional": {"sigma": 1}})).unwrap().0, "optional.sigma");
        assert_eq!(unknown(json!({"list": [{"sigma_px": 1}, {"x": 1}]})), Some(("list.1.x".into(), None)));
    }
}
