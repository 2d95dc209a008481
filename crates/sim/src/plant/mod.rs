//! Plants: equations of motion of the vehicles under commanded accelerations.
//!
//! A [`Plant`] holds the true state of the swarm and is independent of laws. [`rapier`] simulates rigid bodies in a
//! physics engine; only that module uses the engine.

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

/// Equations of motion of a swarm: p'' = a22 v + u (equation (1)) for points.
///
/// A step has two phases. [`Plant::advance`] drifts to the end of the step and predicts the state there, for which the
/// law computes a command. [`Plant::apply`] completes the state with the command and holds it over the next step. The
/// completed state is recorded. A flight begins with `apply`, for the command at the start.
///
/// All of a plant's memory is saved with a simulation, so it must be [`Clone`].
pub trait Plant: DynClone + Send {
    /// Returns the number of vehicles N.
    fn count(&self) -> usize;

    /// Moves every vehicle over `dt_s` seconds and writes the predicted state at the end into `predicted`, and the
    /// deviation of the way from a straight line into `path`. Without a call of [`Plant::apply`] since the previous
    /// step, the held command continues.
    ///
    /// # Errors
    /// [`PlantError`]; the state of the plant is then undefined.
    fn advance(&mut self, dt_s: f64, predicted: &mut Swarm, path: &mut StepPath) -> Result<(), PlantError>;

    /// Returns whether a command is held over a step. Otherwise the plant evaluates the law in continuous time
    /// ([`Plant::advance_under`]).
    fn holds_commands(&self) -> bool {
        true
    }

    /// Moves every vehicle like [`Plant::advance`], from the time `from_s` \[s\] on, with commands from `feedback` in
    /// continuous time. Returns the law's error if vehicles reached its barrier; they then moved on with the
    /// accelerations that they had there.
    ///
    /// # Errors
    /// [`PlantError`]; the state of the plant is then undefined.
    fn advance_under(
        &mut self,
        _feedback: &mut dyn Feedback,
        (_from_s, dt_s): (f64, f64),
        end: &mut Swarm,
        path: &mut StepPath,
    ) -> Result<Option<LawError>, PlantError> {
        self.advance(dt_s, end, path).map(|()| None)
    }

    /// Sets the accelerations u \[m/s^2\], N x 3, to hold over the next step, and corrects the predicted velocities of
    /// `state`. Positions stay, because they have been audited. A second call at the same instant only changes the held
    /// command.
    fn apply(&mut self, command: &Rows, state: &mut Swarm);

    /// Writes the true state.
    fn observe(&self, swarm: &mut Swarm);

    /// Resets the vehicles to an observed state, to undo a refused step.
    fn restore(&mut self, swarm: &Swarm);

    /// Appends the pairs whose keep-out balls overlapped in the last collision detection of the plant, in index order.
    /// Plants without collision detection append nothing.
    fn keep_out_contacts(&self, _pairs: &mut Vec<Pair>) {}

    /// Appends the pairs whose solid hulls collided in the last [`Plant::advance`]. Plants of points append nothing.
    fn hull_contacts(&self, _contacts: &mut Vec<HullContact>) {}

    /// Allows free steps: steps without the engine while no contact is possible. The motion has the same bits. Plants
    /// without an engine have no such steps.
    fn allow_free_steps(&mut self, _free: FreeSteps) {}

    /// Returns the number of steps that the engine made, undone steps included; `None` for a plant without an engine.
    fn engine_steps(&self) -> Option<u64> {
        None
    }

    /// Returns the wall-clock time spent in forces, rotors and attitude loops.
    fn airframe_time(&self) -> Duration {
        Duration::ZERO
    }

    /// Sets whether [`Plant::airframe_time`] is measured. It is off by default.
    fn measure_time(&mut self, _is_on: bool) {}

    /// Returns the recorded channels of the plant, such as attitude, with names and columns but no values.
    fn channels(&self) -> Vec<Channel> {
        Vec::new()
    }

    /// Writes the present values into the channels of [`Plant::channels`], in the same order.
    fn write_channels(&self, _channels: &mut [Channel]) {}

    /// Restarts the random numbers from another seed.
    fn reseed(&mut self, _seed: u64) {}
}

dyn_clone::clone_trait_object!(Plant);

/// Feedback of the control loop: the accelerations u(t, p, v).
pub trait Feedback {
    /// Writes the accelerations \[m/s^2\], N x 3, for a true state at a time \[s\]. The solver also calls this for
    /// trial states, in any order of time.
    ///
    /// # Errors
    /// [`LawError`] if the law is undefined.
    fn command(&mut self, time_s: f64, truth: &Swarm, command: &mut Rows) -> Result<(), LawError>;

    /// Takes the next state of the solution, in order of time, as memory of delayed sensors.
    fn accept(&mut self, _time_s: f64, _truth: &Swarm) {}

    /// Returns the longest solver step that the memory of the feedback allows \[s\].
    fn longest_step_s(&self) -> f64 {
        f64::INFINITY
    }
}

/// Creates the plant of a scenario, at its start.
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

/// Plant of quadrotors.
pub trait Quadrotors: Plant {
    /// Returns the current state of the fleet.
    fn fleet(&self) -> &Fleet;
}

/// Collision of two hulls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HullContact {
    /// The two vehicles of the pair.
    pub pair: Pair,
    /// Closing speed of their centres before the collision \[m/s\].
    pub closing_m_s: f64,
}

/// Treatment of free steps: steps that need no engine, because no contact is possible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FreeSteps {
    /// The engine makes no free step. Pairs may be within delta; their distances give their contacts.
    Trusted,
    /// The engine repeats each [`COMPARED_EACH`]th of them from the same state. A result that differs in a bit, or a
    /// contact, is [`PlantError::EngineDiffers`].
    Compared,
}

