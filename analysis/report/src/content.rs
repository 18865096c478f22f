//! Content of an answer: text, figures and tables, each with the numbers behind it.

use crate::render::svg::Svg;
use sastrugi_schemas::{Cell, Record};
use serde::Serialize;
use serde_json::{Value, json};

/// The answer to one question: a section of the page.
#[derive(Clone, Debug)]
pub struct Section {
    /// Anchor.
    pub id: &'static str,
    /// Name in the list of sections.
    pub name: &'static str,
    /// The question.
    pub title: &'static str,
    /// Its parts in order.
    pub blocks: Vec<Block>,
}

impl Section {
    /// The blocks that have content under a heading; `None` without any.
    pub fn of(id: &'static str, name: &'static str, title: &'static str, mut blocks: Vec<Block>) -> Option<Self> {
        blocks.retain(|block| !block.is_empty());
        (!blocks.is_empty()).then_some(Self { id, name, title, blocks })
    }
}

/// A part of a section.
#[derive(Clone, Debug)]
pub enum Block {
    /// A subheading.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// A paragraph with a result, which the summary repeats, with the warnings that directly follow it.
    Result(String),
    /// A sentence that the reader must not miss.
    Warning(String),
    /// Several such sentences, folded under a summary.
    Warnings {
        /// Their subject.
        summary: String,
        /// Sentences.
        sentences: Vec<String>,
    },
    /// Figures side by side.
    Figures(Vec<Figure>),
    /// A visible table.
    Table(TableBlock),
    /// A folded table.
    FoldedTable(TableBlock),
}

impl Block {
    /// True when it would leave an empty box on the page.
    pub fn is_empty(&self) -> bool {
        match self {
            Self::Heading(_) | Self::Text(_) | Self::Result(_) | Self::Warning(_) => false,
            Self::Warnings { sentences, .. } => sentences.is_empty(),
            Self::Figures(figures) => figures.is_empty(),
            Self::Table(table) | Self::FoldedTable(table) => table.numbers.rows.is_empty(),
        }
    }
}

/// A table with its caption.
#[derive(Clone, Debug)]
pub struct TableBlock {
    /// Name of its file under `data/`, without extension.
    pub id: String,
    /// Caption.
    pub caption: String,
    /// Its numbers.
    pub numbers: Numbers,
}

/// A figure.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name of its files, without extension.
    pub id: String,
    /// Title.
    pub title: String,
    /// What is shown, how it was computed, and its caveats.
    pub caption: String,
    /// Text alternative with the main numbers.
    pub description: String,
    /// Drawing.
    pub svg: Svg,
    /// Numbers behind it.
    pub numbers: Numbers,
}

/// Numbers behind a figure or in a table, and where in the release they come from.
///
/// ```
/// use sastrugi_report::content::{Numbers, number, text};
///
/// let query = "select surface_id, sq_m from 'tables/surfaces/*.parquet'";
/// let mut numbers = Numbers::new(query, &[("surface_id", ""), ("sq_m", "m")]);
/// numbers.row([text("snow"), number(0.05)]);
/// numbers.row([text("ice"), number(f64::NAN)]);
///
/// // The file under `data/`: an unknown number is null, never NaN.
/// let file = numbers.to_json("heights", "RMS heights");
/// assert_eq!(file["rows"], serde_json::json!([["snow", 0.05], ["ice", null]]));
/// assert_eq!((&file["query"], &file["columns"][1]["unit"]), (&query.into(), &"m".into()));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// DuckDB query in the folder of the release, or a file.
    pub query: String,
    /// What the query returns.
    pub gives: Gives,
    /// Name and unit of each column.
    pub columns: Vec<Heading>,
    /// Rows, each as long as `columns`.
    pub rows: Vec<Vec<Cell>>,
    /// True if the rows of a column measure different things, which other columns name: decimals are equal for each of these.
    pub mixed: bool,
    /// Number of rows of which these are a random sample; `None` if these are all.
    pub sampled_of: Option<usize>,
}

/// What a query returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Gives {
    /// The rows themselves, in any order.
    Rows,
    /// The input from which they are computed.
    Input,
    /// Nothing: it is a file.
    File,
}

/// Heading of a column.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Heading {
    /// Name.
    pub name: String,
    /// Unit (`1` for pure numbers, empty for words).
    pub unit: String,
}

