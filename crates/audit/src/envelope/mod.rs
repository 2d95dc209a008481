//! What one vehicle may do by itself: how fast, how high and where it flies, between samples too.
//!
//! Every [`Limit`] is on something that must not exceed a number: speeds, accelerations and heights, and how far a vehicle
//! is outside of a [`Fence`]. Over each stretch of a recording its largest value is enclosed, by what is taken to happen
//! between samples ([`Interpolation`](super::recorded::Interpolation)):
//!
//! - On a **straight** line at constant speed it is known. An acceleration is what the parabola through three samples in a row
//!   has, 2 |v2 - v1| / (h1 + h2) with the mean velocities v over intervals h; no motion through them does with less.
//! - On **curves** all but the fence are convex functions of a polynomial, so that none exceeds its largest value at a control
//!   point: parts are halved until both bounds meet. The room to the fence is that of the chord, less how far control points
//!   stray from it.
//! - Under acceleration **bounded** by A, over h, the largest speed is at least that of the mean velocity and at most A h / 2 more
//!   (Peano's form of the error of a mean); a position is within A h^2 / 8 of the chord.
//!
//! Where the velocity of a recorded curve jumps, no vehicle flies it as it is drawn: such corners are counted and not held against
//! a limit. With [`accel_window_s`](super::recorded::Settings::accel_window_s) accelerations are means over windows of that
//! length, |v(t + w) - v(t)| / w, over corners too.
//!
//! A number counts as exceeded where it is by more than 1e-9 of itself, or 1e-9 where it is below 1: less than that is rounding.

mod extremum;
mod fence;
mod limit;
mod monitor;

pub use fence::{Fence, FenceError};
pub use limit::{Corner, Corners, Envelope, EnvelopeOutcome, Exceeding, Limit, LimitOutcome, Quantity};
pub(super) use monitor::{LimitMonitor, Seen};
