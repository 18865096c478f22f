//! Flat tables as CSV (RFC 4180), for spreadsheets and scripts.
//!
//! One header row, commas, lines that end in LF. A number is the shortest text that reads back as the same 64-bit number, with
//! a decimal point; missing values (NaN, null) are empty; open ends are `inf` and `-inf`. The elements of a list are separated
//! by blanks. Text with a comma, a quote or a line break is quoted.

use crate::atomic;
use sastrugi_schemas::{Cell, Record};
use std::io;
use std::path::Path;

/// Writes rows below a header of column names, in the given order.
///
/// # Errors
/// The file system failed.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_schemas::Cell;
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("a.csv");
/// let row = vec![Cell::Text("dune, flat".to_owned()), Cell::F64(0.5), Cell::F64(f64::NAN), Cell::I64(3)];
/// sastrugi_store::csv::write_rows(&path, &["name", "sigma_m", "b_m", "count"], [row])?;
/// assert_eq!(std::fs::read_to_string(&path)?, "name,sigma_m,b_m,count\n\"dune, flat\",0.5,,3\n");
/// # Ok(())
/// # }
/// ```
pub fn write_rows(path: &Path, columns: &[&str], rows: impl IntoIterator<Item = Vec<Cell>>) -> io::Result<()> {
    atomic::write(path, text(columns, rows).as_bytes())
}

/// Writes the rows of a table, in the given order.
///
/// # Errors
/// The file system failed.
pub fn write_records<R: Record>(path: &Path, rows: &[R]) -> io::Result<()> {
    let columns: Vec<&str> = R::TABLE.columns.iter().map(|c| c.name).collect();
    write_rows(path, &columns, rows.iter().map(Record::cells))
}

fn text(columns: &[&str], rows: impl IntoIterator<Item = Vec<Cell>>) -> String {
    let mut text = line(columns.iter().map(|name| quoted(name)));
    rows.into_iter().for_each(|cells| text.push_str(&line(cells.iter().map(field))));
    text
}

fn line(fields: impl Iterator<Item = String>) -> String {
    fields.collect::<Vec<_>>().join(",") + "\n"
}

fn field(cell: &Cell) -> String {
    match cell {
        Cell::Null => String::new(),
        Cell::Text(text) => quoted(text),
        Cell::F64(value) => number(*value),
        Cell::I64(value) => value.to_string(),
        Cell::Bool(value) => value.to_string(),
        Cell::F32List(values) => values.iter().map(|v| number(f64::from(*v))).collect::<Vec<_>>().join(" "),
        Cell::F64List(values) => values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(" "),
    }
}

/// The shortest text that reads back as the number: `0.5`, `1e-7`.
fn number(value: f64) -> String {
    if value.is_nan() { String::new() } else { format!("{value:?}") }
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_fields_are_formatted_as_documented() {
        let row = vec![
            Cell::Text("a, \"b\"".into()),
            Cell::F64(1e-7),
            Cell::F64(f64::INFINITY),
            Cell::F64(f64::NAN),
            Cell::Null,
            Cell::I64(-3),
            Cell::F64List(vec![0.5, 2.0]),
        ];
        let names = ["name", "x_m", "high_m", "nan", "none", "n", "list"];
        assert_eq!(text(&names, [row]), "name,x_m,high_m,nan,none,n,list\n\"a, \"\"b\"\"\",1e-7,inf,,,-3,0.5 2.0\n");
    }

    #[test]
    fn prop_numbers_read_back_as_they_were() {
        for value in [0.1 + 0.2, 1.0 / 3.0, 1e-300, -123_456_789.123, f64::MIN_POSITIVE] {
            assert_eq!(number(value).parse::<f64>(), Ok(value));
        }
    }
}