impl Numbers {
    /// Without rows yet.
    pub fn new(query: impl Into<String>, columns: &[(&str, &str)]) -> Self {
        let columns = columns.iter().map(|&(name, unit)| Heading { name: name.into(), unit: unit.into() }).collect();
        Self { query: query.into(), gives: Gives::Rows, columns, rows: Vec::new(), mixed: false, sampled_of: None }
    }

    /// Without rows yet; they are computed from what the query returns.
    pub fn computed(query: impl Into<String>, columns: &[(&str, &str)]) -> Self {
        Self { gives: Gives::Input, ..Self::new(query, columns) }
    }

    /// Without rows yet, about a file.
    pub fn of_file(path: impl Into<String>, columns: &[(&str, &str)]) -> Self {
        Self { gives: Gives::File, ..Self::new(path, columns) }
    }

    /// The same for rows that measure different things.
    pub fn with_mixed_units(self) -> Self {
        Self { mixed: true, ..self }
    }

    /// The same where the rows are a random sample of `all`; unchanged if there are as many rows.
    pub fn of_all(self, all: usize) -> Self {
        Self { sampled_of: (self.rows.len() < all).then_some(all), ..self }
    }

    /// Columns of the rows of a table of the release that meet a condition (all rows if it is empty), with the names and units of the
    /// contract.
    ///
    /// # Panics
    /// When the table lacks one of the columns (a bug of the caller).
    pub fn select<'a, R: Record + 'a>(condition: &str, rows: impl IntoIterator<Item = &'a R>, names: &[&str]) -> Self {
        let all = R::TABLE.columns;
        let indices: Vec<usize> = names.iter().filter_map(|n| R::TABLE.position(n)).collect();
        assert_eq!(indices.len(), names.len(), "table {} lacks some of the columns {names:?}", R::TABLE.name);
        let columns: Vec<(&str, &str)> = indices.iter().map(|&i| (all[i].name, all[i].unit)).collect();
        let quoted = |name: &str| if name == "group" { "\"group\"".to_owned() } else { name.to_owned() };
        let list = columns.iter().map(|c| quoted(c.0)).collect::<Vec<_>>().join(", ");
        let rule = if condition.is_empty() { String::new() } else { format!(" where {condition}") };
        let mut numbers = Self::new(format!("select {list} from 'tables/{}/*.parquet'{rule}", R::TABLE.name), &columns);
        for row in rows {
            let cells = row.cells();
            numbers.rows.push(indices.iter().filter_map(|&i| cells.get(i).cloned()).collect());
        }
        numbers
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// The file under `data/`.
    pub fn to_json(&self, id: &str, title: &str) -> Value {
        let rows: Vec<Vec<Value>> = self.rows.iter().map(|r| r.iter().map(value).collect()).collect();
        let mut file = json!({ "id": id, "title": title, "query": self.query, "query_gives": self.gives, "columns": self.columns });
        if let Some(all) = self.sampled_of {
            file["random_sample_of"] = all.into();
        }
        file["rows"] = rows.into();
        file
    }
}

/// Text cell.
pub fn text(value: impl Into<String>) -> Cell {
    Cell::Text(value.into())
}

/// Number cell; null for a value that is not finite.
pub fn number(value: f64) -> Cell {
    if value.is_finite() { Cell::F64(value) } else { Cell::Null }
}

/// Count cell.
pub fn count(n: usize) -> Cell {
    i64::try_from(n).map_or(Cell::Null, Cell::I64)
}

/// Text as a part of a file name and of an anchor: [a-z0-9.-], with everything else replaced by hyphens; no two dots in a row.
pub fn slug(text: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c.to_ascii_lowercase() } else { '-' };
    let slug: String = text.chars().take(96).map(plain).collect();
    slug.replace("..", "--").trim_matches(['-', '.']).to_owned()
}

fn value(cell: &Cell) -> Value {
    match cell {
        Cell::Null => Value::Null,
        Cell::Text(v) => json!(v),
        Cell::F64(v) => json!(v),
        Cell::I64(v) => json!(v),
        Cell::Bool(v) => json!(v),
        Cell::F32List(v) => list(v.iter().map(|v| f64::from(*v))),
        Cell::F64List(v) => list(v.iter().copied()),
    }
}

