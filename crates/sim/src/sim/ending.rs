//! Result and ending of a flight, and errors of a simulation.

use std::time::{Duration, Instant};

use crate::link::Traffic;
use crate::scenario::ScenarioError;
use crate::shield::ShieldReport;
use tautline_audit::{AuditError, AuditOutcome, ClearanceOutcome, ObstacleError, Status};
use tautline_core::failure::Failure;
use tautline_core::impl_coded;
use tautline_core::record::{DeadlockRecovery, EnergyRise, Reassignment, RecordError};
use tautline_core::swarm::{Bounce, Pair, Swarm};
use tautline_laws::law::{Certificate, LawError, ParameterError};

/// Largest distance of a path from the swept straight line, as a share of delta; of two vehicles twice that. Steps with
/// larger bends are halved.
pub(crate) const MAX_BEND: f64 = 1e-5;
/// Largest acceleration along any axis \[m/s^2\]. Motions up to this limit stay within the range of the audit and of
/// readers of recordings.
pub(super) const MAX_COMMAND_M_S2: f64 = 1e30;

/// Result of a flight, besides its recording.
#[derive(Clone, Debug)]
pub struct Flight {
    /// Name of the law.
    pub law: String,
    /// Ending of the flight.
    pub ending: Ending,
    /// Time flown \[s\].
    pub duration_s: f64,
    /// Number of whole steps.
    pub steps: u64,
    /// Number of steps that the engine made, parts and undone ones included; `None` for a plant without an engine.
    pub engine_steps: Option<u64>,
    /// Number of steps that were divided.
    pub refined_steps: u64,
    /// Number of steps whose shortest substep was longer than the law allows. From the first one on, the motion is not
    /// that of the law.
    pub overlong_steps: u64,
    /// Certificate before the first step; void if steps were too long for it.
    pub certificate: Certificate,
    /// Result of the audit. Its status is undecided if integration errors may explain all violations. This is so if
    /// steps were too long for the law, no violation is deeper than the error bound, and none began before the first
    /// such step.
    pub audit: AuditOutcome,
    /// Result of the audit in metres, by the widest hulls, if the audit uses scaled separations
    /// ([`tautline_laws::space::Metric`]).
    pub in_metres: Option<AuditOutcome>,
    /// Result of the audit of obstacles, if the scenario has any.
    pub clearance: Option<ClearanceOutcome>,
    /// Pairs whose keep-out balls overlapped in the collision detection of the plant, in index order.
    pub engine_contacts: Vec<Pair>,
    /// Collisions of hulls, in order of time. After the first, the motion is not governed by the law alone.
    pub bounces: Vec<Bounce>,
    /// Largest rise of the law's energy between two changes of its target: the one that integration explains least.
    /// `None` for a law without energy.
    pub energy_rise: Option<EnergyRise>,
    /// Deadlock recoveries, in order of time.
    pub deadlock_recoveries: Vec<DeadlockRecovery>,
    /// Reassignments of slots, in order of time.
    pub assignments: Vec<Reassignment>,
    /// Counts of messages, if the network sends single messages.
    pub traffic: Option<Traffic>,
    /// Numbers of the shield, if the scenario has one.
    pub shield: Option<ShieldReport>,
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

    /// Returns the verdict on the whole flight: at best undecided if it ended early.
    #[must_use]
    pub fn status(&self) -> Status {
        let is_whole = self.ending == Ending::Completed;
        self.status_so_far().and(if is_whole { Status::Clear } else { Status::Undecided })
    }
}

/// Ending of a flight.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// The flight reached its duration.
    Completed,
    /// The caller interrupted the flight.
    Interrupted,
    /// The law is undefined for the state.
    LawUndefined(LawError),
    /// The motion cannot be continued.
    BrokeDown(Breakdown),
}

/// Wall-clock time by kind of work. Concurrent work counts in each kind.
///
/// A flight of at most 64 vehicles measures each 16th step, from the second on. All times except `wall` and `record`
/// are then scaled from the measured steps to all steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Performance {
    /// From the first to the last step.
    pub wall: Duration,
    /// Law.
    pub law: Duration,
    /// Energy of the law, evaluated at every step.
    pub energy: Duration,
    /// Plant.
    pub physics: Duration,
    /// Part of the plant's time for forces, rotors and attitude loops.
    pub airframe: Duration,
    /// Audit.
    pub audit: Duration,
    /// Recording.
    pub record: Duration,
}

