//! Whole flights: the built-in one, saved ones, undone steps, collisions, ground effect and downwash.

use nalgebra::{Vector3, Vector4};
use tautline_audit::Status;
use tautline_core::record::Event;
use tautline_core::swarm::{Rows, Swarm, row};
use tautline_laws::formation::{Formation, largest_edge_error_m};
use tautline_laws::law::VoidReason;
use tautline_sim::plant::{Quadrotors, StepPath, rapier};
use tautline_sim::scenario::{Scenario, Space};
use tautline_sim::sim::{Ending, Simulation};
use tautline_sim::vehicle::{Airframe, Downwash, Fleet, GRAVITY_M_S2, Ground, Quadrotor, State};

use super::model;
use crate::flight::{builtin, fly, read};

const DT_S: f64 = 1.0 / 500.0;

/// Returns two Crazyflies with given positions, in space.
fn two(positions_m: &[f64; 6], velocities_m_s: &[f64; 6], change: &dyn Fn(&mut Quadrotor)) -> (Scenario, Fleet) {
    let start =
        Swarm { positions_m: Rows::from_row_slice(positions_m), velocities_m_s: Rows::from_row_slice(velocities_m_s) };
    let mut scenario = Scenario::new("two", start, Formation::line(2, 1.0), 0.2, 1.0);
    let mut quadrotor =
        Quadrotor { model: model("crazyflie"), attitude_hz: 500.0, ground_effect: false, downwash: false };
    change(&mut quadrotor);
    scenario.space = Space::Volume;
    scenario.set_airframe(Airframe::Quadrotor(Box::new(quadrotor)));
    let fleet = scenario.fleet().expect("quadrotors");
    (scenario, fleet)
}

fn step(plant: &mut dyn Quadrotors, command: &Rows) -> Swarm {
    let (mut swarm, mut path) = (Swarm::at_rest(Rows::zeros(command.nrows())), StepPath::default());
    plant.apply(command, &mut swarm);
    plant.advance(DT_S, &mut swarm, &mut path).expect("a finite motion");
    assert!(path.instants().next().is_none() && path.bend_m() == 0.0, "a step is one straight line");
    swarm
}

#[test]
fn five_crazyflies_reach_the_pentagon_clear_with_nothing_certified() {
    let scenario = builtin("crazyflies", &[]);
    let (flown, log) = fly(&scenario);
    assert_eq!((flown.ending, flown.audit.status), (Ending::Completed, Status::Clear));
    assert!(flown.certificate.void.contains(&VoidReason::VehicleNotPoint) && flown.certificate.certified_m.is_none());
    let error_m = largest_edge_error_m(&flown.last.positions_m, scenario.formation(), &scenario.graph);
    assert!(error_m < scenario.arrival.edge_error_m, "{error_m} m");
    // The height is held up to the sag of a tilt.
    let off_m = log.samples.iter().map(|sample| sample.swarm.positions_m.column(2).amax()).fold(0.0, f64::max);
    assert!(off_m > 0.0 && off_m < 1e-3, "{off_m} m");
    let weight_n = model("crazyflie").weight_n();
    for sample in &log.samples {
        let [attitude, rotors] = &sample.channels[..] else { panic!("two channels") };
        assert_eq!((&*attitude.name, &*rotors.name), ("attitude", "rotors"));
        for (q, thrusts_n) in attitude.values.chunks_exact(4).zip(rotors.values.chunks_exact(4)) {
            let norm: f64 = q.iter().map(|x| x * x).sum();
            let lift = thrusts_n.iter().sum::<f64>() / weight_n;
            assert!((norm - 1.0).abs() <= 1e-12 && (0.9..1.1).contains(&lift), "{q:?}, {lift} weights");
        }
    }
}

#[test]
fn the_flight_of_points_is_the_scaled_pentagon_with_larger_separations() {
    let least_m = |sets: &[&str]| fly(&builtin("crazyflies", sets)).0.audit.closest.expect("a pair").separation_m;
    let [points_m, quadrotors_m] =
        ["point", "crazyflie"].map(|model| least_m(&["time.duration_s=5", &format!("vehicle.model={model}")]));
    // A fifth of 2.460 m.
    assert!((points_m - 0.492).abs() < 1e-3, "{points_m} m");
    assert!(quadrotors_m < points_m - 0.005, "{quadrotors_m} m and {points_m} m");
}

