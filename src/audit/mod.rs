//! The independent judge: did any two vehicles come closer than delta?
//!
//! An [`Auditor`] is fed with instants, each a time and a position per vehicle, and knows no controller and no engine.
//! Between two instants every vehicle moves on a straight line at constant speed, and the whole step is swept, so nothing
//! passes between samples. Two detectors look at each pair:
//!
//! - the closed form: the smallest |r0 + s d| over s from 0 to 1, where r0 is the relative position at the start of the
//!   step and d its change. It gives the verdict;
//! - parry's shape cast of two keep-out balls of radius delta/2, on the same relative motion. It must agree.
//!
//! A violation is a separation **strictly** below delta. Both work on relative positions, so coordinates far from the
//! origin lose nothing that the positions themselves have not lost. The closed form resolves a separation to 4 eps
//! (1e-15) of the pair's distance at the ends of the step.
//!
//! Large swarms are not swept pair by pair: pairs that a bound on motion proves to be neither below delta nor the closest
//! of the step are left out, so the answer is that of the full sweep, to the last bit.
//!
//! ```
//! use tautline::audit::{Auditor, Status};
//! use tautline::swarm::Rows;
//!
//! // Head-on past each other in one step: far apart at both ends, 1 m apart in between.
//! let mut auditor = Auditor::new(2, 2.0)?;
//! auditor.start(0.0, &Rows::from_row_slice(&[-5.0, 0.0, 0.0, 5.0, 1.0, 0.0]))?;
//! let finding = auditor.step(1.0, &Rows::from_row_slice(&[5.0, 0.0, 0.0, -5.0, 1.0, 0.0]))?;
//! assert_eq!(finding.closest.map(|closest| (closest.separation_m, closest.time_s)), Some((1.0, 0.5)));
//! assert_eq!(auditor.finish().status, Status::Violation);
//! # Ok::<(), tautline::audit::AuditError>(())
//! ```

mod candidates;
mod judge;
mod ledger;
mod outcome;
mod parry;
pub mod recorded;
mod sweep;

pub use outcome::{AuditError, AuditOutcome, Disagreement, ParryEvidence, Status, StepFinding, Violation};

use nalgebra::Vector3;

use crate::swarm::{ClosestApproach, Pair, Rows, row, separation};
use candidates::{Candidates, pair_count};
use judge::{Closest, Findings, Step};
use ledger::{Below, Ledger};
use parry::KeepOut;
use sweep::RelativeMotion;

/// Largest coordinate that is judged \[m\]: fourth powers of lengths, which the cast forms, stay finite.
const MAX_COORDINATE_M: f64 = 1e70;
/// Smallest delta that is judged by \[m\], by the same reason.
const MIN_DELTA_M: f64 = 1e-70;
/// Judges a motion instant by instant.
///
/// Feed it one [`start`](Auditor::start) and then [`step`](Auditor::step) by step; [`finish`](Auditor::finish) gives the
/// verdict. A step allocates nothing once the lists have grown to the swarm, except for new violations.
#[derive(Clone, Debug)]
pub struct Auditor {
    vehicles: usize,
    keep_out: KeepOut,
    /// The last instant judged; `None` before the start.
    time_s: Option<f64>,
    positions_m: Rows,
    /// The smallest separation at the last instant \[m\] among some pairs: the next step's closest approach is at most
    /// this.
    nearest_m: f64,
    candidates: Candidates,
    below: Vec<Below>,
    ledger: Ledger,
    closest: Option<ClosestApproach>,
    steps: u64,
    pairs_checked: u64,
    pairs_excluded: u64,
    refused: u64,
    unresolved: u64,
    parry: ParryEvidence,
}

/// Smallest distance of two vehicles \[m\] while their relative position moves on a straight line from `from` to `to`
/// \[m\].
#[must_use]
pub fn swept_separation_m(from: Vector3<f64>, to: Vector3<f64>) -> f64 {
    RelativeMotion::new(from, to).closest().squared.sqrt()
}

