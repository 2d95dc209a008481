//! Flights in continuous time and in Rapier, for the measurements of claims.

use std::ops::ControlFlow;

use nalgebra::Vector3;

use super::claim::{MeasureError, Progress};
use tautline_core::record::{Event, RecordError, Sample, Sink};
use tautline_core::swarm::{ClosestApproach, Swarm, mean_row, row, set_row};
use tautline_laws::formation::{Formation, largest_edge_error_m};
use tautline_laws::graph::Graph;
use tautline_laws::law::Law;
use tautline_sim::continuous::{self, Solution, Tolerances};
use tautline_sim::scenario::{PlantSpec, Scenario, Source, Space, offset, random, scatter};
use tautline_sim::sim::{self, Components, Ending, Flight};

/// Returns a built-in scenario.
pub(super) fn builtin(name: &str) -> Result<Scenario, MeasureError> {
    Ok(Scenario::read(&Source::Builtin(name.to_owned()), &[])?)
}

/// Returns 0, 1/rate, 2/rate, ... up to a duration \[s\], for a rate \[Hz\] that divides it.
pub(super) fn times(duration_s: f64, rate_hz: f64) -> Vec<f64> {
    (0..u32::MAX).map(|k| f64::from(k) / rate_hz).take_while(|&time_s| time_s <= duration_s).collect()
}

/// Flies a scenario in continuous time and returns its states at these times \[s\].
pub(super) fn continuous(
    scenario: &Scenario,
    times_s: &[f64],
    tolerances: Tolerances,
    progress: &Progress<'_>,
) -> Result<Solution, MeasureError> {
    let mut law = scenario.law()?;
    let carries_on = || !progress.is_interrupted();
    Ok(continuous::solve_while(scenario, law.as_mut(), times_s, tolerances, &carries_on)?)
}

/// Returns the state in continuous time at the end of a scenario.
pub(super) fn end(scenario: &Scenario, tolerances: Tolerances, progress: &Progress<'_>) -> Result<Swarm, MeasureError> {
    let last = continuous(scenario, &[scenario.time.duration_s], tolerances, progress)?.states.pop();
    Ok(last.unwrap_or_else(|| scenario.start.clone()))
}

/// Returns the separation certified before the first step \[m\]; NaN without a certificate.
pub(super) fn certified_m(scenario: &Scenario) -> Result<f64, MeasureError> {
    let certificate = scenario.law()?.certificate(&scenario.observation(&scenario.start), &[]);
    Ok(certificate.certified_m.unwrap_or(f64::NAN))
}

/// Returns the separation of a closest approach \[m\]; NaN without one.
pub(super) fn separation_m(closest: Option<ClosestApproach>) -> f64 {
    closest.map_or(f64::NAN, |closest| closest.separation_m)
}

/// Returns the larger number; NaN if either is NaN.
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// Returns `v_i - mean v` of each vehicle \[m/s\].
pub(super) fn relative_velocities(swarm: &Swarm) -> impl Iterator<Item = Vector3<f64>> + '_ {
    let mean = mean_row(&swarm.velocities_m_s);
    (0..swarm.count()).map(move |i| row(&swarm.velocities_m_s, i) - mean)
}

/// Returns `sum |v_i - mean v|^2`.
pub(super) fn relative_speed_squared(swarm: &Swarm) -> f64 {
    relative_velocities(swarm).map(|v| v.norm_squared()).sum()
}

