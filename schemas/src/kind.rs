//! Kinds (generators, models, vehicles, methods): entries of registries, and errors in their parameters.

use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::fmt::Display;

/// One entry of a registry.
#[derive(Clone, Debug, Serialize)]
pub struct Kind {
    /// Family: `terrain`, `texture`, `vehicle`, `fit` ...
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
    /// Values of all parameters, nested; for vehicles and surfaces.
    pub fn values(&self) -> Option<&Value> {
        self.parameters.get("default")
    }

    /// Source of each of these values, nested likewise.
    pub fn sources(&self) -> Option<&Value> {
        self.parameters.get("x-sources")
    }

    /// Summary and source, as two sentences.
    ///
    /// ```
    /// use sastrugi_schemas::Kind;
    ///
    /// let (summary, source) = ("a trench across level ground", "MAVS random_scene.cpp");
    /// let kind = Kind { family: "terrain", kind: "gap", summary, source, parameters: serde_json::json!({}) };
    /// assert_eq!(kind.description(), "A trench across level ground. Source: MAVS random_scene.cpp.");
    /// ```
    pub fn description(&self) -> String {
        let [summary, source] = [self.summary, self.source].map(|text| text.trim_end_matches('.'));
        format!("{}. Source: {source}.", capital(summary))
    }
}

/// An invalid parameter.
///
/// ```
/// use sastrugi_schemas::ParameterError;
///
/// let error = ParameterError::positive("cell_m", -0.1).unwrap_err();
/// assert_eq!(error.to_string(), "`cell_m` is -0.1; it must be a finite number above 0");
/// // Seen from the table that contains the parameter:
/// assert_eq!(error.within("grid").key, "grid.cell_m");
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{message}", if key.is_empty() { String::new() } else { format!("`{key}` ") })]
pub struct ParameterError {
    /// Dotted path of the parameter below its item (`layers.2.fractal_dimension`); empty for the item as a whole.
    pub key: String,
    /// The problem, with the value, and what would be valid.
    pub message: String,
}

impl ParameterError {
    /// An error at `key`.
    pub fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into() }
    }

    /// The last segment of the key.
    fn name(&self) -> &str {
        self.key.rsplit('.').next().unwrap_or_default()
    }

    /// True if it reports this required key as missing.
    pub fn is_missing(&self, key: &str) -> bool {
        self.message == format!("missing field `{key}`")
    }

    /// The same error seen from one level up.
    pub fn within(self, parent: &str) -> Self {
        let key = if self.key.is_empty() { parent.to_owned() } else { format!("{parent}.{}", self.key) };
        Self { key, ..self }
    }

    /// `Ok` if the value is finite and above zero.
    pub fn positive(key: &str, value: f64) -> Result<f64, Self> {
        if value.is_finite() && value > 0.0 {
            Ok(value)
        } else {
            Err(Self::new(key, format!("is {}; it must be a finite number above 0", shown(value))))
        }
    }

    /// `Ok` if the value is finite and not negative.
    pub fn not_negative(key: &str, value: f64) -> Result<f64, Self> {
        if value.is_finite() && value >= 0.0 {
            Ok(value)
        } else {
            Err(Self::new(key, format!("is {}; it must be a finite number, 0 or above", shown(value))))
        }
    }

    /// `Ok` if the value lies strictly between the bounds.
    pub fn between(key: &str, value: f64, low: f64, high: f64) -> Result<f64, Self> {
        if value > low && value < high {
            Ok(value)
        } else {
            Err(Self::new(key, format!("is {}; it must lie above {low} and below {high}", shown(value))))
        }
    }
}

