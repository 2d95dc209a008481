//! How a flight ends, and what it leaves behind.

use std::time::Duration;

use crate::link::Traffic;
use tautline_audit::{AuditError, AuditOutcome, ClearanceOutcome, ObstacleError, Status};
use tautline_core::record::{DeadlockRecovery, EnergyRise, Reassignment, RecordError};
use tautline_core::swarm::{Bounce, Pair, Swarm};
use tautline_laws::law::{Certificate, LawError, ParameterError};

/// A path may bend away from the straight line that is swept by this much \[m\]; two vehicles by twice as much. A step
/// that bends more is flown in halves.
pub(super) const MAX_BEND_M: f64 = 1e-5;
/// Largest acceleration that is flown, along any axis \[m/s^2\]. What it leads to within any flight stays within what judges and
/// readers of recordings take.
pub(super) const MAX_COMMAND_M_S2: f64 = 1e30;

/// What a flight left behind besides its recording.
#[derive(Clone, Debug)]
pub struct Flight {
    /// Name of the law that was flown.
    pub law: String,
    /// How it ended.
    pub ending: Ending,
    /// Time flown \[s\].
    pub duration_s: f64,
    /// Whole steps flown.
    pub steps: u64,
    /// Those of them that were flown in parts.
    pub refined_steps: u64,
    /// Those of which even the shortest part was longer than the law allows: from the first on it is not the law's motion.
    pub overlong_steps: u64,
    /// The law's promise, made before the first step; void where the steps were too long for it.
    pub certificate: Certificate,
    /// What the independent judge found. Its status is undecided where integration may have made all violations: where steps were too
    /// long for the law, and no violation is deeper than the bound of their error or began before the first of them.
    pub audit: AuditOutcome,
    /// Where that was of scaled lengths ([`tautline_laws::space::Metric`]): what it found in metres, by the widest hulls.
    pub in_metres: Option<AuditOutcome>,
    /// What it found of the ways past obstacles, where there are any.
    pub clearance: Option<ClearanceOutcome>,
    /// Pairs whose keep-out balls the plant's own collision detection saw overlap, in index order.
    pub engine_contacts: Vec<Pair>,
    /// Every time that two hulls hit, in order of time: from then on a bounce is flown and not the law's motion alone.
    pub bounces: Vec<Bounce>,
    /// By how much the law's energy rose between two changes of its target, at most: the rise that integration
    /// explains least; none for a law without energy.
    pub energy_rise: Option<EnergyRise>,
    /// Every time that slots were spread, in the order of time.
    pub deadlock_recoveries: Vec<DeadlockRecovery>,
    /// Every time that vehicles were given other slots, in the order of time.
    pub assignments: Vec<Reassignment>,
    /// What was sent over its network, where messages were sent one by one.
    pub traffic: Option<Traffic>,
    /// State at the end.
    pub last: Swarm,
    /// Wall-clock time by kind of work.
    pub performance: Performance,
}

impl Flight {
    /// Returns the verdict on vehicles and obstacles together, over what was flown.
    #[must_use]
    pub fn status_so_far(&self) -> Status {
        self.audit.status.and(self.clearance.as_ref().map_or(Status::Clear, |clearance| clearance.status))
    }

    /// Returns the verdict on the whole flight that the scenario asks for: undecided at best where it ended early.
    #[must_use]
    pub fn status(&self) -> Status {
        let is_whole = self.ending == Ending::Completed;
        self.status_so_far().and(if is_whole { Status::Clear } else { Status::Undecided })
    }
}

/// How a flight ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// At the scenario's duration.
    Completed,
    /// The caller asked for it.
    Interrupted,
    /// The law had no answer for the state that was reached.
    LawUndefined(LawError),
    /// The motion could not be carried on.
    BrokeDown(Breakdown),
}

/// Wall-clock time by kind of work. Work done side by side counts in each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Performance {
    /// From first to last step.
    pub wall: Duration,
    /// In the law.
    pub law: Duration,
    /// In the law's energy, which every step is looked at for.
    pub energy: Duration,
    /// In the plant.
    pub physics: Duration,
    /// Of that, in the forces, rotors and attitude loops of vehicles that have them.
    pub airframe: Duration,
    /// In the audit.
    pub audit: Duration,
    /// In what receives the recording.
    pub record: Duration,
}