#[test]
fn a_loaded_flight_of_quadrotors_goes_on_with_the_same_bits() {
    for sets in [&["time.control_hz=70", "vehicle.attitude_hz=300"][..], &["plant.kind=ideal"]] {
        let mut simulation = Simulation::new(&builtin("crazyflies", sets)).expect("a flight");
        let run = |simulation: &mut Simulation, steps: u32| {
            let mut samples = Vec::new();
            for _ in 0..steps {
                simulation.step();
                samples.extend(simulation.sample().map(|sample| tautline_core::record::OwnedSample::from(&sample)));
            }
            samples
        };
        run(&mut simulation, 33);
        let saved = simulation.save();
        let flown = run(&mut simulation, 60);
        simulation.load(&saved, None);
        assert_eq!(run(&mut simulation, 60), flown, "{sets:?}");
        assert!(flown.iter().any(|sample| sample.channels.len() == 2));
    }
}

#[test]
fn an_undone_step_has_no_effect() {
    let (scenario, mut fleet) = two(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], &[0.0; 6], &|_| {});
    fleet.states[0].rates_rad_s = Vector3::new(1.0, 2.0, 3.0);
    let mut plant = rapier::quadrotors(&scenario, fleet);
    let hard = Rows::from_row_slice(&[3.0, -2.0, 1.0, 0.0, 4.0, -3.0]);
    (0..50).for_each(|_| drop(step(plant.as_mut(), &hard)));
    let before = plant.fleet().states.clone();
    let after = step(plant.as_mut(), &hard);
    plant.restore(&Swarm::at_rest(Rows::zeros(2)));
    assert_eq!(plant.fleet().states, before);
    assert_eq!(step(plant.as_mut(), &hard), after);
}

#[test]
fn hulls_that_meet_make_quadrotors_tumble_and_the_flight_goes_on() {
    let apart = [-0.5, 0.04, 0.0, 0.5, -0.04, 0.0];
    let (scenario, fleet) = two(&apart, &[2.0, 0.0, 0.0, -2.0, 0.0, 0.0], &|_| {});
    let mut plant = rapier::quadrotors(&scenario, fleet);
    let (mut hits, mut spin_rad_s, mut lowest_m) = (Vec::new(), 0.0_f64, 0.0_f64);
    let mut nearest_m = f64::INFINITY;
    for _ in 0..1500 {
        let swarm = step(plant.as_mut(), &Rows::zeros(2));
        plant.hull_contacts(&mut hits);
        assert_eq!(swarm.first_not_finite(), None);
        nearest_m = nearest_m.min((row(&swarm.positions_m, 0) - row(&swarm.positions_m, 1)).norm());
        for State { rates_rad_s, position_m, .. } in &plant.fleet().states {
            spin_rad_s = spin_rad_s.max(rates_rad_s.norm());
            lowest_m = lowest_m.min(position_m.z);
        }
    }
    let [hit, ..] = hits[..] else { panic!("they hit") };
    // At the ends of steps, in which they close by up to 8 mm.
    assert!(hit.closing_m_s > 2.0 && (0.14..0.148).contains(&nearest_m), "{hit:?}, {nearest_m} m");
    assert!(spin_rad_s > 10.0 && lowest_m < -0.05, "{spin_rad_s} rad/s, {lowest_m} m");
}

#[test]
fn a_flight_into_each_other_is_a_violation_with_a_hit_and_ends_in_time() {
    let scenario = read(
        r#"
        name = "crossing"
        vehicle.model = "crazyflie"
        start.positions_m = [[0, 0], [2, 0.02]]
        formation = { shape = "points", points_m = [[2, 0], [0, 0]] }
        law = { kind = "laplacian", delta_m = 0.3 }
        time.duration_s = 8
        "#,
    );
    let (flown, log) = fly(&Scenario { start: crossing(&scenario), ..scenario });
    assert_eq!((flown.ending, flown.audit.status), (Ending::Completed, Status::Violation));
    assert!(!flown.bounces.is_empty() && log.events.iter().any(|event| matches!(event, Event::HullsHit { .. })));
    assert_eq!(flown.last.first_not_finite(), None);
}

