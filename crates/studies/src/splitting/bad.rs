//! Flights that were violated, and how they are flown again.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::genealogy::Genealogy;
use tautline_core::record::{Event, RecordError, Sample, Sink, StateHash, Step};
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{Flight, SimError, Simulation, fly_on};

/// A flight that was violated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BadFlight {
    /// How it is flown again.
    pub genealogy: Genealogy,
    /// The step in which it was violated, from 1; 0 is the start.
    pub violated_at_step: u64,
    /// The smallest clearance up to there \[m\], below 0.
    pub clearance_m: f64,
    /// SHA-256 over time, positions, velocities and commands after that step, as [`tautline_core::record::StateHash`] has it.
    pub state_hash: String,
}

/// Hash over the state after one step, as [`BadFlight::state_hash`] has it.
#[derive(Clone, Debug)]
pub struct StateAt {
    step: u64,
    seen: u64,
    hash: Option<String>,
}

impl StateAt {
    /// Of the step in which a flight was violated.
    #[must_use]
    pub fn violation_of(flight: &BadFlight) -> Self {
        Self { step: flight.violated_at_step, seen: 0, hash: None }
    }

    /// The hash, once the step has been flown.
    #[must_use]
    pub fn hash(&self) -> Option<&str> {
        self.hash.as_deref()
    }
}

impl Sink for StateAt {
    fn sample(&mut self, _sample: &Sample<'_>) -> Result<(), RecordError> {
        Ok(())
    }

    fn event(&mut self, _event: &Event) -> Result<(), RecordError> {
        Ok(())
    }

    fn step(&mut self, step: &Step<'_>) {
        if self.seen == self.step {
            let mut hash = StateHash::new();
            hash.observe(&Sample::new(step.time_s, self.seen, step.swarm, step.control));
            self.hash = Some(hash.finish());
        }
        self.seen += 1;
    }
}

/// Flies a flight again to its end, with the same bits, and hands what is recorded to `sink`.
///
/// The scenario must be the one that was split.
///
/// # Errors
/// [`SimError`] where law or judge do not exist, or the recording cannot be kept.
pub fn replay(scenario: &Scenario, genealogy: &Genealogy, sink: &mut dyn Sink) -> Result<Flight, SimError> {
    let mut simulation = begun(scenario, genealogy.noise_seed)?;
    let mut branches = genealogy.branches.iter().peekable();
    let mut take_over = |simulation: &mut Simulation| {
        while let Some(branch) = branches.next_if(|branch| branch.step == simulation.steps()) {
            simulation.load(&simulation.save(), Some(branch.noise_seed));
        }
        ControlFlow::Continue(())
    };
    let _goes_on = take_over(&mut simulation);
    fly_on(simulation, sink, &mut take_over)
}

/// The scenario at its start, with the noise of a seed.
pub(super) fn begun(scenario: &Scenario, noise_seed: u64) -> Result<Simulation, SimError> {
    Simulation::new(&Scenario { noise_seed, ..scenario.clone() })
}
