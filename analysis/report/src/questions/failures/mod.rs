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
    Ok(vec![Block::Warning(in_words(data.failed.len())), Block::Table(table)])
}

fn in_words(failed: usize) -> String {
    match failed {
        1 => "1 item of the study failed and is missing from this report.".to_owned(),
        n => format!("{} items of the study failed and are missing from this report.", set::count(n)),
    }
}
