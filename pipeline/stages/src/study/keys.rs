//! Detection of unknown keys with the JSON Schema of a parameter type, before values are read.

use sastrugi_schemas::ParameterError;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// An unknown key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownKey {
    /// Path of the key within the checked value.
    pub path: Vec<String>,
    /// Known keys at that place, in the schema's order.
    pub known: Vec<String>,
}

impl UnknownKey {
    /// The unknown key itself.
    pub fn key(&self) -> &str {
        self.path.last().map_or("", String::as_str)
    }

    /// The known key that was probably meant: a synonym, or the nearest in spelling.
    pub fn nearest(&self) -> Option<&str> {
        let known = || self.known.iter().map(String::as_str);
        let synonym = SYNONYMS.iter().find(|(words, key)| words.contains(&self.key()) && known().any(|k| k == *key));
        synonym.map(|(_, key)| *key).or_else(|| nearest(self.key(), known()))
    }
}

/// Synonyms that users may try, and the key they mean.
const SYNONYMS: [(&[&str], &str); 24] = [
    (&["author", "authors", "people"], "creators"),
    (&["institution", "institutions", "affiliation"], "organizations"),
    (&["tags", "subjects"], "keywords"),
    (&["grant", "grants", "funder", "funders"], "funding"),
    (&["path", "filename", "dem_file", "input", "source"], "file"),
    (&["n", "number", "replicates", "repetitions", "copies"], "count"),
    (&["n", "number", "replicates", "count"], "pairs"),
    (&["n", "number", "replicates", "count"], "rovers"),
    (&["resolution", "pixel_size", "spacing", "gsd", "dx", "cellsize"], "cell_m"),
    (&["size", "extent", "width", "height"], "size_m"),
    (&["shape", "pixels"], "size_px"),
    (&["type", "generator", "algorithm"], "kind"),
    (&["generator", "algorithm", "kind"], "method"),
    (&["label", "category"], "group"),
    (&["name", "key"], "id"),
    (&["roi", "bbox", "bounds", "crop"], "window"),
    (&["random_seed", "rng"], "seed"),
    (&["robot", "platform"], "vehicle"),
    (&["outer_scale", "detrend", "detrending", "window_m"], "outer_scale_m"),
    (&["summary", "abstract"], "description"),
    (&["terrain", "surface", "surfaces"], "terrains"),
    (&["base", "terrain", "surface"], "onto"),
    (&["surface", "raster", "site"], "dem"),
    (&["surface", "terrain", "dem", "operand"], "of"),
];

/// The candidate nearest to `word` in spelling, if it is close enough (Jaro-Winkler similarity above 0.75).
///
/// ```
/// use sastrugi_stages::study::keys::nearest;
///
/// let kinds = ["multifractal", "spheroids", "gap"];
/// assert_eq!(nearest("multifactal", kinds.into_iter()), Some("multifractal"));
/// assert_eq!(nearest("xyz", kinds.into_iter()), None);
/// ```
pub fn nearest<'a>(word: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    candidates
        .map(|c| (strsim::jaro_winkler(word, c), c))
        .filter(|(similarity, _)| *similarity > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, c)| c)
}

/// Names of the properties in a schema.
pub fn properties(schema: &Value) -> Vec<String> {
    objects(schema, schema).iter().flat_map(|o| o.keys().cloned()).collect()
}

/// Combined schema of the parameters of two kernels in one table.
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

/// Reads the parameters of two kernels from one table.
///
/// # Errors
/// The first invalid value.
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

/// The unknown keys of `value`, depth first.
///
/// ```
/// use sastrugi_schemas::{kind::schema_of, study::RoughnessSection};
/// use sastrugi_stages::study::keys::find_unknown;
/// use serde_json::json;
///
/// let schema = schema_of::<RoughnessSection>();
/// let unknown = find_unknown(&json!({ "low_max": 0.3, "semi_maxx": 0.8 }), &schema);
/// assert_eq!((unknown.len(), unknown[0].key(), unknown[0].nearest()), (1, "semi_maxx", Some("semi_max")));
/// ```
pub fn find_unknown(value: &Value, schema: &Value) -> Vec<UnknownKey> {
    let mut found = Vec::new();
    search(value, schema, schema, &mut Vec::new(), &mut found);
    found
}

