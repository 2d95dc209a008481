//! Imperfect sensors, radio and actuators in flight, against theory.

use crate::flight::{Log, builtin, fly, read};
use tautline_audit::Status;
use tautline_core::record::OwnedSample;
use tautline_core::swarm::{Pair, Rows, Swarm, row};
use tautline_laws::formation::Formation;
use tautline_laws::law::{LawError, Linear, VoidReason};
use tautline_sim::scenario::{Failure, FailureKind, Override, Scenario, Source};
use tautline_sim::sim::{Ending, Simulation};

/// Every imperfection that Rapier supports, at once.
const ALL: [&str; 16] = [
    "time.duration_s=4",
    "sensing.position_noise_m=0.01",
    "sensing.position_bias_m=0.02",
    "sensing.velocity_noise_m_s=0.01",
    "sensing.rate_hz=100",
    "sensing.latency_s=0.01",
    "network.latency_s=0.02",
    "network.jitter_s=0.02",
    "network.loss=0.1",
    "network.loss_burst=3",
    "network.rate_hz=50",
    "network.missing=extrapolate",
    "time.control_hz=60",
    "actuation.max_accel_m_s2=2",
    "actuation.lag_s=0.05",
    "law.kind=displacement",
];

fn states(log: &Log) -> Vec<&Swarm> {
    log.samples.iter().map(|sample| &sample.swarm).collect()
}

#[test]
fn a_saved_and_loaded_flight_with_every_imperfection_has_the_same_bits() {
    let scenario = builtin("pentagon", &ALL);
    let mut straight = Simulation::new(&scenario).expect("a simulation");
    let mut resumed = Simulation::new(&scenario).expect("a simulation");
    for step in 0..600 {
        straight.step();
        if step == 301 {
            let saved = straight.save();
            resumed.load(&saved, None);
        } else if step > 301 {
            resumed.step();
        }
    }
    assert_eq!(straight.state(), resumed.state());
    let mut reseeded = Simulation::new(&scenario).expect("a simulation");
    reseeded.load(&straight.save(), Some(9));
    (0..60).for_each(|_| {
        straight.step();
        reseeded.step();
    });
    assert_ne!(straight.state(), reseeded.state(), "random numbers differ from there on");
}

#[test]
fn a_scenario_with_every_imperfection_is_written_and_read_back() {
    let more = [
        "sensing.near_latency_s=0.005",
        "network.near=received",
        "network.failure=[{link=[1, 3], from_s=1, to_s=2.5}, {link=[4, 2], from_s=3}]",
        "failure=[{vehicle=2, at_s=1, kind=\"dead\"}, {vehicle=5, at_s=2, kind=\"silent\"}, {vehicle=1, at_s=3, \
         kind=\"frozen\"}]",
        "noise.seed=7",
        // Separations are smaller than the position errors allow.
        "law.delta_m=1",
    ];
    let sets: Vec<_> = ALL.into_iter().chain(more).collect();
    let scenario = builtin("pentagon", &sets);
    let again = read(&scenario.resolved().toml);
    assert_eq!(scenario, again);
    assert_eq!((again.network.failure.len(), again.failures.len(), again.time.control_hz), (2, 3, Some(60.0)));
    let (flight, log) = fly(&scenario);
    assert!(flight.steps > 900, "{:?}", flight.ending);
    let ages =
        log.samples.last().expect("samples").channels.iter().find(|channel| channel.name.as_ref() == "message_age");
    let ages = &ages.expect("ages of messages").values;
    // Oldest and mean age of each vehicle: vehicle 5 has been silent for 2 s.
    assert_eq!(ages.len(), 10);
    assert!(ages.chunks(2).all(|age| age[0] >= age[1] && age[1] > 0.0), "{ages:?}");
    assert!(ages[0] > 1.9 && ages[8] < 1.0 && flight.traffic.is_some_and(|traffic| traffic.lost > 0), "{ages:?}");
}