/// Floats as an array, with null for values that are not finite.
fn list(values: impl Iterator<Item = f64>) -> Value {
    values.map(|v| value(&number(v))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_schemas::tables::{PsdRow, TerrainRow};

    #[test]
    fn val_lists_are_arrays_with_null_for_absent_values() {
        assert_eq!(value(&Cell::F32List(vec![0.5, f32::NAN])), json!([0.5, null]));
        assert_eq!(value(&Cell::F64List(vec![f64::INFINITY, -2.25])), json!([null, -2.25]));
        assert_eq!(value(&Cell::F64List(vec![])), json!([]));
    }

    #[test]
    fn val_slugs_are_file_names() {
        assert_eq!(slug("psd-2.30"), "psd-2.30");
        assert_eq!(slug("../../etc/Passwd <x>"), "etc-passwd--x");
        assert_eq!(slug("a/../b"), "a----b");
    }

    #[test]
    fn val_selected_columns_keep_name_unit_and_order() {
        let row = PsdRow { surface_id: "a".into(), bin: 0, frequency_cycles_m: 0.5, psd_m4: f64::NAN, modes: 4 };
        let numbers = Numbers::select("modes > 3", [&row], &["modes", "psd_m4", "surface_id"]);
        let names: Vec<&str> = numbers.columns.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["modes", "psd_m4", "surface_id"]);
        assert_eq!(numbers.query, "select modes, psd_m4, surface_id from 'tables/psd/*.parquet' where modes > 3");
        assert_eq!(numbers.columns[1].unit, "m4");
        let json = numbers.to_json("x", "t");
        assert_eq!(json["rows"][0], json!([4, null, "a"]));
        assert_eq!((&json["id"], &json["title"], &json["query_gives"]), (&json!("x"), &json!("t"), &json!("rows")));
    }

    /// `group` is a word of SQL; without a condition, all rows are selected.
    #[test]
    fn val_queries_quote_words_of_sql() {
        let none: [&TerrainRow; 0] = [];
        let numbers = Numbers::select("", none, &["terrain_id", "group"]);
        assert_eq!(numbers.query, "select terrain_id, \"group\" from 'tables/terrains/*.parquet'");
        assert_eq!((numbers.gives, numbers.rows.len(), numbers.mixed), (Gives::Rows, 0, false));
        let names: Vec<&str> = numbers.columns.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["terrain_id", "group"]);
    }

    /// A sample states of how many rows it is one; all rows state nothing.
    #[test]
    fn val_samples_say_so() {
        let of_all = |all: usize| {
            let mut numbers = Numbers::new("q", &[("n", "1")]);
            (0..2).for_each(|n| numbers.row([count(n)]));
            numbers.of_all(all).to_json("x", "t")
        };
        assert_eq!(
            of_all(2).to_string(),
            r#"{"id":"x","title":"t","query":"q","query_gives":"rows","columns":[{"name":"n","unit":"1"}],"rows":[[0],[1]]}"#
        );
        assert_eq!((&of_all(9)["random_sample_of"], &of_all(9)["rows"]), (&json!(9), &json!([[0], [1]])));
    }

    #[test]
    #[should_panic(expected = "table psd lacks some of the columns")]
    fn val_unknown_columns_are_a_bug() {
        let none: [&PsdRow; 0] = [];
        Numbers::select("", none, &["modes", "modus"]);
    }

    #[test]
    fn val_blocks_without_content_are_empty() {
        let table = |rows: usize| {
            let mut numbers = Numbers::new("", &[("n", "1")]);
            (0..rows).for_each(|n| numbers.row([count(n)]));
            TableBlock { id: "t".into(), caption: "c".into(), numbers }
        };
        assert!(Block::Table(table(0)).is_empty() && Block::FoldedTable(table(0)).is_empty());
        assert!(!Block::Table(table(1)).is_empty() && !Block::FoldedTable(table(1)).is_empty());
        let warnings = |sentences: &[&str]| {
            let sentences = sentences.iter().map(|s| (*s).to_owned()).collect();
            Block::Warnings { summary: "s".into(), sentences }
        };
        assert!(warnings(&[]).is_empty() && !warnings(&["w"]).is_empty());
        assert!(Block::Figures(Vec::new()).is_empty() && !Block::Heading("h".into()).is_empty());
    }
}
