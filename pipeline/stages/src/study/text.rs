//! The text of a study: converts TOML to JSON values and keeps the place of every key for error messages.

use serde_json::{Map, Number, Value};
use std::ops::Range;
use toml_edit::{Document, Item, TableLike};

/// An error in a study's text.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct StudyError {
    /// The problem, and what would be valid.
    pub message: String,
    /// Byte range in the study's text.
    pub span: Option<Range<usize>>,
    /// A suggestion.
    pub help: Option<String>,
    /// The id reported as missing; the error is dropped if the item of that id was itself refused.
    pub missing_id: Option<Box<str>>,
    /// Path in its table of the key that it refuses; empty for the table as a whole.
    pub key: Box<[String]>,
    /// The known key that was probably meant, if it refuses an unknown one.
    pub meant: Option<Box<str>>,
}

impl StudyError {
    /// An error at a place in the text.
    pub fn at(span: Option<Range<usize>>, message: impl Into<String>) -> Self {
        Self { message: message.into(), span, help: None, missing_id: None, key: Box::default(), meant: None }
    }

    /// The error with a suggestion.
    pub fn with_help(self, help: Option<String>) -> Self {
        Self { help, ..self }
    }
}

/// All errors in a study's text, at least one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
pub struct Refusals(pub Vec<StudyError>);

impl From<StudyError> for Refusals {
    fn from(error: StudyError) -> Self {
        Self(vec![error])
    }
}

impl Refusals {
    /// `Ok` if there are no errors; otherwise the errors without duplicates, in the order of the text.
    ///
    /// # Errors
    /// If there are any.
    pub fn none(mut errors: Vec<StudyError>) -> Result<(), Self> {
        if errors.is_empty() {
            return Ok(());
        }
        let place = |error: &StudyError| error.span.as_ref().map_or((usize::MAX, 0), |span| (span.start, span.end));
        errors.sort_by(|a, b| place(a).cmp(&place(b)).then_with(|| a.message.cmp(&b.message)));
        errors.dedup();
        Err(Self(errors))
    }
}

/// A parsed TOML text.
#[derive(Debug)]
pub struct StudyText {
    document: Document<String>,
}

impl StudyText {
    /// Parses TOML.
    ///
    /// # Errors
    /// The parser's message and place.
    pub fn parse(text: &str) -> Result<Self, StudyError> {
        let document = Document::parse(text.to_owned())
            .map_err(|e| StudyError::at(e.span(), format!("not valid TOML: {}", e.message().trim())))?;
        Ok(Self { document })
    }

    /// The text as JSON.
    ///
    /// # Errors
    /// A date or a number that is not finite, with its place.
    pub fn to_json(&self) -> Result<Value, StudyError> {
        table_to_json(self.document.as_table())
    }

    /// Place of the value at a path (array positions as numbers), or of its nearest ancestor that has one. With `key`, the place
    /// of the key instead of the value.
    pub fn span(&self, path: &[String], key: bool) -> Option<Range<usize>> {
        self.walk(path, key).last().flatten()
    }

    /// Place of the value at a path; `None` if it does not exist.
    pub fn exact_span(&self, path: &[String]) -> Option<Range<usize>> {
        self.walk(path, false).nth(path.len().checked_sub(1)?).flatten()
    }

    /// The best known place after each step along a path, as far as the path exists.
    fn walk(&self, path: &[String], key: bool) -> impl Iterator<Item = Option<Range<usize>>> {
        let mut at = Some(Node::Item(self.document.as_item()));
        let mut best = None;
        path.iter().map_while(move |segment| {
            let (span, next) = at?.step(segment, key)?;
            best = span.or(best.take());
            at = Some(next);
            Some(best.clone())
        })
    }
}

/// A node in the document; values inside arrays are not items.
#[derive(Clone, Copy)]
enum Node<'a> {
    Item(&'a Item),
    Value(&'a toml_edit::Value),
}

impl<'a> Node<'a> {
    fn table(self) -> Option<&'a dyn TableLike> {
        match self {
            Self::Item(item) => item.as_table_like(),
            Self::Value(value) => value.as_inline_table().map(|t| t as &dyn TableLike),
        }
    }

    fn array(self) -> Option<&'a toml_edit::Array> {
        match self {
            Self::Item(item) => item.as_array(),
            Self::Value(value) => value.as_array(),
        }
    }

    /// The place of the child `segment`, and the child.
    fn step(self, segment: &str, key: bool) -> Option<(Option<Range<usize>>, Self)> {
        if let Some(table) = self.table() {
            let (name, value) = table.get_key_value(segment)?;
            let span = if key { name.span() } else { value.span() };
            return Some((span.or(name.span()), Self::Item(value)));
        }
        let index: usize = segment.parse().ok()?;
        if let Some(array) = self.array() {
            let value = array.get(index)?;
            return Some((value.span(), Self::Value(value)));
        }
        // A table in an array of tables is not an `Item`; descend through the array's index.
        let Self::Item(item) = self else { return None };
        let table = item.as_array_of_tables().and_then(|_| item.get(index))?;
        Some((table.span(), Self::Item(table)))
    }
}

