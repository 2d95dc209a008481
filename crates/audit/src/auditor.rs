//! Audit of a flight: straight steps of all vehicles, one after the other.

use super::candidates::{Candidates, pair_count, pairs, pairs_of};
use super::cross_check::KeepOut;
use super::exact::ExactMotion;
use super::ledger::Ledger;
use super::outcome::{AuditOutcome, Status, StepFinding, Violation};
use super::segment::Line;
use super::sweep::{ClosestPoint, Interval, MAX_LENGTH_M, MIN_LIMIT_M, RelativeMotion};
use tautline_core::swarm::{ClosestApproach, Pair, Rows, row, separation};

/// Audits a flight instant by instant.
///
/// Call [`start`](Auditor::start) once, then [`step`](Auditor::step) for each step; [`finish`](Auditor::finish) returns
/// the verdict. A step allocates only for new violations once the lists have grown to the size of the swarm.
#[derive(Clone, Debug)]
pub struct Auditor {
    vehicles: usize,
    keep_out: KeepOut,
    /// Last judged instant; `None` before the start.
    time_s: Option<f64>,
    positions_m: Rows,
    /// Smallest separation of some pairs at the last instant \[m\]: an upper bound for the closest approach of the next
    /// step.
    nearest_m: f64,
    candidates: Candidates,
    ledger: Ledger<Pair>,
    /// Violations that began in the last step, and violations that ended in it.
    began: Vec<Violation>,
    ended: Vec<Violation>,
    /// Counts so far, and the closest approach so far.
    outcome: AuditOutcome,
    /// Motion of the closest pair during the step of the closest approach.
    closest_motion: Option<ExactMotion>,
}

