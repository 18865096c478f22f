//! The results in a few sentences and a picture; the rest of the page is the evidence. It is made after the other sections, whose results it
//! repeats.

mod made;

use super::{images, missions, photoclinometry, routes, rovers, terrain, texture};
use crate::ReportError;
use crate::content::{Block, Figure, Section};
use crate::data::Data;

/// Anchor on the page.
pub const ID: &str = "summary";
/// Name in the list of sections.
pub const NAME: &str = "Summary";
/// Heading.
pub const TITLE: &str = "What are the results?";

/// What the release has, what the sections found, and a picture.
pub fn answer(data: &Data, sections: &[Section]) -> Result<Vec<Block>, ReportError> {
    let said = made::in_words(data).into_iter().chain(sections.iter().filter_map(results));
    let mut blocks: Vec<Block> = said.map(Block::Text).collect();
    if !blocks.is_empty() {
        blocks.push(Block::Figures(picture(data, sections)?));
    }
    Ok(blocks)
}

/// The results of a section, each with the warnings that directly follow it, after the warnings that the section begins with; `None` without any.
fn results(section: &Section) -> Option<String> {
    let mut follows = true;
    let told = section.blocks.iter().filter_map(|block| {
        let words = match block {
            Block::Result(words) => Some(words.as_str()),
            Block::Warning(words) if follows => Some(words.as_str()),
            _ => None,
        };
        follows = words.is_some();
        words
    });
    let told: Vec<&str> = told.collect();
    (!told.is_empty()).then(|| told.join(" "))
}

/// The picture of a release, as its section has it: results before surfaces. None if it has no rasters and no missions.
fn picture(data: &Data, sections: &[Section]) -> Result<Vec<Figure>, ReportError> {
    let of_section = |id: &str, pictures: fn(&Section) -> Vec<Figure>| {
        Ok(sections.iter().find(|section| section.id == id).map_or_else(Vec::new, pictures))
    };
    let all: [&dyn Fn() -> Result<Vec<Figure>, ReportError>; 7] = [
        &|| of_section(missions::QUESTION.id, missions::picture),
        &|| routes::picture(data),
        &|| rovers::picture(data),
        &|| of_section(texture::QUESTION.id, texture::side_by_side),
        &|| photoclinometry::picture(data),
        &|| images::picture(data),
        &|| terrain::picture(data),
    ];
    for pictures in all {
        let mut figures = pictures()?;
        if !figures.is_empty() {
            figures.iter_mut().for_each(|figure| figure.id = format!("summary-{}", figure.id));
            return Ok(figures);
        }
    }
    Ok(Vec::new())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Results are repeated with the warnings that qualify them; texts and later warnings are not.
    #[test]
    fn val_results_are_repeated_with_their_warnings() {
        let [result, warning, text] = [Block::Result, Block::Warning, Block::Text];
        let of = |blocks: Vec<Block>| results(&Section { id: "s", name: "", title: "", blocks });
        let words = |block: fn(String) -> Block, words: &str| block(words.into());
        let blocks = vec![
            words(warning, "w1"),
            words(result, "r1"),
            words(warning, "w2"),
            words(text, "t"),
            words(warning, "w3"),
            words(result, "r2"),
        ];
        assert_eq!(of(blocks).as_deref(), Some("w1 r1 w2 r2"));
        assert_eq!(of(vec![words(text, "t"), words(warning, "w")]), None);
    }
}
