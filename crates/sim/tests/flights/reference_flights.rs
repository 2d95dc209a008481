//! The built-in scenarios in Rapier agree with the reference solution of the ODE (an 8th-order Runge-Kutta integration
//! at a relative tolerance of 1e-10). Their error vanishes with the square of the step.

use crate::flight::{Log, builtin, fly};
use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_core::record::Sink;
use tautline_core::swarm::{Pair, row};
use tautline_laws::formation::affine_dimension;
use tautline_sim::metrics::{Metrics, Summary};
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{Ending, Flight};

/// Kick, drift, kick at dt = 1/240 s has an error of 1e-6 m after 10 s.
const POSITION_TOLERANCE_M: f64 = 3e-6;
/// Reference table with six decimals.
const SEPARATION_TOLERANCE_M: f64 = 5e-6;
/// A few steps of 4 ms: the minimum is flat, so its time is less accurate than its depth.
const TIME_TOLERANCE_S: f64 = 0.02;
/// The circle passes its minimum at 0.1 m/s or less, and its table has two decimals.
const CIRCLE_TIME_TOLERANCE_S: f64 = 0.05;
/// E(0) and the certificate of the reference have six decimals.
const START_TOLERANCE: f64 = 1e-6;
/// Measured order of a second-order method from two steps: 2 up to terms of the order of dt.
const ORDER: std::ops::RangeInclusive<f64> = 1.9..=2.1;

/// Position of vehicle 1 at t = 10 s in the pentagon \[m\].
const PENTAGON_FIRST_AT_10_S_M: [f64; 3] = [4.318_055_1, -1.043_487_6, 0.0];
const PENTAGON_MIN_M: f64 = 2.460_353;
const PENTAGON_MIN_AT_S: f64 = 2.151;
/// Minimum of the pentagon's start under the baseline.
const BASELINE_MIN_M: f64 = 1.5327;
const BASELINE_MIN_AT_S: f64 = 3.63;

fn summary(scenario: &Scenario, log: &Log) -> Summary {
    let mut metrics = Metrics::new(&scenario.legs, &scenario.graph, scenario.arrival);
    for sample in &log.samples {
        metrics.sample(&sample.as_sample()).expect("metrics take any sample");
    }
    metrics.finish()
}

fn assert_near(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found}, expected {expected} within {tolerance}");
}

/// Checks the properties of every successful flight.
fn assert_completed(scenario: &Scenario, flight: &Flight) {
    assert_eq!(flight.ending, Ending::Completed);
    assert_eq!(flight.steps, scenario.time.steps());
    assert_near(flight.duration_s, scenario.time.duration_s, 1e-9, "duration");
    assert_eq!(flight.audit.steps, flight.steps, "no step of a reference flight is refined");
    assert_eq!(flight.audit.parry.disagreements, 0);
}

fn position_of_first_at(log: &Log, time_s: f64) -> Vector3<f64> {
    let sample = log.samples.iter().find(|sample| sample.time_s >= time_s - 1e-9).expect("a sample");
    assert_near(sample.time_s, time_s, 1e-9, "time of the sample");
    row(&sample.swarm.positions_m, 0)
}

#[test]
fn the_pentagon_is_clear_and_reached_as_in_the_reference() {
    let scenario = builtin("pentagon", &[]);
    let (flight, log) = fly(&scenario);
    assert_completed(&scenario, &flight);

    assert_eq!(flight.audit.status, Status::Clear);
    let closest = flight.audit.closest.expect("five vehicles have a closest pair");
    assert_near(closest.separation_m, PENTAGON_MIN_M, SEPARATION_TOLERANCE_M, "smallest separation");
    assert_near(closest.time_s, PENTAGON_MIN_AT_S, TIME_TOLERANCE_S, "its time");
    assert!([Pair::new(1, 2), Pair::new(0, 2)].contains(&closest.pair), "{}", closest.pair);
    assert_near(flight.certificate.certified_m.expect("a certificate"), 2.055_307, START_TOLERANCE, "certified");
    assert!(flight.certificate.certified_m.is_some_and(|certified_m| closest.separation_m > certified_m));
    assert!(flight.engine_contacts.is_empty());

    let summary = summary(&scenario, &log);
    assert_near(summary.energy_initial.expect("an energy"), 3.656_743, START_TOLERANCE, "E(0)");
    let reached_at_s = summary.reached_at_s.expect("the formation is reached");
    assert!((36.0..=38.0).contains(&reached_at_s), "reached at {reached_at_s} s");
    let off_m = (position_of_first_at(&log, 10.0) - Vector3::from(PENTAGON_FIRST_AT_10_S_M)).norm();
    assert!(off_m <= POSITION_TOLERANCE_M, "vehicle 1 is off by {off_m} m at t = 10 s");
    assert!(summary.max_edge_error_m < 1e-5, "{} m at the end", summary.max_edge_error_m);
}

#[test]
fn the_first_command_of_the_pentagon_is_the_reference_command() {
    let scenario = builtin("pentagon", &["time.duration_s=1"]);
    let (_, log) = fly(&scenario);
    let off_m_s2 = (row(&log.samples[0].control, 0) - Vector3::new(0.860_843_123, -0.021_225_585, 0.0)).norm();
    assert!(off_m_s2 < 1e-9, "off by {off_m_s2} m/s^2, and the reference has nine decimals");
}