impl Performance {
    /// Largest number of vehicles whose steps are sampled. Reading the clock takes a tenth of the step of a small
    /// swarm.
    const MOST_SAMPLED: usize = 64;
    /// Number of steps from one measured step to the next.
    const SAMPLED_EACH: u64 = 16;

    /// Returns whether a step, from 1, is measured. The first step of a sampled flight also creates the engine.
    pub(super) fn is_sampled(step: u64, vehicles: usize) -> bool {
        vehicles > Self::MOST_SAMPLED || step % Self::SAMPLED_EACH == 2
    }

    /// Scales the times of the measured steps to all steps.
    pub(super) fn scaled(self, steps: u64, measured: u64) -> Self {
        let ratio = if measured == 0 { 1.0 } else { steps as f64 / measured as f64 };
        let [law, energy, physics, airframe, audit] =
            [self.law, self.energy, self.physics, self.airframe, self.audit].map(|time| time.mul_f64(ratio));
        Self { law, energy, physics, airframe, audit, ..self }
    }
}

/// Clock of [`Performance`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stopwatch {
    /// Whether times are measured; otherwise they are zero.
    pub(crate) is_on: bool,
}

impl Stopwatch {
    /// Starts a measurement.
    pub(crate) fn start(self) -> Measurement {
        Measurement(self.is_on.then(Instant::now))
    }
}

/// Measurement in progress.
pub(crate) struct Measurement(Option<Instant>);

impl Measurement {
    /// Returns the time since its start.
    pub(crate) fn elapsed(&self) -> Duration {
        self.0.map_or(Duration::ZERO, |began| began.elapsed())
    }
}

/// Reason why a motion cannot be continued. The flight ends with the state before.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Breakdown {
    /// A command of the law is not finite.
    #[error("step {step}: the law's command for vehicle {} is not a finite number", vehicle + 1)]
    CommandNotFinite {
        /// The step, from 1; 0 is the start.
        step: u64,
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// A command of the law is beyond `MAX_COMMAND_M_S2`.
    #[error("step {step}: the law's command for vehicle {} is beyond {MAX_COMMAND_M_S2:e} m/s^2", vehicle + 1)]
    CommandOutOfRange {
        /// The step, from 1; 0 is the start.
        step: u64,
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// The state of a vehicle is not finite.
    #[error("step {step}: the state of vehicle {} is no longer a finite number", vehicle + 1)]
    StateNotFinite {
        /// The step, from 1; 0 is the start.
        step: u64,
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// Rounding may exceed the required position resolution.
    #[error(
        "step {step}: rounding may have moved vehicles by {rounding_m:.1e} m; {required_m} m is required: positions or \
         velocities are too large for steps this short"
    )]
    Unresolved {
        /// The step, from 1.
        step: u64,
        /// Upper bound of the accumulated rounding error of a coordinate \[m\].
        rounding_m: f64,
        /// Required position resolution: the tolerance of arrival \[m\].
        required_m: f64,
    },
    /// A step with the engine and one without it differ for a vehicle ([`crate::plant::FreeSteps`]): a defect.
    #[error("step {step}: the step without the engine differs from that of the engine for vehicle {}", vehicle + 1)]
    EngineDiffers {
        /// The step, from 1.
        step: u64,
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// The solver of the plant cannot continue.
    #[error("step {step}: the equation of motion cannot be solved to its tolerances")]
    Stalled {
        /// The step, from 1.
        step: u64,
    },
    /// A path bends too far from the swept straight line even in the shortest substep.
    #[error(
        "step {step}: a path bends by {bend_m:.1e} m from the audited line; at most {limit_m:.1e} m are allowed, \
         {MAX_BEND:e} of delta; raise time.max_halvings, or reduce time.dt_s"
    )]
    Bent {
        /// The step, from 1.
        step: u64,
        /// Largest bend \[m\].
        bend_m: f64,
        /// Largest allowed bend \[m\].
        limit_m: f64,
    },
    /// The audit refused a step.
    #[error("step {step}: {why}")]
    Audit {
        /// The step, from 1; 0 is the start.
        step: u64,
        /// Reason of the audit.
        why: AuditError,
    },
}

