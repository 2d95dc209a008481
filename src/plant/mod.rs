//! Bodies that carry out the commanded accelerations.
//!
//! A plant holds the true state of the swarm. [`rapier`] flies rigid bodies in a physics engine and is the only room
//! that names it; [`ideal`] solves the equation of motion and is what every physics run is measured against.

pub mod ideal;
pub mod rapier;

use crate::law::{Law, LawError};
use crate::scenario::{PlantSpec, Scenario};
use crate::swarm::{Pair, Rows, Swarm};

/// A swarm of double integrators p'' = a22 v + u (equation (1)), however it is realised.
pub trait Plant: Send {
    /// Moves every vehicle over `dt_s` seconds.
    ///
    /// `held` are the accelerations u \[m/s^2\], N x 3, that `law` commanded at the beginning of the step. A plant that
    /// stands for a real vehicle holds them and leaves the law alone; one that stands for the equations asks the law
    /// all the way along.
    ///
    /// # Errors
    /// [`PlantError`]; the plant then holds no state that may be observed.
    fn step(&mut self, law: &mut dyn Law, held: &Rows, dt_s: f64) -> Result<(), PlantError>;

    /// Writes the true state.
    fn observe(&self, swarm: &mut Swarm);

    /// Puts the vehicles back into a state that [`Plant::observe`] gave: a step that was refused is undone.
    fn restore(&mut self, swarm: &Swarm);

    /// How far at most a vehicle's path over the last step bends away from the straight line between its ends \[m\],
    /// which is what the audit sweeps. Zero for a plant that moves on straight lines within a step.
    fn bend_m(&self) -> f64 {
        0.0
    }

    /// Appends the pairs whose keep-out balls overlapped when the plant's own collision detection last looked, in index
    /// order. A plant without one appends nothing.
    fn keep_out_contacts(&self, _pairs: &mut Vec<Pair>) {}
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
    /// The law has no answer for a state within the step.
    #[error(transparent)]
    LawUndefined(LawError),
    /// The equation of motion cannot be solved to its tolerances.
    #[error("the equation of motion cannot be solved any further")]
    Stalled,
}

/// The plant that a scenario asks for, at the scenario's start.
#[must_use]
pub fn for_scenario(scenario: &Scenario) -> Box<dyn Plant> {
    match scenario.plant {
        PlantSpec::Rapier(precision) => rapier::plant(scenario, precision),
        PlantSpec::Ideal => ideal::plant(scenario),
    }
}