/// A number for a message, with an exponent if it would otherwise be very long.
pub fn shown(value: f64) -> String {
    let size = value.abs();
    if size.is_finite() && size != 0.0 && !(1e-9..1e15).contains(&size) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// A number of things for a message. The number may be text already, such as a rounded one; the noun must have a regular plural.
///
/// ```
/// use sastrugi_schemas::counted;
///
/// assert_eq!([0, 1, 2].map(|n| counted(n, "gap cell")), ["0 gap cells", "1 gap cell", "2 gap cells"]);
/// assert_eq!(["entry", "day", "patch"].map(|noun| counted(3, noun)), ["3 entries", "3 days", "3 patches"]);
/// assert_eq!([1.0, 1.5].map(|x| counted(x, "cell")), ["1 cell", "1.5 cells"]);
/// ```
pub fn counted(number: impl Display, noun: &str) -> String {
    let number = number.to_string();
    match noun.strip_suffix('y') {
        _ if number == "1" => format!("1 {noun}"),
        Some(stem) if !stem.ends_with(['a', 'e', 'i', 'o', 'u']) => format!("{number} {stem}ies"),
        _ if ["s", "x", "ch", "sh"].iter().any(|end| noun.ends_with(end)) => format!("{number} {noun}es"),
        _ => format!("{number} {noun}s"),
    }
}

/// Words with a capital first letter.
///
/// ```
/// use sastrugi_schemas::capital;
///
/// assert_eq!(["success rate", "RMS", ""].map(capital), ["Success rate", "RMS", ""]);
/// ```
pub fn capital(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// JSON Schema of a parameter type.
pub fn schema_of<T: JsonSchema>() -> Value {
    schemars::schema_for!(T).to_value()
}

/// Reads raw parameters from JSON, to which study items and `--set` are converted.
///
/// # Errors
/// A [`ParameterError`] that names the invalid key.
///
/// # Examples
/// ```
/// use sastrugi_schemas::kind::read_parameters;
/// use sastrugi_schemas::study::RoughnessSection;
/// use serde_json::json;
///
/// // What is not given has its default.
/// let section: RoughnessSection = read_parameters(&json!({ "low_max": 0.2 })).unwrap();
/// assert_eq!((section.low_max, section.border_m), (0.2, 5.0));
///
/// let error = read_parameters::<RoughnessSection>(&json!({ "low_max": "smooth" })).unwrap_err();
/// assert_eq!(error.key, "low_max");
/// ```
pub fn read_parameters<T: DeserializeOwned>(value: &Value) -> Result<T, ParameterError> {
    serde_path_to_error::deserialize(value).map_err(|e| {
        let key = dotted(e.path());
        ParameterError::new(key, in_plain_words(e.into_inner().to_string()))
    })
}

/// Serde's sentence on a value of the wrong type in words for people who write studies, without names of Rust types; any other sentence as it is.
fn in_plain_words(message: String) -> String {
    let wrong = message.strip_prefix("invalid type: ").or_else(|| message.strip_prefix("invalid value: "));
    if let Some((found, expected)) = wrong.and_then(|rest| rest.rsplit_once(", expected ")) {
        return format!("must be {}, got {}", type_in_words(expected), value_in_words(found));
    }
    let key = message.strip_prefix("unknown field `").and_then(|rest| rest.split_once("`, expected "));
    if let Some((found, known)) = key {
        return format!("has the unknown key `{found}`; known: {}", known.trim_start_matches("one of "));
    }
    let word = message.strip_prefix("unknown variant `").and_then(|rest| rest.split_once("`, expected "));
    if let Some((found, known)) = word {
        return format!("has the unknown value `{found}`; known: {}", known.trim_start_matches("one of "));
    }
    let length = message.strip_prefix("invalid length ").and_then(|rest| rest.split_once(", expected "));
    match length {
        Some((found, "fewer elements in array")) => format!("must be a shorter list, got {found} values"),
        Some((found, expected)) => match expected.rsplit_once(' ').filter(|_| is_list(expected)) {
            Some((_, values)) => format!("must be a list of {values} values, got {found}"),
            None => message,
        },
        None => message,
    }
}

/// True for a list of so many values that serde expected.
fn is_list(expected: &str) -> bool {
    expected.starts_with("an array of length ") || expected.starts_with("a tuple of size ")
}

/// A type that serde expected.
fn type_in_words(expected: &str) -> &str {
    match expected {
        "f32" | "f64" => "a number",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "u64" | "usize" => "a whole number, 0 or above",
        "u32" => "a whole number from 0 to 4294967295",
        "u16" => "a whole number from 0 to 65535",
        "u8" => "a whole number from 0 to 255",
        "a string" => "text in quotes",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        "a map" => "a table",
        "string or map" | "map with a single key" => "one of its words, in quotes",
        other if other.starts_with("struct ") => "a table",
        other if other.starts_with("internally tagged enum ") => "a table with `kind`",
        other if is_list(other) => "a list",
        other => other,
    }
}

/// A value that serde found.
fn value_in_words(found: &str) -> &str {
    let number = |kind: &str| found.strip_prefix(kind).map(|quoted| quoted.trim_matches('`'));
    match found {
        "sequence" => "a list",
        "map" => "a table",
        _ => found
            .strip_prefix("string ")
            .or_else(|| number("integer "))
            .or_else(|| number("floating point "))
            .or_else(|| number("boolean "))
            .unwrap_or(found),
    }
}

/// As [`read_parameters`], but reports every value of the wrong type, not only the first.
///
/// # Errors
/// The invalid keys, at least one.
///
/// # Examples
/// ```
/// use sastrugi_schemas::kind::read_all;
/// use sastrugi_schemas::study::RoughnessSection;
/// use serde_json::json;
///
/// let errors = read_all::<RoughnessSection>(json!({ "low_max": "smooth", "border_m": [1.0] })).unwrap_err();
/// let mut keys: Vec<&str> = errors.iter().map(|error| error.key.as_str()).collect();
/// keys.sort();
/// assert_eq!(keys, ["border_m", "low_max"]);
/// ```
pub fn read_all<T: DeserializeOwned>(mut value: Value) -> Result<T, Vec<ParameterError>> {
    let mut refused = Vec::new();
    loop {
        match read_parameters(&value) {
            Ok(read) if refused.is_empty() => return Ok(read),
            Ok(_) => return Err(refused),
            Err(error) => {
                // Removing one element would move the others to other positions, so the whole list is removed.
                let words = error.key.split('.').filter(|word| !word.is_empty());
                let path: Vec<String> =
                    words.take_while(|word| word.parse::<usize>().is_err()).map(str::to_owned).collect();
                // A required key that was removed because of its type is not missing.
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

/// Removes the value at a path; false if there is none.
pub fn remove(value: &mut Value, path: &[String]) -> bool {
    let Some((last, parents)) = path.split_last() else { return false };
    let parent = parents.iter().try_fold(value, |at, word| below(at, word));
    parent.and_then(Value::as_object_mut).is_some_and(|map| map.remove(last).is_some())
}

/// The value of a table at a key, or of a list at a position.
fn below<'a>(value: &'a mut Value, word: &str) -> Option<&'a mut Value> {
    match value {
        Value::Object(map) => map.get_mut(word),
        Value::Array(list) => list.get_mut(word.parse::<usize>().ok()?),
        _ => None,
    }
}

/// The path in dotted form, as keys of a study are written.
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

    /// A value of the wrong type is refused without the names of Rust's types.
    #[test]
    fn val_wrong_types_are_named_in_plain_words() {
        let message = |value: Value| read_parameters::<Item>(&value).unwrap_err().to_string();
        let item = |key: &str, value: Value| {
            let mut item = json!({"id": "a"});
            item[key] = value;
            item
        };
        assert_eq!(message(item("id", json!(5))), "`id` must be text in quotes, got 5");
        assert_eq!(message(item("count", json!(-1))), "`count` must be a whole number from 0 to 4294967295, got -1");
        assert_eq!(message(item("count", json!(1.5))), "`count` must be a whole number from 0 to 4294967295, got 1.5");
        assert_eq!(message(item("window", json!(true))), "`window` must be a list, got true");
        assert_eq!(message(item("window", json!(["x"]))), "`window.0` must be a number, got \"x\"");
        let word = read_parameters::<Word>(&json!({"word": "on"})).unwrap_err().to_string();
        assert_eq!(word, "`word` has the unknown value `on`; known: `one`, `two`, `three`");
        for (value, found) in [(json!(5), "5"), (json!({}), "a table")] {
            let word = read_parameters::<Word>(&json!({"word": value})).unwrap_err().to_string();
            assert_eq!(word, format!("`word` must be one of its words, in quotes, got {found}"));
        }
        let tagged = read_parameters::<Tagged>(&json!(5)).unwrap_err().to_string();
        assert_eq!(tagged, "must be a table with `kind`, got 5");
        let pair = |value: Value| read_parameters::<(f64, f64)>(&value).unwrap_err().to_string();
        assert_eq!(pair(json!("x")), "must be a list, got \"x\"");
        assert_eq!(pair(json!([1.0])), "must be a list of 2 values, got 1");
        let layers = json!({"layers": [[1.0]]});
        let short = read_parameters::<Layers>(&layers).unwrap_err().to_string();
        assert_eq!(short, "`layers.0` must be a list of 2 values, got 1");
        let long = read_parameters::<Layers>(&json!({"layers": [[1.0, 2.0, 3.0]]})).unwrap_err().to_string();
        assert_eq!(long, "`layers.0` must be a shorter list, got 3 values");
        // `is_missing` relies on serde's own sentence.
        assert!(read_parameters::<Item>(&json!({})).unwrap_err().is_missing("id"));
    }

    #[derive(Debug, Deserialize)]
    struct Word {
        #[serde(rename = "word")]
        _word: Number,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Number {
        One,
        Two,
        Three,
    }

    #[derive(Debug, Deserialize)]
    #[serde(tag = "kind")]
    enum Tagged {
        Only,
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
    fn val_all_invalid_values_are_reported() {
        let keys = |value: Value| -> Vec<String> {
            let mut keys: Vec<String> =
                read_all::<Item>(value).err().unwrap_or_default().into_iter().map(|e| e.key).collect();
            // Whether JSON objects keep their order or sort their keys depends on a feature of serde_json that other crates select.
            keys.sort();
            keys
        };
        assert_eq!(keys(json!({"id": "a", "count": 3, "window": [1.0]})), Vec::<String>::new());
        assert_eq!(keys(json!({"id": "a", "count": -1, "window": ["x", 2.0, "y"]})), ["count", "window.0"]);
        assert_eq!(keys(json!({"id": 5, "count": "x"})), ["count", "id"]);
        assert_eq!(keys(json!({"count": 1})), [""]);
        assert_eq!(keys(json!([])), [""]);
    }

    /// At the bound, beside it, and without a number.
    #[test]
    fn val_bounds_of_parameters() {
        assert_eq!(ParameterError::positive("a", f64::MIN_POSITIVE), Ok(f64::MIN_POSITIVE));
        assert_eq!(ParameterError::not_negative("a", 0.0), Ok(0.0));
        assert_eq!(ParameterError::between("a", 0.5, 0.0, 1.0), Ok(0.5));
        let refused = |checked: Result<f64, ParameterError>| checked.unwrap_err().to_string();
        assert_eq!(refused(ParameterError::positive("a", 0.0)), "`a` is 0; it must be a finite number above 0");
        for value in [-f64::MIN_POSITIVE, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(refused(ParameterError::positive("a", value)).contains("finite number above 0"), "{value}");
            assert!(refused(ParameterError::not_negative("a", value)).contains("finite number, 0 or above"), "{value}");
        }
        for value in [0.0, 1.0, -0.5, 1.5, f64::NAN] {
            let message = refused(ParameterError::between("a", value, 0.0, 1.0));
            assert_eq!(message, format!("`a` is {value}; it must lie above 0 and below 1"));
        }
    }

    #[test]
    fn val_errors_seen_from_outer_tables() {
        let error = ParameterError::new("hurst", "is 2").within("texture").within("processes.0");
        assert_eq!(error.to_string(), "`processes.0.texture.hurst` is 2");
        assert_eq!(error.name(), "hurst");
        let of_table = ParameterError::new("", "is not a table");
        assert_eq!(of_table.to_string(), "is not a table");
        assert_eq!(of_table.within("low").key, "low");
        let missing = read_parameters::<Item>(&json!({})).unwrap_err();
        assert!(missing.is_missing("id") && !missing.is_missing("count"), "{missing}");
    }

    #[test]
    fn val_values_are_removed_by_path() {
        let mut value = json!({"a": {"b": 1, "c": [{"d": 2, "e": 3}]}});
        let mut removed = |path: &[&str]| {
            let path: Vec<String> = path.iter().map(|word| (*word).to_owned()).collect();
            (remove(&mut value, &path), value.clone())
        };
        for nowhere in [&[][..], &["x"], &["a", "x"], &["a", "b", "x"], &["a", "c", "1", "d"], &["a", "c", "0"]] {
            assert_eq!(removed(nowhere), (false, json!({"a": {"b": 1, "c": [{"d": 2, "e": 3}]}})), "{nowhere:?}");
        }
        assert_eq!(removed(&["a", "c", "0", "d"]), (true, json!({"a": {"b": 1, "c": [{"e": 3}]}})));
        assert_eq!(removed(&["a"]), (true, json!({})));
    }

    #[test]
    fn val_numbers_in_messages_are_short() {
        let text = [0.0, -3.25, 1e300, -2.5e-12, f64::INFINITY].map(shown);
        assert_eq!(text, ["0", "-3.25", "1e300", "-2.5e-12", "inf"]);
    }
}
