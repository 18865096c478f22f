//! One item table of a section: separates envelope and kernel parameters, and expands replicates and sweeps.

use super::keys::{self, UnknownKey};
use super::text::{Refusals, StudyError, StudyText};
use super::{check_id, segments, unknown_key};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::kind::{read_all, schema_of};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Maximum number of items in a study, and so in one table. `docs/scaling.md` states the memory of a plan.
pub const ITEMS_MAX: usize = 1_000_000;

/// One item table.
#[derive(Clone, Copy)]
pub struct Entry<'a> {
    section: &'static str,
    index: usize,
    table: &'a Map<String, Value>,
    text: &'a StudyText,
    is_limited: bool,
}

/// One item that a table expands to.
#[derive(Clone, Debug, PartialEq)]
pub struct Expanded {
    /// Full id.
    pub id: String,
    /// Its id without the replicate number, shared by the replicates.
    pub part: Arc<str>,
    /// Position among the replicates, from 0.
    pub replicate: u64,
    /// The swept parameters with their values, if any.
    pub sweep: Option<String>,
    /// Kernel parameters, shared by the replicates.
    pub params: Arc<Value>,
}

impl<'a> Entry<'a> {
    /// The `index`-th table of `[[section]]`.
    pub fn new(section: &'static str, index: usize, table: &'a Map<String, Value>, text: &'a StudyText) -> Self {
        Self { section, index, table, text, is_limited: false }
    }

    /// The same table, which expands to its first item only.
    pub fn limited(self) -> Self {
        Self { is_limited: true, ..self }
    }

