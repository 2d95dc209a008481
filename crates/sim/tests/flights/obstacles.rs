//! Flights among obstacles: certificates hold, the audit reports violations by laws that ignore obstacles, and hulls do
//! not pass.
//!
//! 12 random flights in continuous time; `TAUTLINE_RANDOM_OBSTACLES=500 cargo test --release --test flights obstacles
//! -- --nocapture` flies 500 and prints the numbers of docs/validation.md.

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_core::obstacle::{Obstacle, Shape};
use tautline_core::record::Event;
use tautline_core::swarm::{Rows, Swarm, separation};
use tautline_laws::formation::Formation;
use tautline_laws::graph::{Graph, Pinning};
use tautline_laws::law::{DisplacementKeys, LawSpec, VoidReason};
use tautline_laws::space::smallest_clearance_margin;
use tautline_laws::target::{DeadlockMode, Guidance, Leg, LegTrigger, ReferenceMotion};
use tautline_sim::plant;
use tautline_sim::scenario::{PlantSpec, Scenario, Source};
use tautline_sim::sim::{Ending, Flight, Simulation};

use crate::flight::{Log, builtin, fly, fly_with};
use crate::numbers::Numbers;

fn shape(numbers: &mut Numbers, delta_m: f64) -> Shape {
    let mut length = |least: f64, most: f64| delta_m * numbers.between(least, most);
    let (a, b, c, d) = (length(0.3, 2.0), length(0.3, 2.0), length(0.3, 2.0), length(-200.0, 200.0));
    match 3.0 * numbers.unit() {
        ..1.0 => Shape::Ball { radius_m: a },
        ..2.0 => Shape::Box { half_m: Vector3::new(a, b, c), yaw_deg: d / delta_m },
        _ => Shape::Capsule { from_m: Vector3::new(-a, b, -c), to_m: Vector3::new(a, -b, c), radius_m: 0.5 * b },
    }
}

/// Returns two legs among three obstacles, around a reference at rest, with starts and slots outside the clearances.
fn among(seed: u64) -> Scenario {
    let mut numbers = Numbers(seed.wrapping_mul(0xe703_7ed1_a0b4_28db) | 1);
    let sixth = 6.0 * numbers.unit();
    let count = 3 + (1..6).filter(|&n| f64::from(n) <= sixth).count();
    let delta_m = numbers.over_decades(0.1, 10.0);
    let extent_m = 5.0 * delta_m;
    let point = |numbers: &mut Numbers| Vector3::from_fn(|_, _| numbers.between(-extent_m, extent_m));
    let obstacles: Vec<_> = (0..3)
        .map(|k| Obstacle {
            name: format!("o{k}"),
            place_m: point(&mut numbers),
            shape: shape(&mut numbers, delta_m),
            clearance_m: delta_m * numbers.between(0.5, 1.0),
        })
        .collect();
    let mut places = |least: f64| {
        let mut rows = Rows::zeros(count);
        for i in 0..count {
            loop {
                let at = point(&mut numbers);
                (0..3).for_each(|axis| rows[(i, axis)] = at[axis]);
                let alone = Rows::from_row_slice(at.as_slice());
                let has_room = smallest_clearance_margin(&obstacles, &alone)
                    .is_some_and(|(clearance_margin_m, ..)| clearance_margin_m > 0.2 * delta_m);
                if has_room && (0..i).all(|j| separation(&rows, i, j) > least * delta_m) {
                    break;
                }
            }
        }
        rows
    };
    let start = Swarm::at_rest(places(1.1));
    let legs = [0.0, 4.0].map(|from_s| Leg {
        formation: Formation { slots_m: places(1.3) },
        begins: LegTrigger::At(from_s),
        interchangeable: false,
    });
    let mut scenario = Scenario::new("among", start, legs[0].formation.clone(), delta_m, 8.0);
    scenario.graph = match 3.0 * numbers.unit() {
        ..1.0 => Graph::complete(count),
        ..2.0 => Graph::star(count),
        _ => Graph::ring(count),
    };
    scenario.law = LawSpec::Displacement(DisplacementKeys { alpha: delta_m * delta_m, ..DisplacementKeys::default() });
    scenario.a22_per_s = numbers.between(-0.5, 0.2);
    scenario.plant = PlantSpec::Ideal;
    scenario.deadlock.mode = DeadlockMode::Off;
    scenario.hull_radius_m.fill((0.4 * delta_m).min(0.5 * delta_m - 0.021).max(1e-3));
    scenario.legs = legs.to_vec();
    let known_by = if numbers.unit() < 0.5 { Pinning::All } else { Pinning::Listed(vec![0]) };
    let motion = ReferenceMotion::Rest { position_m: Vector3::zeros() };
    scenario.reference = Some(Guidance { motion, known_by, feed_forward: true });
    scenario.obstacles = obstacles;
    scenario
}

