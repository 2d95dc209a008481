//! Refinement of steps that are too long for the law, and the verdict if refinement does not suffice.

use crate::flight::{Log, builtin, duel, fly, read};
use tautline_audit::Status;
use tautline_core::record::Event;
use tautline_core::swarm::Pair;
use tautline_laws::law::{LaplacianKeys, LawError, LawSpec, VoidReason};
use tautline_report::report::Report;
use tautline_report::run;
use tautline_sim::scenario::{Scenario, TimeSpec};
use tautline_sim::sim::Ending;

fn refinements(log: &Log) -> Vec<(f64, f64)> {
    let refined = |event: &Event| match *event {
        Event::StepRefined { time_s, dt_s } => Some((time_s, dt_s)),
        _ => None,
    };
    log.events.iter().filter_map(refined).collect()
}

/// Returns the largest excess of the energy over E(0), relative to E(0).
fn energy_excess(log: &Log) -> f64 {
    let initial = log.samples[0].energy.expect("the law has an energy");
    log.samples.iter().filter_map(|sample| sample.peaks.energy).fold(0.0, f64::max) / initial - 1.0
}

/// Returns a pair that closes at 20 m/s, 0.4 m from the barrier.
fn barrier_ahead(dt_s: f64) -> Scenario {
    duel([-1.2, 1.2], [10.0, -10.0], 2.0, dt_s, 5.0)
}

#[test]
fn step_across_the_barrier_is_flown_in_parts() {
    for dt_s in [1.0 / 240.0, 1.0 / 60.0, 0.125, 0.25, 0.5] {
        let scenario = barrier_ahead(dt_s);
        let (flight, log) = fly(&scenario);
        assert_eq!((flight.ending, flight.audit.status), (Ending::Completed, Status::Clear), "dt = {dt_s} s");
        assert_eq!(flight.steps, scenario.time.steps());
        assert!(flight.audit.steps > flight.steps, "the audit sweeps the parts");
        let refined = refinements(&log);
        assert!(!refined.is_empty());
        for (time_s, part_s) in refined {
            assert!(part_s < dt_s && part_s >= dt_s / 1024.0, "{part_s} s");
            assert_eq!((dt_s / part_s).log2().fract(), 0.0, "halves of halves");
            assert_eq!((time_s / dt_s).fract(), 0.0, "a step begins at {time_s} s");
        }
    }
}

#[test]
fn step_across_the_barrier_is_undecided_without_halvings() {
    let mut scenario = barrier_ahead(0.5);
    scenario.time.max_halvings = 0;
    let (flight, log) = fly(&scenario);
    assert_eq!((flight.audit.status, flight.audit.violations.len()), (Status::Undecided, 1));
    assert_eq!(refinements(&log), []);
    let report = run::run(&scenario, &mut ()).expect("a report");
    let said = "UNDECIDED: the step cannot resolve this, as flown vehicles 1 and 2 came to ";
    assert!(report.headline().starts_with(said), "{}", report.headline());
    let reasons = &report.verdict.reasons;
    let has = |code: &str| report.verdict.has(code);
    assert!(!report.verdict.pass && has("unresolved-by-step") && has("steps-too-long"), "{reasons:?}");
}

#[test]
fn step_into_the_barrier_ends_the_run_without_halvings() {
    let mut scenario = barrier_ahead(0.125);
    scenario.time.max_halvings = 0;
    let (flight, log) = fly(&scenario);
    let Ending::LawUndefined(LawError::Collision { pair, separation_m, delta_m }) = flight.ending else {
        panic!("{:?}", flight.ending)
    };
    assert_eq!((pair, delta_m), (Pair::new(0, 1), 2.0));
    assert!(separation_m < delta_m);
    assert_eq!((flight.audit.status, flight.audit.violations.len()), (Status::Undecided, 1));
    assert_eq!((flight.steps, flight.duration_s), (1, 0.125));
    let last = log.samples.last().expect("samples");
    assert_eq!((last.time_s, last.step, last.energy), (0.125, 1, None));
    assert_eq!(&last.swarm, &flight.last);
    assert_eq!(last.control.nrows(), 0, "the law has no command in this state");
    let Some(Event::EndedEarly { time_s, reason }) = log.events.last() else { panic!("{:?}", log.events) };
    assert!(*time_s == 0.125 && reason.contains("vehicles 1 and 2"), "{reason}");
}