    /// The table at the same place with other content.
    pub fn with<'b>(&self, table: &'b Map<String, Value>) -> Entry<'b>
    where
        'a: 'b,
    {
        Entry { section: self.section, index: self.index, table, text: self.text, is_limited: self.is_limited }
    }

    /// Its content.
    pub fn table(&self) -> &'a Map<String, Value> {
        self.table
    }

    /// True if a key of this table is written in the study.
    pub fn is_written(&self, key: &[String]) -> bool {
        !key.is_empty() && self.text.exact_span(&self.path_to(key)).is_some()
    }

    /// Its section.
    pub fn section(&self) -> &'static str {
        self.section
    }

    /// Its index among the tables of its section, from 0.
    pub fn index(&self) -> usize {
        self.index
    }

    /// Number of replicates that the table states; 1 if it states none.
    pub fn replicates_stated(&self) -> u64 {
        self.table.get("count").and_then(Value::as_u64).unwrap_or(1)
    }

    /// Number of combinations of values that its sweeps state; 1 without a sweep.
    pub fn variants_stated(&self) -> u64 {
        let sweeps = self.table.get("sweep").and_then(Value::as_object).into_iter().flat_map(Map::values);
        let lengths = sweeps.filter_map(Value::as_array).map(|values| values.len() as u64);
        lengths.fold(1, u64::saturating_mul)
    }

    /// Separates the envelope from the kernel's parameters.
    ///
    /// # Errors
    /// Envelope keys of the wrong type, and an ill-formed id.
    pub fn read<E: DeserializeOwned + JsonSchema>(&self) -> Result<(E, Value), Refusals> {
        let names = keys::properties(&schema_of::<E>());
        let (envelope, params): (Map<_, _>, Map<_, _>) =
            self.table.clone().into_iter().partition(|(key, _)| names.contains(key));
        let id = envelope.get("id").and_then(Value::as_str);
        let mut errors: Vec<StudyError> =
            id.and_then(|id| check_id("id", id).err()).map(|e| self.refuse(e)).into_iter().collect();
        errors.extend(self.swept_keys(&names));
        match read_all(Value::Object(envelope)) {
            Ok(envelope) => Refusals::none(errors).map(|()| (envelope, Value::Object(params))),
            Err(refused) => {
                errors.extend(refused.into_iter().map(|e| self.refuse_missing(e, &names, &params)));
                Err(Refusals(errors))
            }
        }
    }

    /// Refuses to sweep the keys of the envelope, `own`: a sweep varies parameters.
    fn swept_keys(&self, own: &[String]) -> Vec<StudyError> {
        if !own.iter().any(|key| key == "sweep") {
            return Vec::new();
        }
        let is_own = |swept: &&String| segments(swept).next().is_some_and(|first| own.iter().any(|key| key == first));
        let section = self.section;
        let refuse = |swept: &String| {
            let message = format!(
                "`sweep` varies parameters, but `{swept}` is a key of [[{section}]] itself; write one [[{section}]] for each value"
            );
            self.error_at(vec!["sweep".to_owned(), swept.clone()], &message)
        };
        self.sweeps().filter(is_own).map(refuse).collect()
    }

    /// Names of the swept parameters, dotted.
    fn sweeps(&self) -> impl Iterator<Item = &'a String> {
        self.table.get("sweep").and_then(Value::as_object).into_iter().flat_map(Map::keys)
    }

    /// The error of a table; if a required key is missing because it was given under another name, the error is that of the other name.
    fn refuse_missing(&self, error: ParameterError, names: &[String], params: &Map<String, Value>) -> StudyError {
        let mut others = params.keys().map(|key| self.unknown(key, names.to_vec()));
        match others.find(|other| other.nearest().is_some_and(|key| error.is_missing(key))) {
            Some(other) => unknown_key(self.text, &self.path(), &other),
            None => self.refuse(error),
        }
    }

    /// An unknown key of this table.
    fn unknown(&self, key: &str, known: Vec<String>) -> UnknownKey {
        UnknownKey { path: vec![key.to_owned()], known, given: self.table.keys().cloned().collect() }
    }

    /// Refuses parameter keys that are not in the schema; `E` is the envelope, whose keys are suggested too.
    ///
    /// # Errors
    /// The unknown keys.
    pub fn check_keys<E: JsonSchema>(&self, params: &Value, schema: &Value) -> Result<(), Refusals> {
        let mut unknown = keys::find_unknown(params, schema);
        unknown.extend(self.any_keys(params, schema));
        for key in unknown.iter_mut().filter(|key| key.path.len() == 1) {
            key.known.extend(keys::properties(&schema_of::<E>()));
            key.given = self.table.keys().cloned().collect();
        }
        Refusals::none(unknown.iter().map(|key| self.refuse_unknown(key)).collect())
    }

    /// The error of an unknown key, at the sweep if that sets it.
    fn refuse_unknown(&self, key: &UnknownKey) -> StudyError {
        let error = unknown_key(self.text, &self.path(), key);
        let place = self.place_of(&key.path.join("."));
        if *place == *key.path {
            return error;
        }
        StudyError { span: self.text.span(&self.path_to(&place), true), key: place.into(), ..error }
    }

    /// All keys, as unknown: for a schema without properties.
    fn any_keys(&self, params: &Value, schema: &Value) -> Vec<UnknownKey> {
        if !keys::properties(schema).is_empty() {
            return Vec::new();
        }
        let keys = params.as_object().into_iter().flat_map(Map::keys);
        keys.map(|key| self.unknown(key, Vec::new())).collect()
    }

    /// Expands sweeps and replicates.
    ///
    /// # Errors
    /// A count of 0 or too large, an empty sweep, or a swept parameter that is also set.
    pub fn expand(
        &self,
        id: &str,
        count: Option<u32>,
        sweep: &BTreeMap<String, Vec<Value>>,
        params: &Value,
    ) -> Result<Vec<Expanded>, StudyError> {
        if count == Some(0) {
            return Err(self.error("count", "`count` is 0; it must be 1 or more"));
        }
        let (count, values_max) = if self.is_limited { (count.map(|_| 1), 1) } else { (count, usize::MAX) };
        let sweep: Vec<(&String, &[Value])> =
            sweep.iter().map(|(key, values)| (key, &values[..values.len().min(values_max)])).collect();
        let total =
            sweep.iter().fold(count.unwrap_or(1) as usize, |total, (_, values)| total.saturating_mul(values.len()));
        if total > ITEMS_MAX {
            return Err(
                self.error("count", format!("`count` and sweeps expand to {total} items; the limit is {ITEMS_MAX}"))
            );
        }
        let params = Arc::new(params.clone());
        let plain = Expanded { id: id.to_owned(), part: id.into(), replicate: 0, sweep: None, params };
        let mut items = vec![plain];
        for (parameter, values) in sweep {
            items = self.sweep(items, parameter, values)?;
        }
        let items: Vec<Expanded> = items.into_iter().flat_map(|item| replicates(item, count)).collect();
        for item in &items {
            check_id("id", &item.id).map_err(|e| self.refuse(e))?;
        }
        Ok(items)
    }

    fn sweep(&self, items: Vec<Expanded>, parameter: &str, values: &[Value]) -> Result<Vec<Expanded>, StudyError> {
        if is_too_deep(parameter) {
            let message =
                format!("a swept key is nested more than {TABLES_MAX} tables deep; no parameter is that deep");
            return Err(self.error("sweep", message));
        }
        if values.is_empty() {
            return Err(self.error("sweep", format!("the sweep of `{parameter}` has no values")));
        }
        let mut swept = Vec::new();
        for item in items {
            for value in values {
                let word = id_word(value).ok_or_else(|| {
                    self.error(
                        "sweep",
                        format!(
                            "the sweep of `{parameter}` contains {value}; values must be numbers, words, true or false"
                        ),
                    )
                })?;
                let mut params = Value::clone(&item.params);
                if !set_at(&mut params, parameter, value.clone()) {
                    return Err(self.error("sweep", format!("`{parameter}` is both swept and set")));
                }
                let label =
                    format!("{parameter} = {}", value.as_str().map_or_else(|| value.to_string(), str::to_owned));
                let id = format!("{}-{word}", item.id);
                let sweep = joined(item.sweep.as_deref(), Some(&label));
                swept.push(Expanded { part: id.as_str().into(), id, sweep, params: Arc::new(params), ..item });
            }
        }
        Ok(swept)
    }

    /// An error at a key of this table (dotted path), at the sweep that sets it, or at the table if the key is not written.
    pub fn error(&self, key: &str, message: impl Into<String>) -> StudyError {
        self.error_at(self.place_of(key), &message.into())
    }

    fn error_at(&self, place: Vec<String>, message: &str) -> StudyError {
        let id = self.id().map_or_else(|| format!("number {}", self.index + 1), |id| format!("\"{id}\""));
        let span = self.text.span(&self.path_to(&place), false);
        let error = StudyError::at(span, format!("{} {id}: {message}", self.section));
        StudyError { key: place.into(), ..error }
    }

    /// Path in this table of a dotted key; of the sweep that sets it or a part of it, unless it is written.
    fn place_of(&self, key: &str) -> Vec<String> {
        let own: Vec<String> = segments(key).map(str::to_owned).collect();
        if own.is_empty() || self.is_written(&own) {
            return own;
        }
        let is_within = |part: &str, whole: &str| part.strip_prefix(whole).is_some_and(|rest| rest.starts_with('.'));
        let sets = |swept: &&String| *swept == key || is_within(swept, key) || is_within(key, swept);
        match self.sweeps().find(sets) {
            Some(swept) => vec!["sweep".to_owned(), swept.clone()],
            None => own,
        }
    }

    /// Path in the study of a path in this table.
    fn path_to(&self, place: &[String]) -> Vec<String> {
        self.path().into_iter().chain(place.iter().cloned()).collect()
    }

    /// A kernel's error, with its place.
    pub fn refuse(&self, error: ParameterError) -> StudyError {
        self.error(&error.key, error.to_string())
    }

    /// Its id, if it has one that is text.
    pub fn id(&self) -> Option<&'a str> {
        self.table.get("id").and_then(Value::as_str)
    }

    /// Path of a key of this table in the study.
    pub fn path_of(&self, key: &str) -> Vec<String> {
        self.path().into_iter().chain([key.to_owned()]).collect()
    }

    /// The same for a dotted key.
    pub fn path_of_dotted(&self, key: &str) -> Vec<String> {
        self.path().into_iter().chain(segments(key).map(str::to_owned)).collect()
    }

    fn path(&self) -> Vec<String> {
        vec![self.section.to_owned(), self.index.to_string()]
    }
}

