//! Flights that claims are judged by, in continuous time and in the physics engine.

use std::ops::ControlFlow;

use super::ValidateError;
use crate::continuous::{self, Solution, Tolerances};
use crate::formation::{Formation, largest_edge_error_m};
use crate::graph::Graph;
use crate::law::Law;
use crate::record::{Event, RecordError, Sample, Sink};
use crate::scenario::{PlantSpec, Precision, Scenario, Source};
use crate::sim::{self, Ending, Flight, Parts};
use crate::swarm::Swarm;

/// The embedded scenario of this name.
pub(super) fn builtin(name: &str) -> Result<Scenario, ValidateError> {
    Ok(Scenario::read(&Source::Builtin(name.to_owned()), &[])?)
}

/// 0, 1/rate, 2/rate, ... up to a duration \[s\], for a rate \[Hz\] that divides it.
pub(super) fn times(duration_s: f64, rate_hz: f64) -> Vec<f64> {
    let mut times = Vec::new();
    let mut k = 0.0;
    while k / rate_hz <= duration_s {
        times.push(k / rate_hz);
        k += 1.0;
    }
    times
}

/// The scenario in continuous time, with its states at these times \[s\].
pub(super) fn continuous(scenario: &Scenario, times_s: &[f64]) -> Result<Solution, ValidateError> {
    let mut law = scenario.law()?;
    Ok(continuous::solve(scenario, law.as_mut(), times_s, Tolerances::default())?)
}

/// The scenario in the physics engine, step by step, to its duration; `observe` sees every recorded sample.
pub(super) fn engine(scenario: &Scenario, observe: impl FnMut(&Sample<'_>)) -> Result<Flight, ValidateError> {
    let flight = engine_to_any_end(scenario, scenario.law()?, observe)?;
    match flight.ending {
        Ending::Completed => Ok(flight),
        ending => Err(ValidateError::EndedEarly { scenario: scenario.name.clone(), time_s: flight.duration_s, ending }),
    }
}

/// The scenario in the physics engine under this law, to whatever end it comes.
pub(super) fn engine_to_any_end(
    scenario: &Scenario,
    law: Box<dyn Law>,
    observe: impl FnMut(&Sample<'_>),
) -> Result<Flight, ValidateError> {
    let go_on = &mut |_| ControlFlow::Continue(());
    Ok(sim::fly(scenario, Parts::under(scenario, law), &mut Watch(observe), go_on)?)
}

/// The same scenario at another precision and step \[s\], with every step recorded and taken as it is.
pub(super) fn with_step(scenario: &Scenario, precision: Precision, dt_s: f64) -> Scenario {
    let mut scenario = scenario.clone();
    scenario.plant = PlantSpec::Rapier(precision);
    scenario.time.dt_s = dt_s;
    scenario.time.record_hz = 1.0 / dt_s;
    scenario.time.max_halvings = 0;
    scenario
}

/// The first of these times \[s\] from which on the largest edge error stays below `tolerance_m` \[m\].
pub(super) fn reached_at_s(
    times_s: &[f64],
    states: &[Swarm],
    formation: &Formation,
    graph: &Graph,
    tolerance_m: f64,
) -> Option<f64> {
    let good = |state: &Swarm| largest_edge_error_m(&state.positions_m, formation, graph) < tolerance_m;
    let held = states.iter().rev().take_while(|state| good(state)).count();
    times_s.get(states.len() - held).copied()
}

/// A recorder that shows each sample to a function.
struct Watch<F>(F);

impl<F: FnMut(&Sample<'_>)> Sink for Watch<F> {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        (self.0)(sample);
        Ok(())
    }

    fn event(&mut self, _event: &Event) -> Result<(), RecordError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_that_ends_early_is_an_error_and_not_a_short_flight() {
        let mut scenario = builtin("pentagon").expect("a scenario");
        scenario.time.duration_s = 0.1;
        assert!(engine(&scenario, |_| ()).is_ok());
        // Closer than delta within the first step, which is not refused.
        scenario.time.max_halvings = 0;
        scenario.start.velocities_m_s[(0, 0)] = 600.0;
        let error = engine(&scenario, |_| ()).expect_err("the law is undefined below delta");
        assert!(matches!(error, ValidateError::EndedEarly { ending: Ending::LawUndefined(_), .. }), "{error}");
    }
}
