//! Unicycles, which cannot stop: their motion solves their equations within their limits. Saved flights continue with
//! the same bits, and the audit judges a law that is not made for them.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_core::swarm::{Rows, Swarm, row};
use tautline_laws::law::VoidReason;
use tautline_sim::plant;
use tautline_sim::plant::{Plant as _, StepPath, Unicycles};
use tautline_sim::scenario::{Override, Scenario, Source};
use tautline_sim::sim::{Ending, Simulation};
use tautline_sim::vehicle::Unicycle;

use crate::flight::{fly, read};

/// Five unicycles that fly along x from near the corners of a pentagon with sides of 3 m.
const FLIGHT: &str = r#"
[vehicle]
model = "unicycle"
[start]
positions_m = [[0.3, 0.2], [2.6, -0.3], [1.2, 2.9], [-0.4, 5.0], [3.3, 5.4]]
velocities_m_s = [[1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 0.0]]
[formation]
shape = "pentagon"
side_m = 3.0
[law]
delta_m = 1.5
[time]
duration_s = 60.0
"#;

fn one(velocity_m_s: [f64; 2]) -> Swarm {
    let [x, y] = velocity_m_s;
    Swarm { positions_m: Rows::zeros(1), velocities_m_s: Rows::from_row_slice(&[x, y, 0.0]) }
}

/// Returns the end of a flight of one unicycle under commands u(t, v) over `steps` steps, and the largest bend of a
/// step.
fn flown(
    unicycle: Unicycle,
    start: &Swarm,
    (duration_s, steps): (f64, u32),
    command: impl Fn(f64, Vector3<f64>) -> Vector3<f64>,
) -> (Swarm, f64) {
    let (mut plant, mut state, mut path) = (Unicycles::new(unicycle, start), start.clone(), StepPath::default());
    let (dt_s, mut bend_m) = (duration_s / f64::from(steps), 0.0_f64);
    let apply = |plant: &mut Unicycles, state: &mut Swarm, time_s: f64| {
        let u = command(time_s, row(&state.velocities_m_s, 0));
        plant.apply(&Rows::from_row_slice(u.as_slice()), state);
    };
    apply(&mut plant, &mut state, 0.0);
    for step in 1..=steps {
        path.begin();
        plant.advance(dt_s, &mut state, &mut path).expect("finite");
        bend_m = bend_m.max(path.bend_m());
        apply(&mut plant, &mut state, f64::from(step) * dt_s);
    }
    (state, bend_m)
}

fn left(v: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(-v.y, v.x, 0.0)
}

#[test]
fn a_command_across_flies_a_circle_and_comes_back() {
    // u = omega x v turns at omega for any step, and the chords end on the circle.
    let (speed, omega) = (1.5, 0.8);
    let lap_s = TAU / omega;
    for steps in [8, 100] {
        let (end, bend_m) = flown(Unicycle::default(), &one([0.0, speed]), (lap_s, steps), |_, v| omega * left(v));
        assert!(row(&end.positions_m, 0).norm() < 1e-12, "{steps}: {end:?}");
        assert!((row(&end.velocities_m_s, 0) - Vector3::new(0.0, speed, 0.0)).norm() < 1e-12);
        let dt_s = lap_s / f64::from(steps);
        let sagitta_m = speed / omega * (1.0 - (0.5 * omega * dt_s).cos());
        assert!(bend_m >= sagitta_m && bend_m < 1.2 * sagitta_m, "{steps}: {bend_m} {sagitta_m}");
    }
}

#[test]
fn under_a_changing_command_the_error_falls_with_the_square_of_the_step() {
    let command = |time_s: f64, _: Vector3<f64>| Vector3::new((1.3 * time_s).cos(), (0.7 * time_s).sin(), 0.0) * 0.4;
    let end = |steps: u32| row(&flown(Unicycle::default(), &one([1.0, 0.3]), (4.0, steps), command).0.positions_m, 0);
    let exact = end(1 << 16);
    let errors = [64, 128, 256, 512].map(|steps| (end(steps) - exact).norm());
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((1.9..2.1).contains(&order), "{errors:?}");
    }
    // Within their limits unicycles execute any acceleration, as points do: p'' = u.
    let velocity =
        Vector3::new(1.0 + 0.4 / 1.3 * (1.3_f64 * 4.0).sin(), 0.3 + 0.4 / 0.7 * (1.0 - (0.7_f64 * 4.0).cos()), 0.0);
    let flown = row(&flown(Unicycle::default(), &one([1.0, 0.3]), (4.0, 4096), command).0.velocities_m_s, 0);
    assert!((flown - velocity).norm() < 1e-6, "{flown} {velocity}");
}

