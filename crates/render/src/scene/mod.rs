//! Scenes: draw lists composed from frames of a flight.
//!
//! A [`Scene`] is plain data, independent of the renderer: balls, discs, shells and lines in metres, and
//! [`Annotation`]s (text, boxes, colour scales) in pixels. Lengths are in scene coordinates. Their origin lies in the
//! middle of the flight, so that single precision is enough for swarms far from the recording's origin.

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
