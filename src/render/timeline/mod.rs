//! A recorded flight, ready to be drawn at any time of it.

mod frame;
mod history;
mod interval;
mod plan;
mod tracks;

pub use frame::{Frame, Keyframe};
pub use history::{Timeline, ViolationSpan};
pub use plan::Plan;
pub use tracks::TracksError;

#[cfg(test)]
mod tests;
