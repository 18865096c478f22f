//! The three answers of a comparison.

use serde::Serialize;

/// An answer about one quantity, or about all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// Equivalent within the bounds.
    Same,
    /// Not equal, and not shown to be equivalent.
    Different,
    /// The data rules out neither.
    CannotTell,
}

impl Answer {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::Different => "different",
            Self::CannotTell => "cannot tell",
        }
    }
}