#[test]
fn a_unicycle_cannot_stop_and_turns_back_on_an_arc() {
    let unicycle = Unicycle::default();
    let (end, _) = flown(unicycle, &one([1.0, 0.0]), (5.0, 500), |_, v| -v.normalize());
    assert!((row(&end.velocities_m_s, 0) - Vector3::new(unicycle.min_speed_m_s, 0.0, 0.0)).norm() < 1e-12);
    // Dubins vehicle: half a turn takes pi/omega, and its width is the diameter of the circle.
    let dubins = Unicycle { min_speed_m_s: 1.0, max_speed_m_s: 1.0, ..unicycle };
    let (end, _) = flown(dubins, &one([1.0, 0.0]), (0.5 * PI, 1000), |_, v| 1e3 * left(v) - 7.0 * v);
    let aside = Vector3::new(0.0, 2.0 / dubins.max_turn_rad_s, 0.0);
    assert!((row(&end.positions_m, 0) - aside).norm() < 1e-9, "{end:?}");
    assert!((row(&end.velocities_m_s, 0) + Vector3::x()).norm() < 1e-9, "{end:?}");
}

#[test]
fn five_unicycles_fly_in_a_pentagon_without_a_certificate() {
    let scenario = read(FLIGHT);
    let (flight, log) = fly(&scenario);
    assert_eq!((flight.ending.clone(), flight.audit.status), (Ending::Completed, Status::Clear));
    assert!(flight.certificate.certified_m.is_none() && flight.certificate.void.contains(&VoidReason::VehicleNotPoint));
    let formation = scenario.formation();
    let last = &flight.last;
    for (i, j) in scenario.graph.edges() {
        let off_m = (row(&last.positions_m, i) - row(&last.positions_m, j)).norm()
            - (row(&formation.slots_m, i) - row(&formation.slots_m, j)).norm();
        assert!(off_m.abs() < 0.02, "{i}-{j}: {off_m} m");
    }
    let slowest = log.samples.iter().flat_map(|sample| sample.channels[0].values.chunks(2).map(|of| of[1]));
    let slowest = slowest.fold(f64::INFINITY, f64::min);
    assert!((0.2..1.0).contains(&slowest), "unicycles slow down but never stop: {slowest} m/s");
    assert!(last.mean_velocity_m_s().norm() > 0.5, "the formation flies on");
}

#[test]
fn a_saved_flight_continues_with_the_same_bits_and_a_refused_step_has_no_effect() {
    let scenario = read(&FLIGHT.replace("60.0", "4.0"));
    let mut simulation = Simulation::new(&scenario).expect("a flight");
    (0..300).for_each(|_| simulation.step());
    let saved = simulation.save();
    (0..300).for_each(|_| simulation.step());
    let (through, mut again) = (simulation.state().clone(), Simulation::new(&scenario).expect("a flight"));
    again.load(&saved, None);
    (0..300).for_each(|_| again.step());
    assert_eq!(again.state(), &through);

    let start = one([0.9, 0.4]);
    let (mut plant, mut state, mut path) =
        (Unicycles::new(Unicycle::default(), &start), start.clone(), StepPath::default());
    plant.apply(&Rows::from_element(1, 0.7), &mut state);
    let mut other = plant.clone();
    plant.advance(0.2, &mut state, &mut path).expect("finite");
    plant.restore(&start);
    let (mut one, mut two) = (start.clone(), start.clone());
    plant.advance(0.1, &mut one, &mut path).expect("finite");
    other.advance(0.1, &mut two, &mut path).expect("finite");
    assert_eq!(one, two);
}

#[test]
fn keys_that_unicycles_do_not_support_are_refused_with_a_remedy() {
    for (set, code) in [
        ("start.velocities_m_s.2.x=0", "scenario/out-of-range"),
        ("start.velocities_m_s.3.x=4", "scenario/out-of-range"),
        ("vehicle.min_speed_m_s=0", "scenario/out-of-range"),
        ("vehicle.min_speed_m_s=5", "scenario/inconsistent"),
        ("vehicle.max_turn_rad_s=-1", "scenario/out-of-range"),
        ("vehicle.attitude_hz=100", "scenario/unsupported-by-vehicle"),
        ("plant.kind=ideal", "scenario/unsupported-by-plant"),
        ("swarm.dimensions=3", "scenario/plane"),
        ("vehicle.drag_per_s=0.3", "scenario/unsupported-by-vehicle"),
        ("wind.mean_m_s=[1, 0]", "scenario/unsupported-by-vehicle"),
        ("vehicle.model=point", "unknown"),
    ] {
        let source = Source::Text { name: "test".to_owned(), text: FLIGHT.to_owned() };
        let read = Scenario::read(&source, &[Override::parse(set).expect(set)]);
        match read {
            Err(error) => assert_eq!(error.code(), code, "{set}: {error}"),
            Ok(scenario) => assert!(set.ends_with("point") && scenario.airframe.is_point(), "{set}"),
        }
    }
    let scenario = read(FLIGHT);
    let source = Source::Text { name: "again".to_owned(), text: scenario.resolved().toml };
    assert_eq!(Scenario::read(&source, &[]).expect("its own text"), scenario);
    assert!(plant::of(&scenario).holds_commands());
}