#[test]
fn law_without_a_barrier_needs_no_refinement() {
    let mut scenario = barrier_ahead(1.0);
    scenario.law = LawSpec::Laplacian(LaplacianKeys { f1_per_s2: 1.0, f2_per_s: Some(1.0) });
    scenario.time.max_rate_dt = 1.0;
    let (flight, log) = fly(&scenario);
    assert_eq!((refinements(&log), flight.audit.steps), (vec![], flight.steps));
}

#[test]
fn refinement_for_the_fastest_rate_bounds_the_energy() {
    let mut scenario = builtin("pentagon", &["law.alpha=100", "time.dt_s=0.1", "time.record_hz=10"]);
    let (honest, log) = fly(&scenario);
    assert!(!refinements(&log).is_empty(), "refinements are recorded");
    assert!(honest.audit.steps > honest.steps);
    assert!(energy_excess(&log) < 1e-3, "{}", energy_excess(&log));
    (scenario.time.max_rate_dt, scenario.time.max_halvings) = (1e9, 0);
    let (whole, log) = fly(&scenario);
    let collided = matches!(whole.ending, Ending::LawUndefined(_));
    assert!(collided || energy_excess(&log) > 0.01, "taken whole, such steps gain energy: {}", energy_excess(&log));
}

#[test]
fn overlong_steps_void_the_certificate_and_do_not_pass() {
    let stiff = builtin("pentagon", &["law.alpha=997335080"]);
    let (flight, _) = fly(&stiff);
    assert!(flight.overlong_steps > 0, "the law needs shorter steps than the halvings give");
    assert_eq!((flight.certificate.certified_m, &flight.certificate.void[..]), (None, &[VoidReason::StepsTooLong][..]));
    let report = run::run(&stiff, &mut ()).expect("a report");
    assert_eq!(report.run.overlong_steps, flight.overlong_steps);
    assert!(!report.verdict.pass && !report.breaks_certificate());
    assert!(report.headline().contains("longer than the law allows"), "{}", report.headline());
    assert!(report.verdict.has("steps-too-long"));
}

#[test]
fn clear_and_reached_flight_with_overlong_steps_does_not_pass() {
    let report = |max_halvings: &str| {
        let keys = ["law.alpha=100", "time.dt_s=0.01", max_halvings];
        let scenario = builtin("pentagon", &keys);
        run::run(&scenario, &mut ()).expect("a report")
    };
    let [refined, whole] = ["time.max_halvings=10", "time.max_halvings=0"].map(report);
    assert_eq!((refined.run.overlong_steps, refined.verdict.pass), (0, true));
    assert!(whole.run.overlong_steps > 0 && !whole.verdict.pass, "{:?}", whole.verdict);
    assert!(whole.headline().starts_with("STEP TOO LONG: "), "{}", whole.headline());
    assert_eq!(whole.certificate.separation_m, None);
    // A clear motion that is not that of the law proves nothing about the law.
    let proved = |report: &Report| report.to_json().expect("JSON").contains("\"proved\": true");
    assert!(proved(&refined) && !proved(&whole));
}

#[test]
fn step_length_is_checked_at_its_end_too() {
    // Fast contacts within one step: before it, the law's rate is low and the barrier is far.
    for (name, keys) in [
        ("swap", &["law.alpha=5000", "law.k_per_s2=1", "time.dt_s=0.1", "time.record_hz=4", "time.duration_s=5"][..]),
        ("pentagon", &["law.kind=displacement", "law.alpha=1e6", "time.record_hz=4", "time.duration_s=10"]),
        (
            "pentagon",
            &["law.alpha=400", "time.dt_s=0.045", "time.record_hz=4", "time.max_rate_dt=1e9", "time.duration_s=30"],
        ),
    ] {
        let report = run::run(&builtin(name, keys), &mut ()).expect("a report");
        assert!(!report.breaks_certificate(), "{name} {keys:?}: {}", report.headline());
        let rises = report.energy.max_over_leg_start.is_some_and(|ratio| ratio > 1.01);
        assert!(
            !rises || (report.run.overlong_steps > 0 && !report.verdict.pass),
            "{name} {keys:?}: {}",
            report.headline()
        );
    }
}

#[test]
fn held_commands_need_no_refinement() {
    let keys = ["law.alpha=100", "time.dt_s=0.01", "time.max_halvings=0", "time.control_hz=100"];
    let (flight, _) = fly(&builtin("pentagon", &keys));
    assert_eq!(flight.overlong_steps, 0);
}