impl Auditor {
    /// Creates an auditor of `vehicles` vehicles with the safety distance delta \[m\]. Fewer than two vehicles are
    /// always clear.
    ///
    /// # Errors
    /// [`AuditError::Delta`] unless delta is between 1e-70 m and 1e70 m; [`AuditError::TooManyVehicles`] from 2^32
    /// vehicles on.
    pub fn new(vehicles: usize, delta_m: f64) -> Result<Self, AuditError> {
        if !(MIN_LIMIT_M..=MAX_LENGTH_M).contains(&delta_m) {
            return Err(AuditError::Delta { delta_m, min_m: MIN_LIMIT_M, max_m: MAX_LENGTH_M });
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
            candidates: Candidates::new(vehicles),
            ledger: Ledger::default(),
            began: Vec::new(),
            ended: Vec::new(),
            outcome: AuditOutcome::default(),
            closest_motion: None,
        })
    }

    /// Judges the first instant: `positions_m` is N x 3 \[m\].
    ///
    /// # Errors
    /// [`AuditError`] if the instant cannot be judged, or the auditor was already started. Only the count of refusals
    /// changes then, which keeps the outcome from being clear.
    pub fn start(&mut self, time_s: f64, positions_m: &Rows) -> Result<StepFinding<'_>, AuditError> {
        let checked = if self.time_s.is_some() { Err(AuditError::AlreadyStarted) } else { Ok(()) };
        self.check_input(checked.and_then(|()| check_instant(self.vehicles, time_s, positions_m)))?;
        self.positions_m.clone_from(positions_m);
        self.nearest_m = (1..self.vehicles).map(|i| separation(positions_m, i - 1, i)).fold(f64::INFINITY, f64::min);
        Ok(self.sweep(Interval { from_s: time_s, to_s: time_s }, positions_m))
    }

    /// Judges the straight motion from the last instant to this one: `positions_m` is N x 3 \[m\].
    ///
    /// # Errors
    /// [`AuditError`] if the instant cannot be judged. Only the count of refusals changes then, which keeps the outcome
    /// from being clear. A later step is swept from the last judged instant.
    pub fn step(&mut self, time_s: f64, positions_m: &Rows) -> Result<StepFinding<'_>, AuditError> {
        let checked = match self.time_s {
            None => Err(AuditError::NotStarted),
            Some(previous_s) if time_s <= previous_s => Err(AuditError::TimeNotIncreasing { previous_s, time_s }),
            Some(previous_s) => check_instant(self.vehicles, time_s, positions_m).map(|()| previous_s),
        };
        let previous_s = self.check_input(checked)?;
        self.outcome.steps += 1;
        Ok(self.sweep(Interval { from_s: previous_s, to_s: time_s }, positions_m))
    }

    /// Returns the violations found so far, ordered by the step in which they began and then by pair.
    #[must_use]
    pub fn violations(&self) -> &[Violation] {
        &self.ledger.violations
    }

    /// Returns the closest approach of two vehicles so far.
    #[must_use]
    pub fn closest(&self) -> Option<ClosestApproach> {
        self.outcome.closest
    }

    /// Returns the verdict over all judged steps.
    ///
    /// Without a violation the smallest separation is rounded down, as in the audit of a recording. With violations it
    /// is the value of the closest approach.
    #[must_use]
    pub fn finish(mut self) -> AuditOutcome {
        let decided = self.time_s.is_some() && self.outcome.refused == 0 && self.ledger.is_decided();
        let parry = self.ledger.parry;
        let violations = self.ledger.into_lists().violations;
        let status = Status::new(!violations.is_empty(), decided);
        if let Some((closest, motion)) = self.outcome.closest.as_mut().zip(self.closest_motion)
            && violations.is_empty()
        {
            closest.separation_m = motion.separation();
        }
        AuditOutcome { status, violations, parry, ..self.outcome }
    }

    fn check_input<T>(&mut self, checked: Result<T, AuditError>) -> Result<T, AuditError> {
        self.outcome.refused += u64::from(checked.is_err());
        checked
    }

    /// Sweeps from the stored positions to `to`, which must have been checked.
    fn sweep(&mut self, step: Interval, to: &Rows) -> StepFinding<'_> {
        let Self { keep_out, positions_m: from, ledger, began, ended, .. } = self;
        // Of equal separations the first is kept.
        let (mut pair, mut closest) = ((0, 0), ClosestPoint { squared: f64::INFINITY, at: 0.0 });
        let mut nearest_squared = f64::INFINITY;
        began.clear();
        ended.clear();

        let bound_m = self.nearest_m.max(keep_out.delta_m);
        let listed = self.candidates.cover(from, to, bound_m);
        let swept = pairs_of(listed, self.vehicles);
        for (i, j) in pairs(listed, self.vehicles) {
            let motion = RelativeMotion::new(row(from, j) - row(from, i), row(to, j) - row(to, i));
            let point = motion.closest();
            if point.squared < closest.squared && point.separation_m() < closest.separation_m() {
                (pair, closest) = ((i, j), point);
            }
            nearest_squared = nearest_squared.min(motion.to_squared);
            let contact = keep_out.cast(&motion);
            if contact.is_some() || keep_out.is_near(&motion, point) {
                let known = ledger.violations.len();
                let exact = exact_motion([from, to], [i, j], step);
                // The separation reported for the closest approach, or the next double below the limit if rounding
                // lifts it to the limit.
                let least_m = || point.separation_m().min(keep_out.delta_m.next_down());
                if let Some(index) = ledger.judge_straight(Pair::new(i, j), keep_out, &motion, contact, &exact, least_m)
                {
                    let violation = ledger.violations[index];
                    if index == known {
                        began.push(violation);
                    }
                    if motion.to_squared.sqrt() >= keep_out.delta_m {
                        ended.push(violation);
                    }
                }
            }
        }

        self.outcome.pairs_checked += swept;
        self.outcome.pairs_excluded += pair_count(self.vehicles) - swept;
        let (separation_m, time_s) = (closest.separation_m(), step.at(closest.at));
        let pair = (pair.0 != pair.1).then(|| Pair::new(pair.0, pair.1));
        let closest = pair.map(|pair| ClosestApproach { pair, separation_m, time_s });
        if let Some(new) = closest
            && self.outcome.closest.is_none_or(|old| new.separation_m < old.separation_m)
        {
            self.outcome.closest = closest;
            let vehicles = [new.pair.first(), new.pair.second()];
            self.closest_motion = Some(exact_motion([&self.positions_m, to], vehicles, step));
        }
        self.nearest_m = nearest_squared.sqrt();
        self.positions_m.copy_from(to);
        self.time_s = Some(step.to_s);
        StepFinding { closest, began: &self.began, ended: &self.ended }
    }
}

/// Returns the straight motion of a pair over a step.
fn exact_motion([from, to]: [&Rows; 2], [i, j]: [usize; 2], interval: Interval) -> ExactMotion {
    let Interval { from_s, to_s } = interval;
    let line = |vehicle| Line { from_s, to_s, from: row(from, vehicle), to: row(to, vehicle) };
    ExactMotion { first: line(i), second: line(j), interval }
}

/// Checks that an instant can be judged: a finite time, and a position within range for each vehicle.
pub(super) fn check_instant(vehicles: usize, time_s: f64, positions_m: &Rows) -> Result<(), AuditError> {
    if !time_s.is_finite() {
        return Err(AuditError::TimeNotFinite { time_s });
    }
    if positions_m.nrows() != vehicles {
        return Err(AuditError::WrongCount { expected: vehicles, found: positions_m.nrows() });
    }
    let near = |x: &f64| x.abs() <= MAX_LENGTH_M;
    // Without an early exit the common case has no branch per number.
    if positions_m.as_slice().iter().fold(true, |all, x| all & near(x)) {
        return Ok(());
    }
    let far = (0..vehicles).find(|&i| !positions_m.row(i).iter().all(near));
    far.map_or(Ok(()), |vehicle| {
        Err(if positions_m.row(vehicle).iter().all(|x| x.is_finite()) {
            AuditError::TooFar { vehicle, time_s, limit_m: MAX_LENGTH_M }
        } else {
            AuditError::NotFinite { vehicle, time_s }
        })
    })
}

