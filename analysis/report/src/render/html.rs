//! The page: one file that contains its style, figures and tables and makes no network request.

use super::number;
use super::svg::escape;
use crate::content::{Block, Figure, Gives, Heading, Numbers, Section, TableBlock};
use sastrugi_schemas::Cell;
use std::collections::BTreeMap;

/// Style of the page.
const STYLE: &str = include_str!("style.css");
/// Most rows of a figure's numbers that are repeated in the page.
const FIGURE_ROWS_MAX: usize = 60;
/// Most rows of a table that are printed in the page.
const TABLE_ROWS_MAX: usize = 1500;

/// A table with more rows is folded under its caption.
const OPEN_ROWS_MAX: usize = 100;

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
        Block::Text(text) | Block::Result(text) => paragraph("", text),
        Block::Warning(text) => paragraph("warning", text),
        Block::Warnings { summary, sentences } => warnings(summary, sentences),
        Block::Figures(figures) => figure_grid(figures),
        Block::Table(t) if t.numbers.rows.len() <= OPEN_ROWS_MAX => table_block(t),
        Block::Table(t) | Block::FoldedTable(t) => {
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
    let items: String = sentences.iter().map(|s| format!("<li>{}</li>\n", set(s))).collect();
    format!("<details class=\"warning\"><summary>{}</summary>\n<ul>\n{items}</ul></details>\n", set(summary))
}

fn paragraph(class: &str, text: &str) -> String {
    let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
    format!("<p{class}>{}</p>\n", set(text))
}

/// Words as markup: what is between two backticks is set as code. A backtick without a second one stays.
fn set(words: &str) -> String {
    let parts: Vec<&str> = words.split('`').collect();
    let last = parts.len() - 1;
    let part = |(i, part): (usize, &&str)| match i % 2 {
        1 if i < last => format!("<code>{}</code>", escape(part)),
        1 => format!("`{}", escape(part)),
        _ => escape(part),
    };
    parts.iter().enumerate().map(part).collect()
}

/// Markup of [`set`] as an attribute: without code spans.
fn without_tags(markup: &str) -> String {
    markup.replace("<code>", "").replace("</code>", "")
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
        set(&figure.title),
        set(&figure.caption),
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
    let (summary, id) = (set(summary), escape(id));
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
    let cards = numbers.columns.len() > CARD_COLUMNS_MIN && numbers.rows.len() <= CARD_ROWS_MAX;
    let columns = columns(numbers);
    let head: String = columns.iter().map(heading).collect();
    let labels: Vec<String> = columns.iter().map(|c| if cards { label(&c.heading) } else { String::new() }).collect();
    let decimals = decimals_by_measure(numbers, &columns);
    let row = |cells: &Vec<Cell>| {
        let decimals = decimals.get(&measure(numbers, cells)).into_iter().flatten().copied();
        row(cells, columns.iter().zip(decimals).zip(&labels))
    };
    let rows: String = numbers.rows.iter().take(TABLE_ROWS_MAX).map(row).collect();
    let class = if cards { "scroll cards" } else { "scroll" };
    let caption = match numbers.rows.len().saturating_sub(TABLE_ROWS_MAX) {
        0 => set(caption),
        _ => format!(
            "{} (first {TABLE_ROWS_MAX} of {} rows{})",
            set(caption),
            number::count(numbers.rows.len()),
            sampled(numbers)
        ),
    };
    let name = without_tags(&caption);
    format!(
        "<div class=\"{class}\" tabindex=\"0\" role=\"region\" aria-label=\"{name}\"><table><caption>{caption}</caption>\n\
         <thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n"
    )
}

/// A column as it is printed: one of the numbers, or both ends of an interval.
#[derive(Clone, Debug, PartialEq)]
struct Column {
    /// Its number, or that of the lower end.
    at: usize,
    /// True if the next of the numbers is the upper end.
    is_interval: bool,
    heading: Heading,
    numeric: bool,
}

impl Column {
    /// The numbers that it prints.
    fn sources(&self) -> impl Iterator<Item = usize> + use<> {
        self.at..=self.at + usize::from(self.is_interval)
    }
}