/// Leaves out of a table what errors refuse, and puts unknown keys under the names that were probably meant; false if nothing changes.
pub fn leave_out(table: &mut Value, errors: &[StudyError]) -> bool {
    let mut is_changed = false;
    for error in errors.iter().filter(|error| error.missing_id.is_none()) {
        // One element of a list cannot be left out without moving the others, so the whole list is.
        let list = error.key.iter().position(|word| word.parse::<usize>().is_ok()).unwrap_or(error.key.len());
        let Some(value) = take(table, &error.key).or_else(|| take(table, &error.key[..list])) else { continue };
        is_changed = true;
        let parents = &error.key[..error.key.len() - 1];
        if let (Some(meant), Some(map)) = (&error.meant, map_at(table, parents)) {
            map.entry(&**meant).or_insert(value);
        }
    }
    is_changed
}

/// Takes the value of a key out of a table.
fn take(table: &mut Value, path: &[String]) -> Option<Value> {
    let (key, parents) = path.split_last()?;
    map_at(table, parents)?.remove(key)
}

/// The table at a path within a table.
fn map_at<'v>(table: &'v mut Value, path: &[String]) -> Option<&'v mut Map<String, Value>> {
    let mut at = table;
    for word in path {
        at = match at {
            Value::Object(map) => map.get_mut(word)?,
            Value::Array(list) => list.get_mut(word.parse::<usize>().ok()?)?,
            _ => return None,
        };
    }
    at.as_object_mut()
}

