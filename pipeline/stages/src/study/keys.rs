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
    /// Keys that are given at that place, which cannot have been meant.
    pub given: Vec<String>,
}

impl UnknownKey {
    /// The unknown key itself.
    pub fn key(&self) -> &str {
        self.path.last().map_or("", String::as_str)
    }

    /// The known key that was probably meant: a synonym, or the nearest in spelling.
    pub fn nearest(&self) -> Option<&str> {
        let open = || self.known.iter().filter(|key| !self.given.contains(key)).map(String::as_str);
        let synonym = SYNONYMS.iter().find(|(words, key)| words.contains(&self.key()) && open().any(|k| k == *key));
        synonym.map(|(_, key)| *key).or_else(|| nearest(self.key(), open()))
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
    (&["outer_scale", "detrend", "detrending", "window", "window_m"], "outer_scale_m"),
    (&["summary", "abstract"], "description"),
    (&["terrain", "surface", "surfaces"], "terrains"),
    (&["base", "terrain", "surface"], "onto"),
    (&["surface", "raster", "site"], "dem"),
    (&["surface", "terrain", "dem", "operand"], "of"),
];

/// The candidate nearest to `word` in spelling, if it is close enough: Jaro-Winkler similarity above 0.75, and either one begins with the
/// other or at most half of the letters differ, since the similarity alone overrates short candidates.
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
        .filter(|(similarity, c)| *similarity > 0.75 && (continues(word, c) || differ_little(word, c)))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, c)| c)
}

/// The word that was probably meant, of those that a message of `read_parameters` lists: "has the unknown key `mas_kg`; known: `size_m`, `mass_kg`".
pub fn nearest_in(message: &str) -> Option<&str> {
    let (_, rest) = message.split_once("the unknown ")?;
    let (found, known) = rest.split_once("; known: ")?;
    let word = found.split('`').nth(1)?;
    nearest(word, known.split('`').skip(1).step_by(2))
}

/// True if one begins with the other, which has three letters or more.
fn continues(word: &str, candidate: &str) -> bool {
    let begins = |long: &str, short: &str| short.len() >= 3 && long.starts_with(short);
    begins(word, candidate) || begins(candidate, word)
}

/// True if at most half of the letters of the longer one must be edited.
fn differ_little(word: &str, candidate: &str) -> bool {
    2 * strsim::levenshtein(word, candidate) <= word.chars().count().max(candidate.chars().count())
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
                found.push(UnknownKey { path: path.clone(), known, given: map.keys().cloned().collect() });
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

    /// What is given already was not meant, and a short key is not near to a longer word that contains its letters.
    #[test]
    fn val_suggestions_are_plausible() {
        let owned = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
        let meant = |key: &str, given: &[&str]| {
            let known = owned(&["id", "dem", "minus", "outer_scale_m", "model"]);
            let unknown = UnknownKey { path: owned(&[key]), known, given: owned(given) };
            unknown.nearest().map(str::to_owned)
        };
        assert_eq!(meant("window", &["id", "dem"]).as_deref(), Some("outer_scale_m"));
        assert_eq!(meant("modl", &[]).as_deref(), Some("model"));
        assert_eq!(meant("modl", &["model"]), None);
        for key in ["windw_m", "width_m"] {
            assert_eq!(meant(key, &[]), None, "{key}");
        }
        let kinds = ["gap", "fractal_dimension", "off", "id"];
        for (word, expected) in [("fractal", Some("fractal_dimension")), ("of", Some("off")), ("window", None)] {
            assert_eq!(nearest(word, kinds.into_iter()), expected, "{word}");
        }
        let message = "`chassis.mas_kg` has the unknown key `mas_kg`; known: `size_m`, `mass_kg`, `bottom_z_m`";
        assert_eq!(nearest_in(message), Some("mass_kg"));
        assert_eq!(nearest_in("`cell_m` is -1; it must be a finite number above 0"), None);
    }

    /// A surface has another key in every section; only keys of that section are suggested.
    #[test]
    fn val_synonyms_of_each_section() {
        let meant = |key: &str, known: &[&str]| {
            let known = known.iter().map(|key| (*key).to_owned()).collect();
            UnknownKey { path: vec![key.to_owned()], known, given: Vec::new() }.nearest().map(str::to_owned)
        };
        for known in [["terrains", "of"], ["fit", "onto"], ["cell_m", "dem"], ["kind", "of"]] {
            let expected = if known[0] == "terrains" { "terrains" } else { known[1] };
            assert_eq!(meant("surface", &known).as_deref(), Some(expected));
        }
        assert_eq!(meant("surface", &["count", "seed"]), None);
    }
}