fn table_to_json(table: &dyn TableLike) -> Result<Value, StudyError> {
    let entries = table.iter().map(|(key, item)| Ok((key.to_owned(), item_to_json(item)?)));
    Ok(Value::Object(entries.collect::<Result<Map<_, _>, StudyError>>()?))
}

fn item_to_json(item: &Item) -> Result<Value, StudyError> {
    match item {
        Item::None => Ok(Value::Null),
        Item::Value(value) => value_to_json(value),
        Item::Table(table) => table_to_json(table),
        Item::ArrayOfTables(tables) => {
            tables.iter().map(|t| table_to_json(t)).collect::<Result<_, _>>().map(Value::Array)
        }
    }
}

/// A TOML value as JSON.
///
/// # Errors
/// Dates, and numbers that are not finite: no parameter accepts them.
pub fn value_to_json(value: &toml_edit::Value) -> Result<Value, StudyError> {
    use toml_edit::Value as Toml;
    let refuse = |what: &str| StudyError::at(value.span(), what);
    match value {
        Toml::String(v) => Ok(Value::String(v.value().clone())),
        Toml::Integer(v) => Ok(Value::Number((*v.value()).into())),
        Toml::Float(v) => Number::from_f64(*v.value())
            .map(Value::Number)
            .ok_or_else(|| refuse("the number is not finite; parameters must be finite")),
        Toml::Boolean(v) => Ok(Value::Bool(*v.value())),
        Toml::Datetime(_) => Err(refuse("dates must be written as text, \"YYYY-MM-DD\"")),
        Toml::Array(v) => v.iter().map(value_to_json).collect::<Result<_, _>>().map(Value::Array),
        Toml::InlineTable(v) => table_to_json(v),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "[study]\nname = \"x\"\n[[terrain]]\nid = \"a\"\nlow.sigma = 1\n[[terrain]]\nid = \"b\"\nlist = [1, 2]\n";

    fn path(words: &[&str]) -> Vec<String> {
        words.iter().map(|w| (*w).to_owned()).collect()
    }

    #[test]
    fn val_places() {
        let text = StudyText::parse(TEXT).unwrap();
        let at = |words: &[&str], key| text.span(&path(words), key).map(|s| &TEXT[s]);
        assert_eq!(at(&["study", "name"], false), Some("\"x\""));
        assert_eq!(at(&["terrain", "0", "low", "sigma"], true), Some("sigma"));
        assert_eq!(at(&["terrain", "1", "id"], false), Some("\"b\""));
        assert_eq!(at(&["terrain", "1", "list", "1"], false), Some("2"));
        assert_eq!(at(&["terrain", "1", "nothing"], false), Some("[[terrain]]"));
        assert_eq!(text.exact_span(&path(&["terrain", "1", "nothing"])), None);
        assert_eq!(text.exact_span(&path(&["terrain", "0", "id"])).map(|s| &TEXT[s]), Some("\"a\""));
        assert_eq!(text.exact_span(&[]), None);
        assert_eq!(at(&["fit", "0"], false), None);
    }

    /// Every type that a parameter may have, in tables, inline tables and lists of tables.
    #[test]
    fn val_toml_becomes_json() {
        let text =
            "a = 1\nb = 2.5\nc = true\nd = \"x\"\ne = [1, [2.0, \"y\"]]\nf = { g = 1 }\nh.i = 2\n[[j]]\nk = 3\n[[j]]\n";
        let expected = serde_json::json!({
            "a": 1, "b": 2.5, "c": true, "d": "x", "e": [1, [2.0, "y"]], "f": { "g": 1 }, "h": { "i": 2 }, "j": [{ "k": 3 }, {}]
        });
        assert_eq!(StudyText::parse(text).unwrap().to_json().unwrap(), expected);
    }

    /// Errors come once each, in the order of the text; those without a place come last.
    #[test]
    fn val_errors_are_sorted() {
        let error = |span: Option<std::ops::Range<usize>>, message: &str| StudyError::at(span, message);
        let all = vec![
            error(None, "c"),
            error(Some(9..10), "a"),
            error(Some(2..5), "b"),
            error(Some(2..3), "z"),
            error(Some(9..10), "a"),
        ];
        let Refusals(sorted) = Refusals::none(all).unwrap_err();
        assert_eq!(sorted.iter().map(|e| e.message.as_str()).collect::<String>(), "zbac");
        assert_eq!(Refusals::none(Vec::new()), Ok(()));
    }

    #[test]
    fn val_refusals() {
        let error = StudyText::parse("a = nan").unwrap().to_json().unwrap_err();
        assert!(error.message.contains("not finite") && error.span == Some(4..7));
        let error = StudyText::parse("a = [1, 2026-01-01]").unwrap().to_json().unwrap_err();
        assert!(error.message.starts_with("dates must be written as text") && error.span == Some(8..18), "{error:?}");
        assert!(StudyText::parse("a = [").unwrap_err().message.contains("TOML"));
    }
}
