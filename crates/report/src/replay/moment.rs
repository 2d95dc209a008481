//! What the judge found, as a replay jumps to it.

use super::choice::Span;

/// What kind of finding it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The closest approach of all.
    Closest,
    /// Two were too close, or a vehicle too near to an obstacle.
    Violation,
    /// It cannot be told.
    Undecided,
    /// A vehicle was not seen, so that it cannot be told.
    Unseen,
}

impl Kind {
    /// Its name in the data of a page.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Closest => "closest",
            Self::Violation => "violation",
            Self::Undecided | Self::Unseen => "undecided",
        }
    }
}

/// A finding of the judge.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// What it is.
    pub kind: Kind,
    /// Whose, from 0.
    pub vehicles: Vec<usize>,
    /// The obstacle, from 0, where there is one.
    pub obstacle: Option<usize>,
    /// When it began and ended, and when it was at its worst \[s\].
    pub span: Span,
    /// It in a few words, while it lasts.
    pub brief: String,
    /// All of it in a sentence, with distance and time as the judge says them.
    pub said: String,
}