/// The columns of a table as printed: the two ends of an interval share one.
fn columns(numbers: &Numbers) -> Vec<Column> {
    // An interval that says nothing else is named after its estimate where there are several.
    let unnamed = (0..numbers.columns.len()).filter(|&i| ends(numbers, i).is_some_and(|name| name == INTERVAL)).count();
    let mut columns: Vec<Column> = Vec::new();
    let mut at = 0;
    while let Some(own) = numbers.columns.get(at) {
        let (is_interval, name) = match ends(numbers, at) {
            Some(name) if name == INTERVAL && unnamed > 1 => (true, format!("{}, {INTERVAL}", before(numbers, at))),
            Some(name) => (true, name),
            None => (false, own.name.clone()),
        };
        let heading = Heading { name, unit: own.unit.clone() };
        columns.push(Column { at, is_interval, heading, numeric: is_interval || numeric(numbers, at) });
        at += 1 + usize::from(is_interval);
    }
    columns
}

/// Heading of the ends of a column's interval.
const INTERVAL: &str = "interval";

/// Name of the column before another.
fn before(numbers: &Numbers, column: usize) -> &str {
    column.checked_sub(1).and_then(|i| numbers.columns.get(i)).map_or("", |heading| &heading.name)
}

/// Heading of the interval whose lower end a column is; `None` for any other column.
fn ends(numbers: &Numbers, column: usize) -> Option<String> {
    let (low, high) = (numbers.columns.get(column)?, numbers.columns.get(column + 1)?);
    let estimate = column.checked_sub(1).and_then(|i| numbers.columns.get(i));
    let name = match (low.name.as_str(), high.name.as_str()) {
        // Without an estimate of the same unit before them, they are the ends of a range.
        ("low", "high") => estimate.filter(|e| e.unit == low.unit).map(|_| INTERVAL.to_owned()),
        ("band, 5 %", "band, 95 %") => Some("band, 5 to 95 %".into()),
        ("smallest", "largest") => Some("smallest to largest".into()),
        ("one world, low", "one world, high") => Some("band of one world".into()),
        // "shift, low" says of what, "low, blocks" of which kind.
        (low, high) => match (low.strip_suffix(", low"), low.strip_prefix("low, ")) {
            (Some(of), _) if high.strip_suffix(", high") == Some(of) => Some(format!("{of}, {INTERVAL}")),
            (_, Some(kind)) if high.strip_prefix("high, ") == Some(kind) => Some(format!("{INTERVAL}, {kind}")),
            _ => None,
        },
    };
    name.filter(|_| low.unit == high.unit)
}

/// True for a column of numbers, also where all of them are unknown.
fn numeric(numbers: &Numbers, column: usize) -> bool {
    let has_unit = numbers.columns.get(column).is_some_and(|heading| !heading.unit.is_empty());
    let mut cells = numbers.rows.iter().filter_map(|r| r.get(column));
    cells.find(|c| **c != Cell::Null).map_or(has_unit, |c| matches!(c, Cell::F64(_) | Cell::I64(_)))
}

/// Names of the columns whose words tell what the numbers of a row measure.
const MEASURES: [&str; 6] = ["metric", "quantity", "parameter", "ratio", "measure", "unit"];

/// What the numbers of a row measure, where rows differ in it, in the words of the columns that name it.
fn measure<'a>(numbers: &Numbers, row: &'a [Cell]) -> Vec<&'a str> {
    if !numbers.mixed {
        return Vec::new();
    }
    let words = |cell: &'a Cell| match cell {
        Cell::Text(words) => Some(words.as_str()),
        _ => None,
    };
    let names = numbers.columns.iter().zip(row).filter(|(heading, _)| MEASURES.contains(&heading.name.as_str()));
    names.filter_map(|(_, cell)| words(cell)).collect()
}

/// Decimals of every column, for each measure: numbers of one column and measure have the same.
fn decimals_by_measure<'a>(numbers: &'a Numbers, columns: &[Column]) -> BTreeMap<Vec<&'a str>, Vec<Option<usize>>> {
    let mut rows: BTreeMap<Vec<&str>, Vec<&[Cell]>> = BTreeMap::new();
    for row in &numbers.rows {
        rows.entry(measure(numbers, row)).or_default().push(row);
    }
    let of_rows = |rows: &[&[Cell]]| -> Vec<Option<usize>> {
        let of_column = |column: &Column| {
            let cells = rows.iter().flat_map(|row| column.sources().filter_map(move |i| row.get(i)));
            // A single number has all its digits, and no more.
            let alone = numbers.mixed && rows.len() == 1 && !column.is_interval;
            (!alone).then(|| decimals(cells, &column.heading.unit)).flatten()
        };
        columns.iter().map(of_column).collect()
    };
    rows.into_iter().map(|(measure, rows)| (measure, of_rows(&rows))).collect()
}