/// Returns a hub with links to two vehicles that have no link between them, all at their slots.
fn star(half_m: f64, speed_m_s: f64, kind: &str, more: &str) -> Scenario {
    read(&format!(
        "start.positions_m = [[0, 0], [3, {half_m}], [3, -{half_m}]]\n\
         start.velocities_m_s = [[0, 0], [0, -{speed_m_s}], [0, {speed_m_s}]]\n\
         formation = {{ shape = \"points\", points_m = [[0, 0], [3, 0.501], [3, -0.501]] }}\n\
         graph.kind = \"{kind}\"\nlaw.delta_m = 1.0\ntime.duration_s = 2.0\n{more}"
    ))
}

#[test]
fn pair_without_a_link_needs_no_refinement() {
    let (flight, log) = fly(&star(0.501, 0.0, "star", ""));
    assert_eq!((refinements(&log), flight.audit.steps), (vec![], flight.steps));
    assert_eq!(flight.audit.status, Status::Clear);
    // With a link the pair has a steep tension at this distance.
    let (flight, log) = fly(&star(0.501, 0.0, "complete", ""));
    assert!(!refinements(&log).is_empty() && flight.audit.steps > flight.steps);
}

#[test]
fn violation_of_a_pair_without_a_link_does_not_depend_on_the_step() {
    let (flight, log) = fly(&star(0.501, 0.02, "star", ""));
    assert_eq!((refinements(&log), flight.overlong_steps), (vec![], 0));
    assert_eq!((flight.audit.status, flight.audit.steps), (Status::Violation, flight.steps));
    assert_eq!(flight.audit.violations[0].pair, Pair::new(1, 2));
    let report = run::run(&star(0.501, 0.02, "star", ""), &mut ()).expect("a report");
    assert!(report.headline().starts_with("VIOLATION: vehicles 2 and 3 came to 0.9"), "{}", report.headline());
}

#[test]
fn linked_pair_is_refined_although_another_pair_is_closer() {
    let mut scenario = star(0.501, 0.0, "star", "");
    scenario.start.velocities_m_s[(0, 0)] = 20.0;
    let (flight, log) = fly(&scenario);
    assert!(!refinements(&log).is_empty());
    let apart_m = |i: usize| tautline_core::swarm::separation(&flight.last.positions_m, 0, i);
    assert!(apart_m(1) > 1.0 && apart_m(2) > 1.0);
}

/// Two vehicles without a link pass each other within the first step, which is too long for the law.
#[test]
fn violation_beyond_the_integration_error_stands() {
    let more = "law.alpha = 80.0\ntime.dt_s = 0.05\ntime.max_halvings = 0\ntime.record_hz = 20";
    let scenario = star(0.6, 20.0, "star", more);
    let (flight, _) = fly(&scenario);
    assert!(flight.overlong_steps > 0);
    assert_eq!(flight.audit.status, Status::Violation);
    // A violation by 0.1 mm after a step with a larger possible error.
    let mut scenario = star(0.501, 0.021, "star", more);
    scenario.time.duration_s = 0.05;
    let (shallow, _) = fly(&scenario);
    assert!(shallow.overlong_steps > 0 && !shallow.audit.violations.is_empty());
    assert_eq!(shallow.audit.status, Status::Undecided);
}

#[test]
fn jump_across_the_barrier_in_the_shortest_part_is_undecided() {
    let keys = ["law.kind=potential", "law.k_per_s2=1e6", "time.duration_s=2", "time.max_halvings=10"];
    let stiff = builtin("pentagon", &keys);
    let (flight, _) = fly(&stiff);
    assert!(flight.overlong_steps > 0 && !flight.audit.violations.is_empty());
    assert_eq!(flight.audit.status, Status::Undecided, "the certificate excludes this distance");
}

#[test]
fn halvings_follow_the_certified_distance_of_a_stiff_potential() {
    let keys = |more: &[&'static str]| {
        let keys = ["law.kind=potential", "law.k_per_s2=1e4", "time.duration_s=1", "arrival.hold_s=0.1"];
        builtin("pentagon", &[&keys[..], more].concat())
    };
    let chosen = keys(&[]);
    assert!(chosen.time.max_halvings > TimeSpec::DEFAULT_MAX_HALVINGS, "{}", chosen.time.max_halvings);
    let (flight, _) = fly(&chosen);
    assert_eq!((flight.audit.status, flight.overlong_steps), (Status::Clear, 0));
    // With 10 halvings the shortest part of a step is too long for the law.
    let given = keys(&["time.max_halvings=10"]);
    assert_eq!(given.time.max_halvings, 10);
    assert!(fly(&given).0.overlong_steps > 0);
    // A field of small gain needs the default halvings only.
    assert_eq!(builtin("pentagon", &["law.kind=potential"]).time.max_halvings, TimeSpec::DEFAULT_MAX_HALVINGS);
}