/// Joins the labels of two sweeps.
pub fn joined(first: Option<&str>, second: Option<&str>) -> Option<String> {
    let labels: Vec<&str> = first.into_iter().chain(second).collect();
    (!labels.is_empty()).then(|| labels.join(", "))
}

fn replicates(item: Expanded, count: Option<u32>) -> Vec<Expanded> {
    let Some(count) = count else { return vec![item] };
    (0..count)
        .map(|k| Expanded { id: format!("{}-{:04}", item.id, k + 1), replicate: u64::from(k), ..item.clone() })
        .collect()
}

/// A value as part of an id: lower case, with other characters as `-`.
fn id_word(value: &Value) -> Option<String> {
    let text = match value {
        Value::String(s) => s.to_lowercase(),
        Value::Number(_) | Value::Bool(_) => value.to_string(),
        _ => return None,
    };
    let plain = |c: char| if c.is_ascii_lowercase() || c.is_ascii_digit() || c == '.' { c } else { '-' };
    Some(text.chars().map(plain).collect())
}

/// Most tables that a dotted name may reach through: it becomes that many nested values, which end recursively.
pub const TABLES_MAX: usize = 100;

/// Whether a dotted name reaches through too many tables.
pub fn is_too_deep(dotted: &str) -> bool {
    dotted.matches('.').count() > TABLES_MAX
}

