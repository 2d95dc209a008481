//! A recorded flight, ready to be drawn at any time of it.

mod airframe;
mod frame;
mod history;
mod judge;
mod obstacles;
mod tracks;

pub use airframe::QuadrotorShape;
pub(super) use airframe::attitudes_of;
pub use frame::{Frame, Keyframe};
pub(super) use history::PICTURED;
pub use history::Timeline;
pub use obstacles::TooNear;
pub use tracks::TracksError;

#[cfg(test)]
mod tests;
