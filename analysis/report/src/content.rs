//! What a question answers with: text, figures and tables, each with the numbers behind it.

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

/// A part of a section.
#[derive(Clone, Debug)]
pub enum Block {
    /// A smaller heading.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// A sentence the reader must not miss.
    Warning(String),
    /// Several such sentences, one click away under words that say what they are about.
    Warnings {
        /// What they are about.
        summary: String,
        /// Sentences.
        sentences: Vec<String>,
    },
    /// Figures side by side.
    Figures(Vec<Figure>),
    /// A table that is shown.
    Table(TableBlock),
    /// A table that is folded away.
    FoldedTable(TableBlock),
}

impl Block {
    /// True when it would leave an empty box on the page.
    pub fn is_empty(&self) -> bool {
        match self {
            Self::Heading(_) | Self::Text(_) | Self::Warning(_) => false,
            Self::Warnings { sentences, .. } => sentences.is_empty(),
            Self::Figures(figures) => figures.is_empty(),
            Self::Table(table) | Self::FoldedTable(table) => table.numbers.rows.is_empty(),
        }
    }
}

/// A table with its caption.
#[derive(Clone, Debug)]
pub struct TableBlock {
    /// Name of its file under `data/`, without ending.
    pub id: String,
    /// Caption.
    pub caption: String,
    /// What it holds.
    pub numbers: Numbers,
}

/// A figure.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name of its files, without ending.
    pub id: String,
    /// Title.
    pub title: String,
    /// What is seen, how it was made, what to mind.
    pub caption: String,
    /// The same in words for those who do not see it: the main figures.
    pub description: String,
    /// Drawing.
    pub svg: Svg,
    /// Numbers behind it.
    pub numbers: Numbers,
}

/// Numbers behind a figure or in a table, and where in the release they come from.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// Query of duckdb in the folder of the release, or a file.
    pub query: String,
    /// What the query gives.
    pub gives: Gives,
    /// Name and unit of each column.
    pub columns: Vec<Heading>,
    /// Rows, each as long as `columns`.
    pub rows: Vec<Vec<Cell>>,
    /// True where the rows of a column have units of their own: each figure is then set by its own digits.
    pub mixed: bool,
}

/// What a query gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Gives {
    /// The rows themselves, in any order.
    Rows,
    /// What they are computed from.
    Input,
    /// It is a file.
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
    /// No rows yet.
    pub fn new(query: impl Into<String>, columns: &[(&str, &str)]) -> Self {
        let columns = columns.iter().map(|&(name, unit)| Heading { name: name.into(), unit: unit.into() }).collect();
        Self { query: query.into(), gives: Gives::Rows, columns, rows: Vec::new(), mixed: false }
    }

    /// No rows yet, which are computed from what the query gives.
    pub fn computed(query: impl Into<String>, columns: &[(&str, &str)]) -> Self {
        Self { gives: Gives::Input, ..Self::new(query, columns) }
    }

    /// No rows yet, about a file.
    pub fn of_file(path: impl Into<String>, columns: &[(&str, &str)]) -> Self {
        Self { gives: Gives::File, ..Self::new(path, columns) }
    }

    /// The same for rows that have units of their own.
    pub fn with_mixed_units(self) -> Self {
        Self { mixed: true, ..self }
    }

    /// Columns of the rows of a table of the release that meet a condition (all where it is empty), with the names and units of the
    /// contract.
    ///
    /// # Panics
    /// When the table has no column of such a name (a bug of the caller).
    pub fn select<'a, R: Record + 'a>(condition: &str, rows: impl IntoIterator<Item = &'a R>, names: &[&str]) -> Self {
        let all = R::TABLE.columns;
        let indices: Vec<usize> = names.iter().filter_map(|n| R::TABLE.position(n)).collect();
        assert_eq!(indices.len(), names.len(), "table {} has not all columns of {names:?}", R::TABLE.name);
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
        json!({ "id": id, "title": title, "query": self.query, "query_gives": self.gives, "columns": self.columns, "rows": rows })
    }
}

/// Text cell.
pub fn text(value: impl Into<String>) -> Cell {
    Cell::Text(value.into())
}

/// Number cell; what is not finite is null.
pub fn number(value: f64) -> Cell {
    if value.is_finite() { Cell::F64(value) } else { Cell::Null }
}

/// Count cell.
pub fn count(n: usize) -> Cell {
    i64::try_from(n).map_or(Cell::Null, Cell::I64)
}

/// Text as a part of a file name and of an anchor: [a-z0-9.-], everything else a hyphen; no two points in a row.
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

/// Floats as an array; what is not finite is null.
fn list(values: impl Iterator<Item = f64>) -> Value {
    values.map(|v| value(&number(v))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_schemas::tables::PsdRow;

    #[test]
    fn val_lists_are_arrays_with_null_for_what_is_absent() {
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
    }
}
