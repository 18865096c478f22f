//! The page: one file that contains its style, figures and tables and makes no network request.

use super::number;
use super::svg::escape;
use crate::content::{Block, Figure, Gives, Heading, Numbers, Section, TableBlock};
use sastrugi_schemas::Cell;

/// Style of the page.
const STYLE: &str = include_str!("style.css");
/// Most rows of a figure's numbers that are repeated in the page.
const FIGURE_ROWS_MAX: usize = 60;
/// Most rows of a table that are printed in the page.
const TABLE_ROWS_MAX: usize = 1500;

/// On a narrow screen, a table with more columns than this becomes a list of cards, unless it has more than [`CARD_ROWS_MAX`] rows.
const CARD_COLUMNS_MIN: usize = 3;
const CARD_ROWS_MAX: usize = 100;

/// Bytes of text above which a cell has a line of its card to itself.
const CARD_TEXT: usize = 13;
/// Bytes of text above which a cell may wrap.
const LONG_TEXT: usize = 48;

/// Head of the page, above the sections.
#[derive(Clone, Debug)]
pub struct Head {
    /// Title of the release.
    pub title: String,
    /// A paragraph about it; may be empty.
    pub description: String,
    /// Facts in order: name, value.
    pub facts: Vec<(String, String)>,
    /// Key counts: value, and what is counted.
    pub numbers: Vec<(String, String)>,
}

/// The complete page.
pub fn page(head: &Head, sections: &[Section]) -> String {
    let title = escape(&head.title);
    let links: String = sections.iter().map(|s| format!("<a href=\"#{}\">{}</a>", s.id, escape(s.name))).collect();
    let body: String = sections.iter().map(section).collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <header>\n<p class=\"kicker\">sastrugi release report</p>\n<h1>{title}</h1>\n{}</header>\n\
         <nav aria-label=\"Sections\">{links}</nav>\n<main>\n{body}</main>\n{FOOTER}</body>\n</html>\n",
        head_parts(head)
    )
}

const FOOTER: &str = "<footer><p>This page is self-contained and needs no network. Next to it, <code>figures/</code> \
has every figure as SVG and <code>data/</code> the numbers behind it as JSON. The tables of the release are in \
<code>tables/</code> as Parquet.</p></footer>\n";

fn head_parts(head: &Head) -> String {
    let description = if head.description.is_empty() { String::new() } else { paragraph("lead", &head.description) };
    let pair =
        |(name, value): &(String, String)| format!("<div><dt>{}</dt><dd>{}</dd></div>", escape(name), fact(value));
    let facts: String = head.facts.iter().map(pair).collect();
    let item = |(value, what): &(String, String)| format!("<li><b>{}</b> {}</li>", escape(value), escape(what));
    let numbers: String = head.numbers.iter().map(item).collect();
    let numbers = if numbers.is_empty() { numbers } else { format!("<ul class=\"key\">{numbers}</ul>\n") };
    format!("{description}<dl class=\"facts\">{facts}</dl>\n{numbers}")
}

/// A value in the head of the page; a hash is set as code.
fn fact(value: &str) -> String {
    let hash = value.len() == 64 && value.chars().all(|c| c.is_ascii_hexdigit());
    if hash { format!("<code>{value}</code>") } else { escape(value) }
}

fn section(section: &Section) -> String {
    let blocks: String = section.blocks.iter().map(block).collect();
    format!("<section id=\"{}\">\n<h2>{}</h2>\n{blocks}</section>\n", section.id, escape(section.title))
}

fn block(block: &Block) -> String {
    match block {
        Block::Heading(text) => format!("<h3>{}</h3>\n", escape(text)),
        Block::Text(text) => paragraph("", text),
        Block::Warning(text) => paragraph("warning", text),
        Block::Warnings { summary, sentences } => warnings(summary, sentences),
        Block::Figures(figures) => figure_grid(figures),
        Block::Table(t) => table_block(t),
        Block::FoldedTable(t) => {
            let rows = number::counted(t.numbers.rows.len(), "row");
            let summary = format!("{} ({rows}{})", t.caption, sampled(&t.numbers));
            folded(&summary, &t.id, &table_block(t))
        }
    }
}

/// Of how many rows these are a sample, in words; empty if these are all.
fn sampled(numbers: &Numbers) -> String {
    numbers.sampled_of.map_or_else(String::new, |all| format!(", a random sample of the {}", number::count(all)))
}

/// A single sentence is shown; several are folded under their summary.
fn warnings(summary: &str, sentences: &[String]) -> String {
    if let [only] = sentences {
        return paragraph("warning", only);
    }
    let items: String = sentences.iter().map(|s| format!("<li>{}</li>\n", escape(s))).collect();
    format!("<details class=\"warning\"><summary>{}</summary>\n<ul>\n{items}</ul></details>\n", escape(summary))
}

fn paragraph(class: &str, text: &str) -> String {
    let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
    format!("<p{class}>{}</p>\n", escape(text))
}

fn figure_grid(figures: &[Figure]) -> String {
    format!("<div class=\"figures\">\n{}</div>\n", figures.iter().map(figure).collect::<String>())
}

