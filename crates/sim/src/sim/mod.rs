//! The loop: sense, supervise, command, actuate, move, judge, record.
//!
//! A [`Simulation`] is advanced step by step; [`fly`] takes one to its end and hands everything that is recorded to a
//! [`Sink`]. The law is asked at the beginning of each step; a [`Plant`](crate::plant::Plant) either holds its command over the step or
//! is one of continuous time and asks the law all the way along. The audit sweeps every step, the step that a refusal
//! shortened too. A step allocates nothing.

mod controller;
mod ending;
mod judge;
mod monitors;
mod simulation;

pub use ending::{Breakdown, Ending, Flight, Performance, SimError};
pub use judge::{judged, judged_shape};
pub use simulation::{Parts, Saved, Simulation};

use std::ops::ControlFlow;
use std::time::Instant;

use crate::scenario::Scenario;
use tautline_core::record::{Event, RecordError, Sink, Step};

/// Flies a scenario with these parts to its end and hands every recorded instant to `sink`.
///
/// `carry_on` is asked after each step with the number of steps flown and ends the flight with
/// [`ControlFlow::Break`].
///
/// The scenario must be one that [`Scenario::validate`] accepts, and the parts of its number of vehicles.
///
/// # Errors
/// [`SimError`]; what was recorded up to then stays recorded. A motion that cannot be carried on is no error but an
/// [`Ending`], with the reason as the last event of the recording.
pub fn fly(
    scenario: &Scenario,
    parts: Parts,
    sink: &mut dyn Sink,
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Flight, SimError> {
    let simulation = Simulation::with(scenario, parts)?;
    fly_on(simulation, sink, &mut |simulation| carry_on(simulation.steps()))
}

/// Flies a simulation on from where it is, as [`fly`] does; `after` is given it after each step, may load it, and ends the flight
/// with [`ControlFlow::Break`].
///
/// # Errors
/// [`SimError`] where what is recorded cannot be kept.
pub fn fly_on(
    mut simulation: Simulation,
    sink: &mut dyn Sink,
    after: &mut dyn FnMut(&mut Simulation) -> ControlFlow<()>,
) -> Result<Flight, SimError> {
    let began = Instant::now();
    hand_over(&mut simulation, sink)?;
    while simulation.ending().is_none() {
        simulation.step();
        hand_over(&mut simulation, sink)?;
        if simulation.ending().is_none() && after(&mut simulation).is_break() {
            simulation.interrupt();
            hand_over(&mut simulation, sink)?;
        }
    }
    if let Some(reason) = simulation.ending().and_then(Ending::reason) {
        sink.event(&Event::EndedEarly { time_s: simulation.time_s(), reason })?;
    }
    simulation.performance.wall = began.elapsed();
    Ok(simulation.finish())
}

/// Gives what is to be recorded to the sink, in the order in which it happened, and shows it the step.
fn hand_over(simulation: &mut Simulation, sink: &mut dyn Sink) -> Result<(), RecordError> {
    simulation.events().try_for_each(|event| sink.event(&event))?;
    sink.step(&Step { time_s: simulation.time_s(), swarm: simulation.state(), control: simulation.control() });
    let began = Instant::now();
    if let Some(sample) = simulation.sample() {
        sink.sample(&sample)?;
        simulation.performance.record += began.elapsed();
    }
    Ok(())
}
