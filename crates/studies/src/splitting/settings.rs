//! How a probability is asked for.

use tautline_sim::sim::SimError;

/// Flights from which on estimates seldom end with nothing.
const ENOUGH: usize = 100;

/// How flights are split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Flights at a time, n; 100 and more are good, 2 the least.
    pub flights: usize,
    /// At least so many are ended in a round, k, less than n: 1 is the most accurate for the steps flown.
    pub kill: usize,
    /// Most bad flights that are kept.
    pub keep: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { flights: ENOUGH, kill: 1, keep: 10 }
    }
}

/// Why there is no estimate.
#[derive(Debug, thiserror::Error)]
pub enum SplittingError {
    /// Too few flights for one to be a copy of another.
    #[error("splitting with {flights} flights: at least 2 are needed, and 100 are advised")]
    Flights {
        /// So many.
        flights: usize,
    },
    /// A number to be ended that leaves none, or ends none.
    #[error("splitting that ends {kill} of {flights} flights in a round: between 1 and {} are possible", flights - 1)]
    Kill {
        /// So many are to be ended.
        kill: usize,
        /// Of so many.
        flights: usize,
    },
    /// Two flights that go on from one state are the same flight.
    #[error(
        "nothing in this flight is random from step to step, and splitting needs two flights from one state to differ: add \
         turbulence (wind.dryden), errors of measurement (sensing.position_noise_m and sensing.rate_hz), or losses or jitter \
         of messages (network.loss, network.jitter_s)"
    )]
    NoNoise,
    /// Law or judge do not exist.
    #[error(transparent)]
    Flight(#[from] SimError),
}

impl Settings {
    /// Whether there are flights to be ended, and others to take their place.
    ///
    /// # Errors
    /// [`SplittingError::Flights`] and [`SplittingError::Kill`].
    pub fn check(&self) -> Result<(), SplittingError> {
        let &Self { flights, kill, .. } = self;
        if flights < 2 {
            return Err(SplittingError::Flights { flights });
        }
        if kill == 0 || kill >= flights {
            return Err(SplittingError::Kill { kill, flights });
        }
        Ok(())
    }

    /// What is to be said before so few flights are flown.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        (self.flights < ENOUGH).then(|| warning(self.flights as u64)).flatten()
    }
}

/// What is to be said of so few flights.
pub(super) fn warning(flights: u64) -> Option<String> {
    (flights < ENOUGH as u64).then(|| {
        format!(
            "{flights} flights at a time are few: where the event is rare, most estimates end at 0 and a few far above the truth, \
             so that their mean is right only over very many of them; take {ENOUGH} or more"
        )
    })
}