/// Decimals of the cells of a column: four digits for the largest number, two for the smallest. `None` if that takes more than five
/// digits, or if the numbers are very large or small.
fn decimals<'a>(cells: impl Iterator<Item = &'a Cell>, unit: &str) -> Option<usize> {
    let magnitude = |cell: &Cell| match cell {
        Cell::F64(v) => Some(number::without_noise(*v, unit).abs()).filter(|v| *v != 0.0),
        _ => None,
    };
    let magnitudes: Vec<f64> = cells.filter_map(magnitude).collect();
    if magnitudes.iter().all(|v| v.fract() == 0.0) {
        return Some(0);
    }
    let (low, high) = magnitudes.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
    let reaches =
        |v: f64, digits: f64| (0..=6).find(|d| v * libm::pow(10.0, f64::from(*d)) >= libm::pow(10.0, digits - 1.0));
    let places: i32 = reaches(high, 4.0)?.max(reaches(low, 2.0)?);
    (high * libm::pow(10.0, f64::from(places)) < 1e5).then_some(usize::try_from(places).unwrap_or(0))
}

fn heading(column: &Column) -> String {
    let name = broken(&set(&column.heading.name));
    let unit = match number::unit(&column.heading.unit) {
        u if u.is_empty() => u,
        u => format!("<br><small>{}</small>", escape(&u)),
    };
    let class = if column.numeric { " class=\"n\"" } else { "" };
    format!("<th scope=\"col\"{class}>{name}{unit}</th>")
}

/// A name that may be broken after each underscore.
fn broken(name: &str) -> String {
    name.replace('_', "_<wbr>")
}

/// Name and unit of a column, as the label of a number in a card. An attribute has no `<wbr>`: a space of no width is where a line may break.
fn label(heading: &Heading) -> String {
    let unit = match number::unit(&heading.unit) {
        unit if unit.is_empty() => unit,
        unit => format!(", {unit}"),
    };
    format!(" data-label=\"{}{}\"", escape(&heading.name).replace('_', "_\u{200b}"), escape(&unit))
}

/// A row with the columns, their decimals and their labels, which are empty if rows are not cards.
fn row<'a>(cells: &[Cell], formats: impl Iterator<Item = ((&'a Column, Option<usize>), &'a String)>) -> String {
    let cells: String = formats.map(|((column, decimals), label)| cell(cells, column, decimals, label)).collect();
    format!("<tr>{cells}</tr>\n")
}

fn cell(cells: &[Cell], column: &Column, decimals: Option<usize>, label: &str) -> String {
    let in_column = |v: f64| in_digits(number::without_noise(v, &column.heading.unit), decimals);
    let (class, text) = match cells.get(column.at) {
        low if column.is_interval => ("n i", interval(low, cells.get(column.at + 1), in_column)),
        None | Some(Cell::Null) => (if column.numeric { "n" } else { "" }, number::ABSENT.to_owned()),
        Some(Cell::Text(v)) => (class_of_text(v), words(v)),
        Some(Cell::F64(v)) => ("n", in_column(*v)),
        Some(Cell::I64(v)) => ("n", v.to_string()),
        Some(Cell::Bool(v)) => ("", if *v { "yes" } else { "no" }.to_owned()),
        Some(Cell::F32List(v)) => ("", list(v.iter().map(|v| f64::from(*v)))),
        Some(Cell::F64List(v)) => ("", list(v.iter().copied())),
    };
    let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
    format!("<td{class}{label}>{text}</td>")
}

/// Words of a cell. A single long one, such as an id, may be broken after each slash.
fn words(text: &str) -> String {
    match text.contains(' ') || text.len() <= CARD_TEXT {
        true => set(text),
        false => text.split('/').map(set).collect::<Vec<_>>().join("/<wbr>"),
    }
}

fn in_digits(value: f64, decimals: Option<usize>) -> String {
    decimals.map_or_else(|| number::plain(value, 4), |d| number::fixed(value, d))
}

