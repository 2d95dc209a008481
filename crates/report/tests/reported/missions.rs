//! References, leaders, legs and deadlock recoveries under the displacement law.
//!
//! 20 random missions of three legs in continuous time; `TAUTLINE_RANDOM_MISSIONS=1000 cargo test --release --test
//! reported missions -- --nocapture` flies 1,000 and prints the numbers of docs/validation.md.

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_core::record::Event;
use tautline_core::swarm::{Swarm, row, set_row};
use tautline_laws::formation::Formation;
use tautline_laws::graph::{Graph, Pinning};
use tautline_laws::law::{DisplacementKeys, LawSpec, VoidReason};
use tautline_laws::target::{DeadlockMode, Guidance, Leg, LegTrigger, ReferenceMotion};
use tautline_report::report::Reason;
use tautline_report::run::run;
use tautline_sim::scenario::{PlantSpec, Scenario};
use tautline_sim::sim::Simulation;

use crate::flight::{builtin, fly, read};
use crate::numbers::Numbers;
use crate::random_scenarios::places;

/// Returns a random mission of three legs, with a random graph and reference, from positions at least 1.1 delta apart.
fn mission(seed: u64) -> Scenario {
    let mut numbers = Numbers(seed.wrapping_mul(0xa076_1d64_78bd_642f));
    let sixth = 6.0 * numbers.unit();
    let count = 3 + (1..6).filter(|&n| f64::from(n) <= sixth).count();
    let in_space = numbers.unit() < 0.5;
    let delta_m = numbers.over_decades(0.1, 10.0);
    let extent_m = delta_m * numbers.between(2.0, 5.0);
    let start = places(&mut numbers, count, if in_space { 3 } else { 2 }, extent_m, 1.1 * delta_m);
    let mut legs = Vec::new();
    for number in 0..3 {
        let radius_m = delta_m * numbers.between(1.2, 2.0) / (std::f64::consts::PI / count as f64).sin();
        let formation = match (3.0 * numbers.unit(), in_space) {
            (..1.0, true) => Formation::sphere(count, 1.5 * radius_m),
            (..2.0, _) => Formation::grid(count, delta_m * numbers.between(1.2, 2.5)),
            _ => Formation::circle(count, radius_m),
        };
        let moved_m = Vector3::new(numbers.between(-1.0, 1.0), numbers.between(-1.0, 1.0), 0.0) * extent_m;
        let leg = Leg { begins: LegTrigger::At(2.0 * f64::from(number)), ..Leg::first(formation) };
        legs.push(leg.placed(numbers.between(1.0, 1.5), numbers.between(-3.0, 3.0), moved_m));
    }
    let mut scenario = Scenario::new("mission", Swarm::at_rest(start), legs[0].formation.clone(), delta_m, 6.0);
    scenario.graph = match 4.0 * numbers.unit() {
        ..1.0 => Graph::complete(count),
        ..2.0 => Graph::star(count),
        ..3.0 => Graph::ring(count),
        _ => Graph::path(count),
    };
    scenario.law = LawSpec::Displacement(DisplacementKeys { alpha: delta_m * delta_m, ..DisplacementKeys::default() });
    scenario.a22_per_s = numbers.between(-0.5, 0.2);
    scenario.plant = PlantSpec::Ideal;
    scenario.deadlock.mode = DeadlockMode::Off;
    scenario.hull_radius_m.fill(0.2 * delta_m);
    scenario.hull_radius_m.iter_mut().for_each(|radius_m| *radius_m = radius_m.min(0.5 * delta_m - 0.011).max(1e-3));
    scenario.legs = legs;
    guide(&mut scenario, &mut numbers, extent_m);
    scenario
}

/// Adds a reference to half of the missions: known to all vehicles, known to one, or flown by a leader.
fn guide(scenario: &mut Scenario, numbers: &mut Numbers, extent_m: f64) {
    let known_by = match 6.0 * numbers.unit() {
        ..1.0 => Pinning::All,
        ..2.0 => Pinning::Listed(vec![1]),
        ..3.0 => Pinning::Leader(0),
        _ => return,
    };
    let motion = match 3.0 * numbers.unit() {
        ..1.0 => ReferenceMotion::Rest { position_m: Vector3::zeros() },
        ..2.0 => ReferenceMotion::Velocity {
            from_m: Vector3::zeros(),
            velocity_m_s: Vector3::new(numbers.between(-0.3, 0.3), numbers.between(-0.3, 0.3), 0.0) * extent_m,
        },
        _ => ReferenceMotion::Circle {
            centre_m: Vector3::zeros(),
            radius_m: 0.5 * extent_m,
            period_s: numbers.between(5.0, 20.0),
        },
    };
    if known_by.leader().is_some() {
        let begins = motion.at(0.0);
        set_row(&mut scenario.start.velocities_m_s, 0, begins.velocity_m_s);
        let place_m = row(&scenario.start.positions_m, 0) - begins.position_m;
        for leg in &mut scenario.legs {
            let moved_m = place_m - row(&leg.formation.slots_m, 0);
            *leg = leg.clone().placed(1.0, 0.0, moved_m);
        }
    }
    scenario.reference = Some(Guidance { motion, known_by, feed_forward: true });
}