#[test]
fn the_seed_changes_only_the_noise_and_threads_change_no_bits() {
    let flown = |sets: &[&str], threads: usize| {
        let sets: Vec<_> = ALL.into_iter().chain(sets.iter().copied()).collect();
        let scenario = builtin("pentagon", &sets);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| fly(&scenario).1)
    };
    let (one, four) = (flown(&[], 1), flown(&[], 4));
    assert_eq!(states(&one), states(&four));
    assert_ne!(states(&one), states(&flown(&["noise.seed=1"], 1)));
}

#[test]
fn certificates_are_void_with_a_reason() {
    for (set, reason) in [
        ("sensing.latency_s=0.01", VoidReason::SensingDelayed),
        ("sensing.near_latency_s=0.01", VoidReason::SensingDelayed),
        ("sensing.rate_hz=100", VoidReason::SensingDelayed),
        ("sensing.position_bias_m=0.01", VoidReason::SensingInexact),
        ("network.latency_s=0.01", VoidReason::MessagesDelayed),
        ("network.rate_hz=50", VoidReason::MessagesDelayed),
        ("actuation.max_accel_m_s2=1", VoidReason::AccelerationLimited),
        ("actuation.lag_s=0.01", VoidReason::AccelerationLagged),
        ("time.control_hz=60", VoidReason::CommandsHeld),
        ("failure=[{vehicle=1, at_s=0.5, kind=\"dead\"}]", VoidReason::VehicleFails),
    ] {
        let (flight, _) = fly(&builtin("pentagon", &["time.duration_s=1", set]));
        assert_eq!((flight.certificate.certified_m, flight.certificate.void), (None, vec![reason]), "{set}");
    }
    let silent = ["time.duration_s=1", "network.rate_hz=50", "failure=[{vehicle=1, at_s=0.5, kind=\"silent\"}]"];
    let (flight, _) = fly(&builtin("pentagon", &silent));
    assert_eq!(flight.certificate.void, [VoidReason::MessagesDelayed, VoidReason::MessagesLost]);
    assert!(fly(&builtin("pentagon", &["time.duration_s=1"])).0.certificate.certified_m.is_some());
}

/// Returns two vehicles at their slots under the displacement law; the second drifts away at 1 m/s.
fn drifting(sets: &str) -> Scenario {
    read(&format!(
        "name = \"drift\"\nstart = {{ positions_m = [[0, 0], [5, 0]], velocities_m_s = [[0, 0], [1, 0]] }}\n\
         formation = {{ shape = \"points\", points_m = [[0, 0], [5, 0]] }}\n\
         law = {{ kind = \"displacement\", delta_m = 1.0 }}\n{sets}"
    ))
}

#[test]
fn accelerations_keep_the_limit_and_are_recorded_as_flown() {
    let free = fly(&builtin("pentagon", &["time.duration_s=4", "time.record_hz=240"])).1;
    let limited =
        fly(&builtin("pentagon", &["time.duration_s=4", "time.record_hz=240", "actuation.max_accel_m_s2=0.3"])).1;
    let peak = |log: &Log| {
        let of = |sample: &OwnedSample| (0..5).map(|i| row(&sample.control, i).norm()).fold(0.0, f64::max);
        log.samples.iter().map(of).fold(0.0, f64::max)
    };
    assert!(peak(&free) > 0.5 && (peak(&limited) - 0.3).abs() < 1e-12, "{} {}", peak(&free), peak(&limited));
}