#[test]
fn no_random_flight_among_obstacles_violates_its_certificate() {
    let flights = std::env::var("TAUTLINE_RANDOM_OBSTACLES").map_or(12, |n| n.parse().expect("a number"));
    let (mut tightest, mut near, mut worst_rise) = (f64::INFINITY, 0_u64, 0.0_f64);
    for seed in 0..flights {
        let scenario = among(seed);
        scenario.validate().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let (flight, _) = fly(&scenario);
        assert_eq!(flight.ending, Ending::Completed, "seed {seed}");
        let certificate = &flight.certificate;
        let (certified_m, certified_clearance_margin_m) =
            (certificate.certified_m.expect("a promise"), certificate.certified_clearance_margin_m.expect("a promise"));
        let closest_m = flight.audit.closest.expect("a pair").separation_m;
        let clearance = flight.clearance.expect("obstacles");
        let clearance_margin_m =
            clearance.closest.iter().map(|near| near.lower_m - near.limit_m).fold(f64::INFINITY, f64::min);
        assert!(closest_m >= certified_m, "seed {seed}: {closest_m} {certified_m}");
        assert!(
            clearance_margin_m >= certified_clearance_margin_m && certified_clearance_margin_m > 0.0,
            "seed {seed}: {clearance_margin_m} {certified_clearance_margin_m}"
        );
        assert_eq!((flight.audit.status, clearance.status), (Status::Clear, Status::Clear), "seed {seed}");
        assert_eq!(clearance.parry.disagreements, 0, "seed {seed}");
        tightest = tightest.min((clearance_margin_m - certified_clearance_margin_m) / scenario.delta_m);
        near += u64::from(clearance_margin_m < 0.1 * scenario.delta_m);
        let rise = flight.energy_rise.expect("an energy");
        worst_rise = worst_rise.max((rise.to - rise.from) / rise.from);
    }
    println!(
        "{flights} flights among obstacles, {near} of them nearer than 0.1 delta beyond a clearance: least room above \
         the \
         certificate {tightest:.3e} delta, largest rise of energy {worst_rise:.1e}"
    );
    assert!(worst_rise < 1e-6, "{worst_rise}");
    assert!(4 * near > flights, "{near}: too few flights came close to obstacles");
}

/// Flies under a law without the obstacles: the audit reports violations, and there is no certificate.
fn ignorant(scenario: &Scenario) -> (Flight, Log) {
    let mut alone = scenario.clone();
    alone.obstacles.clear();
    let (flown, log) = fly_with(scenario, alone.law().expect("a law"), plant::of(scenario));
    (flown.expect("a flight"), log)
}

#[test]
fn a_law_without_obstacles_hits_them_and_has_no_certificate() {
    let too_near = (0..12).map(among).filter(|scenario| {
        let (flight, log) = ignorant(scenario);
        assert_eq!(flight.certificate.void, [VoidReason::ObstaclesNotAvoided]);
        let clearance = flight.clearance.expect("obstacles");
        let began = log.events.iter().filter(|event| matches!(event, Event::ObstacleViolationBegan { .. })).count();
        assert_eq!(began, clearance.violations.len());
        clearance.status == Status::Violation
    });
    assert!(too_near.count() >= 6);
}