/// Free steps from one that the engine repeats to the next ([`FreeSteps::Compared`]).
pub const COMPARED_EACH: u32 = 8;

/// Error of a step of a plant.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// A position or velocity is not finite.
    #[error("the state of vehicle {} is no longer a finite number", vehicle + 1)]
    NotFinite {
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// The engine and a free step move a vehicle differently, or the engine reports a contact: a defect.
    #[error("a free step of vehicle {} differs from a step of the engine", vehicle + 1)]
    EngineDiffers {
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// The equations of motion cannot be solved with any step.
    #[error("the equations of motion cannot be solved to their tolerances")]
    Stalled,
    /// The law is undefined on the way, in a plant of continuous time.
    #[error(transparent)]
    Law(#[from] LawError),
}

/// Way of a swarm over a step: straight segments between instants, and an upper bound of the deviation of the true
/// paths from them.
///
/// A plant that moves along one straight line per step adds nothing. A plant with internal steps adds their ends; a
/// plant with curved paths adds their bend.
#[derive(Clone, Debug, Default)]
pub struct StepPath {
    /// Instants; their memory is reused, and only the first `passed` belong to this step.
    instants: Vec<(f64, Rows)>,
    passed: usize,
    bend_m: f64,
}

impl StepPath {
    /// Resets the way to a straight line from the state before the step.
    pub fn begin(&mut self) {
        (self.passed, self.bend_m) = (0, 0.0);
    }

    /// Adds positions \[m\], N x 3, `after_s` seconds after the beginning of the step, in increasing order and before
    /// its end.
    pub fn add_instant(&mut self, after_s: f64, positions_m: &Rows) {
        if self.passed == self.instants.len() {
            self.instants.push((after_s, positions_m.clone()));
        } else {
            let (time_s, rows) = &mut self.instants[self.passed];
            *time_s = after_s;
            rows.clone_from(positions_m);
        }
        self.passed += 1;
    }

    /// Raises the bound of the deviation to at least this value \[m\].
    pub fn raise_bend(&mut self, bend_m: f64) {
        self.bend_m = self.bend_m.max(bend_m);
    }

    /// Returns the bound of the deviation of a true path from its segments \[m\].
    #[must_use]
    pub fn bend_m(&self) -> f64 {
        self.bend_m
    }

    /// Returns the instants between the ends of the step: seconds from its beginning, and positions \[m\].
    pub fn instants(&self) -> impl Iterator<Item = (f64, &Rows)> {
        self.instants[..self.passed].iter().map(|(after_s, positions_m)| (*after_s, positions_m))
    }
}

/// Wind and its push on points: drag times wind velocity. The part of the drag due to a point's own velocity belongs to
/// the motion in still air.
#[derive(Clone, Debug)]
pub(crate) struct Air {
    wind: Wind,
    /// Drag along each axis \[1/s\]; 0 along z in the plane.
    drag_per_s: Vector3<f64>,
    /// Commanded accelerations \[m/s^2\].
    command: Rows,
}

impl Air {
    /// Creates the wind of a scenario; `None` in still air.
    pub(crate) fn of(scenario: &Scenario) -> Option<Self> {
        let up_per_s = if scenario.space == Space::Plane { 0.0 } else { scenario.drag_per_s };
        let drag_per_s = Vector3::new(scenario.drag_per_s, scenario.drag_per_s, up_per_s);
        let command = Rows::zeros(scenario.count());
        (!scenario.wind.is_still()).then(|| Self { wind: scenario.air(), drag_per_s, command })
    }

    /// Advances the wind by `dt_s` seconds.
    pub(crate) fn advance(&mut self, dt_s: f64) {
        self.wind.advance(dt_s);
    }

    /// Undoes the last [`Air::advance`].
    pub(crate) fn undo(&mut self) {
        self.wind.undo();
    }

    /// Sets the command.
    pub(super) fn hold(&mut self, command: &Rows) {
        self.command.copy_from(command);
    }

    /// Writes the command plus the present push of the wind \[m/s^2\].
    pub(super) fn write_held(&self, held: &mut Rows) {
        for i in 0..self.command.nrows() {
            set_row(held, i, row(&self.command, i) + self.push_m_s2(i, 0.0));
        }
    }

    /// Returns the push of the wind on a vehicle, `before_s` seconds before the present \[m/s^2\].
    pub(crate) fn push_m_s2(&self, vehicle: usize, before_s: f64) -> Vector3<f64> {
        self.wind.air_at_m_s(vehicle, self.wind.now_s() - before_s).component_mul(&self.drag_per_s)
    }

    /// Returns the time for which the wind is smooth, from `before_s` seconds before the present on \[s\].
    pub(crate) fn smooth_s(&self, before_s: f64) -> f64 {
        let time_s = self.wind.now_s() - before_s;
        self.wind.next_slope_change_s(time_s) - time_s
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
    fn a_path_holds_the_instants_of_its_step_and_the_largest_bend() {
        let rows_at = |x: f64| Rows::from_element(2, x);
        let mut path = StepPath::default();
        path.add_instant(0.1, &rows_at(1.0));
        path.add_instant(0.2, &rows_at(2.0));
        path.raise_bend(0.5);
        path.raise_bend(0.25);
        assert_eq!(path.bend_m(), 0.5);
        path.begin();
        path.add_instant(0.3, &rows_at(3.0));
        assert_eq!(path.instants().collect::<Vec<_>>(), [(0.3, &rows_at(3.0))]);
        assert_eq!(path.bend_m(), 0.0);
    }
}