/// Flies a scenario in Rapier to its end; `observe` receives every recorded sample.
pub(super) fn engine(
    scenario: &Scenario,
    progress: &Progress<'_>,
    observe: impl FnMut(&Sample<'_>),
) -> Result<Flight, MeasureError> {
    let flight = engine_to_any_end(scenario, scenario.law()?, progress, observe)?;
    match flight.ending {
        Ending::Completed => Ok(flight),
        ending => {
            let (name, time_s) = (&scenario.name, flight.duration_s);
            Err(format!("the flight of {name} ended early, at {time_s} s: {ending:?}").into())
        }
    }
}

/// Flies a scenario in Rapier under a law, to any ending.
pub(super) fn engine_to_any_end(
    scenario: &Scenario,
    law: Box<dyn Law>,
    progress: &Progress<'_>,
    observe: impl FnMut(&Sample<'_>),
) -> Result<Flight, MeasureError> {
    let parts = Components::with_law(scenario, law);
    Ok(sim::fly(scenario, parts, &mut SampleSink(observe), &mut |_| go_on(progress))?)
}

/// Ends a flight at an interruption.
pub(super) fn go_on(progress: &Progress<'_>) -> ControlFlow<()> {
    if progress.is_interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// Returns the scenario in Rapier with another step \[s\], every step recorded, without refinement.
pub(super) fn with_step(scenario: &Scenario, dt_s: f64) -> Scenario {
    let mut scenario = scenario.clone();
    scenario.plant = PlantSpec::Rapier;
    scenario.time.dt_s = dt_s;
    scenario.time.record_hz = 1.0 / dt_s;
    scenario.time.max_halvings = 0;
    scenario
}

/// Returns the first of these times \[s\] after which the largest edge error stays below `tolerance_m` \[m\].
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

/// Sink that passes each sample to a function.
struct SampleSink<F>(F);

impl<F: FnMut(&Sample<'_>)> Sink for SampleSink<F> {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        (self.0)(sample);
        Ok(())
    }

    fn event(&mut self, _event: &Event) -> Result<(), RecordError> {
        Ok(())
    }
}

/// Admitted numbers of vehicles of a random start.
pub(super) const COUNTS: std::ops::RangeInclusive<usize> = 3..=8;
/// Safety distance \[m\].
pub(super) const DELTA_M: f64 = 1.0;
/// Smallest separation of starts and of slots, divided by delta; starts may be tight.
const START_SPACING: f64 = 1.05;
const SLOT_SPACING: f64 = 1.2;
/// Half side of the square or cube of starts, divided by delta, and the same for slots.
const START_EXTENT: f64 = 4.0;
const SLOT_EXTENT: f64 = 3.0;
/// Largest velocity component \[m/s\] of a moving start.
const SPEED_M_S: f64 = 0.5;

/// Returns flights of random swarms to random shapes. The number of vehicles and plane or space take turns, and every
/// second start moves.
pub(super) fn random_starts(seed: u64, count: usize, duration_s: f64) -> Result<Vec<Scenario>, MeasureError> {
    let sizes: Vec<usize> = COUNTS.collect();
    (0..count)
        .map(|trial| {
            let (vehicles, round) = (sizes[trial % sizes.len()], trial / sizes.len());
            let space = if round.is_multiple_of(2) { Space::Plane } else { Space::Volume };
            // Each trial has its own stream, independent of the numbers that other trials draw.
            let mut random = random(seed);
            random.set_stream(trial as u64);
            let mut points =
                |extent: f64, spacing: f64| scatter(vehicles, space, extent * DELTA_M, spacing * DELTA_M, &mut random);
            let formation = Formation::points(points(SLOT_EXTENT, SLOT_SPACING)?);
            let mut swarm = Swarm::at_rest(points(START_EXTENT, START_SPACING)?);
            if (round / 2).is_multiple_of(2) {
                for i in 0..vehicles {
                    set_row(&mut swarm.velocities_m_s, i, offset(SPEED_M_S, space, &mut random));
                }
            }
            Ok(Scenario { space, ..Scenario::new("start", swarm, formation, DELTA_M, duration_s) })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::monitor::Silent;

    #[test]
    fn a_flight_that_ends_early_is_an_error() {
        let mut scenario = builtin("pentagon").expect("a scenario");
        scenario.time.duration_s = 0.1;
        assert!(engine(&scenario, &Silent::default(), |_| ()).is_ok());
        // Closer than delta within the first step, without refinement.
        scenario.time.max_halvings = 0;
        scenario.start.velocities_m_s[(0, 0)] = 600.0;
        let error = engine(&scenario, &Silent::default(), |_| ()).expect_err("the law is undefined below delta");
        assert!(error.to_string().starts_with("the flight of pentagon ended early, at "), "{error}");
        assert!(error.to_string().contains("LawUndefined("), "{error}");
    }
}