/// Vehicles fly straight at a wall that the law ignores: points pass through it, hulls do not.
#[test]
fn a_hull_does_not_pass_a_wall_that_a_point_passes() {
    let mut scenario = builtin("pentagon", &[]);
    scenario.law = LawSpec::Displacement(DisplacementKeys::default());
    let slots_m = &mut scenario.legs[0].formation.slots_m;
    slots_m.copy_from(&scenario.start.positions_m);
    slots_m.column_mut(1).add_scalar_mut(12.0);
    let motion = ReferenceMotion::Rest { position_m: Vector3::zeros() };
    scenario.reference = Some(Guidance { motion, known_by: Pinning::All, feed_forward: true });
    scenario.time.duration_s = 20.0;
    let wall = |shape, y: f64| Obstacle {
        name: "wall".to_owned(),
        place_m: Vector3::new(0.0, y, 0.0),
        shape,
        clearance_m: 1.0,
    };
    for shape in [
        Shape::Box { half_m: Vector3::new(60.0, 1.0, 5.0), yaw_deg: 0.0 },
        Shape::Capsule { from_m: -60.0 * Vector3::x(), to_m: 60.0 * Vector3::x(), radius_m: 1.0 },
        Shape::Ball { radius_m: 40.0 },
        Shape::HalfSpace { normal: -2.0 * Vector3::y() },
    ] {
        let y = match shape {
            Shape::Ball { radius_m } => 6.0 + radius_m,
            _ => 6.0,
        };
        scenario.obstacles = vec![wall(shape, y)];
        for (plant, passes) in [(PlantSpec::Rapier, false), (PlantSpec::Ideal, true)] {
            let flown = Scenario { plant, ..scenario.clone() };
            let (flight, _) = ignorant(&flown);
            let clearance = flight.clearance.expect("an obstacle");
            assert_eq!(clearance.status, Status::Violation);
            let deepest_m = clearance.closest[0].lower_m;
            assert_eq!(deepest_m < 0.0, passes, "{shape:?} {plant:?}: {deepest_m}");
            assert!(passes || deepest_m > 0.2, "a hull has a radius of 0.25 m: {deepest_m}");
        }
        // A law with the obstacles keeps the clearance and stops in front of it.
        let (flight, _) = fly(&Scenario { reference: None, ..scenario.clone() });
        assert_eq!(flight.clearance.expect("an obstacle").status, Status::Clear);
    }
}

/// The same flight in the engine and in continuous time, through the gate of the built-in scenario.
#[test]
fn the_engine_matches_continuous_time_among_obstacles() {
    const TOLERANCE_M: f64 = 1e-3;
    let engine = builtin("obstacles", &["time.duration_s=8"]);
    let ideal = Scenario { plant: PlantSpec::Ideal, ..engine.clone() };
    let [engine, ideal] = [engine, ideal].map(|scenario| {
        let (flight, _) = fly(&scenario);
        let nearest = flight.clearance.expect("obstacles").closest[0];
        (nearest.pair, nearest.lower_m, nearest.time_s, flight.audit.closest.expect("a pair").separation_m)
    });
    assert_eq!(engine.0, ideal.0);
    assert!(
        (engine.1 - ideal.1).abs() < TOLERANCE_M && (engine.3 - ideal.3).abs() < TOLERANCE_M,
        "{engine:?} {ideal:?}"
    );
    assert!((engine.2 - ideal.2).abs() < 0.01, "{engine:?} {ideal:?}");
}

#[test]
fn a_moving_reference_or_added_energy_voids_the_certificate_among_obstacles() {
    let mut scenario = among(3);
    let certified = |scenario: &Scenario| scenario.certificate(scenario.law().expect("a law").as_ref());
    assert!(certified(&scenario).certified_clearance_margin_m.is_some());
    let guidance = scenario.reference.take();
    scenario.a22_per_s = 0.1;
    assert_eq!(certified(&scenario).void, [VoidReason::VelocityUndamped]);
    scenario.a22_per_s = -0.1;
    assert!(certified(&scenario).certified_clearance_margin_m.is_some(), "with drag it needs no reference");
    let motion = ReferenceMotion::Velocity { from_m: Vector3::zeros(), velocity_m_s: Vector3::x() };
    scenario.reference = guidance.map(|guidance| Guidance { motion, ..guidance });
    assert_eq!(certified(&scenario).void, [VoidReason::ReferenceAmongObstacles]);
    assert!(certified(&scenario).certified_m.is_none());
}

