//! The questions that a report answers. Adding one takes a folder and a line in [`ALL`].

mod clusters;
pub mod comparison;
pub mod covariance;
mod curves;
pub mod failures;
pub mod formations;
pub mod images;
pub mod logs;
pub mod losses;
pub mod missions;
mod outcome;
pub mod photoclinometry;
pub mod probability;
pub mod published;
pub mod releases;
mod relief;
pub mod routes;
pub mod rovers;
pub mod scoreboard;
pub mod sensitivity;
mod sql;
pub mod summary;
mod team;
pub mod terrain;
pub mod texture;
pub mod thesis;

use crate::ReportError;
use crate::content::{Block, Section};
use crate::data::Data;

/// A question.
#[derive(Clone, Copy, Debug)]
pub struct Question {
    /// Anchor on the page.
    pub id: &'static str,
    /// Name in the list of sections.
    pub name: &'static str,
    /// Heading.
    pub title: &'static str,
    /// Its answer; without blocks if the release has no data for it.
    pub answer: fn(&Data) -> Result<Vec<Block>, ReportError>,
}

/// All questions but that of the summary, which comes before them, in the order of the page.
pub const ALL: [Question; 19] = [
    failures::QUESTION,
    terrain::QUESTION,
    images::QUESTION,
    photoclinometry::QUESTION,
    covariance::QUESTION,
    texture::QUESTION,
    scoreboard::QUESTION,
    routes::QUESTION,
    formations::QUESTION,
    losses::QUESTION,
    rovers::QUESTION,
    missions::QUESTION,
    comparison::QUESTION,
    releases::QUESTION,
    logs::QUESTION,
    published::QUESTION,
    thesis::QUESTION,
    probability::QUESTION,
    sensitivity::QUESTION,
];

/// The sections of the page; those without an answer are left out. The summary is made last, of what the others say, so that nothing is
/// computed twice. `progress` is called with each question.
pub fn sections(data: &Data, progress: &dyn Fn(&str)) -> Result<Vec<Section>, ReportError> {
    let mut sections = Vec::new();
    for question in &ALL {
        progress(question.title);
        let blocks = (question.answer)(data)?;
        sections.extend(Section::of(question.id, question.name, question.title, blocks));
    }
    progress(summary::TITLE);
    let blocks = summary::answer(data, &sections)?;
    sections.splice(0..0, Section::of(summary::ID, summary::NAME, summary::TITLE, blocks));
    Ok(sections)
}

#[cfg(test)]
mod tests {
    use super::{ALL, summary};

    /// The manual lists the sections by the names and questions that the page has.
    #[test]
    fn val_the_manual_lists_every_question() {
        let manual = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/report.md");
        let manual = std::fs::read_to_string(manual).unwrap();
        let sections = manual.split("\n## ").find(|part| part.starts_with("The sections\n")).unwrap();
        let all = ALL.map(|question| (question.name, question.title));
        for (name, title) in all.into_iter().chain([(summary::NAME, summary::TITLE)]) {
            assert!(sections.contains(name) && sections.contains(title), "{title}");
        }
    }
}