#[test]
fn a_lagging_vehicle_flies_the_solution_of_its_equations() {
    const PARTS: u32 = 100_000;
    // x'' = a, lag a' = -(k x + c x') - a for the distance of two vehicles with k = c = 1, by small steps of Heun's
    // method.
    let lag_s = 0.2;
    let (mut x, mut v, mut a) = (0.0_f64, 1.0_f64, 0.0_f64);
    let rates = |x: f64, v: f64, a: f64| (v, a, (-(x + v) - a) / lag_s);
    let h = 3.0 / f64::from(PARTS);
    for _ in 0..PARTS {
        let (x1, v1, a1) = rates(x, v, a);
        let (x2, v2, a2) = rates(x + h * x1, v + h * v1, a + h * a1);
        (x, v, a) = (x + 0.5 * h * (x1 + x2), v + 0.5 * h * (v1 + v2), a + 0.5 * h * (a1 + a2));
    }
    let off = |dt_s: f64| {
        let sets = format!("time = {{ duration_s = 3.0, dt_s = {dt_s} }}\nactuation = {{ lag_s = {lag_s} }}");
        let last = fly(&drifting(&sets)).0.last;
        (last.positions_m[(1, 0)] - last.positions_m[(0, 0)] - 5.0 - x).abs()
    };
    let (coarse, fine) = (off(0.02), off(0.01));
    assert!(fine < 2e-5, "{fine}");
    let order = (coarse / fine).log2();
    assert!((1.7..2.3).contains(&order), "second order in the step: {order} ({coarse} {fine})");
    // Without the lag the motion is different.
    let sets = "time = { duration_s = 3.0, dt_s = 0.01 }";
    let last = fly(&drifting(sets)).0.last;
    assert!((last.positions_m[(1, 0)] - last.positions_m[(0, 0)] - 5.0 - x).abs() > 0.05);
}

#[test]
fn a_dead_vehicle_drifts_and_a_frozen_one_keeps_accelerating() {
    let sets = "time = { duration_s = 2.0, record_hz = 240.0 }";
    for kind in [FailureKind::Dead {}, FailureKind::Frozen {}] {
        let mut scenario = drifting(sets);
        scenario.failures = vec![Failure { vehicle: 2, at_s: 1.0, kind }];
        let (_, log) = fly(&scenario);
        let at = |k: usize| row(&log.samples[k].control, 1);
        let after: Vec<_> = (241..=480).map(at).collect();
        let expected = if kind == (FailureKind::Dead {}) { nalgebra::Vector3::zeros() } else { at(240) };
        assert!(after.iter().all(|command| *command == expected), "{kind:?}");
        assert!(at(239).norm() > 0.01 && row(&log.samples[480].control, 0).norm() > 0.0);
    }
}

// Delay

/// Returns vehicles 1 mm off their slots in different directions, under the displacement law with negligible tension.
fn disturbed(graph: &str, sets: &str) -> Scenario {
    let slots = Formation::pentagon(3.0).slots_m;
    let off = |i: usize, axis: usize| 1e-3 * libm::sin(f64::from(u32::try_from(4 * i + 7 * axis).unwrap_or(0)));
    let list =
        |rows: &Rows| (0..5).map(|i| format!("[{}, {}]", rows[(i, 0)], rows[(i, 1)])).collect::<Vec<_>>().join(", ");
    let start = Rows::from_fn(5, |i, axis| slots[(i, axis)] + if axis < 2 { off(i, axis) } else { 0.0 });
    read(&format!(
        "name = \"late\"\nstart = {{ positions_m = [{}] }}\nformation = {{ shape = \"points\", points_m = [{}] }}\n\
         law = {{ kind = \"displacement\", delta_m = 2.0, alpha = 1e-8 }}\ngraph = {{ kind = \"{graph}\" }}\n\
         plant = {{ kind = \"ideal\" }}\ndeadlock = {{ mode = \"off\" }}\n{sets}",
        list(&start),
        list(&slots)
    ))
}

/// Returns the root mean square error of the relative positions over a time interval \[m\].
fn error_m(log: &Log, slots_m: &Rows, from_s: f64, to_s: f64) -> f64 {
    let within = log.samples.iter().filter(|sample| (from_s..to_s).contains(&sample.time_s));
    let (mut sum, mut number) = (0.0, 0.0);
    for sample in within {
        let errors_m = &sample.swarm.positions_m - slots_m;
        let mean = errors_m.row_mean();
        sum += (0..5).map(|i| (errors_m.row(i) - mean).norm_squared()).sum::<f64>();
        number += 1.0;
    }
    (sum / number).sqrt()
}

