//! Why nothing can be drawn.

use thiserror::Error;

use super::limits::{MAX_DRAWN_SLOTS, MAX_PIXELS, MAX_TEXT_CHARS};

/// Why something cannot be drawn with slots.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DrawingError {
    /// A character that the font does not have.
    #[error("the font has no {0:?}")]
    Glyph(char),
    /// A text that is too long.
    #[error("a text of {0} characters; at most {MAX_TEXT_CHARS} are drawn")]
    Length(usize),
    /// Fewer slots than there are letters.
    #[error("{slots} slots for {letters} letters")]
    Letters {
        /// Slots asked for.
        slots: usize,
        /// Letters of the text, blanks not counted.
        letters: usize,
    },
    /// Path data that cannot be read.
    #[error("this is no SVG path: {0}")]
    Path(String),
    /// An SVG file that cannot be read.
    #[error("this is no SVG file: {0}")]
    Svg(String),
    /// An SVG file whose elements are nested too deep.
    #[error("elements of the SVG file are nested more than {0} deep")]
    Nesting(usize),
    /// A picture that cannot be read.
    #[error("this is no PNG picture: {0}")]
    Png(String),
    /// A picture that is too large.
    #[error("{width} x {height} pixels; at most {MAX_PIXELS} in all are read")]
    Pixels {
        /// Pixels of a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// Lines that are not finite, or too far apart to compute with.
    #[error("what is drawn reaches to where numbers end")]
    NotFinite,
    /// No line and no area.
    #[error("nothing is drawn")]
    Empty,
    /// More slots than a drawing is spread over.
    #[error("{0} slots; a drawing has at most {MAX_DRAWN_SLOTS}")]
    Slots(usize),
}
