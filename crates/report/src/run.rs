//! Flight of a scenario and its report.
//!
//! [`run`] depends on its scenario only, so flights can run in parallel. Memory does not grow with the length of a
//! flight. Recordings, figures and pictures are made by sinks.

use std::ops::ControlFlow;

use crate::report::{FlightResult, Report, Verification};
use tautline_core::record::{Sink, StateHash, record_in_thread};
use tautline_sim::metrics::Metrics;
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{self, Components, Ending, SimError};

/// Flies a scenario to its end, passes its samples and events to `sink`, and returns the report.
///
/// # Errors
/// [`SimError`]. Everything recorded up to then stays recorded.
pub fn run(scenario: &Scenario, sink: &mut (impl Sink + Send)) -> Result<Report, SimError> {
    run_while(scenario, &Preflight::of(scenario)?, sink, &mut |_| ControlFlow::Continue(()))
}

/// Smallest number of vehicles for which samples are recorded in a thread of their own. Below it, the handover costs
/// more.
const BESIDE_FROM: usize = 512;

/// Flies a scenario like [`run`], with the findings of its check. `carry_on` is called after each step with the number
/// of flown steps, and [`ControlFlow::Break`] ends the flight. Samples of a large swarm are recorded in a thread of
/// their own if threads are available and the sink does not [need steps](Sink::needs_steps).
///
/// # Errors
/// As [`run`].
pub fn run_while(
    scenario: &Scenario,
    preflight: &Preflight,
    sink: &mut (dyn Sink + Send),
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Report, SimError> {
    Ok(run_with(scenario, preflight, Components::of(scenario)?, sink, carry_on)?.0)
}

/// Flies a scenario like [`run_while`], with parts that may differ from those of the scenario, such as another law.
/// `preflight` is the check of that law ([`Preflight::with_law`]). Also returns how the flight ended.
///
/// # Errors
/// As [`run`].
pub fn run_with(
    scenario: &Scenario,
    preflight: &Preflight,
    parts: Components,
    sink: &mut (dyn Sink + Send),
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<(Report, Ending), SimError> {
    let freedom = parts.law.capabilities().controls.freedom();
    let mut metrics = Metrics::new(&scenario.legs, &scenario.graph, scenario.arrival)
        .with_freedom(freedom)
        .with_reference(scenario.reference.as_ref());
    let mut state_hash = StateHash::new();
    let is_beside = scenario.count() >= BESIDE_FROM && rayon::current_num_threads() > 1 && !sink.needs_steps();
    let mut recorders = (sink, &mut state_hash);
    let flight = if is_beside {
        record_in_thread(&mut recorders, |beside| sim::fly(scenario, parts, &mut (beside, &mut metrics), carry_on))?
    } else {
        sim::fly(scenario, parts, &mut (&mut recorders, &mut metrics), carry_on)?
    };
    let report = Report::new(&FlightResult {
        scenario,
        preflight,
        flight: &flight,
        summary: &metrics.finish(),
        ended_legs: metrics.ended_legs(),
        quadrotor_peaks: metrics.quadrotor_peaks(),
        state_hash: &state_hash.finish(),
    });
    Ok((report, flight.ending))
}

/// Largest difference of two smallest separations that count as equal, relative to delta.
const SAME: f64 = 0.01;

/// Flies the scenario of `report` again with every step half as long, and compares the results.
///
/// # Errors
/// As [`run`].
pub fn verify(scenario: &Scenario, report: &Report) -> Result<Verification, SimError> {
    let mut finer = scenario.clone();
    finer.time.dt_s *= 0.5;
    finer.time.max_rate_dt *= 0.5;
    let again = run(&finer, &mut ())?;
    let same_distance = match (report.min_separation_m(), again.min_separation_m()) {
        (Some(before_m), Some(after_m)) => (before_m - after_m).abs() <= SAME * scenario.delta_m,
        (before_m, after_m) => before_m == after_m,
    };
    let same_verdict = report.verdict.pass == again.verdict.pass && report.answer.status == again.answer.status;
    Ok(Verification {
        dt_s: finer.time.dt_s,
        pass: again.verdict.pass,
        min_m: again.min_separation_m(),
        reached_at_s: again.formation.reached_at_s,
        firm: same_distance && same_verdict,
    })
}
