//! Formations that are drawn: slots on the lines or all over the inside of letters, SVG and pictures.
//!
//! `text`, `svg` and `picture` read what is drawn into polylines or a mask, `walk` lays sample points on them, one
//! next to the other, and `spread` chooses slots among those that keep apart.

mod drawing;
mod error;
mod limits;
mod mask;
mod outline;
mod picture;
mod spread;
mod svg;
#[cfg(test)]
mod tests;
mod text;
mod walk;

pub use drawing::Drawing;
pub use error::DrawingError;
pub use limits::{MAX_DRAWN_SLOTS, MAX_PIXELS, MAX_TEXT_CHARS};
pub use picture::Ink;
