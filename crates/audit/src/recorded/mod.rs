//! The audit of recorded motion: did any two vehicles come too close, by what a recording says?
//!
//! A recording is a stream of [`Item`](tautline_core::track::Item)s, each vehicle at times of its own. What happens between two samples is stated
//! ([`Interpolation`]), never assumed silently, and the answer is one of three: **clear** (proved, under that motion), a
//! **violation**, or **undecided**, with the interval in which the smallest distance lies.
//!
//! - Straight flight and jumps are swept in closed form, like the steps of [`super::Auditor`].
//! - On curves the smallest distance is enclosed by Bernstein coefficients to [`WIDTH_M`].
//! - Under bounded acceleration A a vehicle is within A h^2 / 8 of the straight line between two samples h apart, or within
//!   A h^2 / 16 of the cubic where the samples have velocities. Two vehicles are at least as far apart as drawn, less both
//!   deviations; they are too close for certain only where even the deviations cannot keep them apart, such as at a sample.
//! - What bounds on the motion do not prove clear is judged a second time, by parry; where it contradicts, nothing is
//!   clear.
//!
//! Not every pair is swept: a window of time at a time, pairs are left out that bounds on their motion prove to be neither
//! too close nor among the ten closest, to 1e-12 of a distance. Memory is that of a window, and of what was found.
//!
//! Every instant counts, the first and the last too, and a vehicle that was seen once is judged where it was seen. A
//! vehicle that is late or leaves early is judged while it is there. While a vehicle is not seen for longer than
//! [`Settings::max_gap_s`], nothing is known of it. Where there never were two to keep apart nothing is clear.
//!
//! ```
//! use nalgebra::Vector3;
//! use tautline_audit::Status;
//! use tautline_audit::recorded::{Settings, audit};
//! use tautline_core::track::{Item, Sample};
//!
//! // Past each other in one second: far apart in every sample, 1 m apart in between.
//! let seen = |vehicle, time_s, x, y| {
//!     let position_m = Vector3::new(x, y, 0.0);
//!     Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
//! };
//! let items = [seen(0, 0.0, -5.0, 0.0), seen(1, 0.0, 5.0, 1.0), seen(0, 1.0, 5.0, 0.0), seen(1, 1.0, -5.0, 1.0)];
//! let names = ["alpha".to_owned(), "bravo".to_owned()];
//! let outcome = audit(&names, &items, Settings::delta(2.0))?;
//! assert_eq!(outcome.status, Status::Violation);
//! assert_eq!((outcome.closest[0].lower_m, outcome.closest[0].time_s), (1.0, 0.5));
//! # Ok::<(), tautline_audit::recorded::RecordedError>(())
//! ```

mod auditor;
mod outcome;
mod second_pass;
mod settings;
mod smallest;
mod vehicle;
mod window;

pub use super::outcome::{Approach, ObjectPair, WIDTH_M};
pub use auditor::{TrackAuditor, audit};
pub use outcome::{Absence, Contradiction, Gap, Outcome, Presence, Tallies};
pub use second_pass::{PairSample, PairSeries, PositionLookup, Proof, ProofBuilder, ProofWindow};
pub use settings::{Interpolation, RecordedError, Settings, TOUCHING_ELLIPSOIDS, VehicleSettings};
