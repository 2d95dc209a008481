//! The independent judge: did any two come closer than they may?
//!
//! It is fed with motion alone and knows no controller and no engine. Motion comes in segments: the steps of a flight, in
//! which every vehicle moves on a straight line from one instant to the next ([`Auditor`], and [`ClearanceAuditor`] past
//! obstacles), or what a recording says of
//! each vehicle at times of its own, on lines, on curves, or within a bound ([`recorded`]). Whole segments are swept, so
//! nothing passes between samples. Two detectors look at each pair that is swept:
//!
//! - the closed form: the smallest |r0 + s d| over s from 0 to 1, where r0 is the relative position at the start of the
//!   segment and d its change. It gives the verdict. Where its rounding leaves a doubt, exact arithmetic on the positions decides. On
//!   curves the smallest distance is enclosed;
//! - parry's shape cast of two keep-out balls of radius delta/2. It must agree.
//!
//! The second is a cross-check of the formula and no second proof: both are given the same list of pairs and the same
//! relative motion, so a pair that is wrongly left out, or a motion that is wrongly read, is wrong for both.
//!
//! A violation is a separation **strictly** below the limit, exactly: positions and times are taken as the doubles that they are.
//!
//! Large swarms are not swept pair by pair: pairs that a bound on motion proves to be neither too close nor among the
//! closest are left out, so the answer is that of the full sweep.
//!
//! ```
//! use tautline_audit::{Auditor, Status};
//! use tautline_core::swarm::Rows;
//!
//! // Head-on past each other in one step: far apart at both ends, 1 m apart in between.
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
mod double_double;
mod enclosure;
pub mod envelope;
mod exact;
mod findings;
mod ledger;
mod obstacle;
mod outcome;
mod pair_sweep;
mod polynomial;
pub mod recorded;
mod segment;
mod slices;
mod sweep;

pub use auditor::{AuditError, Auditor};
pub use clearance::{ClearanceAuditor, ClearanceFinding, ClearanceOutcome, swept_distance_m};
pub use findings::{LISTED, Tally};
pub use obstacle::{Obstacle, ObstacleError, Shape};
pub use outcome::{
    Approach, AuditOutcome, Disagreement, ObjectPair, ParryEvidence, Status, StepFinding, Undecided, Violation,
};
pub use recorded::TrackAuditor;
pub use slices::{Slice, Slices};
pub use sweep::swept_separation_m;
pub use tautline_core::{swarm, track};
