//! A recorded flight, ready to be drawn at any time of it.

mod airframe;
mod frame;
mod history;
mod judge;
mod obstacles;
mod plan;
mod tracks;

pub use airframe::QuadrotorShape;
pub(super) use airframe::attitudes_of;
pub use frame::{Frame, Keyframe};
pub(super) use history::PICTURED;
pub use history::Timeline;
pub use obstacles::TooNear;
pub use plan::Plan;
pub use tracks::TracksError;

#[cfg(test)]
mod tests;
