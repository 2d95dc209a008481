//! What moves the vehicles between two instants at which the law is asked.

use std::time::Duration;

use crate::continuous::{Continuous, IdealError, Quadrotors};
use crate::feedback::Feedback;
use crate::plant::{HullContact, Path, Plant, PlantError, Unicycles, rapier};
use crate::scenario::{PlantSpec, Scenario};
use tautline_core::record::Channel;
use tautline_core::swarm::{Pair, Rows, Swarm};
use tautline_laws::law::LawError;

use super::controller::Controller;
use super::ending::{Breakdown, Ending};

/// What moves the vehicles.
#[derive(Clone)]
pub enum Motion {
    /// A plant that holds the command of the beginning of a step (sample-and-hold).
    Sampled(Box<dyn Plant>),
    /// Continuous time: the law is asked all the way along.
    Continuous(Box<Continuous>),
}

/// Accelerations that do not change over a step.
struct Held<'a>(&'a Rows);

impl Feedback for Held<'_> {
    fn command(&mut self, _time_s: f64, _truth: &Swarm, command: &mut Rows) -> Result<(), LawError> {
        command.copy_from(self.0);
        Ok(())
    }
}

impl<P: Plant + 'static> From<P> for Motion {
    fn from(plant: P) -> Self {
        Self::Sampled(Box::new(plant))
    }
}

impl Motion {
    /// What the scenario asks for, at its start.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        if let Some(unicycle) = scenario.airframe.unicycle() {
            return Unicycles::new(*unicycle, &scenario.start).into();
        }
        match scenario.plant {
            PlantSpec::Rapier => Self::Sampled(rapier::plant(scenario)),
            PlantSpec::Ideal => match scenario.fleet() {
                Some(fleet) => Self::Sampled(Box::new(Quadrotors::new(fleet))),
                None => Self::Continuous(Box::new(Continuous::new(scenario))),
            },
        }
    }

    /// Moves from `from_s` over `dt_s` seconds, and says where the vehicles are then. In continuous time accelerations that
    /// are `held` stand in the place of the law's. The result is why the law had no answer on the way, where vehicles came to its
    /// barrier and moved on under the accelerations that they had there.
    pub(super) fn advance(
        &mut self,
        (step, from_s, dt_s): (u64, f64, f64),
        held: Option<&Rows>,
        controller: &mut Controller,
        end: &mut Swarm,
        path: &mut Path,
    ) -> Result<Option<LawError>, Ending> {
        path.begin();
        match self {
            Self::Sampled(plant) => plant.advance(dt_s, end, path).map(|()| None).map_err(|error| match error {
                PlantError::NotFinite { vehicle } => Breakdown::StateNotFinite { step, vehicle }.into(),
                PlantError::Stalled => Breakdown::Stalled { step }.into(),
            }),
            Self::Continuous(solution) => {
                let mut still = held.map(Held);
                let feedback: &mut dyn Feedback = match &mut still {
                    Some(held) => held,
                    None => controller,
                };
                solution.advance((from_s, dt_s), feedback, end, path).map_err(|error| match error {
                    IdealError::Law { source, .. } => Ending::LawUndefined(source),
                    IdealError::Stalled { .. } | IdealError::Times { .. } | IdealError::Tolerances => {
                        Breakdown::Stalled { step }.into()
                    }
                })
            }
        }
    }

    /// Completes the state with the law's command, which is held from now on.
    pub(super) fn apply(&mut self, command: &Rows, state: &mut Swarm) {
        match self {
            Self::Sampled(plant) => plant.apply(command, state),
            Self::Continuous(_) => {}
        }
    }

    pub(super) fn count(&self) -> usize {
        match self {
            Self::Sampled(plant) => plant.count(),
            Self::Continuous(solution) => solution.count(),
        }
    }

    /// Whether a command is held over a step, and not made anew all the way along.
    pub(super) fn holds_commands(&self) -> bool {
        matches!(self, Self::Sampled(_))
    }

    /// All random numbers begin anew.
    pub(super) fn reseed(&mut self, seed: u64) {
        match self {
            Self::Sampled(plant) => plant.reseed(seed),
            Self::Continuous(solution) => solution.reseed(seed),
        }
    }

    /// Time spent so far in airframes.
    pub(super) fn airframe_time(&self) -> Duration {
        match self {
            Self::Sampled(plant) => plant.airframe_time(),
            Self::Continuous(_) => Duration::ZERO,
        }
    }

    /// What is known of the vehicles beside position and velocity.
    pub(super) fn channels(&self) -> Vec<Channel> {
        match self {
            Self::Sampled(plant) => plant.channels(),
            Self::Continuous(solution) => solution.channels(),
        }
    }

    /// Writes its present values.
    pub(super) fn write_channels(&self, channels: &mut [Channel]) {
        match self {
            Self::Sampled(plant) => plant.write_channels(channels),
            Self::Continuous(solution) => solution.write_channels(channels),
        }
    }

    pub(super) fn observe(&self, state: &mut Swarm) {
        match self {
            Self::Sampled(plant) => plant.observe(state),
            Self::Continuous(solution) => solution.observe(state),
        }
    }

    pub(super) fn restore(&mut self, state: &Swarm) {
        match self {
            Self::Sampled(plant) => plant.restore(state),
            Self::Continuous(solution) => solution.restore(state),
        }
    }

    pub(super) fn keep_out_contacts(&self, pairs: &mut Vec<Pair>) {
        match self {
            Self::Sampled(plant) => plant.keep_out_contacts(pairs),
            Self::Continuous(_) => {}
        }
    }

    pub(super) fn hull_contacts(&self, contacts: &mut Vec<HullContact>) {
        match self {
            Self::Sampled(plant) => plant.hull_contacts(contacts),
            Self::Continuous(_) => {}
        }
    }
}