/// Reason why an input was not judged. The outcome can no longer be clear then.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AuditError {
    /// The safety distance is not a positive number within range.
    #[error("delta: must be between {min_m:e} m and {max_m:e} m, got {delta_m} m")]
    Delta {
        /// Safety distance \[m\].
        delta_m: f64,
        /// Smallest accepted value \[m\].
        min_m: f64,
        /// Largest accepted value \[m\].
        max_m: f64,
    },
    /// The number of vehicles exceeds 2^32 - 1.
    #[error("the number of vehicles must be at most {max}, got {vehicles}", max = u32::MAX)]
    TooManyVehicles {
        /// Number of vehicles.
        vehicles: usize,
    },
    /// A step was given before the start.
    #[error("the first step came before the start; call `start` first")]
    NotStarted,
    /// The auditor was started twice.
    #[error("the auditor was already started; call `step`")]
    AlreadyStarted,
    /// The number of positions differs from the number of vehicles.
    #[error("expected the positions of {expected} vehicles, found {found}")]
    WrongCount {
        /// Number of vehicles that are judged.
        expected: usize,
        /// Number of positions.
        found: usize,
    },
    /// The time is not a finite number.
    #[error("the time {time_s} s is not a finite number")]
    TimeNotFinite {
        /// Time \[s\].
        time_s: f64,
    },
    /// The time is not later than the previous one.
    #[error("the time {time_s} s is not later than the time before, {previous_s} s")]
    TimeNotIncreasing {
        /// Previous time \[s\].
        previous_s: f64,
        /// Time \[s\].
        time_s: f64,
    },
    /// A position is not a finite number.
    #[error("the position of vehicle {} at {time_s} s is not a finite number", vehicle + 1)]
    NotFinite {
        /// Index of the vehicle, from 0.
        vehicle: usize,
        /// Time \[s\].
        time_s: f64,
    },
    /// A position is so large that its square could overflow.
    #[error("the position of vehicle {} at {time_s} s is beyond {limit_m:e} m, too far to judge", vehicle + 1)]
    TooFar {
        /// Index of the vehicle, from 0.
        vehicle: usize,
        /// Time \[s\].
        time_s: f64,
        /// Largest accepted coordinate \[m\].
        limit_m: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns an auditor whose second detector uses a larger delta than the first.
    fn auditor_with_wrong_second_detector() -> Auditor {
        let mut auditor = Auditor::new(2, 2.0).unwrap();
        auditor.keep_out = KeepOut::new(2.1);
        auditor.keep_out.delta_m = 2.0;
        auditor
    }

    fn pass(miss_m: f64) -> [Rows; 2] {
        [-5.0, 5.0].map(|x| Rows::from_row_slice(&[0.0, 0.0, 0.0, x, miss_m, 0.0]))
    }

    #[test]
    fn a_contact_of_one_detector_alone_is_undecided_and_reported() {
        let [before, after] = pass(2.05);
        let mut auditor = auditor_with_wrong_second_detector();
        auditor.start(0.0, &before).unwrap();
        auditor.step(1.0, &after).unwrap();
        let outcome = auditor.finish();
        assert_eq!((outcome.status, outcome.parry.disagreements), (Status::Undecided, 1));
        let first = outcome.parry.first_disagreement.unwrap();
        assert_eq!((first.pair, first.closed_form_s, first.min_m), (Pair::new(0, 1), None, 2.05));
        assert!(first.parry_s.is_some() && first.parry_s == outcome.parry.min_toi_s);
        let sentence = first.to_string();
        assert!(sentence.starts_with("vehicles 1 and 2 between 0 s and 1 s, smallest separation 2.05 m"), "{sentence}");
    }

    #[test]
    fn entries_at_different_times_are_a_violation_and_a_disagreement() {
        let [before, after] = pass(1.0);
        let mut auditor = auditor_with_wrong_second_detector();
        auditor.start(0.0, &before).unwrap();
        auditor.step(1.0, &after).unwrap();
        let outcome = auditor.finish();
        assert_eq!((outcome.status, outcome.parry.disagreements), (Status::Violation, 1));
    }

    #[test]
    fn two_correct_detectors_agree() {
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
    fn an_auditor_can_be_sent_to_another_thread() {
        fn is_send<T: Send>(_: &T) {}
        is_send(&Auditor::new(2, 2.0).unwrap());
    }
}
