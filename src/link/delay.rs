//! Everything is known late.

use super::history::History;
use super::interface::{Link, Sensed};
use crate::observation::Others;
use crate::swarm::Swarm;

/// Solver steps of continuous time within one delay, so that the past is interpolated finely enough.
const STEPS_PER_DELAY: f64 = 8.0;
/// Shortest delay \[s\].
const SHORTEST_S: f64 = 1e-6;

/// The state of the whole swarm, own state included, as it was some seconds ago; before that has passed, as it was at the
/// start. As far as a law sees, its clock is right and what it reads is old.
#[derive(Clone, Debug)]
pub struct Delay {
    by_s: f64,
    history: History,
    sensed: Swarm,
}

/// Why there is no such delay.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("a delay of {delay_s} s; it must be a finite number of at least 1e-6, or 0")]
pub struct DelayError {
    /// As given \[s\].
    pub delay_s: f64,
}

impl Delay {
    /// A delay of so many seconds, of a swarm that starts like this. In continuous time the solver takes at least
    /// eight steps within it, so a short delay is a slow flight.
    ///
    /// # Errors
    /// [`DelayError`] unless it is 0, or at least a microsecond and finite.
    pub fn new(delay_s: f64, start: &Swarm) -> Result<Self, DelayError> {
        if delay_s != 0.0 && !(delay_s >= SHORTEST_S && delay_s.is_finite()) {
            return Err(DelayError { delay_s });
        }
        Ok(Self { by_s: delay_s, history: History::new(delay_s), sensed: start.clone() })
    }
}

impl Link for Delay {
    fn sense<'a>(&'a mut self, time_s: f64, truth: &'a Swarm) -> Sensed<'a> {
        if self.by_s == 0.0 {
            return Sensed { own: truth, others: Others::Shared };
        }
        self.history.at(time_s - self.by_s, &mut self.sensed);
        Sensed { own: &self.sensed, others: Others::Shared }
    }

    fn accept(&mut self, time_s: f64, truth: &Swarm) {
        self.history.push(time_s, truth);
    }

    fn forget_after(&mut self, time_s: f64) {
        self.history.forget_after(time_s);
    }

    fn settle(&mut self, time_s: f64) {
        self.history.settle(time_s);
    }

    fn is_exact(&self) -> bool {
        self.by_s == 0.0
    }

    fn longest_step_s(&self) -> f64 {
        if self.by_s == 0.0 { f64::INFINITY } else { self.by_s / STEPS_PER_DELAY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::swarm::Rows;

    #[test]
    fn what_is_no_delay_is_refused_and_none_at_all_is_exact() {
        let start = Swarm::at_rest(Rows::zeros(2));
        for wrong_s in [-0.1, 1e-12, f64::NAN, f64::INFINITY] {
            assert!(Delay::new(wrong_s, &start).is_err(), "{wrong_s}");
        }
        assert!(Delay::new(0.0, &start).is_ok_and(|link| link.is_exact()));
        assert!(Delay::new(0.1, &start).is_ok_and(|link| !link.is_exact()));
    }
}
