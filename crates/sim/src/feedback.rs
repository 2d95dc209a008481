//! The closed loop, seen from the vehicles: what they are commanded in a state.

use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::law::LawError;

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