/// Sets a dotted parameter; false if it is set already or its parent is not a table.
fn set_at(params: &mut Value, dotted: &str, value: Value) -> bool {
    let mut at = params;
    let mut words = dotted.split('.').peekable();
    while let Some(word) = words.next() {
        let Some(map) = at.as_object_mut() else { return false };
        if words.peek().is_none() {
            return map.insert(word.to_owned(), value).is_none();
        }
        at = map.entry(word).or_insert_with(|| Value::Object(Map::new()));
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_schemas::study::TerrainItem;

    fn with<T>(toml: &str, f: impl FnOnce(Entry<'_>) -> T) -> T {
        let text = StudyText::parse(toml).unwrap();
        let json = text.to_json().unwrap();
        let table = json["terrain"][0].as_object().unwrap().clone();
        f(Entry::new("terrain", 0, &table, &text))
    }

    fn expand(toml: &str) -> Result<Vec<Expanded>, Refusals> {
        with(toml, |entry| {
            let (item, params): (TerrainItem, _) = entry.read()?;
            Ok(entry.expand(&item.id, item.count, &item.sweep, &params)?)
        })
    }

    /// A hundred thousand dots would be as many nested values, and overflow the stack.
    #[test]
    fn val_deeply_nested_sweeps_are_refused() {
        let deep = format!("[[terrain]]\nid = \"a\"\nkind = \"k\"\nsweep.\"{}x\" = [1]\n", "a.".repeat(100_000));
        let Refusals(errors) = expand(&deep).unwrap_err();
        assert_eq!(errors.len(), 1);
        assert!(errors[0].message.contains("more than 100 tables deep"), "{:.200}", errors[0].message);
    }

    #[test]
    fn val_replicates_and_sweeps() {
        let items =
            expand("[[terrain]]\nid = \"a\"\nkind = \"k\"\ncount = 2\nsweep.\"high.d\" = [2.3, 2.6]\nlow.s = 1\n")
                .unwrap();
        let ids: Vec<&str> = items.iter().map(|i| i.id.as_str()).collect();
        assert_eq!(ids, ["a-2.3-0001", "a-2.3-0002", "a-2.6-0001", "a-2.6-0002"]);
        assert_eq!(*items[2].params, serde_json::json!({"low": {"s": 1}, "high": {"d": 2.6}}));
        assert_eq!(items[3].sweep.as_deref(), Some("high.d = 2.6"));
        assert_eq!((items[3].replicate, &*items[3].part), (1, "a-2.6"));
    }

    /// What a table states is known before it is expanded; a limited one expands to its first item.
    #[test]
    fn val_numbers_are_known_before_items() {
        let toml = "[[terrain]]\nid = \"a\"\nkind = \"k\"\ncount = 4000000000\nsweep.d = [1, 2]\nsweep.h = [3, 4, 5]\n";
        let (replicates, variants, first) = with(toml, |entry| {
            let (item, params): (TerrainItem, _) = entry.read().unwrap();
            let first = entry.limited().expand(&item.id, item.count, &item.sweep, &params).unwrap();
            (entry.replicates_stated(), entry.variants_stated(), first)
        });
        assert_eq!((replicates, variants), (4_000_000_000, 6));
        assert_eq!(first.iter().map(|one| one.id.as_str()).collect::<Vec<_>>(), ["a-1-3-0001"]);
        let plain = |toml: &str| with(toml, |entry| (entry.replicates_stated(), entry.variants_stated()));
        assert_eq!(plain("[[terrain]]\nid = \"a\"\n"), (1, 1));
        // What cannot be read is reported by its type.
        assert_eq!(plain("[[terrain]]\ncount = \"many\"\nsweep = 5\n"), (1, 1));
        let long =
            format!("[[terrain]]\nsweep = {{ {} }}\n", ["a", "b", "c"].map(|key| format!("{key} = [1, 2]")).join(", "));
        assert_eq!(plain(&long), (1, 8));
    }

    /// Refused values are left out, lists as a whole, and unknown keys are renamed unless the right one is given.
    #[test]
    fn val_refused_keys_are_left_out() {
        let error = |key: &[&str], meant: Option<&str>| StudyError {
            key: key.iter().map(|word| (*word).to_owned()).collect(),
            meant: meant.map(Into::into),
            ..StudyError::at(None, "wrong")
        };
        let left = |errors: &[StudyError]| {
            let mut table = serde_json::json!({"id": "a", "cel_m": 2, "low": {"d": 9, "s": 1}, "size": [1, "x"], "list": [{"x": 1, "y": 2}]});
            let is_changed = leave_out(&mut table, errors);
            (is_changed, table)
        };
        let (is_changed, table) = left(&[
            error(&["cel_m"], Some("cell_m")),
            error(&["low", "d"], None),
            error(&["size", "1"], None),
            error(&["list", "0", "x"], Some("y")),
        ]);
        assert!(is_changed);
        assert_eq!(table, serde_json::json!({"id": "a", "cell_m": 2, "low": {"s": 1}, "list": [{"y": 2}]}));
        assert!(!left(&[error(&[], None), error(&["none"], None), error(&["none", "x"], None)]).0);
        assert!(!left(&[StudyError { missing_id: Some("b".into()), ..error(&["id"], None) }]).0);
    }

    /// Errors of swept parameters are at the values of the sweep; keys of the table that are not parameters cannot be swept.
    #[test]
    fn val_errors_of_sweeps_are_at_the_sweep() {
        let toml = "[[terrain]]\nid = \"a\"\nkind = \"k\"\nlow.s = 1\nsweep.d = [2]\nsweep.\"high.d\" = [3]\nsweep.count = [4]\n";
        let place = |error: StudyError| (error.span.map(|span| toml[span].to_owned()), error.key.join("/"));
        let at = |key: &str| with(toml, |entry| place(entry.error(key, "wrong")));
        let is = |span: &str, key: &str| (Some(span.to_owned()), key.to_owned());
        assert_eq!(at("d"), is("[2]", "sweep/d"));
        assert_eq!((at("high.d"), at("high")), (is("[3]", "sweep/high.d"), is("[3]", "sweep/high.d")));
        assert_eq!(
            (at("low.s"), at("none"), at("")),
            (is("1", "low/s"), is("[[terrain]]", "none"), is("[[terrain]]", ""))
        );
        let unknown = with(toml, |entry| {
            let key = entry.unknown("d", vec!["cell_m".to_owned()]);
            place(entry.refuse_unknown(&key))
        });
        assert_eq!(unknown, is("d", "sweep/d"));
        let Refusals(errors) = with(toml, |entry| entry.read::<TerrainItem>().err().unwrap());
        let [error] = &errors[..] else { panic!("{errors:?}") };
        assert!(error.message.contains("`count` is a key of [[terrain]] itself"), "{}", error.message);
        assert_eq!(place(error.clone()), is("[4]", "sweep/count"));
    }

    #[test]
    fn val_refusals() {
        let message = |toml: &str| expand(toml).unwrap_err().to_string();
        assert!(message("[[terrain]]\nid = \"a\"\nkind = \"k\"\ncount = 0\n").contains("1 or more"));
        assert!(message("[[terrain]]\nid = \"A\"\nkind = \"k\"\n").contains("a-z"));
        assert!(message("[[terrain]]\nid = \"a\"\nkind = \"k\"\nsweep.d = []\n").contains("no values"));
        assert!(
            message("[[terrain]]\nid = \"a\"\nkind = \"k\"\nd = 1\nsweep.d = [1]\n").contains("both swept and set")
        );
        assert!(message("[[terrain]]\nkind = \"k\"\n").contains("missing field `id`"));
        let many = message("[[terrain]]\nid = \"a\"\nkind = \"k\"\ncount = 4000000000\nsweep.d = [1,2]\n");
        assert!(many.contains("expand to 8000000000 items; the limit is 1000000"), "{many}");
    }
}
