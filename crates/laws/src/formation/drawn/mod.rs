//! Drawn formations: slots on the lines or over the inside of letters, SVG and pictures.
//!
//! `outline` reads letters and SVG into curves, `picture` reads a PNG file into a mask. `outline` then places sample
//! points on them, and `spread` chooses evenly spaced slots among the points.

mod drawing;
mod outline;
mod picture;
mod spread;
#[cfg(test)]
mod tests;

pub use drawing::Drawing;
pub use drawing::DrawingError;
pub use drawing::{MAX_DRAWN_SLOTS, MAX_PIXELS, MAX_TEXT_CHARS};
