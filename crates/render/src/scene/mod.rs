//! From a frame of a flight to a draw list.
//!
//! A [`Scene`] is plain data and knows nothing of how it is drawn: balls, discs, shells and lines in metres, and [`Annotation`]s
//! (words, boxes, scales of colour) in pixels. Lengths are in the scene's coordinates, which are the recording's but for
//! their origin: it lies amid the flight, so that single precision does for swarms far from the recording's origin.

mod camera;
mod caption;
mod colour;
mod compose;
mod draw_list;
mod extent;
mod geometry;
mod ground;
mod labels;

#[cfg(feature = "window")]
pub(super) use camera::TAN_HALF_VIEW;
pub use camera::{Camera, CameraSpec, Lens, Orbit, Projected};
pub(super) use caption::metres;
pub use colour::{Colour, Theme};
pub use compose::{Layers, View};
pub use draw_list::{Annotation, Ball, Disc, Line, Scene};
pub use extent::Extent;
#[cfg(test)]
pub(super) use labels::width;

#[cfg(test)]
mod tests;