/// Returns whether the disturbance grows from the middle to the end, or ends the flight.
fn grows(scenario: &Scenario) -> bool {
    let (flight, log) = fly(scenario);
    if flight.ending != Ending::Completed {
        return true;
    }
    let end_s = scenario.time.duration_s;
    let slots_m = &scenario.formation().slots_m;
    error_m(&log, slots_m, 0.75 * end_s, end_s) > error_m(&log, slots_m, 0.25 * end_s, 0.5 * end_s)
}

const LOOK: &str = "time = { duration_s = 30.0, dt_s = 0.25, record_hz = 4.0, max_halvings = 10 }";

/// Returns the modes of the law at the slots.
fn linear(scenario: &Scenario) -> Linear {
    scenario.law().expect("a law").linear(scenario.formation()).expect("modes")
}

// `tautline validate` repeats these by bisection for the complete graph, the star and the ring.

#[test]
fn the_delay_margin_matches_the_formula() {
    let plain = disturbed("ring", LOOK);
    let margin_s = linear(&plain).delay_margin_s(0.0);
    for (share, expected) in [(0.95, false), (1.05, true)] {
        let mut late = plain.clone();
        late.sensing.latency_s = share * margin_s;
        assert_eq!(grows(&late), expected, "{share} of {margin_s} s");
    }
}

#[test]
fn the_margin_of_the_network_delay_matches_the_formula() {
    let plain = disturbed("star", LOOK);
    let margin_s = linear(&plain).received.and_then(|received| received.delay_margin_s(0.0)).expect("a margin");
    for (share, expected) in [(0.95, false), (1.05, true)] {
        let mut late = plain.clone();
        (late.time.duration_s, late.network.latency_s) = (20.0 * margin_s, share * margin_s);
        // A delay couples the common motion to earlier positions, so common motion must be present.
        late.start.velocities_m_s.fill(1e-3);
        late.start.velocities_m_s.column_mut(2).fill(0.0);
        assert_eq!(moves(&late), expected, "{share} of {margin_s} s");
    }
}

/// Returns whether the swarm, with its mean, moves more at the end than in the middle.
fn moves(scenario: &Scenario) -> bool {
    let (_, log) = fly(scenario);
    let end_s = scenario.time.duration_s;
    let speed = |from_s: f64, to_s: f64| {
        let within = log.samples.iter().filter(|sample| (from_s..to_s).contains(&sample.time_s));
        within.map(|sample| sample.swarm.velocities_m_s.norm()).fold(0.0, f64::max)
    };
    speed(0.75 * end_s, end_s) > speed(0.25 * end_s, 0.5 * end_s)
}

#[test]
fn the_margin_of_the_control_period_matches_the_formula() {
    for graph in ["complete", "ring"] {
        let plain = disturbed(graph, LOOK);
        let margin_s = linear(&plain).sampling_margin_s(0.0);
        for (share, expected) in [(0.98, false), (1.02, true)] {
            let mut held = plain.clone();
            (held.time.dt_s, held.time.record_hz) = (share * margin_s, 1.0 / (share * margin_s));
            held.time.control_hz = Some(held.time.record_hz);
            held.time.duration_s = 60.0 * held.time.dt_s;
            assert_eq!(grows(&held), expected, "{graph}: {share} of {margin_s} s");
        }
    }
}

