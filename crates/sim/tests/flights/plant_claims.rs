//! The rigid bodies of the physics engine are the double integrators of equation (1). Free motion is exact; masses,
//! keep-out balls and the third axis of a plane have no effect; hulls are solid.

use crate::flight::{builtin, fly};
use nalgebra::Vector3;
use tautline_core::swarm::{Pair, Rows, Swarm, row, separation, set_row};
use tautline_laws::formation::Formation;
use tautline_sim::plant::{Plant, StepPath, rapier};
use tautline_sim::scenario::{Scenario, Space};

const DT_S: f64 = 1.0 / 240.0;
const HULL_RADIUS_M: f64 = 0.25;

/// Advances a plant by a step under accelerations \[m/s^2\].
fn step(plant: &mut dyn Plant, command: &Rows, dt_s: f64) {
    let mut state = observed(plant, command.nrows());
    plant.apply(command, &mut state);
    plant.advance(dt_s, &mut state, &mut StepPath::default()).expect("a finite motion");
}

/// Returns vehicles with positions \[m\] and velocities \[m/s\].
fn scenario(positions_m: &[f64], velocities_m_s: &[f64]) -> Scenario {
    let start =
        Swarm { positions_m: Rows::from_row_slice(positions_m), velocities_m_s: Rows::from_row_slice(velocities_m_s) };
    let formation = Formation::line(start.count(), 3.0);
    let mut scenario = Scenario::new("plant", start, formation, 2.0 * HULL_RADIUS_M, 10.0);
    scenario.time.dt_s = DT_S;
    scenario
}

fn observed(plant: &dyn Plant, count: usize) -> Swarm {
    let mut swarm = Swarm::at_rest(Rows::zeros(count));
    plant.observe(&mut swarm);
    swarm
}

#[test]
fn a_free_velocity_is_exactly_v0_exp_a22_t_for_both_signs_of_a22() {
    const STEPS: u32 = 2400;
    let velocity = Vector3::new(0.75, -0.5, 0.25);
    for a22_per_s in [-0.9, -0.1, 0.0, 0.1, 0.7] {
        let mut scenario = scenario(&[0.0, 0.0, 0.0, 90.0, 0.0, 0.0], &[0.75, -0.5, 0.25, 0.0, 0.0, 0.0]);
        scenario.a22_per_s = a22_per_s;
        let mut plant = rapier::plant(&scenario);
        for _ in 0..STEPS {
            step(plant.as_mut(), &Rows::zeros(2), DT_S);
        }
        let found = row(&observed(plant.as_ref(), 2).velocities_m_s, 0);
        let expected = velocity * (a22_per_s * f64::from(STEPS) * DT_S).exp();
        let off = (found - expected).norm() / expected.norm();
        // Each step rounds the velocity of the drift and that at its end.
        let rounding = 3.0 * f64::from(STEPS) * f64::EPSILON;
        assert!(off <= rounding, "a22 = {a22_per_s}, off by {off}, rounding is {rounding}");
        if a22_per_s == 0.0 {
            assert_eq!(found, velocity);
        }
    }
}

#[test]
fn within_a_step_motion_is_the_straight_line_that_the_audit_sweeps() {
    let scenario = scenario(&[0.0, 0.0, 0.0, 90.0, 0.0, 0.0], &[0.75, -0.5, 0.25, 0.0, 0.0, 0.0]);
    let mut plant = rapier::plant(&scenario);
    let mut control = Rows::zeros(2);
    set_row(&mut control, 0, Vector3::new(2.0, 4.0, -8.0));
    step(plant.as_mut(), &control, DT_S);
    let after = observed(plant.as_ref(), 2);
    // Exact motion under a constant acceleration: p = v t + u t^2/2, v = v(0) + u t.
    let (velocity, held) = (Vector3::new(0.75, -0.5, 0.25), Vector3::new(2.0, 4.0, -8.0));
    let rounding = 4.0 * f64::EPSILON;
    let off_m_s = (row(&after.velocities_m_s, 0) - (velocity + held * DT_S)).norm();
    let off_m = (row(&after.positions_m, 0) - (velocity + held * (0.5 * DT_S)) * DT_S).norm();
    // The engine's origin is the centre of the start, 45 m away.
    assert!(off_m_s <= rounding && off_m <= 45.0 * f64::EPSILON, "{off_m_s} m/s, {off_m} m");
}

#[test]
fn keep_out_balls_report_contacts_and_do_not_push() {
    // In the baseline, delta is only the diameter of the keep-out balls.
    let [touching, clear] =
        ["law.delta_m=2", "law.delta_m=1.5"].map(|delta| fly(&builtin("pentagon-laplacian", &[delta])));
    assert!(!touching.0.engine_contacts.is_empty(), "balls of 1 m overlap");
    assert!(clear.0.engine_contacts.is_empty(), "balls of 0.75 m never meet");
    for (with, without) in touching.1.samples.iter().zip(&clear.1.samples) {
        assert_eq!(with.swarm, without.swarm, "at {} s", with.time_s);
    }
    assert_eq!(touching.0.last, clear.0.last);
}

