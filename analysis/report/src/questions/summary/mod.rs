//! The results in a few sentences and a picture; the rest of the page is the evidence.

mod made;

use super::missions::outcomes;
use super::{
    Question, comparison, failures, formations, images, logs, outcome, photoclinometry, probability, published,
    releases, routes, rovers, terrain, texture, thesis,
};
use crate::ReportError;
use crate::content::{Block, Figure};
use crate::data::Data;
use crate::render::number as set;
use std::collections::BTreeSet;

/// Registry entry.
pub const QUESTION: Question = Question { id: "summary", name: "Summary", title: "What are the results?", answer };

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let made = [made::in_words(data), photoclinometry::in_words(data), routes::in_words(data)];
    let driven = [missions(data), probability::in_words(data), formations::in_words(data), rovers::in_words(data)];
    let compared = [releases::result(data), logs::result(data), published::result(data), thesis::in_words(data)];
    let judged = [comparison::claims(data), texture::in_words(data), failures::in_words(data)];
    let all = made.into_iter().chain(driven).chain(compared).chain(judged);
    let mut blocks: Vec<Block> = all.flatten().map(Block::Text).collect();
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

/// Pictures of one part of a release, as its section has them; none where the release lacks that part.
type Pictures = fn(&Data) -> Result<Vec<Figure>, ReportError>;

/// The first of these that a release has is its picture: results before surfaces.
const PICTURES: [Pictures; 7] = [
    of_missions,
    routes::picture,
    rovers::picture,
    texture::side_by_side,
    photoclinometry::picture,
    images::picture,
    terrain::picture,
];

/// The outcomes of the missions; none without missions.
fn of_missions(data: &Data) -> Result<Vec<Figure>, ReportError> {
    let groups = data.mission_groups();
    Ok(if groups.is_empty() { Vec::new() } else { vec![outcomes::stacked(data, &groups)] })
}

/// The picture of a release; none if it has no rasters and no missions.
fn picture(data: &Data) -> Result<Vec<Figure>, ReportError> {
    for pictures in PICTURES {
        let mut figures = pictures(data)?;
        if !figures.is_empty() {
            figures.iter_mut().for_each(|figure| figure.id = format!("summary-{}", figure.id));
            return Ok(figures);
        }
    }
    Ok(Vec::new())
}