/// Two vehicles fly one behind the other, 2.5 m apart, with a network latency of 0.1 s.
#[test]
fn a_law_undefined_by_received_states_reports_the_true_distance() {
    let flight = |latency_s: f64| {
        let scenario = read(&format!(
            "start = {{ positions_m = [[0, 0], [2.5, 0]], velocities_m_s = [[100, 0], [100, 0]] }}\n\
             formation = {{ shape = \"line\", spacing_m = 3.0 }}\nlaw.delta_m = 2.0\n\
             network.latency_s = {latency_s:?}\n\
             network.missing = \"hold\"\ntime.duration_s = 1.0"
        ));
        fly(&scenario).0
    };
    let late = flight(0.1);
    let Ending::LawUndefined(LawError::KnownCollision { pair, known_m, true_m, .. }) = late.ending else {
        panic!("{:?}", late.ending)
    };
    assert_eq!((pair, late.audit.status), (Pair::new(0, 1), Status::Clear));
    assert!(known_m <= 2.0 && true_m > 2.4, "{known_m} {true_m}");
    let closest_m = late.audit.closest.expect("a pair").separation_m;
    assert!(true_m >= closest_m && closest_m > 2.4, "{closest_m}");
    let reason = late.ending.reason().expect("it ended early");
    assert!(reason.contains("sense or receive a separation of") && reason.contains("true separation is 2."));
    assert_eq!(flight(0.0).ending, Ending::Completed);
}

#[test]
fn a_wrong_imperfection_is_refused_at_its_place() {
    let ideal = "plant.kind=ideal";
    let failure = |keys: &str| format!("failure=[{{{keys}}}]");
    let link = |keys: &str| format!("network.failure=[{{{keys}}}]");
    for (sets, code) in [
        (&["sensing.position_noise_m=-0.1"][..], "scenario/out-of-range"),
        (&["sensing.position_noise_m=nan"], "scenario/out-of-range"),
        (&["sensing.position_noise_m=0.1"], "scenario/missing-key"),
        (&["sensing.rate_hz=0"], "scenario/out-of-range"),
        (&["sensing.latency_s=200"], "scenario/outside-flight"),
        (&["sensing.latency_s=1e-9"], "scenario/out-of-range"),
        (&["sensing.rate_hz=100", ideal], "scenario/unsupported-by-plant"),
        (&["network.loss=1.5", "network.rate_hz=50"], "scenario/out-of-range"),
        (&["network.loss=-0.5", "network.rate_hz=50"], "scenario/out-of-range"),
        (&["network.loss=0.1"], "scenario/missing-key"),
        (&["network.jitter_s=0.1"], "scenario/missing-key"),
        (&["network.loss=0.8", "network.loss_burst=2", "network.rate_hz=50"], "scenario/inconsistent"),
        (&["network.latency_s=121"], "scenario/outside-flight"),
        (&["network.missing=guess"], "scenario/unknown-choice"),
        (&["network.rate_hz=50", &link("link=[1, 9], from_s=1")], "scenario/edge"),
        (&["network.rate_hz=50", &link("link=[1, 2], from_s=3, to_s=2")], "scenario/outside-flight"),
        (&["network.rate_hz=1e8"], "scenario/step-too-long"),
        (&["actuation.max_accel_m_s2=0"], "scenario/out-of-range"),
        (&["actuation.lag_s=0.1", ideal], "scenario/unsupported-by-plant"),
        (&[&failure("vehicle=6, at_s=1, kind=\"dead\"")], "scenario/unknown-vehicle"),
        (&[&failure("vehicle=1, at_s=500, kind=\"dead\"")], "scenario/outside-flight"),
        (&[&failure("vehicle=1, at_s=5, kind=\"silent\"")], "scenario/missing-key"),
        (&[&failure("vehicle=1, at_s=5, kind=\"frozen\""), ideal], "scenario/unsupported-by-plant"),
    ] {
        let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
        let error = Scenario::read(&Source::Builtin("pentagon".to_owned()), &overrides).expect_err(code);
        assert_eq!(error.code(), code, "{sets:?}: {error}");
        assert!(!error.help.is_empty(), "{sets:?}: {error}");
        assert!(error.place.as_ref().is_some_and(|place| place.source == "set"), "{sets:?}: {error}");
    }
}
