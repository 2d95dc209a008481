//! Bodies that carry out the commanded accelerations.
//!
//! A [`Plant`] holds the true state of the swarm; it depends on no law. [`rapier`] flies rigid bodies in a physics engine;
//! only that module uses the engine.

mod air;
mod path;
pub mod rapier;
mod unicycle;

pub(crate) use air::Air;
pub use path::Path;
pub use unicycle::Unicycles;

use std::time::Duration;

use dyn_clone::DynClone;

use crate::continuous::{self, Continuous};
use crate::feedback::Feedback;
use crate::scenario::{PlantSpec, Scenario};
use crate::vehicle::Fleet;
use tautline_core::record::Channel;
use tautline_core::swarm::{Pair, Rows, Swarm};
use tautline_laws::law::LawError;

/// What moves a swarm, however it is realised: p'' = a22 v + u (equation (1)) for the point vehicles.
///
/// A step has two phases. [`Plant::advance`] drifts to the end of the step and predicts the state there, of which the law
/// makes a command; [`Plant::apply`] completes the state with it and holds it over the next step. That state is
/// recorded. A flight begins with `apply`, for the command at the start.
///
/// All of a plant's memory is saved with a simulation, so it must be [`Clone`].
pub trait Plant: DynClone + Send {
    /// Number of vehicles N.
    fn count(&self) -> usize;

    /// Moves every vehicle over `dt_s` seconds and writes into `predicted` where it is then and how fast it is expected
    /// to be; `path` gets what the way there was like beside a straight line. Without an [`Plant::apply`] since the step
    /// before, the command that is held goes on.
    ///
    /// # Errors
    /// [`PlantError`]; the plant then holds no state that may be observed.
    fn advance(&mut self, dt_s: f64, predicted: &mut Swarm, path: &mut Path) -> Result<(), PlantError>;

    /// Whether a command is held over a step. Otherwise the plant is one of continuous time, which evaluates the law all the way
    /// along ([`Plant::advance_under`]).
    fn holds_commands(&self) -> bool {
        true
    }

    /// Like [`Plant::advance`], from the time `from_s` \[s\] on, with commands from `feedback` in the place of the held one, in
    /// a plant of continuous time. The result is the law's error where vehicles came to its barrier: they then moved on with
    /// the accelerations that they had there.
    ///
    /// # Errors
    /// [`PlantError`]; the plant then holds no state that may be observed.
    fn advance_under(
        &mut self,
        _feedback: &mut dyn Feedback,
        (_from_s, dt_s): (f64, f64),
        end: &mut Swarm,
        path: &mut Path,
    ) -> Result<Option<LawError>, PlantError> {
        self.advance(dt_s, end, path).map(|()| None)
    }

    /// Takes the accelerations u \[m/s^2\], N x 3, to be held over the next step, and changes the velocities of `state` from
    /// what was predicted to what they are; positions stay, for they have been judged. Called again at the same instant it
    /// changes nothing but what is held.
    fn apply(&mut self, command: &Rows, state: &mut Swarm);

    /// Writes the true state.
    fn observe(&self, swarm: &mut Swarm);

    /// Puts the vehicles back into a state that was observed: a step that was refused is undone.
    fn restore(&mut self, swarm: &Swarm);

    /// Appends the pairs whose keep-out balls overlapped when the plant's own collision detection last looked, in index
    /// order. A plant without one appends nothing.
    fn keep_out_contacts(&self, _pairs: &mut Vec<Pair>) {}

    /// Appends the pairs whose solid hulls pushed each other apart in the last [`Plant::advance`]. A plant of points
    /// appends nothing.
    fn hull_contacts(&self, _contacts: &mut Vec<HullContact>) {}

    /// Wall-clock time spent so far in the forces, rotors and attitude loops of its vehicles, where they have them.
    fn airframe_time(&self) -> Duration {
        Duration::ZERO
    }

    /// What is known of its vehicles beside position and velocity: a channel each, without values yet.
    fn channels(&self) -> Vec<Channel> {
        Vec::new()
    }

    /// Writes the present values into channels of [`Plant::channels`], in their order.
    fn write_channels(&self, _channels: &mut [Channel]) {}

    /// Begins its random numbers anew.
    fn reseed(&mut self, _seed: u64) {}
}

dyn_clone::clone_trait_object!(Plant);

/// The plant of a scenario, at its start.
#[must_use]
pub fn of(scenario: &Scenario) -> Box<dyn Plant> {
    if let Some(unicycle) = scenario.airframe.unicycle() {
        return Box::new(Unicycles::new(*unicycle, &scenario.start));
    }
    match (scenario.plant, scenario.fleet()) {
        (PlantSpec::Rapier, _) => rapier::plant(scenario),
        (PlantSpec::Ideal, Some(fleet)) => Box::new(continuous::Quadrotors::new(fleet)),
        (PlantSpec::Ideal, None) => Box::new(Continuous::new(scenario)),
    }
}

/// A plant of quadrotors.
pub trait Quadrotors: Plant {
    /// They, as they are now.
    fn fleet(&self) -> &Fleet;
}

/// Two hulls that pushed each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HullContact {
    /// Whose.
    pub pair: Pair,
    /// How fast their centres neared each other before \[m/s\].
    pub closing_m_s: f64,
}

/// Why a plant could not carry out a step.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// A position or velocity left the range of the plant's numbers.
    #[error("the state of vehicle {} is no longer a finite number", vehicle + 1)]
    NotFinite {
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// No step is short enough to solve the equations of motion.
    #[error("the equations of motion cannot be solved to their tolerances")]
    Stalled,
    /// The law has no command on the way, in a plant of continuous time.
    #[error(transparent)]
    Law(#[from] LawError),
}