fn search(value: &Value, schema: &Value, root: &Value, path: &mut Vec<String>, found: &mut Vec<UnknownKey>) {
    match value {
        Value::Object(map) => search_object(map, schema, root, path, found),
        Value::Array(list) => {
            let Some(item) = alternatives(schema, root).into_iter().find_map(|s| s.get("items")) else { return };
            for (i, v) in list.iter().enumerate() {
                below(path, i.to_string(), |path| search(v, item, root, path, found));
            }
        }
        _ => {}
    }
}

fn search_object(
    map: &Map<String, Value>,
    schema: &Value,
    root: &Value,
    path: &mut Vec<String>,
    found: &mut Vec<UnknownKey>,
) {
    let objects = objects(schema, root);
    if objects.is_empty() {
        return;
    }
    for (key, value) in map {
        below(path, key.clone(), |path| match objects.iter().find_map(|o| o.get(key)) {
            Some(inner) => search(value, inner, root, path, found),
            None => {
                let known = objects.iter().flat_map(|o| o.keys().cloned()).collect();
                found.push(UnknownKey { path: path.clone(), known });
            }
        });
    }
}

fn below(path: &mut Vec<String>, segment: String, f: impl FnOnce(&mut Vec<String>)) {
    path.push(segment);
    f(path);
    path.pop();
}

/// The `properties` of a schema and of all its references and alternatives.
fn objects<'a>(schema: &'a Value, root: &'a Value) -> Vec<&'a Map<String, Value>> {
    alternatives(schema, root).into_iter().filter_map(|s| s.get("properties")?.as_object()).collect()
}

/// The schema with references resolved and alternatives expanded.
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
        let unknown = |v: Value| -> Vec<(String, Option<String>)> {
            let found = find_unknown(&v, &schema);
            found.iter().map(|u| (u.path.join("."), u.nearest().map(str::to_owned))).collect()
        };
        let one = |path: &str, nearest: Option<&str>| vec![(path.to_owned(), nearest.map(str::to_owned))];
        assert_eq!(unknown(json!({"low": {"sigma_px": 1}, "cell_m": 2})), []);
        assert_eq!(unknown(json!({"cel_m": 2})), one("cel_m", Some("cell_m")));
        assert_eq!(unknown(json!({"resolution": 2})), one("resolution", Some("cell_m")));
        assert_eq!(unknown(json!({"low": {"sigma": 1}})), one("low.sigma", Some("sigma_px")));
        assert_eq!(unknown(json!({"optional": {"sigma": 1}}))[0].0, "optional.sigma");
        assert_eq!(unknown(json!({"list": [{"sigma_px": 1}, {"x": 1}]})), one("list.1.x", None));
        assert_eq!(unknown(json!({"x": 1, "low": {"y": 1}, "list": [{"z": 1}]})).len(), 3);
    }

    /// A surface has another key in every section; only keys of that section are suggested.
    #[test]
    fn val_synonyms_of_each_section() {
        let meant = |key: &str, known: &[&str]| {
            let known = known.iter().map(|key| (*key).to_owned()).collect();
            UnknownKey { path: vec![key.to_owned()], known }.nearest().map(str::to_owned)
        };
        for known in [["terrains", "of"], ["fit", "onto"], ["cell_m", "dem"], ["kind", "of"]] {
            let expected = if known[0] == "terrains" { "terrains" } else { known[1] };
            assert_eq!(meant("surface", &known).as_deref(), Some(expected));
        }
        assert_eq!(meant("surface", &["count", "seed"]), None);
    }
}