#[test]
fn random_missions_keep_their_certificates() {
    let missions = std::env::var("TAUTLINE_RANDOM_MISSIONS").map_or(20, |n| n.parse().expect("a number"));
    let (mut tightest, mut worst_rise) = (f64::INFINITY, 0.0_f64);
    for seed in 0..missions {
        let scenario = mission(seed);
        scenario.validate().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let (flight, log) = fly(&scenario);
        assert_eq!(flight.ending, tautline_sim::sim::Ending::Completed, "seed {seed}");
        let [first, second, third] = flight.certificate.legs[..] else { panic!("seed {seed}") };
        let certified_m = flight.certificate.certified_m.expect("a promise");
        assert_eq!(Some(certified_m), third.certified_m, "seed {seed}");
        let closest_m = flight.audit.closest.expect("a pair").separation_m;
        assert!(closest_m >= certified_m, "seed {seed}: {closest_m} {certified_m}");
        tightest = tightest.min((closest_m - certified_m) / scenario.delta_m);
        let began = |leg: usize| {
            let begins = |event: &Event| matches!(event, Event::LegBegan { leg: of, .. } if *of == leg);
            log.events.iter().find(|event| begins(event)).map_or(f64::NAN, Event::time_s)
        };
        assert_eq!([began(1), began(2)], [2.0, 4.0], "seed {seed}");
        for sample in &log.samples {
            let bound = [first, second, third][[2.0, 4.0].iter().filter(|&&from_s| sample.time_s >= from_s).count()];
            let energy = sample.energy.expect("an energy");
            assert!(energy <= bound.energy * (1.0 + 1e-9), "seed {seed} at {} s: {energy} {bound:?}", sample.time_s);
        }
        let rise = flight.energy_rise.expect("an energy");
        worst_rise = worst_rise.max((rise.to - rise.from) / rise.from.max(1e-9 * third.energy));
    }
    println!(
        "{missions} missions: least room above the certificate {tightest:.3e} delta, largest rise {worst_rise:.1e}"
    );
    assert!(worst_rise < 1e-6, "{worst_rise}");
}

/// Three legs with assigned slots behind way points in Rapier, the last from a given time on. Each leg is reached, and
/// the certificates hold.
#[test]
fn mission_reaches_every_leg_and_reports_each() {
    let scenario = read(MISSION);
    let report = run(&scenario, &mut ()).expect("a report");
    assert!(report.verdict.pass, "{:?}", report.verdict.reasons);
    assert_eq!(report.legs.len(), 3);
    let reached_s: Vec<_> = report.legs.iter().map(|leg| leg.reached_at_s.expect("reached")).collect();
    assert!(reached_s.is_sorted() && report.legs[2].from_s == Some(40.0));
    let certified_m: Vec<_> = report.legs.iter().map(|leg| leg.certified_m.expect("a promise")).collect();
    assert!(certified_m.windows(2).all(|pair| pair[1] <= pair[0]));
    assert!(report.min_separation_m() > report.certificate.separation_m);
    assert!(report.headline().contains("3 of 3 legs reached"), "{}", report.headline());

    // Counter-example: no time for the second leg.
    let hurried = read(&MISSION.replace("start_s = 40.0", "start_s = 20.5"));
    let report = run(&hurried, &mut ()).expect("a report");
    assert!(!report.verdict.pass);
    assert!(report.verdict.reasons.iter().any(|why| matches!(why, Reason::LegNotReached { leg: 2, .. })));
}

