//! Limits on single vehicles: speed, acceleration, height and position, between samples too.
//!
//! Every [`Limit`] bounds a number: a speed, an acceleration, a height, or the distance of a vehicle outside a
//! [`Fence`]. The largest value over each part of a recording is enclosed under the motion assumed between samples
//! ([`Interpolation`](super::recorded::Interpolation)):
//!
//! - On a **straight** line at constant speed the value is exact. The acceleration is that of the parabola through
//!   three consecutive samples, 2 |v2 - v1| / (h1 + h2) with the mean velocities v over intervals h. No motion through
//!   the samples has a smaller largest acceleration.
//! - On **curves** all quantities but the fence are convex functions of a polynomial, so no value exceeds the largest
//!   one at a control point. Parts are bisected until both bounds meet. The clearance margin of the fence is that of
//!   the chord, less the distance of the control points from it.
//! - Under acceleration **bounded** by A, over h, the largest speed is at least that of the mean velocity. It is at
//!   most A h / 2 more (Peano's form of the error of a mean). A position is within A h^2 / 8 of the chord.
//!
//! No vehicle can fly a recorded curve exactly where its velocity jumps. Such corners are counted and not compared with
//! a limit. With [`accel_window_s`](super::recorded::Settings::accel_window_s) accelerations are means over windows of
//! that length, |v(t + w) - v(t)| / w, across corners too.
//!
//! A height counts for the **navigation floor** only while the horizontal speed is above [`LEVEL_MOTION_M_S`]. The
//! **yaw** is linear between the setpoints of a show.
//!
//! A limit is exceeded if the excess is more than rounding: 1e-9 of the limit, or 1e-9 if the limit is below 1.

mod extremum;
mod fence;
mod limit;
mod monitor;
mod navigation;

pub use fence::{Fence, FenceError};
pub use limit::{Corner, Corners, Envelope, EnvelopeOutcome, Exceedance, Limit, LimitOutcome, Quantity};
pub(super) use monitor::{ItemContext, LimitMonitor};
pub use navigation::LEVEL_MOTION_M_S;
