//! Simulation loop: sense, supervise, command, actuate, move, audit, record.
//!
//! A [`Simulation`] advances step by step; [`fly`] takes one to its end and passes all samples and events to a
//! [`Sink`]. A [`VectorSimulation`] advances many worlds together. The law is evaluated at the beginning of each step.
//! A [`Plant`](crate::plant::Plant) either holds the command over the step or evaluates the law in continuous time. The
//! audit sweeps every step, also the parts of divided steps. A step allocates no memory.

mod controller;
mod ending;
mod judge;
mod monitors;
mod simulation;
mod vector;

pub use ending::{Breakdown, Ending, Flight, Performance, SimError};
pub(crate) use ending::{MAX_BEND, Stopwatch};
pub(crate) use judge::check_judge;
pub use simulation::{Components, SavedState, Simulation};
pub use vector::{GivenStarts, SeedChoice, States, StatesMut, Threads, VectorError, VectorSimulation};

use std::ops::ControlFlow;
use std::time::Instant;

use crate::scenario::Scenario;
use tautline_core::record::{Event, RecordError, Sink, Step};

/// Flies a scenario with given components to its end and passes every recorded instant to `sink`.
///
/// `carry_on` is called after each step with the number of steps so far; [`ControlFlow::Break`] ends the flight.
///
/// The scenario must be valid ([`Scenario::validate`]), and the components must have its number of vehicles.
///
/// # Errors
/// [`SimError`]; earlier records are kept. A motion that cannot be continued is not an error but an [`Ending`]; its
/// reason is the last event of the recording.
pub fn fly(
    scenario: &Scenario,
    parts: Components,
    sink: &mut dyn Sink,
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Flight, SimError> {
    let simulation = Simulation::with(scenario, parts)?;
    continue_flight(simulation, sink, &mut |simulation| carry_on(simulation.steps()))
}

/// Continues a simulation to its end, like [`fly`]. `after` is called after each step; it may load a saved state, and
/// ends the flight with [`ControlFlow::Break`].
///
/// # Errors
/// [`SimError`] if the recording cannot be written.
pub fn continue_flight(
    mut simulation: Simulation,
    sink: &mut dyn Sink,
    after: &mut dyn FnMut(&mut Simulation) -> ControlFlow<()>,
) -> Result<Flight, SimError> {
    let began = Instant::now();
    pass_to_sink(&mut simulation, sink)?;
    while simulation.ending().is_none() {
        simulation.step();
        pass_to_sink(&mut simulation, sink)?;
        if simulation.ending().is_none() && after(&mut simulation).is_break() {
            simulation.interrupt();
            pass_to_sink(&mut simulation, sink)?;
        }
    }
    if let Some(reason) = simulation.ending().and_then(Ending::reason) {
        sink.event(&Event::EndedEarly { time_s: simulation.time_s(), reason })?;
    }
    simulation.performance.wall = began.elapsed();
    Ok(simulation.finish())
}

/// Passes events and a due sample to the sink in order of time, then the step.
fn pass_to_sink(simulation: &mut Simulation, sink: &mut dyn Sink) -> Result<(), RecordError> {
    simulation.events().try_for_each(|event| sink.event(&event))?;
    sink.step(&Step { time_s: simulation.time_s(), swarm: simulation.state(), control: simulation.control() });
    if !simulation.sample_is_due() {
        return Ok(());
    }
    let began = Instant::now();
    if let Some(sample) = simulation.sample() {
        sink.sample(&sample)?;
        simulation.performance.record += began.elapsed();
    }
    Ok(())
}
