//! A scenario, flown to its report.
//!
//! [`run`] is a function of its scenario: many of them run side by side, and memory does not grow with the length of a
//! flight. Whatever else is wanted of a flight (a recording, figures, pictures) is the business of the sink.

use std::ops::ControlFlow;

use crate::report::{FailedVehicle, Findings, Hulls, Network, Performance, Report, Run, VehicleNumbers, Verification};
use tautline_core::record::{Sink, StateHash, record_beside};
use tautline_laws::law::{Certificate, Void};
use tautline_sim::metrics::Metrics;
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{self, Breakdown, Ending, Flight, Parts, SimError};
use tautline_sim::vehicle::Quadrotor;

/// Flies a scenario to its end, hands what is recorded to `sink`, and reports.
///
/// # Errors
/// [`SimError`]; what was recorded up to then stays recorded.
pub fn run(scenario: &Scenario, sink: &mut (impl Sink + Send)) -> Result<Report, SimError> {
    run_while(scenario, &Preflight::of(scenario)?, sink, &mut |_| ControlFlow::Continue(()))
}

/// From this many vehicles on samples are recorded in a thread of their own; below, handing them over costs more.
const BESIDE_FROM: usize = 512;

/// As [`run`], with what is known before the first step; `carry_on` is asked after each step with the number of steps
/// flown and ends the flight with [`ControlFlow::Break`]. A large swarm's samples are recorded in a thread of their own where
/// there are threads at hand, unless the sink [looks at steps](Sink::looks_at_steps).
///
/// # Errors
/// As [`run`].
pub fn run_while(
    scenario: &Scenario,
    preflight: &Preflight,
    sink: &mut (dyn Sink + Send),
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Report, SimError> {
    Ok(run_with(scenario, preflight, Parts::of(scenario)?, sink, carry_on)?.0)
}

/// As [`run_while`], with parts that need not be the scenario's, such as another law; `preflight` is of that law
/// ([`Preflight::under`]). Says how the flight ended too.
///
/// # Errors
/// As [`run`].
pub fn run_with(
    scenario: &Scenario,
    preflight: &Preflight,
    parts: Parts,
    sink: &mut (dyn Sink + Send),
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<(Report, Ending), SimError> {
    let freedom = parts.law.capabilities().controls.freedom();
    let mut metrics = Metrics::new(&scenario.legs, &scenario.graph, scenario.arrival)
        .free_by(freedom)
        .carried_by(scenario.reference.as_ref());
    let mut state_hash = StateHash::new();
    let is_beside = scenario.count() >= BESIDE_FROM && rayon::current_num_threads() > 1 && !sink.looks_at_steps();
    let mut recorders = (sink, &mut state_hash);
    let flight = if is_beside {
        record_beside(&mut recorders, |beside| sim::fly(scenario, parts, &mut (beside, &mut metrics), carry_on))?
    } else {
        sim::fly(scenario, parts, &mut (&mut recorders, &mut metrics), carry_on)?
    };
    let report = report(scenario, preflight, &flight, &metrics, state_hash.finish());
    Ok((report, flight.ending))
}

/// Smallest separations that differ by this part of delta or less are the same.
const SAME: f64 = 0.01;

/// Flies the scenario of `report` again with every step half as long.
///
/// # Errors
/// As [`run`].
pub fn verify(scenario: &Scenario, report: &Report) -> Result<Verification, SimError> {
    let mut finer = scenario.clone();
    finer.time.dt_s *= 0.5;
    finer.time.max_rate_dt *= 0.5;
    let again = run(&finer, &mut ())?;
    let same_distance = match (report.separation.min_m, again.separation.min_m) {
        (Some(before_m), Some(after_m)) => (before_m - after_m).abs() <= SAME * scenario.delta_m,
        (before_m, after_m) => before_m == after_m,
    };
    let same_verdict = report.verdict.pass == again.verdict.pass && report.audit.status == again.audit.status;
    Ok(Verification {
        dt_s: finer.time.dt_s,
        pass: again.verdict.pass,
        min_m: again.separation.min_m,
        reached_at_s: again.formation.reached_at_s,
        firm: same_distance && same_verdict,
    })
}

/// Whether the energy is proved never to grow: relative velocities are damped, and nothing voids the proof but that it
/// certifies no distance.
fn energy_falls(preflight: &Preflight, certificate: &Certificate) -> bool {
    let holds =
        |void: &Void| matches!(void, Void::NoBarrier | Void::GraphNotComplete | Void::StepsTooLong | Void::Unresolved);
    preflight.velocity_margin_per_s.is_some_and(|margin_per_s| margin_per_s >= 0.0)
        && certificate.void.iter().all(holds)
}

fn report(
    scenario: &Scenario,
    preflight: &Preflight,
    flight: &Flight,
    metrics: &Metrics<'_>,
    state_hash: String,
) -> Report {
    let ended_early = match &flight.ending {
        Ending::BrokeDown(why @ Breakdown::Unresolved { .. }) => {
            Some(format!("{why}; shorten time.duration_s, or reduce what drives the mean velocity"))
        }
        Ending::BrokeDown(why) => Some(format!("{why}; shorten time.dt_s, or look for speeds and gains that grow")),
        ending => ending.reason(),
    };
    let wall_s = flight.performance.wall.as_secs_f64();
    let in_metres = flight.in_metres.as_ref().unwrap_or(&flight.audit);
    let hulls = if scenario.has_engine() {
        Hulls::solid(&flight.bounces, in_metres, &scenario.hull_radius_m, scenario.time.dt_s)
    } else {
        Hulls::of_points(in_metres, &scenario.hull_radius_m)
    };
    let vehicle =
        scenario.airframe.quadrotor().zip(metrics.strain()).map(|(Quadrotor { model, .. }, strain)| VehicleNumbers {
            model: model.name.clone(),
            max_tilt_deg: strain.max_tilt_rad.to_degrees(),
            thrust_share: strain.max_thrust_n / model.max_thrust_n,
        });
    let failed = scenario.failures.iter().filter(|failure| failure.at_s <= flight.duration_s).map(FailedVehicle::from);
    let failed: Vec<_> = failed.collect();
    Report::new(&Findings {
        scenario_name: &scenario.name,
        scenario_sha256: &scenario.sha256_hex(),
        delta_m: scenario.delta_m,
        half_axes_m: scenario.half_axes_m(),
        judge: scenario.arrival,
        trap_dimension: preflight.trap_dimension(),
        formation_dimension: preflight.formation_dimension,
        refused: &preflight.refusing(),
        certificate: &flight.certificate,
        audit: &flight.audit,
        in_metres: flight.in_metres.as_ref(),
        clearance: flight.clearance.as_ref(),
        obstacles: &scenario.obstacles.iter().map(|obstacle| obstacle.name.clone()).collect::<Vec<_>>(),
        engine_contact_pairs: scenario.has_engine().then_some(flight.engine_contacts.len() as u64),
        hulls: &hulls,
        vehicle: vehicle.as_ref(),
        network: flight.traffic.map(|of| Network { sent: of.sent, lost: of.lost, age_p95_s: of.age_p95_s }),
        failures: &failed,
        is_disturbed: !scenario.wind.is_still() || !scenario.is_exact() || !scenario.airframe.is_point(),
        summary: &metrics.finish(),
        legs: scenario.legs.len(),
        ended_legs: metrics.ended_legs(),
        breaths: &flight.breaths,
        assignments: &flight.assignments,
        energy_rise: flight.energy_rise,
        energy_falls: scenario.wind.is_still() && energy_falls(preflight, &flight.certificate),
        run: &Run {
            duration_s: flight.duration_s,
            dt_s: scenario.time.dt_s,
            steps: flight.steps,
            refined_steps: flight.refined_steps,
            overlong_steps: flight.overlong_steps,
            ended_early,
            vehicles: scenario.count(),
            state_hash,
        },
        performance: Performance {
            wall_s,
            real_time_factor: Some(flight.duration_s / wall_s).filter(|factor| factor.is_finite()),
            law_s: flight.performance.law.as_secs_f64(),
            energy_s: flight.performance.energy.as_secs_f64(),
            physics_s: flight.performance.physics.as_secs_f64(),
            airframe_s: flight.performance.airframe.as_secs_f64(),
            audit_s: flight.performance.audit.as_secs_f64(),
            record_s: flight.performance.record.as_secs_f64(),
        },
    })
}