const MISSION: &str = r#"
swarm = { count = 6, a22_per_s = 0.05 }
start = { shape = "line", spacing_m = 2.5 }
formation = { shape = "circle", radius_m = 4.0 }
law = { kind = "displacement", delta_m = 1.5 }
graph = { kind = "star" }
reference = { kind = "way-points", points_m = [[0, 0], [6, 0], [6, 4]], speed_m_s = 1.0 }
time = { duration_s = 60.0 }
[[leg]]
shape = "grid"
spacing_m = 2.5
assignment = "optimal"
[[leg]]
start_s = 40.0
scale = 1.5
yaw_deg = 45.0
move_m = [3, 0]
"#;

/// A leader turns in a circle. Without feed-forward of its acceleration each follower lags by `(k sigma M)^-1 1 (a0 -
/// a22 r')`, here exactly by `
/// r''
/// /k` on a star with a22 = 0.
#[test]
fn followers_lag_without_feed_forward_of_the_leaders_acceleration() {
    let flown = |fed: bool| {
        let sets = [
            "law.kind=displacement",
            "swarm.a22_per_s=0",
            "graph.kind=star",
            &format!("reference={{kind=\"velocity\", velocity_m_s=[0.5, 0], leader=1, feed_forward={fed}}}"),
            "time.duration_s=40",
            // A lag is not a jam.
            "deadlock.mode=off",
        ];
        let mut scenario = builtin("pentagon", &sets);
        // Nearly constant acceleration: the start of a very large circle.
        let Some(guidance) = &mut scenario.reference else { panic!("a reference") };
        guidance.motion =
            ReferenceMotion::Circle { centre_m: Vector3::zeros(), radius_m: 1e4, period_s: RADIUS_PERIOD_S };
        let begins = guidance.motion.at(0.0);
        (0..5).for_each(|i| set_row(&mut scenario.start.velocities_m_s, i, begins.velocity_m_s));
        scenario.start.positions_m.copy_from(&scenario.legs[0].formation.slots_m);
        let moved_m = -begins.position_m;
        scenario.legs[0] = scenario.legs[0].clone().placed(1.0, 0.0, moved_m);
        scenario.plant = PlantSpec::Rapier;
        scenario.validate().unwrap_or_else(|error| panic!("{error}"));
        let (flight, _) = fly(&scenario);
        let slots_m = &scenario.formation().slots_m;
        let offset_m = row(&flight.last.positions_m, 0) - row(slots_m, 0);
        let off_m = |i: usize| (row(&flight.last.positions_m, i) - row(slots_m, i) - offset_m).norm();
        let lags: Vec<f64> = (1..5).map(off_m).collect();
        (lags, flight.certificate)
    };
    let (exact, certificate) = flown(true);
    assert!(exact.iter().all(|&lag_m| lag_m < 1e-3), "{exact:?}");
    assert!(certificate.certified_m.is_some());
    let (late, certificate) = flown(false);
    assert!(certificate.void.contains(&VoidReason::NoFeedForward));
    let rate_per_s = std::f64::consts::TAU / RADIUS_PERIOD_S;
    let expected_m = 1e4 * rate_per_s * rate_per_s;
    assert!(late.iter().all(|lag_m| (lag_m - expected_m).abs() < 0.01 * expected_m), "{late:?} {expected_m}");
}

/// |r''| = 0.1 m/s^2 at a radius of 10 km.
const RADIUS_PERIOD_S: f64 = 1_986.917_653;

#[test]
fn reference_removes_the_drift_of_feed_forward() {
    let sets = [
        "law.kind=displacement",
        "swarm.a22_per_s=0.2",
        "start.velocities_m_s=[[1, 0], [1, 0], [1, 0], [1, 0], [1, 0]]",
        "time.duration_s=30",
    ];
    let drifts = run(&builtin("pentagon", &sets), &mut ()).expect("a report");
    assert!(drifts.velocity.common_m_s > Some(100.0), "{:?}", drifts.velocity);
    let known = [&sets[..], &["reference={kind=\"rest\"}"]].concat();
    let held = run(&builtin("pentagon", &known), &mut ()).expect("a report");
    assert!(held.verdict.pass && held.velocity.common_m_s < Some(1e-3), "{:?}", held.verdict);
}

/// 16 random vehicles block each other on their way to assigned slots in a grid.
#[test]
fn a_stalled_swarm_arrives_only_with_deadlock_recovery() {
    let stuck = |mode: &str| read(&CROWD.replace("MODE", mode));
    let held = run(&stuck("off"), &mut ()).expect("a report");
    assert!(!held.formation.reached && held.answer.status == Status::Clear, "{}", held.headline());
    let report = run(&stuck("auto"), &mut ()).expect("a report");
    assert!(report.verdict.pass, "{:?}", report.verdict.reasons);
    assert!(
        !report.deadlock_recoveries.is_empty() && report.headline().contains("deadlock recover"),
        "{}",
        report.headline()
    );
    assert!(report.min_separation_m() > report.certificate.separation_m);
    let first = &report.deadlock_recoveries[0];
    assert!(
        first.scale == 2.0 && report.certificate.separation_m <= first.certified_m,
        "{:?}",
        report.deadlock_recoveries
    );
}