fn figure(figure: &Figure) -> String {
    let id = escape(&figure.id);
    let svg = figure.svg.finish(&figure.id, &figure.title, &figure.description);
    let numbers = match figure.numbers.rows.len() {
        0 => String::new(),
        1..=FIGURE_ROWS_MAX => folded("Numbers", &figure.id, &table(&figure.numbers, &figure.title)),
        n => format!(" <span>({} rows{})</span>", number::count(n), sampled(&figure.numbers)),
    };
    format!(
        "<figure id=\"fig-{id}\">\n{svg}<figcaption><b>{}</b> {}<div class=\"links\"><a href=\"figures/{id}.svg\">SVG</a> \
         <a href=\"data/{id}.json\">JSON</a>{}{numbers}</div></figcaption>\n</figure>\n",
        escape(&figure.title),
        escape(&figure.caption),
        source(&figure.numbers, &figure.id),
    )
}

/// Source of the numbers: the name of a file, or a folded query.
fn source(numbers: &Numbers, id: &str) -> String {
    let query = format!("<code>{}</code>", escape(&numbers.query));
    match numbers.gives {
        Gives::File => format!(" <span>from {query}</span>"),
        Gives::Rows => folded("Query", id, &query),
        Gives::Input => folded("Query for the input", id, &query),
    }
}

/// Folded content; in print, its summary names the file that contains it.
fn folded(summary: &str, id: &str, content: &str) -> String {
    let (summary, id) = (escape(summary), escape(id));
    format!("<details><summary data-file=\"data/{id}.json\">{summary}</summary>\n{content}</details>\n")
}

fn table_block(block: &TableBlock) -> String {
    let id = escape(&block.id);
    format!(
        "{}<div class=\"links\"><a href=\"data/{id}.json\">JSON</a>{}</div>\n",
        table(&block.numbers, &block.caption),
        source(&block.numbers, &block.id)
    )
}

fn table(numbers: &Numbers, caption: &str) -> String {
    let head: String = numbers.columns.iter().enumerate().map(|(i, c)| heading(c, numeric(numbers, i))).collect();
    let decimals: Vec<Option<usize>> = (0..numbers.columns.len()).map(|i| decimals(numbers, i)).collect();
    let cards = numbers.columns.len() > CARD_COLUMNS_MIN && numbers.rows.len() <= CARD_ROWS_MAX;
    let labels: Vec<String> = numbers.columns.iter().map(|c| if cards { label(c) } else { String::new() }).collect();
    let format = |i: usize| Format { decimals: decimals[i], label: &labels[i] };
    let formats: Vec<Format> = (0..labels.len()).map(format).collect();
    let rows: String = numbers.rows.iter().take(TABLE_ROWS_MAX).map(|r| row(r, &formats)).collect();
    let class = if cards { "scroll cards" } else { "scroll" };
    let caption = match numbers.rows.len().saturating_sub(TABLE_ROWS_MAX) {
        0 => escape(caption),
        _ => format!(
            "{} (first {TABLE_ROWS_MAX} of {} rows{})",
            escape(caption),
            number::count(numbers.rows.len()),
            sampled(numbers)
        ),
    };
    format!(
        "<div class=\"{class}\" tabindex=\"0\" role=\"region\" aria-label=\"{caption}\"><table><caption>{caption}</caption>\n\
         <thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n"
    )
}

/// True for a column of numbers.
fn numeric(numbers: &Numbers, column: usize) -> bool {
    let mut cells = numbers.rows.iter().filter_map(|r| r.get(column));
    cells.find(|c| **c != Cell::Null).is_some_and(|c| matches!(c, Cell::F64(_) | Cell::I64(_)))
}

/// Decimals of a column: four digits for its largest number, two for its smallest. `None` if that takes more than five
/// digits, if the numbers are very large or small, or if their units differ.
fn decimals(numbers: &Numbers, column: usize) -> Option<usize> {
    if numbers.mixed {
        return None;
    }
    let magnitude = |row: &Vec<Cell>| match row.get(column) {
        Some(Cell::F64(v)) if *v != 0.0 => Some(v.abs()),
        _ => None,
    };
    let magnitudes = || numbers.rows.iter().filter_map(magnitude);
    if magnitudes().all(|v| v.fract() == 0.0) {
        return Some(0);
    }
    let (low, high) = (magnitudes().fold(f64::INFINITY, f64::min), magnitudes().fold(0.0, f64::max));
    let reaches =
        |v: f64, digits: f64| (0..=6).find(|d| v * libm::pow(10.0, f64::from(*d)) >= libm::pow(10.0, digits - 1.0));
    let places: i32 = reaches(high, 4.0)?.max(reaches(low, 2.0)?);
    (high * libm::pow(10.0, f64::from(places)) < 1e5).then_some(usize::try_from(places).unwrap_or(0))
}

fn heading(heading: &Heading, numeric: bool) -> String {
    let name = escape(&heading.name).replace('_', "_<wbr>");
    let unit = match number::unit(&heading.unit) {
        u if u.is_empty() => u,
        u => format!("<br><small>{}</small>", escape(&u)),
    };
    let class = if numeric { " class=\"n\"" } else { "" };
    format!("<th scope=\"col\"{class}>{name}{unit}</th>")
}

