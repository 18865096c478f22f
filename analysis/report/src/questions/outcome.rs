//! Outcomes of a mission, and how each is drawn: by colour, line and mark, so that nothing depends on colour alone.

use crate::data::Mission;
use crate::render::svg::{OUTCOMES, Paint, Stroke, Symbol};

/// One outcome.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Value in the table `missions`.
    pub word: &'static str,
    /// Name on the page.
    pub name: &'static str,
    /// Mark where the mission ended.
    pub symbol: Symbol,
    /// Dashes of its track.
    pub dash: &'static str,
}

const fn outcome(word: &'static str, name: &'static str, symbol: Symbol, dash: &'static str) -> Outcome {
    Outcome { word, name, symbol, dash }
}

/// All outcomes; the last is for values that a newer program may write.
pub const ALL: [Outcome; 6] = [
    outcome("success", "success", Symbol::Disc, ""),
    outcome("stuck", "stuck", Symbol::Square, "2 3"),
    outcome("tipped", "tipped", Symbol::Triangle, "7 3"),
    outcome("out_of_bounds", "out of bounds", Symbol::Cross, "9 3 2 3"),
    outcome("timeout", "timeout", Symbol::Diamond, "5 2 1 2 1 2"),
    outcome("", "other", Symbol::Frame, "1 3"),
];

/// Number of a mission's outcome in [`ALL`].
pub fn index(mission: &Mission) -> usize {
    ALL.iter().position(|o| o.word == mission.outcome.as_str()).unwrap_or(ALL.len() - 1)
}

/// True for a mission that reached its goal.
pub fn successful(mission: &Mission) -> bool {
    index(mission) == 0
}

/// Missions by outcome.
pub fn counts<'a>(missions: impl IntoIterator<Item = &'a Mission>) -> [usize; ALL.len()] {
    let mut counts = [0; ALL.len()];
    missions.into_iter().for_each(|m| counts[index(m)] += 1);
    counts
}

/// Track of an outcome on a map. Colours on maps do not follow the theme.
pub fn track(index: usize) -> Stroke {
    Stroke::new(Paint::Fixed(OUTCOMES[index]), 1.7).dashed(ALL[index].dash)
}
