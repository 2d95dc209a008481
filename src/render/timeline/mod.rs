//! A recorded flight, ready to be drawn at any time of it.

mod frame;
mod history;
mod interval;
mod plan;
mod tracks;

pub use frame::Frame;
pub use history::{Keyframe, Timeline, ViolationSpan};
pub(super) use interval::Interval;
pub use plan::Plan;
pub use tracks::TracksError;

#[cfg(test)]
mod tests;