/// Error that prevents a flight.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// The audit does not support the scenario.
    #[error(transparent)]
    Audit(#[from] AuditError),
    /// The audit does not support an obstacle.
    #[error(transparent)]
    Obstacle(#[from] ObstacleError),
    /// The recording cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The parameters give no law.
    #[error(transparent)]
    Law(#[from] ParameterError),
    /// The scenario does not fit its shield.
    #[error(transparent)]
    Shield(#[from] ScenarioError),
    /// An external law failed or commanded numbers that are not finite.
    #[error("the law {law}: {reason}")]
    ExternalLaw {
        /// Name of the law.
        law: String,
        /// Reason, a sentence.
        reason: String,
    },
    /// A step with the engine and one without it differ for a vehicle: a defect.
    #[error("{0}; please report this with the scenario")]
    EngineDiffers(Breakdown),
    /// The scenario has no formation.
    #[error("the scenario has no leg")]
    NoLeg,
    /// The number of vehicles differs from that of the scenario.
    #[error("the scenario has {expected} vehicles, and what moves them has {found}")]
    Vehicles {
        /// Number of vehicles of the scenario.
        expected: usize,
        /// Number of vehicles of the component.
        found: usize,
    },
    /// Given accelerations do not have one finite row per vehicle.
    #[error(
        "the accelerations must have {expected} rows of finite numbers up to {MAX_COMMAND_M_S2:e} m/s^2, got {found} \
         rows"
    )]
    Commands {
        /// Number of vehicles.
        expected: usize,
        /// Number of rows given.
        found: usize,
    },
}

impl_coded! { Ending {
    Self::Completed => "completed",
    Self::Interrupted => "interrupted",
    Self::LawUndefined(_) => "law-undefined",
    Self::BrokeDown(Breakdown::CommandNotFinite { .. }) => "command-not-finite",
    Self::BrokeDown(Breakdown::CommandOutOfRange { .. }) => "command-out-of-range",
    Self::BrokeDown(Breakdown::StateNotFinite { .. }) => "state-not-finite",
    Self::BrokeDown(Breakdown::Unresolved { .. }) => "positions-unresolved",
    Self::BrokeDown(Breakdown::EngineDiffers { .. }) => "engine-differs",
    Self::BrokeDown(Breakdown::Stalled { .. }) => "solver-stalled",
    Self::BrokeDown(Breakdown::Bent { .. }) => "path-bends",
    Self::BrokeDown(Breakdown::Audit { .. }) => "audit-refused",
} }

impl From<SimError> for Failure {
    fn from(error: SimError) -> Self {
        match error {
            SimError::Record(error) => error.into(),
            SimError::Law(error) => error.into(),
            SimError::NoLeg
            | SimError::Obstacle(_)
            | SimError::Vehicles { .. }
            | SimError::Commands { .. }
            | SimError::EngineDiffers(_) => Self::new("simulation/inconsistent", false, error.to_string()),
            SimError::Shield(error) => error.into(),
            SimError::ExternalLaw { .. } => Self::input(
                "simulation/law-failed",
                error.to_string(),
                "correct the law; it gives every vehicle a finite command at every instant",
            ),
            SimError::Audit(error) => Self::input(
                "simulation/cannot-judge",
                error.to_string(),
                "choose a safety distance and a number of vehicles that can be judged",
            ),
        }
    }
}

impl Ending {
    /// Returns the reason of an early ending, one sentence.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_measured_steps_are_scaled_to_all_steps() {
        let second = Duration::from_secs(1);
        let measured = Performance { law: second, physics: 2 * second, record: second, ..Performance::default() };
        let scaled = measured.scaled(480, 30);
        assert_eq!((scaled.law, scaled.physics, scaled.record), (16 * second, 32 * second, second));
        assert_eq!(measured.scaled(1, 0), measured);
        let sampled = |vehicles: usize| (1..=480).filter(|&step| Performance::is_sampled(step, vehicles)).count();
        assert_eq!((sampled(5), sampled(64), sampled(65)), (30, 30, 480));
    }
}
