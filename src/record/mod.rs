//! A run's samples as they are made, and the files that hold them.
//!
//! [`mcap`] writes and reads `run.mcap`. A recorder knows the state of a swarm and nothing of laws, plants or judges.

pub mod mcap;

use crate::swarm::{ClosestApproach, Pair, Rows, Swarm};

/// One recorded instant.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Time since the start \[s\].
    pub time_s: f64,
    /// Steps taken so far.
    pub step: u64,
    /// Positions \[m\] and velocities \[m/s\].
    pub swarm: &'a Swarm,
    /// Commanded accelerations u \[m/s^2\], N x 3, at this instant.
    pub control: &'a Rows,
    /// Closest approach over the steps since the sample before (at the first sample: of the start itself).
    pub separation: Option<ClosestApproach>,
    /// The law's energy E \[m^2/s^2\] where it has one.
    pub energy: Option<f64>,
}

/// Something that happened between samples.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A pair came closer than delta.
    ViolationBegan {
        /// The pair.
        pair: Pair,
        /// When \[s\].
        time_s: f64,
    },
    /// A pair that was closer than delta is clear again.
    ViolationEnded {
        /// The pair.
        pair: Pair,
        /// When \[s\].
        time_s: f64,
        /// Smallest separation within \[m\].
        min_m: f64,
    },
    /// The engine's own collision detection saw two keep-out balls overlap for the first time.
    EngineContact {
        /// The pair.
        pair: Pair,
        /// When \[s\].
        time_s: f64,
    },
    /// A step was refused and flown in shorter ones, because it took more than half of a clearance.
    StepRefined {
        /// When the step began \[s\].
        time_s: f64,
        /// Shortest step used instead \[s\].
        dt_s: f64,
    },
    /// The run ended before its time.
    EndedEarly {
        /// When \[s\].
        time_s: f64,
        /// Why, in a sentence.
        reason: String,
    },
}

/// Receives a run as it is made.
pub trait Recorder {
    /// Takes one sample.
    ///
    /// # Errors
    /// [`RecordError`] when it cannot be kept.
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError>;

    /// Takes one event.
    ///
    /// # Errors
    /// [`RecordError`] when it cannot be kept.
    fn event(&mut self, event: &Event) -> Result<(), RecordError>;
}

/// Why a sample could not be kept.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file could not be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// A recording could not be read.
    #[error("{path} is not a recording that can be read: {reason}")]
    Read {
        /// The file.
        path: String,
        /// What is wrong with it.
        reason: String,
    },
}
