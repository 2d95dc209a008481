//! Formations that are drawn: slots on the lines or all over the inside of letters, SVG and pictures.
//!
//! `outline` reads letters and SVG into curves, `picture` reads a PNG file into a mask. `outline` lays sample points on them, and
//! `spread` chooses slots that keep apart among the points.

mod drawing;
mod outline;
mod picture;
mod spread;
#[cfg(test)]
mod tests;

pub use drawing::Drawing;
pub use drawing::DrawingError;
pub use drawing::{MAX_DRAWN_SLOTS, MAX_PIXELS, MAX_TEXT_CHARS};
pub use picture::Ink;
