//! The three verdicts of a comparison.

use serde::Serialize;

/// The verdict on one quantity, or on all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// Equivalent within the bounds.
    Same,
    /// Significantly different, and not shown to be equivalent.
    Different,
    /// The data can rule out neither.
    CannotTell,
}

impl Answer {
    /// Name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::Different => "different",
            Self::CannotTell => "cannot tell",
        }
    }
}