/// Returns the start with velocities towards each other, faster than the law can brake.
fn crossing(scenario: &Scenario) -> Swarm {
    let velocities_m_s = Rows::from_row_slice(&[2.5, 0.0, 0.0, -2.5, 0.0, 0.0]);
    Swarm { velocities_m_s, ..scenario.start.clone() }
}

#[test]
fn continuous_time_flies_the_same_flight() {
    let sets = ["time.duration_s=4"];
    let bodies = fly(&builtin("crazyflies", &sets)).0.last;
    let ideal = fly(&builtin("crazyflies", &[sets[0], "plant.kind=ideal"])).0.last;
    let off_m = (bodies.positions_m - ideal.positions_m).amax();
    assert!(off_m <= 2e-5 && off_m > 0.0, "{off_m} m");
}

#[test]
fn thrust_grows_only_near_a_ground() {
    let ground = Ground { place_m: Vector3::new(0.0, 0.0, -1.0), normal: Vector3::z() };
    let (scenario, _) = two(&[0.0; 6], &[0.0; 6], &|_| {});
    let felt = Quadrotor { ground_effect: true, ..scenario.airframe.quadrotor().expect("a quadrotor").clone() };
    let thrust = |quadrotor: &Quadrotor, grounds: &[Ground], height_m: f64| {
        let start = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, height_m - 1.0]));
        let fleet = Fleet::trimmed(quadrotor, grounds, &start, false);
        fleet.dynamics.thrusts_n(&fleet.states[0]).sum() / quadrotor.model.weight_n()
    };
    let (k, radius_m) = (felt.model.ground_effect, felt.model.rotor_radius_m);
    for height_m in [0.05, 0.1, 0.5] {
        let expected = 1.0 + k * (0.25 * radius_m / height_m).powi(2);
        assert!((thrust(&felt, &[ground], height_m) - expected).abs() <= 1e-12);
    }
    let bounded = thrust(&felt, &[ground], 0.001) - thrust(&felt, &[ground], radius_m);
    assert!(bounded.abs() <= 1e-12, "{bounded}");
    let free = Quadrotor { ground_effect: false, ..felt.clone() };
    for none in [thrust(&felt, &[], 0.05), thrust(&free, &[ground], 0.05), thrust(&felt, &[ground], -0.05)] {
        assert!((none - 1.0).abs() <= 1e-12, "{none}");
    }
}

#[test]
fn downwash_acts_below_rotors_and_not_beside() {
    // Momentum theory: 4.42 m/s through the discs of a Crazyflie in hover.
    let quarter_n = 0.25 * model("crazyflie").weight_n();
    let jet = Downwash::new(Vector3::zeros(), model("crazyflie").rotor_radius_m, quarter_n);
    let through_m_s = 0.5 * jet.squared_m2_s2(Vector3::new(0.0, 0.0, -1e-6)).sqrt();
    assert!((through_m_s - 4.42).abs() < 0.01, "{through_m_s} m/s");
    let push = |place_m: Vector3<f64>, downwash: bool| {
        let at = [0.0, 0.0, 0.0, place_m.x, place_m.y, place_m.z];
        let (_, mut fleet) = two(&at, &[0.0; 6], &|quadrotor| quadrotor.downwash = downwash);
        fleet.compute_wrenches();
        let weight_n = fleet.dynamics.model().weight_n();
        (1.0 - fleet.wrench(1).force_n.z / weight_n, 1.0 - fleet.wrench(0).force_n.z / weight_n)
    };
    let below = [0.3, 0.6, 1.0].map(|depth_m| push(Vector3::new(0.0, 0.0, -depth_m), true));
    // Drag alone, without the loss of thrust by the inflow.
    for ((found, above), expected) in below.into_iter().zip([0.22, 0.13, 0.10]) {
        assert!((found - expected).abs() < 0.01 && above.abs() < 1e-12, "{found} of the weight, {above}");
    }
    assert!(push(Vector3::new(0.5, 0.0, -0.3), true).0.abs() < 1e-9, "half a metre beside");
    assert!(push(Vector3::new(0.0, 0.0, -0.3), false).0.abs() < 1e-12, "off by default");
}

