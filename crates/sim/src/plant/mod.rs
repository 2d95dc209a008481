//! Bodies that carry out the commanded accelerations.
//!
//! A [`Plant`] holds the true state of the swarm; it depends on no law. [`rapier`] flies rigid bodies in a physics engine;
//! only that module uses the engine.

pub mod rapier;
mod unicycle;

pub use unicycle::Unicycles;

use std::time::Duration;

use dyn_clone::DynClone;
use nalgebra::Vector3;

use crate::continuous::{self, Continuous};
use crate::scenario::{PlantSpec, Scenario, Space};
use crate::vehicle::Fleet;
use tautline_core::record::Channel;
use tautline_core::swarm::{Pair, Rows, Swarm, row, set_row};
use tautline_laws::law::LawError;
use tautline_laws::wind::Wind;

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

/// What closes the loop: the accelerations u(t, p, v).
pub trait Feedback {
    /// Writes the accelerations \[m/s^2\], N x 3, for a true state at a time \[s\]. Trial states are asked about too, in
    /// any order of time.
    ///
    /// # Errors
    /// [`LawError`] where there are none.
    fn command(&mut self, time_s: f64, truth: &Swarm, command: &mut Rows) -> Result<(), LawError>;

    /// The solution has come to this state, in the order of time: what a delayed sensor remembers.
    fn accept(&mut self, _time_s: f64, _truth: &Swarm) {}

    /// Longest solver step that the memory of the feedback allows \[s\].
    fn longest_step_s(&self) -> f64 {
        f64::INFINITY
    }
}

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

/// The way of a swarm over a step: straight segments through the instants that were passed, and how far at most the true
/// paths bend away from them.
///
/// A plant that moves on one straight line within a step adds nothing. One that takes steps of its own passes through
/// their ends; one that moves on curves says how far they bend.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// Reused from step to step; the first `passed` are of this one.
    instants: Vec<(f64, Rows)>,
    passed: usize,
    bend_m: f64,
}

impl Path {
    /// A straight line from the state before the step.
    pub fn begin(&mut self) {
        (self.passed, self.bend_m) = (0, 0.0);
    }

    /// Passes through these positions \[m\], N x 3, `after_s` seconds from the beginning of the step, in increasing
    /// order and before its end.
    pub fn pass(&mut self, after_s: f64, positions_m: &Rows) {
        if self.passed == self.instants.len() {
            self.instants.push((after_s, positions_m.clone()));
        } else {
            let (time_s, rows) = &mut self.instants[self.passed];
            *time_s = after_s;
            rows.clone_from(positions_m);
        }
        self.passed += 1;
    }

    /// No vehicle's true path leaves its segments by more than this \[m\], or by more than what was said before.
    pub fn bend(&mut self, bend_m: f64) {
        self.bend_m = self.bend_m.max(bend_m);
    }

    /// How far at most a true path leaves its segments \[m\].
    #[must_use]
    pub fn bend_m(&self) -> f64 {
        self.bend_m
    }

    /// The instants between the ends of the step: seconds from its beginning, and positions \[m\].
    pub fn passed(&self) -> impl Iterator<Item = (f64, &Rows)> {
        self.instants[..self.passed].iter().map(|(after_s, positions_m)| (*after_s, positions_m))
    }
}

/// A wind, and points that are pushed by their drag times its velocity. The other half of a drag, on their own velocity, is of
/// the motion in still air.
#[derive(Clone, Debug)]
pub(crate) struct Air {
    wind: Wind,
    /// Along each axis \[1/s\]; none along z in the plane.
    drag_per_s: Vector3<f64>,
    /// What is commanded \[m/s^2\].
    command: Rows,
}

impl Air {
    /// That of the scenario, where a wind blows.
    pub(crate) fn of(scenario: &Scenario) -> Option<Self> {
        let up_per_s = if scenario.space == Space::Plane { 0.0 } else { scenario.drag_per_s };
        let drag_per_s = Vector3::new(scenario.drag_per_s, scenario.drag_per_s, up_per_s);
        let command = Rows::zeros(scenario.count());
        (!scenario.wind.is_still()).then(|| Self { wind: scenario.air(), drag_per_s, command })
    }

    /// Moves the wind on by `dt_s` seconds.
    pub(crate) fn advance(&mut self, dt_s: f64) {
        self.wind.advance(dt_s);
    }

    /// Takes the last [`Air::advance`] back.
    pub(crate) fn undo(&mut self) {
        self.wind.undo();
    }

    /// Takes another command.
    pub(super) fn hold(&mut self, command: &Rows) {
        self.command.copy_from(command);
    }

    /// Writes the command and what the wind adds to it now \[m/s^2\].
    pub(super) fn write_held(&self, held: &mut Rows) {
        for i in 0..self.command.nrows() {
            set_row(held, i, row(&self.command, i) + self.push_m_s2(i, 0.0));
        }
    }

    /// What the wind pushes a vehicle with, `before_s` seconds before now \[m/s^2\].
    pub(crate) fn push_m_s2(&self, vehicle: usize, before_s: f64) -> Vector3<f64> {
        self.wind.air_at_m_s(vehicle, self.wind.now_s() - before_s).component_mul(&self.drag_per_s)
    }

    /// How long the wind is smooth from so many seconds before now on \[s\].
    pub(crate) fn smooth_s(&self, before_s: f64) -> f64 {
        let time_s = self.wind.now_s() - before_s;
        self.wind.next_turn_s(time_s) - time_s
    }

    pub(crate) fn reseed(&mut self, seed: u64) {
        self.wind.reseed(seed);
    }

    pub(crate) fn channel() -> Channel {
        Wind::channel()
    }

    pub(crate) fn write_channel(&self, channel: &mut Channel) {
        self.wind.write_channel(channel);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_holds_what_was_passed_in_this_step_and_the_largest_bend() {
        let at = |x: f64| Rows::from_element(2, x);
        let mut path = Path::default();
        path.pass(0.1, &at(1.0));
        path.pass(0.2, &at(2.0));
        path.bend(0.5);
        path.bend(0.25);
        assert_eq!(path.bend_m(), 0.5);
        path.begin();
        path.pass(0.3, &at(3.0));
        assert_eq!(path.passed().collect::<Vec<_>>(), [(0.3, &at(3.0))]);
        assert_eq!(path.bend_m(), 0.0);
    }
}