#[test]
fn a_saved_flight_among_obstacles_goes_on_with_the_same_bits() {
    let scenario = builtin("obstacles", &["time.duration_s=4"]);
    let mut simulation = Simulation::new(&scenario).expect("a flight");
    (0..300).for_each(|_| simulation.step());
    let saved = simulation.save();
    (0..400).for_each(|_| simulation.step());
    let once = simulation.finish();
    let mut again = Simulation::new(&scenario).expect("a flight");
    again.load(&saved, None);
    (0..400).for_each(|_| again.step());
    let again = again.finish();
    assert_eq!((once.last, once.clearance), (again.last, again.clearance));
}

/// Steps are far too long for the law's rate at a wall: moves that take more than half of the margin are undone and
/// halved.
#[test]
fn a_step_that_takes_more_than_half_of_the_margin_is_halved() {
    let mut scenario = builtin("obstacles", &["time.duration_s=6", "time.max_rate_dt=1e6", "time.dt_s=0.05"]);
    scenario.start.velocities_m_s.column_mut(0).fill(20.0);
    let (flight, log) = fly(&scenario);
    assert_eq!(flight.ending, Ending::Completed);
    assert_eq!(flight.clearance.expect("obstacles").status, Status::Clear);
    assert!(log.events.iter().any(|event| matches!(event, Event::StepRefined { .. })));
}

const TOWER_AND_WALL: &str = r#"[swarm]
count = 3
[start]
positions_m = [[-6, 0], [-6, 3], [-8, 0]]
[formation]
shape = "points"
points_m = [[6, -1], [6, 1], [4, 0]]
[reference]
kind = "rest"
[[obstacle]]
name = "tower"
ball = { radius_m = 1.0 }
at_m = [0.0, 0.3, 0.0]
[[obstacle]]
name = "wall"
box = { size_m = [4.0, 1.0, 3.0], yaw_deg = 33.3 }
at_m = [0.0, 6.0, 0.0]
clearance_m = 0.7
[law]
kind = "displacement"
delta_m = 1.0
[time]
duration_s = 25
"#;

#[test]
fn a_wrong_obstacle_is_refused_at_its_place() {
    let replaced = |from: &str, to: &str| {
        assert!(TOWER_AND_WALL.contains(from), "{from}");
        TOWER_AND_WALL.replace(from, to)
    };
    let tower = "name = \"tower\"\nball = { radius_m = 1.0 }\nat_m = [0.0, 0.3, 0.0]\n";
    for (text, code) in [
        (replaced("[0.0, 0.3, 0.0]", "[-6.0, 1.2, 0.0]"), "scenario/near-obstacle"),
        (replaced("[0.0, 0.3, 0.0]", "[-6.0, 0.2, 0.0]"), "scenario/near-obstacle"),
        (replaced("[0.0, 0.3, 0.0]", "[6.0, 2.2, 0.0]"), "scenario/near-obstacle"),
        (replaced("radius_m = 1.0", "radius_m = 0.0"), "scenario/out-of-range"),
        (replaced("clearance_m = 0.7", "clearance_m = 0.26"), "scenario/hulls-touch"),
        (replaced("clearance_m = 0.7", "clearance_m = nan"), "scenario/out-of-range"),
        (replaced("\"wall\"", "\"tower\""), "scenario/name"),
        (replaced("\"wall\"", "\"2\""), "scenario/name"),
        (replaced("\"wall\"", "\"\""), "scenario/name"),
        (replaced(tower, "name = \"t\"\nball = { radius_m = 1.0 }\n"), "scenario/obstacle"),
        (replaced(tower, "name = \"t\"\nat_m = [0, 0, 0]\n"), "scenario/obstacle"),
        (
            replaced(tower, "name = \"t\"\nball = { radius_m = 1 }\npath = [[0, 0, 0, 0], [1, 1, 0, 0]]\n"),
            "scenario/obstacle",
        ),
        (replaced(tower, "name = \"t\"\nbal = { radius_m = 1 }\nat_m = [0, 0, 0]\n"), "scenario/unknown-key"),
        (replaced(tower, "name = \"t\"\nhalf_space = { normal = [0, 0, 0] }\n"), "scenario/out-of-range"),
    ] {
        let source = Source::Text { name: "test".to_owned(), text };
        let error = Scenario::read(&source, &[]).expect_err(code);
        assert_eq!(error.code(), code, "{error}");
        assert!(!error.help.is_empty() && error.place.is_some(), "{error}");
    }
}