/// Name and unit of a column, as the label of a number in a card.
fn label(heading: &Heading) -> String {
    let unit = match number::unit(&heading.unit) {
        unit if unit.is_empty() => unit,
        unit => format!(", {unit}"),
    };
    format!(" data-label=\"{}{}\"", escape(&heading.name), escape(&unit))
}

/// How the cells of a column are set.
struct Format<'a> {
    decimals: Option<usize>,
    /// Attribute that names the column; empty if rows are not cards.
    label: &'a str,
}

fn row(cells: &[Cell], formats: &[Format]) -> String {
    let cells: String = cells.iter().zip(formats).map(cell).collect();
    format!("<tr>{cells}</tr>\n")
}

fn cell((cell, format): (&Cell, &Format)) -> String {
    let (class, text) = match cell {
        Cell::Null => ("n", number::ABSENT.to_owned()),
        Cell::Text(v) => (class_of_text(v), escape(v)),
        Cell::F64(v) => ("n", format.decimals.map_or_else(|| number::plain(*v, 4), |d| number::fixed(*v, d))),
        Cell::I64(v) => ("n", v.to_string()),
        Cell::Bool(v) => ("", if *v { "yes" } else { "no" }.to_owned()),
        Cell::F32List(v) => ("", list(v.iter().map(|v| f64::from(*v)))),
        Cell::F64List(v) => ("", list(v.iter().copied())),
    };
    let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
    format!("<td{class}{}>{text}</td>", format.label)
}

fn class_of_text(text: &str) -> &'static str {
    match text.len() {
        n if n > LONG_TEXT => "w",
        n if n > CARD_TEXT => "l",
        _ => "",
    }
}

fn list(values: impl Iterator<Item = f64>) -> String {
    let figure = |v: f64| if v.is_finite() { number::plain(v, 4) } else { number::ABSENT.to_owned() };
    values.map(figure).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::content::number as figure;

    /// A table of `rows` rows and `columns` columns.
    fn numbers(rows: usize, columns: usize) -> Numbers {
        let mut numbers = Numbers::new("", &vec![("n", "m2"); columns]);
        (0..rows).for_each(|n| numbers.row(vec![Cell::I64(n as i64); columns]));
        numbers
    }

    /// The page prints 1500 rows of a table and states how many there are.
    #[test]
    fn val_long_tables_are_cut_and_say_so() {
        let [whole, cut] = [1500, 1501].map(|rows| table(&numbers(rows, 2), "caption"));
        assert!(!whole.contains("first") && whole.contains("<caption>caption</caption>"));
        assert!(cut.contains("<caption>caption (first 1500 of 1501 rows)</caption>"));
        // The head is a row, too.
        assert_eq!([&whole, &cut].map(|t| t.matches("<tr>").count()), [1501; 2]);
        assert!(whole.contains(">1499<") && cut.contains(">1499<") && !cut.contains(">1500<"));
    }

    /// Four columns or more turn into cards with labels on a narrow screen, unless there are more than 100 rows.
    #[test]
    fn val_wide_tables_become_cards() {
        let cards = |rows: usize, columns: usize| {
            let table = table(&numbers(rows, columns), "c");
            assert_eq!(table.contains("class=\"scroll cards\""), table.contains("data-label=\"n, m²\""));
            table.contains("cards")
        };
        assert_eq!([cards(100, 4), cards(101, 4), cards(100, 3)], [true, false, false]);
    }

    #[test]
    fn val_cells_are_set_by_their_type() {
        let format = Format { decimals: Some(2), label: "" };
        let of = |one: Cell| cell((&one, &format));
        assert_eq!(of(Cell::Null), "<td class=\"n\">–</td>");
        assert_eq!(of(Cell::F64(-0.25)), "<td class=\"n\">−0.25</td>");
        assert_eq!(of(Cell::I64(-3)), "<td class=\"n\">-3</td>");
        assert_eq!([of(Cell::Bool(true)), of(Cell::Bool(false))], ["<td>yes</td>", "<td>no</td>"]);
        assert_eq!(of(Cell::Text("a<b".into())), "<td>a&lt;b</td>");
        assert_eq!(of(Cell::F64List(vec![0.5, f64::NAN])), "<td>0.5, –</td>");
    }

    #[test]
    fn val_decimals_of_a_column() {
        let of = |values: &[f64]| {
            let rows = values.iter().map(|v| vec![figure(*v)]).collect();
            decimals(&Numbers { rows, ..Numbers::new("", &[("x", "")]) }, 0)
        };
        assert_eq!(of(&[84.75, 0.73, f64::NAN]), Some(2));
        assert_eq!(of(&[100.0, 0.6377]), Some(2));
        assert_eq!(of(&[9023.4, 0.05]), None);
        assert_eq!(of(&[20.0, 400.0, 0.0]), Some(0));
        assert_eq!(of(&[1e-9, 2e-9]), None);
        assert_eq!(of(&[]), Some(0));
    }
}