/// Slots are spread from the start on a weakly damped star. The certificate includes this spreading.
#[test]
fn the_certificate_includes_slots_spread_from_the_start() {
    let weak = WEAK_STAR.replace("MODE", "start");
    let scenario = read(&weak);
    let promised_m = tautline_sim::preflight::Preflight::of(&scenario).expect("a law").certified_m.expect("a promise");
    let report = run(&scenario, &mut ()).expect("a report");
    let closest_m = report.min_separation_m().expect("a pair");
    assert!(promised_m <= closest_m && closest_m < 1.1, "{promised_m} {closest_m}");
    // Negative twin: the certificate without spreading is larger than the separation.
    let still = read(&WEAK_STAR.replace("MODE", "off"));
    let promised_m = tautline_sim::preflight::Preflight::of(&still).expect("a law").certified_m.expect("a promise");
    assert!(promised_m > closest_m, "{promised_m} {closest_m}");
}

/// A leader stays at rest while slots are spread about it, and the energy keeps its bound.
#[test]
fn slots_spread_about_a_leader_leave_it_at_rest() {
    let led = WEAK_STAR.replace("MODE", "start") + "reference = { kind = \"rest\", leader = 1 }\n";
    let scenario = read(&led);
    let (flight, log) = fly(&scenario);
    let moved_m = |sample: &tautline_core::record::OwnedSample| {
        (row(&sample.swarm.positions_m, 0) - row(&scenario.start.positions_m, 0)).norm()
    };
    assert!(log.samples.iter().all(|sample| moved_m(sample) < 1e-9));
    let rise = flight.energy_rise.expect("an energy");
    assert!(rise.to <= rise.from * (1.0 + 1e-3) && !flight.deadlock_recoveries.is_empty(), "{rise:?}");
}

const WEAK_STAR: &str = r#"
swarm = { count = 5 }
start = { positions_m = [[0, 0], [2, 0], [0, 2], [-2, 0], [0, -2]] }
formation = { shape = "points", points_m = [[0, 0], [2, 0], [0, 2], [-2, 0], [0, -2]] }
law = { kind = "displacement", delta_m = 1.0, zeta_per_s = 0.1 }
graph = { kind = "star" }
deadlock = { mode = "MODE", scale = 4.0 }
time = { duration_s = 60.0 }
"#;

/// The renewed certificate of a stalled swarm holds for the current leg and the following ones.
#[test]
fn spreading_slots_renews_the_certificates_of_legs() {
    let text = CROWD.replace("MODE", "auto") + "[[leg]]\nscale = 1.2\n";
    let report = run(&read(&text), &mut ()).expect("a report");
    let recovery = report.deadlock_recoveries.first().expect("a deadlock recovery");
    assert_eq!(report.legs[1].certified_m, recovery.certified_m);
    assert!(report.legs[0].certified_m >= report.legs[1].certified_m, "{:?}", report.legs);
    assert!(report.legs[1].certified_m <= report.certificate.separation_m, "{:?}", report.legs);
    assert!(report.min_separation_m() > report.certificate.separation_m);
}

