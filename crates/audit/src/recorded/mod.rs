//! Audit of recorded motion: finds every time at which two vehicles of a recording come closer than their limit.
//!
//! A recording is a stream of [`Item`](tautline_core::track::Item)s, each vehicle at its own times. The motion between
//! two samples is a stated assumption ([`Interpolation`]). The verdict is one of three: **clear** (proved, under that
//! motion), **violation**, or **undecided**, with the interval in which the smallest distance lies.
//!
//! - Straight flight and jumps are swept in closed form, like the steps of [`super::Auditor`].
//! - On curves the smallest distance is enclosed by Bernstein coefficients to [`WIDTH_M`].
//! - Under bounded acceleration A a vehicle is within A h^2 / 8 of the straight line between two samples h apart. With
//!   velocities it is within A h^2 / 16 of the cubic. The separation of two vehicles is at least that of their curves
//!   less both deviations. A violation is certain only where it remains under both deviations, such as at a sample.
//! - Each approach that bounds on the motion do not prove clear is checked by parry too; if the results contradict, the
//!   motion is not clear.
//!
//! Not every pair is swept. In each window of time bounds on the motion leave out pairs that are neither below their
//! limit nor among the ten closest, to 1e-12 of a distance. Memory holds one window and the findings.
//!
//! Every instant is judged, including the first and the last. A vehicle with a single sample is judged at that sample.
//! A vehicle that arrives late or leaves early is judged while it is present. In a gap longer than
//! [`Settings::max_gap_s`] the motion of a vehicle is unknown. Without two objects to keep apart the verdict is never
//! clear.
//!
//! ```
//! use nalgebra::Vector3;
//! use tautline_audit::Status;
//! use tautline_audit::recorded::{Settings, audit};
//! use tautline_core::track::{Item, Sample};
//!
//! // Past each other in one second: 10 m apart in every sample, 1 m apart in between.
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
mod failure;
mod flights;
mod outcome;
mod plan;
mod plan_sweep;
mod plans;
mod second_pass;
mod settings;
mod smallest;
mod vehicle;
mod well_clear;
mod window;

pub use super::outcome::{Approach, ObjectPair, WIDTH_M};
pub use auditor::{TrackAuditor, audit};
pub use outcome::{Absence, Contradiction, ExemptTime, Gap, Outcome, Presence, Tallies};
pub use plan::{Deviation as PlanDeviation, PlanComparison, PlanFindings, Unknown as PlanUnknown};
pub use plans::{
    Counterpart, PlanApproach, PlanAuditor, PlanConflict, PlanReference, PlanSeparations, PlansOutcome, TrackingError,
};
pub use second_pass::{PairSample, PairSeries, PositionLookup};
pub use settings::{
    Interpolation, RecordedError, Settings, TOUCHING_CYLINDER, TOUCHING_ELLIPSOIDS, TimedSetting, VehicleSettings,
};
pub use well_clear::{WellClearLoss, WellClearOutcome};
