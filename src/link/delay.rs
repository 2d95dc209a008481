//! Everything is known late.

use super::history::History;
use super::interface::{Link, Sensed};
use crate::observation::Others;
use crate::swarm::Swarm;

/// Solver steps of continuous time within one delay, so that the past is interpolated finely enough.
const STEPS_PER_DELAY: f64 = 8.0;

/// The state of the whole swarm, own state included, as it was some seconds ago; before that has passed, as it was at the
/// start. As far as a law sees, its clock is right and what it reads is old.
#[derive(Clone, Debug)]
pub struct Delay {
    by_s: f64,
    history: History,
    sensed: Swarm,
}

impl Delay {
    /// A delay of so many seconds, of a swarm that starts like this.
    #[must_use]
    pub fn new(delay_s: f64, start: &Swarm) -> Self {
        Self { by_s: delay_s, history: History::new(delay_s), sensed: start.clone() }
    }
}

impl Link for Delay {
    fn sense<'a>(&'a mut self, time_s: f64, _truth: &'a Swarm) -> Sensed<'a> {
        self.history.at(time_s - self.by_s, &mut self.sensed);
        Sensed { own: &self.sensed, others: Others::Shared }
    }

    fn accept(&mut self, time_s: f64, truth: &Swarm) {
        self.history.push(time_s, truth);
    }

    fn forget_after(&mut self, time_s: f64) {
        self.history.forget_after(time_s);
    }

    fn longest_step_s(&self) -> f64 {
        self.by_s / STEPS_PER_DELAY
    }
}