/// Blocked interchangeable vehicles exchange slots and keep them on the next leg; no slots are spread.
#[test]
fn stalled_interchangeable_vehicles_are_reassigned_and_spread_no_slots() {
    let anew = "assignment = \"when-stalled\"";
    let text = CROWD.replace("MODE", "auto").replace("spacing_m = 1.4", &format!("spacing_m = 1.4, {anew}"))
        + &format!("[[leg]]\nscale = 1.2\n{anew}\n");
    let scenario = read(&text);
    let report = run(&scenario, &mut ()).expect("a report");
    assert!(report.verdict.pass, "{:?}", report.verdict.reasons);
    let [assignment] = report.assignments[..] else {
        panic!("{:?} {:?}", report.assignments, report.deadlock_recoveries)
    };
    assert!(report.deadlock_recoveries.is_empty() && assignment.vehicles > 1, "{}", report.headline());
    assert!(report.headline().contains("2 of 2 legs reached; 1 new assignment"), "{}", report.headline());
    assert!(report.legs[0].certified_m >= report.legs[1].certified_m, "{:?}", report.legs);
    assert_eq!(
        (report.legs[1].certified_m, report.certificate.separation_m),
        (assignment.certified_m, assignment.certified_m)
    );
    assert!(report.min_separation_m() > report.certificate.separation_m);
    let promised_m = tautline_sim::preflight::Preflight::of(&scenario).expect("a law").certified_m;
    assert!(assignment.certified_m <= promised_m, "{assignment:?} {promised_m:?}");

    // The resolved scenario reads back as the same scenario.
    assert_eq!(read(&scenario.resolved().toml), scenario);

    // A simulation that was saved earlier continues to the same bits.
    let mut simulation = Simulation::new(&scenario).expect("a flight");
    while simulation.time_s() < assignment.time_s - 0.5 {
        simulation.step();
    }
    let saved = simulation.save();
    let go_on = |simulation: &mut Simulation| {
        while simulation.time_s() < assignment.time_s + 3.0 {
            simulation.step();
        }
        let changed: Vec<_> = simulation.events().filter(|event| matches!(event, Event::Assigned { .. })).collect();
        (changed, simulation.state().clone())
    };
    let first = go_on(&mut simulation);
    assert_eq!(first.0.len(), 1);
    simulation.load(&saved, None);
    assert_eq!(go_on(&mut simulation), first);
}

#[test]
fn rejects_invalid_references_and_legs() {
    let code_of = |text: String| {
        let source = tautline_sim::scenario::Source::Text { name: "test".to_owned(), text };
        tautline_sim::scenario::Scenario::read(&source, &[]).map_or_else(|error| error.code(), |_| "")
    };
    let refused = |reference: &str| {
        let text = MISSION.lines().filter(|line| !line.starts_with("reference")).collect::<Vec<_>>().join("\n");
        code_of(format!("reference = {{ {reference} }}\n{text}"))
    };
    for (reference, code) in [
        ("kind = \"rest\", leader = 9", "scenario/unknown-vehicle"),
        ("kind = \"rest\", leader = 0", "scenario/unknown-vehicle"),
        ("kind = \"rest\", known_by = []", "scenario/inconsistent"),
        ("kind = \"rest\", leader = 1, known_by = \"all\"", "scenario/exclusive-keys"),
        ("kind = \"circle\", radius_m = 3, period_s = 0.01", "scenario/step-too-long"),
        ("kind = \"way-points\", points_m = [[0, 0], [1, 0]], times_s = [0, 0.001]", "scenario/step-too-long"),
        ("kind = \"way-points\", points_m = [[0, 0], [1, 0]]", "scenario/missing-key"),
        ("kind = \"spline\", points_m = [[0, 0], [1, 0]], times_s = [0, 0]", "scenario/reference"),
        ("kind = \"spline\", points_m = [[0, 0], [1, 0]], times_s = [0, 10]", "scenario/outside-flight"),
        (
            "kind = \"spline\", points_m = [[0, 0], [0, 0.1], [9, 0], [9, 0.1]], times_s = [0, 20, 40, 60]",
            "scenario/reference",
        ),
        ("kind = \"way-points\", points_m = [[0, 0], [0, 0], [3, 0]], speed_m_s = 1.0", ""),
    ] {
        assert_eq!(refused(reference), code, "{reference}");
    }
    let short = "shape = \"points\"\npoints_m = [[0, 0], [3, 0]]\n";
    for (from, to, code) in [
        ("start_s = 40.0", "start_s = 70.0", "scenario/outside-flight"),
        ("spacing_m = 2.5\nassign", "spacing_m = 1.0\nassign", "scenario/within-delta"),
        ("kind = \"displacement\"", "kind = \"edge-tension\"", "scenario/unsupported-by-law"),
        ("shape = \"grid\"\nspacing_m = 2.5\n", short, "scenario/count-mismatch"),
    ] {
        assert!(MISSION.contains(from), "{from}");
        assert_eq!(code_of(MISSION.replace(from, to)), code, "{to}");
    }
}

const CROWD: &str = r#"
swarm = { count = 16 }
start = { shape = "random", half_extent_m = 3.8, min_separation_m = 1.15, seed = 5 }
formation = { shape = "grid", spacing_m = 1.4 }
law = { kind = "displacement", delta_m = 1.0 }
deadlock = { mode = "MODE" }
time = { duration_s = 60.0, dt_s = 0.01 }
"#;
