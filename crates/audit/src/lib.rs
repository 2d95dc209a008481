//! Independent audit of motion: finds every time at which two vehicles come closer than their limit.
//!
//! The audit reads motion only and shares no code with controllers or engines. Motion comes in segments. In a flight
//! these are steps, in which every vehicle moves on a straight line from one instant to the next ([`Auditor`], and
//! [`ClearanceAuditor`] for obstacles). In a recording each vehicle has its own times and moves on lines, on curves, or
//! within a bound ([`recorded`]). Segments are swept whole, so an approach between two samples is found. Each swept
//! pair is checked by two detectors:
//!
//! - The closed form: the smallest |r0 + s d| over s from 0 to 1, where r0 is the relative position at the start of the
//!   segment and d its change. It gives the verdict. Where its rounding could change the verdict, exact arithmetic on
//!   the positions decides. On curves the smallest distance is enclosed.
//! - The shape cast of parry with two keep-out balls of radius delta/2. It must agree.
//!
//! The cast checks the formula and is no second proof. Both detectors get the same list of pairs and the same relative
//! motion. A pair that is left out by mistake, or a motion that is misread, is wrong for both.
//!
//! A violation is a separation **strictly** below the limit. The comparison is exact for the positions and times as
//! doubles.
//!
//! Large swarms are not swept pair by pair. A pair is left out if a bound on its motion proves that it is neither below
//! its limit nor among the closest pairs. The result equals that of the full sweep.
//!
//! ```
//! use tautline_audit::{Auditor, Status};
//! use tautline_core::swarm::Rows;
//!
//! // Head-on past each other in one step: 10 m apart at both ends, 1 m apart in between.
//! let mut auditor = Auditor::new(2, 2.0)?;
//! auditor.start(0.0, &Rows::from_row_slice(&[-5.0, 0.0, 0.0, 5.0, 1.0, 0.0]))?;
//! let finding = auditor.step(1.0, &Rows::from_row_slice(&[5.0, 0.0, 0.0, -5.0, 1.0, 0.0]))?;
//! assert_eq!(finding.closest.map(|closest| (closest.separation_m, closest.time_s)), Some((1.0, 0.5)));
//! assert_eq!(auditor.finish().status, Status::Violation);
//! # Ok::<(), tautline_audit::AuditError>(())
//! ```

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod auditor;
mod candidates;
mod clearance;
mod cross_check;
mod cylinder;
mod decimals;
mod double_double;
mod enclosure;
pub mod envelope;
mod exact;
mod findings;
#[cfg(test)]
mod fractions;
mod ledger;
mod obstacle;
mod outcome;
mod pair_sweep;
mod polynomial;
pub mod recorded;
mod segment;
mod slices;
mod sweep;
mod well_clear;

pub use auditor::{AuditError, Auditor};
pub use clearance::{ClearanceAuditor, ClearanceFinding, ClearanceOutcome, swept_distance_m};
pub use cylinder::Cylinder;
pub use decimals::are_decimals_apart;
pub use findings::{LISTED, Tally};
pub use nalgebra;
pub use obstacle::{MovingObstacle, ObstacleError, ObstacleFault};
pub use outcome::{
    Approach, AuditOutcome, Disagreement, ObjectPair, ParryEvidence, Status, StepFinding, Undecided, Violation,
};
pub use recorded::TrackAuditor;
pub use slices::{Slice, Slices};
pub use sweep::{Sweep, sweep, swept_separation_m};
pub use tautline_core::{swarm, track};
pub use well_clear::WellClear;
