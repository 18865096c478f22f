//! The results in a few sentences and a picture; the rest of the page is the evidence.

use super::missions::outcomes;
use super::{Question, comparison, failures, formations, outcome, rovers, texture};
use crate::ReportError;
use crate::content::{Block, Figure};
use crate::data::Data;
use crate::render::number as set;
use std::collections::BTreeSet;

/// Registry entry.
pub const QUESTION: Question = Question { id: "summary", name: "Summary", title: "What are the results?", answer };

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let driven = [missions(data), formations::in_words(data), rovers::in_words(data)];
    let judged = [comparison::claims(data), texture::in_words(data), failures::in_words(data)];
    let mut blocks: Vec<Block> = driven.into_iter().chain(judged).flatten().map(Block::Text).collect();
    if !blocks.is_empty() {
        blocks.push(Block::Figures(picture(data)?));
    }
    Ok(blocks)
}

/// How the missions ended.
fn missions(data: &Data) -> Option<String> {
    let groups = data.mission_groups();
    let all: Vec<_> = groups.iter().flat_map(|g| g.rows.iter().copied()).collect();
    let terrains = all.iter().map(|m| m.terrain_id.as_str()).collect::<BTreeSet<_>>().len();
    let ends = outcome::counts(all.iter().copied());
    let others: Vec<String> = outcome::ALL
        .iter()
        .zip(ends)
        .skip(1)
        .filter(|(_, n)| *n > 0)
        .map(|(o, n)| format!("{}: {}", o.name, set::count(n)))
        .collect();
    let failed = if others.is_empty() { "none failed".to_owned() } else { others.join(", ") };
    (!all.is_empty()).then(|| {
        format!(
            "{} of {} on {} reached the goal; {failed}.",
            set::count(ends[0]),
            set::counted(all.len(), "mission"),
            set::counted(terrains, "terrain")
        )
    })
}

/// One picture: the outcomes of the missions, or else a texture next to the surface that it was fitted to.
fn picture(data: &Data) -> Result<Vec<Figure>, ReportError> {
    let groups = data.mission_groups();
    let mut figures = match groups.is_empty() {
        false => vec![outcomes::stacked(data, &groups)],
        true => texture::side_by_side(data)?,
    };
    figures.iter_mut().for_each(|figure| figure.id = format!("summary-{}", figure.id));
    Ok(figures)
}