#[test]
fn hulls_are_solid_and_bounce() {
    // The engine predicts contacts and stops the hulls at each other's surface, up to rounding over 240 steps.
    const STEPS: u32 = 480;
    // A head-on collision at 1 m/s each.
    let scenario = scenario(&[-1.0, 0.0, 0.0, 1.0, 0.0, 0.0], &[1.0, 0.0, 0.0, -1.0, 0.0, 0.0]);
    let mut plant = rapier::plant(&scenario);
    let mut nearest_m = f64::INFINITY;
    let mut hits = Vec::new();
    for _ in 0..STEPS {
        step(plant.as_mut(), &Rows::zeros(2), DT_S);
        nearest_m = nearest_m.min(separation(&observed(plant.as_ref(), 2).positions_m, 0, 1));
        plant.hull_contacts(&mut hits);
    }
    let rounding = f64::from(STEPS) * f64::EPSILON;
    assert!((nearest_m - 2.0 * HULL_RADIUS_M).abs() <= rounding, "{nearest_m} m between the centres");
    let [left, right] = [0, 1].map(|i| observed(plant.as_ref(), 2).velocities_m_s[(i, 0)]);
    assert!(
        (left + 0.5).abs() <= rounding && (right - 0.5).abs() <= rounding,
        "half the speed remains: {left}, {right}"
    );
    let [hit] = hits[..] else { panic!("one hit expected: {hits:?}") };
    assert_eq!(hit.pair, Pair::new(0, 1));
    assert!((hit.closing_m_s - 2.0).abs() <= rounding, "{} m/s", hit.closing_m_s);
}

#[test]
fn hulls_that_pass_beside_each_other_do_not_touch() {
    let apart_m = 2.0 * HULL_RADIUS_M + 1e-3;
    let start = [-1.0, 0.0, 0.0, 1.0, apart_m, 0.0];
    let mut plant = rapier::plant(&scenario(&start, &[1.0, 0.0, 0.0, -1.0, 0.0, 0.0]));
    for _ in 0..480 {
        step(plant.as_mut(), &Rows::zeros(2), DT_S);
    }
    assert_eq!(observed(plant.as_ref(), 2).velocities_m_s, Rows::from_row_slice(&[1.0, 0.0, 0.0, -1.0, 0.0, 0.0]));
    let mut hits = Vec::new();
    plant.hull_contacts(&mut hits);
    assert_eq!(hits, []);
}

#[test]
fn a_swarm_in_the_plane_never_leaves_it_under_any_command() {
    let mut scenario = scenario(&[-1.0, 0.1, 0.0, 1.0, 0.0, 0.0], &[1.0, 0.0, 0.0, -1.0, 0.0, 0.0]);
    assert_eq!(scenario.space, Space::Plane);
    let mut control = Rows::zeros(2);
    control.column_mut(2).fill(3.0);
    let lifted = |scenario: &Scenario| {
        let mut plant = rapier::plant(scenario);
        (0..480).any(|_| {
            step(plant.as_mut(), &control, DT_S);
            let swarm = observed(plant.as_ref(), 2);
            swarm.positions_m.column(2).iter().chain(swarm.velocities_m_s.column(2).iter()).any(|&z| z != 0.0)
        })
    };
    assert!(!lifted(&scenario));
    scenario.space = Space::Volume;
    assert!(lifted(&scenario), "the same command lifts a swarm in three dimensions");
}

#[test]
fn two_dimensional_flights_stay_in_their_plane_exactly() {
    for name in ["pentagon", "circle", "pentagon-laplacian"] {
        let (_, log) = fly(&builtin(name, &["time.duration_s=20"]));
        for sample in &log.samples {
            let flat = |rows: &Rows| rows.column(2).iter().all(|&z| z == 0.0);
            assert!(flat(&sample.swarm.positions_m) && flat(&sample.swarm.velocities_m_s) && flat(&sample.control));
        }
    }
}

#[test]
fn mass_does_not_change_motion() {
    // Rounding of force and inverse mass over 2400 steps of a flight that does not amplify it.
    const TOLERANCE_M: f64 = 1e-10;
    let sets = ["time.duration_s=10"];
    let with = |mass: &str| fly(&builtin("pentagon", &[sets[0], mass])).0.last;
    let light = with("swarm.mass_kg=1");
    let off_m = (with("swarm.mass_kg=[0.03,700,5,1e-6,1e6]").positions_m - &light.positions_m).amax();
    assert!(off_m <= TOLERANCE_M, "off by {off_m} m");
    assert_eq!(with("swarm.mass_kg=[0.25,1024,2,0.5,8]"), light, "powers of two cause no rounding");
}

#[test]
fn a_restored_plant_continues_as_without_the_refused_step() {
    let scenario = builtin("pentagon", &[]);
    let mut plant = rapier::plant(&scenario);
    let mut control = Rows::zeros(5);
    control.column_mut(0).copy_from_slice(&[1.0, -2.0, 3.0, -4.0, 5.0]);
    let before = observed(plant.as_ref(), 5);
    step(plant.as_mut(), &control, DT_S);
    let straight = observed(plant.as_ref(), 5);
    step(plant.as_mut(), &control, 100.0 * DT_S);
    plant.restore(&before);
    step(plant.as_mut(), &control, DT_S);
    assert_eq!(observed(plant.as_ref(), 5), straight);
}