#[test]
fn the_circle_is_clear_and_reached_as_in_the_reference() {
    let scenario = builtin("circle", &[]);
    let (flight, log) = fly(&scenario);
    assert_completed(&scenario, &flight);

    assert_eq!(flight.audit.status, Status::Clear);
    let closest = flight.audit.closest.expect("six vehicles have a closest pair");
    assert_near(closest.separation_m, 1.238_135, SEPARATION_TOLERANCE_M, "smallest separation");
    assert_near(closest.time_s, 4.18, CIRCLE_TIME_TOLERANCE_S, "its time");
    assert_eq!(closest.pair, Pair::new(2, 3));
    assert_near(flight.certificate.certified_m.expect("a certificate"), 1.019_476, START_TOLERANCE, "certified");

    let summary = summary(&scenario, &log);
    assert_near(summary.energy_initial.expect("an energy"), 4.479_772_16, START_TOLERANCE, "E(0)");
    assert_near(summary.reached_at_s.expect("the formation is reached"), 44.3, 1.0, "reached");
}

#[test]
fn the_baseline_reaches_the_pentagon_through_a_violation() {
    let scenario = builtin("pentagon-laplacian", &[]);
    let (flight, log) = fly(&scenario);
    assert_completed(&scenario, &flight);

    assert_eq!(flight.audit.status, Status::Violation);
    let closest = flight.audit.closest.expect("five vehicles have a closest pair");
    assert_near(closest.time_s, BASELINE_MIN_AT_S, TIME_TOLERANCE_S, "time of the smallest separation");
    let deepest_m = flight.audit.violations.iter().map(|violation| violation.min_m).fold(f64::INFINITY, f64::min);
    assert_eq!(deepest_m, closest.separation_m);
    assert_eq!(flight.certificate.certified_m, None);
    assert!(!flight.certificate.void.is_empty(), "a law without a barrier has a reason for its missing certificate");
    let seen_by_engine = |pair| flight.engine_contacts.contains(&pair);
    assert!(
        flight.audit.violations.iter().all(|violation| seen_by_engine(violation.pair)),
        "the engine reports it as well"
    );
    assert!(summary(&scenario, &log).reached_at_s.is_some(), "the baseline converges");
}

#[test]
fn the_extrapolated_depth_of_the_baselines_violation_matches_the_reference() {
    let [coarse_m, fine_m] = [120, 240].map(|steps_per_s| {
        let flight = fly(&in_steps("pentagon-laplacian", steps_per_s, 5)).0;
        flight.audit.closest.expect("five vehicles have a closest pair").separation_m
    });
    assert!((coarse_m - BASELINE_MIN_M).abs() < 1e-3, "a step of 1/120 s is off by {}", coarse_m - BASELINE_MIN_M);
    // The error of second order in the step cancels; the reference has four decimals.
    assert_near((4.0 * fine_m - coarse_m) / 3.0, BASELINE_MIN_M, 1e-4, "smallest separation");
}

#[test]
fn a_start_on_a_line_stays_on_it_exactly_and_forms_nothing() {
    let scenario = builtin("pentagon-collinear", &[]);
    let (flight, log) = fly(&scenario);
    assert_completed(&scenario, &flight);

    assert_eq!(flight.audit.status, Status::Clear);
    let closest = flight.audit.closest.expect("five vehicles have a closest pair");
    assert_near(closest.separation_m, 2.458_145, SEPARATION_TOLERANCE_M, "smallest separation");
    for sample in &log.samples {
        let leaves = |rows: &tautline_core::swarm::Rows| rows.columns(1, 2).iter().any(|&x| x != 0.0);
        assert!(!leaves(&sample.swarm.positions_m) && !leaves(&sample.swarm.velocities_m_s), "{} s", sample.time_s);
    }
    let summary = summary(&scenario, &log);
    assert_eq!(summary.reached_at_s, None);
    assert_near(summary.max_edge_error_m, 8.57, 0.01, "largest edge error, known to two decimals");
    assert_eq!(affine_dimension(&scenario.start.positions_m, 1e-9), 1);
    assert_eq!(scenario.formation().affine_dimension(1e-9), 2);
}

/// Returns a built-in scenario with a duration and steps of 1/`steps_per_s`.
fn in_steps(name: &str, steps_per_s: u32, duration_s: u32) -> Scenario {
    let mut scenario = builtin(name, &[]);
    scenario.time.dt_s = 1.0 / f64::from(steps_per_s);
    scenario.time.duration_s = f64::from(duration_s);
    scenario
}

/// Returns the distance of vehicle 1 from the reference at t = 10 s with steps of 1/`steps_per_s` \[m\].
fn error_at_10_s(steps_per_s: u32) -> f64 {
    let scenario = in_steps("pentagon", steps_per_s, 10);
    let (flight, log) = fly(&scenario);
    assert_completed(&scenario, &flight);
    (position_of_first_at(&log, 10.0) - Vector3::from(PENTAGON_FIRST_AT_10_S_M)).norm()
}

#[test]
fn the_error_against_the_reference_shrinks_with_the_square_of_the_step() {
    let errors_m = [60, 120, 240, 480].map(error_at_10_s);
    for pair in errors_m.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!(ORDER.contains(&order), "order {order} in {errors_m:?}");
    }
}
