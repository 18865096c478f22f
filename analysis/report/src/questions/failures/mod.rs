//! Which items of the study failed. A release lists them once it is sealed.

use super::Question;
use crate::ReportError;
use crate::content::{Block, Numbers, TableBlock, text};
use crate::data::Data;
use crate::render::number as set;
use crate::sample::{ROWS_MAX, sample};

/// Registry entry.
pub const QUESTION: Question = Question { id: "failures", name: "Missing items", title: "What is missing?", answer };

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    if data.failed.is_empty() {
        return Ok(Vec::new());
    }
    let mut numbers =
        Numbers::of_file("manifest.json, failed", &[("stage", ""), ("item", ""), ("error", ""), ("parameters", "")]);
    for item in sample(data.failed.iter().collect(), ROWS_MAX, &mut data.stream("failed", "listed")) {
        let parameters = item.parameters.as_ref().map_or("", |parameters| parameters.as_str());
        numbers.row([text(&item.stage), text(&item.item), text(&item.error), text(parameters)]);
    }
    let table =
        TableBlock { id: "failed".into(), caption: "Failed items".into(), numbers: numbers.of_all(data.failed.len()) };
    Ok(in_words(data).map(Block::Warning).into_iter().chain([Block::Table(table)]).collect())
}

/// How many items failed; `None` where none did.
pub(super) fn in_words(data: &Data) -> Option<String> {
    match data.failed.len() {
        0 => None,
        1 => Some("1 item of the study failed and is missing from this report.".to_owned()),
        n => Some(format!("{} items of the study failed and are missing from this report.", set::count(n))),
    }
}