impl Auditor {
    /// A judge of so many vehicles by the safety distance delta \[m\]. Fewer than two vehicles are always clear.
    ///
    /// # Errors
    /// [`AuditError::Delta`] unless delta is between 1e-70 m and 1e70 m; [`AuditError::TooManyVehicles`] beyond 2^32 - 1.
    pub fn new(vehicles: usize, delta_m: f64) -> Result<Self, AuditError> {
        if !(MIN_DELTA_M..=MAX_COORDINATE_M).contains(&delta_m) {
            return Err(AuditError::Delta { delta_m, min_m: MIN_DELTA_M, max_m: MAX_COORDINATE_M });
        }
        if u32::try_from(vehicles).is_err() {
            return Err(AuditError::TooManyVehicles { vehicles });
        }
        Ok(Self {
            vehicles,
            keep_out: KeepOut::new(delta_m),
            time_s: None,
            positions_m: Rows::zeros(0),
            nearest_m: f64::INFINITY,
            candidates: Candidates::new(),
            below: Vec::new(),
            ledger: Ledger::default(),
            closest: None,
            steps: 0,
            pairs_checked: 0,
            pairs_excluded: 0,
            refused: 0,
            unresolved: 0,
            parry: ParryEvidence::default(),
        })
    }

    /// Judges the first instant: `positions_m` is N x 3 \[m\].
    ///
    /// # Errors
    /// [`AuditError`] where the instant cannot be judged, or there already was a first one. Nothing changes then but the
    /// outcome's count of refusals, which keeps it from being clear.
    pub fn start(&mut self, time_s: f64, positions_m: &Rows) -> Result<StepFinding<'_>, AuditError> {
        let checked = if self.time_s.is_some() { Err(AuditError::AlreadyStarted) } else { Ok(()) };
        self.admit(checked.and_then(|()| self.check(time_s, positions_m)))?;
        self.positions_m.clone_from(positions_m);
        self.nearest_m = (1..self.vehicles).map(|i| separation(positions_m, i - 1, i)).fold(f64::INFINITY, f64::min);
        Ok(self.sweep(Step { from_s: time_s, to_s: time_s }, positions_m))
    }

    /// Judges the straight motion from the instant before to this one: `positions_m` is N x 3 \[m\].
    ///
    /// # Errors
    /// [`AuditError`] where the instant cannot be judged. Nothing changes then but the outcome's count of refusals, which
    /// keeps it from being clear; a later step is swept from the last instant that was judged.
    pub fn step(&mut self, time_s: f64, positions_m: &Rows) -> Result<StepFinding<'_>, AuditError> {
        let checked = match self.time_s {
            None => Err(AuditError::NotStarted),
            Some(previous_s) if time_s <= previous_s => Err(AuditError::TimeNotIncreasing { previous_s, time_s }),
            Some(previous_s) => self.check(time_s, positions_m).map(|()| previous_s),
        };
        let previous_s = self.admit(checked)?;
        self.steps += 1;
        Ok(self.sweep(Step { from_s: previous_s, to_s: time_s }, positions_m))
    }

    /// Violations found so far, in the order of the steps in which they began and by pair within a step.
    #[must_use]
    pub fn violations(&self) -> &[Violation] {
        &self.ledger.violations
    }

    /// The verdict over everything judged.
    #[must_use]
    pub fn finish(self) -> AuditOutcome {
        let decided =
            self.time_s.is_some() && self.refused == 0 && self.unresolved == 0 && self.parry.disagreements == 0;
        let status = match (self.ledger.violations.is_empty(), decided) {
            (false, _) => Status::Violation,
            (true, true) => Status::Clear,
            (true, false) => Status::Undecided,
        };
        AuditOutcome {
            status,
            closest: self.closest,
            violations: self.ledger.into_violations(),
            steps: self.steps,
            pairs_checked: self.pairs_checked,
            pairs_excluded: self.pairs_excluded,
            refused: self.refused,
            unresolved: self.unresolved,
            parry: self.parry,
        }
    }

    fn admit<T>(&mut self, checked: Result<T, AuditError>) -> Result<T, AuditError> {
        self.refused += u64::from(checked.is_err());
        checked
    }

    fn check(&self, time_s: f64, positions_m: &Rows) -> Result<(), AuditError> {
        if !time_s.is_finite() {
            return Err(AuditError::TimeNotFinite { time_s });
        }
        if positions_m.nrows() != self.vehicles {
            return Err(AuditError::WrongCount { expected: self.vehicles, found: positions_m.nrows() });
        }
        let near = |x: &f64| x.abs() <= MAX_COORDINATE_M;
        // Without an early exit the usual case has no branch per number.
        if positions_m.iter().fold(true, |all, x| all & near(x)) {
            return Ok(());
        }
        let far = (0..self.vehicles).find(|&i| !positions_m.row(i).iter().all(near));
        far.map_or(Ok(()), |vehicle| {
            Err(if positions_m.row(vehicle).iter().all(|x| x.is_finite()) {
                AuditError::TooFar { vehicle, time_s, limit_m: MAX_COORDINATE_M }
            } else {
                AuditError::NotFinite { vehicle, time_s }
            })
        })
    }

    /// Sweeps from the positions held to `to`, which must have been checked.
    fn sweep(&mut self, step: Step, to: &Rows) -> StepFinding<'_> {
        let Self { keep_out, positions_m: from, .. } = self;
        let mut closest = Closest::NONE;
        let mut nearest_squared = f64::INFINITY;
        self.below.clear();
        let mut findings =
            Findings { below: &mut self.below, parry: &mut self.parry, unresolved: &mut self.unresolved };

        let bound_m = self.nearest_m.max(keep_out.delta_m);
        let swept = self.candidates.cover(from, to, bound_m).for_each(|i, j| {
            let motion = RelativeMotion::new(row(from, j) - row(from, i), row(to, j) - row(to, i));
            let approach = motion.closest();
            closest.offer(i, j, approach);
            nearest_squared = nearest_squared.min(motion.to_squared);
            let cast = keep_out.cast(&motion);
            if cast.is_some() || keep_out.is_near(&motion, approach) {
                findings.enter(keep_out, step, Pair::new(i, j), &motion, approach, cast);
            }
        });

        self.pairs_checked += swept;
        self.pairs_excluded += pair_count(self.vehicles) - swept;
        self.ledger.enter(&self.below);
        let closest = closest.over(step);
        if let Some(new) = closest
            && self.closest.is_none_or(|old| new.separation_m < old.separation_m)
        {
            self.closest = closest;
        }
        self.nearest_m = nearest_squared.sqrt();
        self.positions_m.copy_from(to);
        self.time_s = Some(step.to_s);
        StepFinding { closest, began: &self.ledger.began, ended: &self.ledger.ended }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A judge whose second detector measures with another delta than the first.
    fn judge_with_a_wrong_second_detector() -> Auditor {
        let mut auditor = Auditor::new(2, 2.0).unwrap();
        auditor.keep_out = KeepOut::new(2.1);
        auditor.keep_out.delta_m = 2.0;
        auditor
    }

    fn pass(miss_m: f64) -> [Rows; 2] {
        [-5.0, 5.0].map(|x| Rows::from_row_slice(&[0.0, 0.0, 0.0, x, miss_m, 0.0]))
    }

    #[test]
    fn a_pass_that_only_one_detector_calls_contact_is_undecided_and_says_why() {
        let [before, after] = pass(2.05);
        let mut auditor = judge_with_a_wrong_second_detector();
        auditor.start(0.0, &before).unwrap();
        auditor.step(1.0, &after).unwrap();
        let outcome = auditor.finish();
        assert_eq!((outcome.status, outcome.parry.disagreements), (Status::Undecided, 1));
        let first = outcome.parry.first_disagreement.unwrap();
        assert_eq!((first.pair, first.closed_form_s, first.min_m), (Pair::new(0, 1), None, 2.05));
        assert!(first.parry_s.is_some() && first.parry_s == outcome.parry.min_toi_s);
        let sentence = first.to_string();
        assert!(sentence.starts_with("vehicles 1-2 between 0 s and 1 s, smallest separation 2.05 m"), "{sentence}");
    }

    #[test]
    fn entries_at_different_times_are_a_disagreement_beside_the_violation() {
        let [before, after] = pass(1.0);
        let mut auditor = judge_with_a_wrong_second_detector();
        auditor.start(0.0, &before).unwrap();
        auditor.step(1.0, &after).unwrap();
        let outcome = auditor.finish();
        assert_eq!((outcome.status, outcome.parry.disagreements), (Status::Violation, 1));
    }

    #[test]
    fn two_right_detectors_call_the_same_passes_clear_and_violation() {
        for (miss_m, status) in [(2.05, Status::Clear), (1.0, Status::Violation)] {
            let [before, after] = pass(miss_m);
            let mut auditor = Auditor::new(2, 2.0).unwrap();
            auditor.start(0.0, &before).unwrap();
            auditor.step(1.0, &after).unwrap();
            let outcome = auditor.finish();
            assert_eq!((outcome.status, outcome.parry.disagreements), (status, 0));
        }
    }

    #[test]
    fn a_judge_can_be_sent_to_another_thread() {
        fn is_send<T: Send>(_: &T) {}
        is_send(&Auditor::new(2, 2.0).unwrap());
    }
}