/// Why a motion could not be carried on. The state before is the last.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Breakdown {
    /// The law commanded something that is not a number.
    #[error("step {step}: the law's command for vehicle {} is not a finite number", vehicle + 1)]
    CommandNotFinite {
        /// The step, from 1; 0 is the start.
        step: u64,
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// The law commanded an acceleration that no flight comes back from, and that no judge can follow.
    #[error("step {step}: the law's command for vehicle {} is beyond {MAX_COMMAND_M_S2:e} m/s^2", vehicle + 1)]
    CommandOutOfRange {
        /// The step, from 1; 0 is the start.
        step: u64,
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// A vehicle's state left the range of numbers.
    #[error("step {step}: the state of vehicle {} is no longer a finite number", vehicle + 1)]
    StateNotFinite {
        /// The step, from 1; 0 is the start.
        step: u64,
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// Rounding may have moved the vehicles by more than what has to be resolved.
    #[error(
        "step {step}: rounding may have moved vehicles by {rounding_m:.1e} m, and {required_m} m has to be resolved: positions or \
         velocities are too large for steps this short"
    )]
    Unresolved {
        /// The step, from 1.
        step: u64,
        /// Upper bound of the accumulated rounding error of a coordinate \[m\].
        rounding_m: f64,
        /// The position error that counts as reached \[m\].
        required_m: f64,
    },
    /// The plant could not be solved any further.
    #[error("step {step}: the equation of motion cannot be solved to its tolerances")]
    Stalled {
        /// The step, from 1.
        step: u64,
    },
    /// A path bends too far from the straight line that is swept, however often the step is halved.
    #[error(
        "step {step}: a path bends by {bend_m:.1e} m from the straight line that is audited, and {MAX_BEND_M:e} m are allowed"
    )]
    Bent {
        /// The step, from 1.
        step: u64,
        /// By how much at most \[m\].
        bend_m: f64,
    },
    /// The judge refused what it was shown.
    #[error("step {step}: {why}")]
    Audit {
        /// The step, from 1; 0 is the start.
        step: u64,
        /// The judge's reason.
        why: AuditError,
    },
}

/// Why there is no flight to report on.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// There is no judge for the scenario.
    #[error(transparent)]
    Audit(#[from] AuditError),
    /// An obstacle cannot be judged.
    #[error(transparent)]
    Obstacle(#[from] ObstacleError),
    /// The recording could not be kept.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The law does not exist.
    #[error(transparent)]
    Law(#[from] ParameterError),
    /// The scenario has no formation to fly to.
    #[error("the scenario has no leg")]
    NoLeg,
    /// Vehicles that are not those of the scenario.
    #[error("the scenario has {expected} vehicles, and what moves them has {found}")]
    Vehicles {
        /// Number of vehicles of the scenario.
        expected: usize,
        /// Number of vehicles that are moved.
        found: usize,
    },
    /// Accelerations from outside that are not a finite row for each vehicle.
    #[error(
        "{found} rows of accelerations for {expected} vehicles, or a number among them that is not finite or beyond \
         {MAX_COMMAND_M_S2:e} m/s^2"
    )]
    Commands {
        /// Number of vehicles.
        expected: usize,
        /// Number of rows given.
        found: usize,
    },
}

impl Ending {
    /// Why a flight ended before its time, in a sentence.
    #[must_use]
    pub fn reason(&self) -> Option<String> {
        match self {
            Self::Completed => None,
            Self::Interrupted => Some("interrupted".to_owned()),
            Self::LawUndefined(why) => Some(format!("the law is undefined: {why}")),
            Self::BrokeDown(why) => Some(why.to_string()),
        }
    }
}

impl From<LawError> for Ending {
    fn from(undefined: LawError) -> Self {
        Self::LawUndefined(undefined)
    }
}

impl From<Breakdown> for Ending {
    fn from(breakdown: Breakdown) -> Self {
        Self::BrokeDown(breakdown)
    }
}