/// A space at which no line is broken.
const NO_BREAK: char = '\u{a0}';

/// Both ends of an interval, which may be broken between them; an end that is unbounded is left out.
fn interval(low: Option<&Cell>, high: Option<&Cell>, in_column: impl Fn(f64) -> String) -> String {
    match (low, high) {
        (Some(Cell::F64(low)), Some(Cell::F64(high))) => {
            format!("{} to{NO_BREAK}{}", in_column(*low), in_column(*high))
        }
        (Some(Cell::F64(low)), _) => format!("from{NO_BREAK}{}", in_column(*low)),
        (_, Some(Cell::F64(high))) => format!("up to{NO_BREAK}{}", in_column(*high)),
        _ => number::ABSENT.to_owned(),
    }
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

    /// A table of more than 100 rows is folded, whatever its section asks for.
    #[test]
    fn val_long_tables_are_folded() {
        let of_rows = |rows: usize| {
            block(&Block::Table(TableBlock { id: "t".into(), caption: "All".into(), numbers: numbers(rows, 2) }))
        };
        // The query below an open table is folded, too.
        assert!(of_rows(100).starts_with("<div class=\"scroll\""));
        assert!(of_rows(101).starts_with("<details><summary data-file=\"data/t.json\">All (101 rows)</summary>"));
    }

    /// A long id may be broken after a slash; a unit may not, and a sentence only between its words.
    #[test]
    fn val_ids_are_broken_at_slashes() {
        assert_eq!(words("d2.30-0001/husky-0001.mcap"), "d2.30-0001/<wbr>husky-0001.mcap");
        assert!(!words("in m/s2, as measured").contains("<wbr>"));
        assert!(words("a<b/husky-0001.mcap").starts_with("a&lt;b/<wbr>"));
        assert!(!words("m/s2").contains("<wbr>"));
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
        let heading = Heading { name: "n".into(), unit: "m".into() };
        let column = Column { at: 0, is_interval: false, heading, numeric: true };
        let of = |one: Cell| cell(&[one], &column, Some(2), "");
        assert_eq!(of(Cell::Null), "<td class=\"n\">–</td>");
        assert_eq!(of(Cell::F64(-0.25)), "<td class=\"n\">−0.25</td>");
        assert_eq!(of(Cell::I64(-3)), "<td class=\"n\">-3</td>");
        assert_eq!([of(Cell::Bool(true)), of(Cell::Bool(false))], ["<td>yes</td>", "<td>no</td>"]);
        assert_eq!(of(Cell::Text("a<b".into())), "<td>a&lt;b</td>");
        assert_eq!(of(Cell::F64List(vec![0.5, f64::NAN])), "<td>0.5, –</td>");
        // Rounding noise is 0; an unknown word is aligned as words are.
        assert_eq!(of(Cell::F64(-1.5e-16)), "<td class=\"n\">0.00</td>");
        let words = Column { numeric: false, ..column.clone() };
        assert_eq!(cell(&[Cell::Null], &words, None, ""), "<td>–</td>");
    }

    /// A column without any number is one of numbers if it has a unit, and its heading is aligned like its cells.
    #[test]
    fn val_unknown_numbers_are_aligned_with_their_heading() {
        let mut numbers = Numbers::new("", &[("depth", "m"), ("note", "")]);
        numbers.row([Cell::Null, Cell::Null]);
        let table = table(&numbers, "c");
        assert!(table.contains("<th scope=\"col\" class=\"n\">depth") && table.contains("<th scope=\"col\">note"));
        assert!(table.contains("<td class=\"n\">–</td><td>–</td>"), "{table}");
    }

    /// The ends of an interval share a column with equal decimals; where there are several, each is named after its estimate. An unbounded end is left
    /// out. The lowest and the highest value of a raster are no interval of what precedes them.
    #[test]
    fn val_ends_of_intervals_share_a_column() {
        let names = |columns: &[(&str, &str)]| {
            let columns = super::columns(&Numbers::new("", columns));
            columns.into_iter().map(|c| c.heading.name).collect::<Vec<_>>()
        };
        assert_eq!(names(&[("share", "%"), ("low", "%"), ("high", "%")]), ["share", "interval"]);
        let two = [("a", "1"), ("low", "1"), ("high", "1"), ("b", "m"), ("low", "m"), ("high", "m")];
        assert_eq!(names(&two), ["a", "a, interval", "b", "b, interval"]);
        assert_eq!(names(&[("shift, low", ""), ("shift, high", "")]), ["shift, interval"]);
        let of_fit = [("estimate", "m"), ("low", "m"), ("high", "m"), ("low, blocks", "m"), ("high, blocks", "m")];
        assert_eq!(names(&of_fit), ["estimate", "interval", "interval, blocks"]);
        let kinds = [("low, %", ""), ("high, %", ""), ("low, a", ""), ("high, b", "")];
        assert_eq!(names(&kinds), ["interval, %", "low, a", "high, b"]);
        assert_eq!(names(&[("band, 5 %", "m"), ("band, 95 %", "m")]), ["band, 5 to 95 %"]);
        assert_eq!(names(&[("cell_y_m", "m"), ("low", ""), ("high", "")]), ["cell_y_m", "low", "high"]);
        let mut numbers = Numbers::new("", &[("a", ""), ("low", ""), ("high", "")]);
        for (low, high) in [(-0.5, 1.25), (0.25, f64::INFINITY), (f64::NAN, 2.0), (f64::NAN, f64::NAN)] {
            numbers.row([figure(1.0), figure(low), figure(high)]);
        }
        let table = table(&numbers, "c");
        for cell in ["−0.500 to\u{a0}1.250", "from\u{a0}0.250", "up to\u{a0}2.000", "–"] {
            assert!(table.contains(&format!("<td class=\"n i\">{cell}</td>")), "{cell}: {table}");
        }
    }

    /// Where rows measure different quantities, those of one quantity have equal decimals.
    #[test]
    fn val_decimals_follow_the_measure() {
        let mut numbers = Numbers::new("", &[("metric", ""), ("median", "")]).with_mixed_units();
        for (metric, median) in [("time", 14.7), ("time", 26.73), ("p", 0.05)] {
            numbers.row([Cell::Text(metric.into()), figure(median)]);
        }
        let printed = table(&numbers, "c");
        assert!([">14.70<", ">26.73<", ">0.05<"].iter().all(|cell| printed.contains(cell)), "{printed}");
        // Of one unit, but not of one magnitude; the first column names what has the parameters.
        let mut numbers = Numbers::new("", &[("fit", ""), ("parameter", ""), ("estimate", "m")]).with_mixed_units();
        for (parameter, estimate) in [("σ", 0.0521), ("σ", 0.13), ("b", 640.0), ("b", 12.5)] {
            numbers.row([Cell::Text("f".into()), Cell::Text(parameter.into()), figure(estimate)]);
        }
        let printed = table(&numbers, "c");
        assert!([">0.0521<", ">0.1300<", ">640.0<", ">12.5<"].iter().all(|cell| printed.contains(cell)), "{printed}");
    }

    /// Labels of cards may be broken after underscores, as headings are.
    #[test]
    fn val_labels_break_after_underscores() {
        let heading = Heading { name: "covariance_error_max".into(), unit: String::new() };
        assert_eq!(label(&heading), " data-label=\"covariance_\u{200b}error_\u{200b}max\"");
    }

    #[test]
    fn val_code_between_backticks() {
        assert_eq!(set("run `a <b>` and `c`"), "run <code>a &lt;b&gt;</code> and <code>c</code>");
        assert_eq!([set("one ` alone"), set("plain"), set("")], ["one ` alone", "plain", ""]);
        let caption = table(&numbers(1, 1), "`size_m` gives");
        assert!(
            caption.contains("aria-label=\"size_m gives\"") && caption.contains("<caption><code>size_m</code> gives")
        );
    }

    #[test]
    fn val_decimals_of_a_column() {
        let of = |values: &[f64]| {
            let cells: Vec<Cell> = values.iter().map(|v| figure(*v)).collect();
            decimals(cells.iter(), "")
        };
        assert_eq!(of(&[84.75, 0.73, f64::NAN]), Some(2));
        assert_eq!(of(&[100.0, 0.6377]), Some(2));
        assert_eq!(of(&[9023.4, 0.05]), None);
        assert_eq!(of(&[20.0, 400.0, 0.0]), Some(0));
        assert_eq!(of(&[1e-9, 2e-9]), None);
        assert_eq!(of(&[]), Some(0));
    }
}