#[test]
fn rotor_speeds_saturate_at_their_limits() {
    let (_, fleet) = two(&[0.0; 6], &[0.0; 6], &|_| {});
    let (dynamics, state) = (&fleet.dynamics, &fleet.states[0]);
    let most_rpm = tautline_sim::vehicle::RotorCurve::of(dynamics.model()).speed_rpm(dynamics.model().max_thrust_n);
    for command_m_s2 in [1e9, -1e9].into_iter().flat_map(|x| [Vector3::x(), Vector3::z()].map(|axis| axis * x)) {
        let commanded_rpm: Vector4<f64> = dynamics.commanded_rpm(state, command_m_s2);
        assert!(commanded_rpm.iter().all(|rpm| (0.0..=most_rpm).contains(rpm)), "{command_m_s2}: {commanded_rpm}");
    }
    // A level hover needs the rotors to carry the weight; a tilted vehicle turns back before it climbs.
    let level = dynamics.commanded_rpm(state, Vector3::zeros());
    assert!((level - Vector4::repeat(dynamics.hover_rpm())).amax() <= 1e-6);
    let climbing = dynamics.commanded_rpm(state, Vector3::z() * GRAVITY_M_S2);
    assert!(climbing.iter().all(|&rpm| rpm > dynamics.hover_rpm()));
}

#[test]
fn the_engine_and_continuous_time_fly_in_the_same_turbulence() {
    let sets = [
        "time.duration_s=3",
        "wind={mean_m_s=[1,0.5], dryden={speed_20ft_m_s=4, height_m=10}, shared=false}",
        "noise.seed=5",
    ];
    let last = |more: &str| fly(&builtin("crazyflies", &[&sets[..], &[more]].concat())).0.last.positions_m;
    let (bodies, ideal, still) = (
        last("plant.kind=rapier"),
        last("plant.kind=ideal"),
        fly(&builtin("crazyflies", &["time.duration_s=3"])).0.last.positions_m,
    );
    let off_m = (&bodies - &ideal).amax();
    assert!(off_m <= 1e-4 && (&bodies - &still).amax() > 0.5, "{off_m} m from each other");
}

#[test]
fn a_dead_quadrotor_falls_and_one_that_loses_a_rotor_turns_over_in_either_plant() {
    for plant in ["rapier", "ideal"] {
        let fallen = |failure: &str| {
            let sets = ["time.duration_s=2", &format!("plant.kind={plant}"), &format!("failure=[{failure}]")];
            let (flown, _) = fly(&builtin("crazyflies", &sets));
            assert!(flown.certificate.void.contains(&VoidReason::VehicleFails));
            (flown.ending, flown.last.positions_m.column(2).iter().copied().collect::<Vec<_>>())
        };
        let (ending, heights_m) = fallen("{vehicle=4, at_s=1.0, kind=\"dead\"}");
        assert_eq!(ending, Ending::Completed);
        // A second of fall, less the remaining push and drag of the slowing rotors.
        assert!((-4.9..-3.5).contains(&heights_m[3]) && heights_m[0].abs() < 1e-3, "{plant}: {heights_m:?}");
        let (_, heights_m) = fallen("{vehicle=4, at_s=1.0, kind=\"rotor\", rotor=2}");
        assert!(heights_m[3] < -0.5 && heights_m[0].abs() < 1e-3, "{plant}: {heights_m:?}");
        let (_, heights_m) = fallen("{vehicle=4, at_s=1.0, kind=\"rotor\", rotor=2, share=0.95}");
        assert!(heights_m[3] > -0.2, "{plant}: {heights_m:?}");
    }
}
