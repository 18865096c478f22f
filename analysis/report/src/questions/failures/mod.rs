//! Which items of the study failed: a release says so as soon as it is sealed.

use super::Question;
use crate::ReportError;
use crate::content::{Block, Numbers, TableBlock, text};
use crate::data::Data;
use crate::render::number as set;

/// Registry entry.
pub const QUESTION: Question = Question { id: "failures", name: "Missing items", title: "What is missing?", answer };

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    if data.failed.is_empty() {
        return Ok(Vec::new());
    }
    let mut numbers =
        Numbers::of_file("manifest.json, failed", &[("stage", ""), ("item", ""), ("error", ""), ("parameters", "")]);
    for item in &data.failed {
        numbers.row([text(&item.stage), text(&item.item), text(&item.error), text(item.parameters.to_string())]);
    }
    let items = if data.failed.len() == 1 { "item" } else { "items" };
    let sentence =
        format!("{} {items} of the study failed and are not in any figure below.", set::count(data.failed.len()));
    let table = TableBlock { id: "failed".into(), caption: "Failed items".into(), numbers };
    Ok(vec![Block::Warning(sentence), Block::Table(table)])
}
