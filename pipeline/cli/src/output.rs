//! Results on stdout: JSON for machines, aligned lines for people; messages on stderr.

use crate::failure::{Code, Failure};
use miette::{GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteDiagnostic, NamedSource, Report};
use sastrugi_stages::Error;
use sastrugi_stages::study::{Refusals, StudyError};
use serde::Serialize;
use serde_json::Value;
use std::io::{BufWriter, IsTerminal, Write};
use std::ops::Range;

/// Places in or beside a longer line are given by line and column only: drawing it is useless, and `miette` counts columns in 16 bits.
const COLUMNS_SHOWN: usize = 1000;

/// Maximum number of errors that are drawn; a file that is not a study would give thousands.
const REFUSALS_SHOWN: usize = 100;

/// Prints the value as JSON on request, otherwise the text.
///
/// # Errors
/// If stdout cannot be written.
pub fn print(json: bool, value: &Value, text: &str) -> Result<(), Failure> {
    print_long(json, value, text)
}

/// The same for a value that may be very long, such as the plan of a million items: it is written piece by piece.
///
/// # Errors
/// As [`print`].
pub fn print_long(json: bool, value: &impl Serialize, text: &str) -> Result<(), Failure> {
    let mut out = BufWriter::new(std::io::stdout().lock());
    let written = if json {
        let written = serde_json::to_writer_pretty(&mut out, value).map_err(std::io::Error::from);
        written.and_then(|()| writeln!(out))
    } else {
        writeln!(out, "{}", text.trim_end())
    };
    match written.and_then(|()| out.flush()) {
        // A reader that closes the pipe early (`| head`) is not a failure.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(Failure::failed),
    }
}

/// Prints a line on stderr. A closed stderr is ignored.
pub fn warn(line: &str) {
    drop(writeln!(std::io::stderr(), "{line}"));
}

/// Prints the message of a failure on stderr and returns the exit code.
pub fn report(failure: Failure) -> Code {
    let code = failure.code();
    match failure.0 {
        Error::Study { name, text, refusals } => print_refusals(&name, &text, &refusals),
        Error::Usage(m) | Error::Input(m) | Error::Failed(m) | Error::Retry(m) => warn(&format!("sastrugi: {m}")),
    }
    code
}

/// Prints the errors in a study, each with its source line.
fn print_refusals(name: &str, text: &str, refusals: &Refusals) {
    let Refusals(errors) = refusals;
    let number = if errors.len() == 1 { String::new() } else { format!(": {} errors", errors.len()) };
    let drawn: Vec<String> = errors.iter().take(REFUSALS_SHOWN).map(|error| drawn(name, text, error)).collect();
    warn(&format!("sastrugi: invalid study{number}\n{}", drawn.join("\n")));
    if errors.len() > REFUSALS_SHOWN {
        warn(&format!("... and {} more", errors.len() - REFUSALS_SHOWN));
    }
}

fn drawn(name: &str, text: &str, error: &StudyError) -> String {
    let mut diagnostic = MietteDiagnostic::new(error.message.clone());
    match error.span.clone() {
        Some(span) if is_narrow(text, &span) => diagnostic = diagnostic.with_label(LabeledSpan::underline(span)),
        Some(span) => {
            let before = text.get(..span.start).unwrap_or(text);
            let (line, column) = (1 + before.matches('\n').count(), 1 + last_line(before).chars().count());
            diagnostic = MietteDiagnostic::new(format!("{} (line {line}, column {column})", error.message));
        }
        None => {}
    }
    if let Some(help) = error.help.clone() {
        diagnostic = diagnostic.with_help(help);
    }
    let report = Report::new(diagnostic).with_source_code(NamedSource::new(name, text.to_owned()));
    let colours = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let theme = if colours { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let mut rendered = String::new();
    let handler = GraphicalReportHandler::new_themed(theme).with_width(100);
    match handler.render_report(&mut rendered, report.as_ref()) {
        Ok(()) => rendered.trim_end_matches('\n').to_owned(),
        Err(_) => format!("{name}: {}", error.message),
    }
}

/// Whether the lines of a span are short enough to draw, and the lines before and after it, which are drawn as well.
fn is_narrow(text: &str, span: &Range<usize>) -> bool {
    let before = text.get(..span.start).and_then(|before| before.rmatch_indices('\n').nth(1));
    let after = text.get(span.end..).and_then(|after| after.match_indices('\n').nth(1));
    let start = before.map_or(0, |(at, _)| at + 1);
    let end = after.map_or(text.len(), |(at, _)| span.end + at);
    text.get(start..end).is_some_and(|lines| lines.lines().all(|line| line.len() <= COLUMNS_SHOWN))
}

fn last_line(text: &str) -> &str {
    text.rsplit('\n').next().unwrap_or_default()
}

/// Rows of cells in aligned columns.
pub fn columns(rows: &[Vec<String>]) -> String {
    let width = |column: usize| rows.iter().filter_map(|r| r.get(column)).map(|c| c.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..rows.iter().map(Vec::len).max().unwrap_or(0)).map(width).collect();
    // Not by a width in the format, which may be 65 535 at most.
    let padded = |(cell, width): (&String, &usize)| cell.to_owned() + &" ".repeat(width - cell.chars().count());
    let line = |row: &Vec<String>| {
        let cells: Vec<String> = row.iter().zip(&widths).map(padded).collect();
        cells.join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// A size with unit.
pub fn bytes(count: f64) -> String {
    let steps = [(1e9, "GB"), (1e6, "MB"), (1e3, "kB")];
    match steps.iter().find(|(size, _)| count >= *size) {
        Some((size, unit)) => format!("{:.1} {unit}", count / size),
        None => format!("{count:.0} bytes"),
    }
}

/// A duration with unit.
pub fn seconds(count: f64) -> String {
    if count < 90.0 { format!("{count:.1} s") } else { format!("{:.1} min", count / 60.0) }
}

/// A number to four significant digits, without an exponent.
pub fn significant(value: f64) -> String {
    let scientific = format!("{value:.3e}");
    let exponent: i32 = scientific.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0);
    let decimals = (3 - exponent).clamp(0, 12) as usize;
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_columns_may_be_wide() {
        let wide = "y".repeat(70_000);
        let rows = [vec!["a".to_owned(), wide.clone()], vec!["bcd".to_owned(), "é".to_owned()]];
        assert_eq!(columns(&rows), format!("a    {wide}\nbcd  é"));
        let rows = [vec![wide.clone(), "z".to_owned()], vec!["é".to_owned(), "z".to_owned()]];
        assert_eq!(columns(&rows), format!("{wide}  z\né{}  z", " ".repeat(69_999)));
    }

    #[test]
    fn val_only_short_lines_are_drawn() {
        let text = format!("a = 1\nb = 2\nc = \"{}\" x\nd = 3\ne = 4\n", "y".repeat(70_000));
        let at = |word: &str| text.find(word).unwrap();
        let is_drawn = |word: &str| is_narrow(&text, &(at(word)..at(word) + 1));
        assert!(is_drawn("a =") && is_drawn("e =") && is_narrow(&text, &(text.len() - 2..text.len())));
        // The long line itself, and its neighbours, with which it would be drawn.
        assert!(!is_drawn("x\n") && !is_drawn("b =") && !is_drawn("d ="));
        assert!(!is_narrow(&text, &(0..text.len())) && !is_narrow(&text, &(0..text.len() + 9)));
    }

    #[test]
    fn val_numbers_for_people() {
        let sizes = [0.0, 999.0, 1000.0, 1.5e6, 2.34e9].map(bytes);
        assert_eq!(sizes, ["0 bytes", "999 bytes", "1.0 kB", "1.5 MB", "2.3 GB"]);
        assert_eq!([0.0, 89.9, 90.0, 600.0].map(seconds), ["0.0 s", "89.9 s", "1.5 min", "10.0 min"]);
        // Rounding up may take one digit more before the point.
        let numbers = [0.0, -0.5, 1.0, 9.9996, 1234.6, 123_456.0, 0.000_123_456, 1e-20, f64::NAN].map(significant);
        let expected = ["0.000", "-0.5000", "1.000", "10.00", "1235", "123456", "0.0001235", "0.000000000000", "NaN"];
        assert_eq!(numbers, expected);
    }

    /// Two spaces between columns, as wide as the widest cell in characters; rows may be short.
    #[test]
    fn val_columns_are_aligned() {
        let rows = [vec!["σ", "b", "x"], vec!["long", "", ""], vec!["c"]];
        let rows = rows.map(|row| row.into_iter().map(str::to_owned).collect::<Vec<_>>());
        assert_eq!(columns(&rows), "σ     b  x\nlong\nc");
        assert_eq!(columns(&[]), "");
    }
}
