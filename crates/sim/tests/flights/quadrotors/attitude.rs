//! Attitude loop: its poles with lagging rotors, and quadrotors against their solution in continuous time.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tautline_sim::continuous;
use tautline_sim::plant::{Quadrotors, rapier};
use tautline_sim::scenario::ScenarioError;
use tautline_sim::vehicle::{Model, State};

use super::{alone, fly, model, orders, without_drag};

/// Returns angles \[rad\] about x at intervals \[s\] of a vehicle that begins with a small tilt.
fn angles(model: &Model, hz: f64, period_s: f64, samples: usize) -> Vec<f64> {
    let (scenario, mut fleet) = alone(model.clone(), hz);
    fleet.states[0].attitude = UnitQuaternion::from_euler_angles(1e-4, 0.0, 0.0);
    let mut plant = rapier::quadrotors(&scenario, fleet);
    (0..samples)
        .map(|_| {
            let state = fly(plant.as_mut(), (period_s, 1.0 / hz), &mut |_, _| Vector3::zeros());
            2.0 * state.attitude.quaternion().i
        })
        .collect()
}

/// Returns the coefficients of s^2, s and 1 of the monic cubic whose exponentials sum to these samples. They follow
/// from the recursion of four neighbours with z = e^(s T), and the sums of roots s = ln(z)/T.
fn cubic(samples: &[f64], period_s: f64) -> [f64; 3] {
    let row = |k: usize| Vector3::new(samples[k + 2], samples[k + 1], samples[k]);
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for k in 0..samples.len() - 3 {
        normal += row(k) * row(k).transpose();
        right += row(k) * samples[k + 3];
    }
    let of = normal.try_inverse().expect("three modes") * right;
    let companion = Matrix3::new(of.x, of.y, of.z, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    let roots = companion.complex_eigenvalues().map(|z| z.ln() / period_s);
    let [a, b, c] = [roots[0], roots[1], roots[2]];
    [-(a + b + c).re, (a * b + a * c + b * c).re, -(a * b * c).re]
}

#[test]
fn the_attitude_obeys_tau_s3_plus_s2_plus_2_zeta_omega_s_plus_omega2() {
    let model = without_drag("crazyflie");
    let (omega, zeta, lag_s) = (model.attitude_rad_s, model.attitude_damping, model.lag_up_s);
    let expected = [1.0 / lag_s, 2.0 * zeta * omega / lag_s, omega * omega / lag_s];
    let error = |model: &Model, hz: f64| {
        let found = cubic(&angles(model, hz, 0.05, 16), 0.05);
        found.iter().zip(expected).map(|(found, expected)| (found / expected - 1.0).abs()).fold(0.0, f64::max)
    };
    // Half a period of the loop adds to the lag: 0.1 % of each coefficient at 8 kHz, and half of it at twice the rate.
    let errors = [4000.0, 8000.0, 16_000.0].map(|hz| error(&model, hz));
    assert!(errors[2] <= 2e-3 && orders(&errors).iter().all(|order| (0.8..1.2).contains(order)), "{errors:?}");
    let prompt = Model { lag_up_s: 0.5 * lag_s, lag_down_s: 0.5 * lag_s, ..model };
    assert!(error(&prompt, 8000.0) > 0.5, "another lag has other poles");
}

#[test]
fn unstable_gains_are_refused_and_grow_in_flight() {
    let tuned = |rad_s: f64| Model { attitude_rad_s: rad_s, ..without_drag("crazyflie") };
    // 2 zeta/tau is 30.8 rad/s.
    let largest = |model: &Model| {
        let angles = angles(model, 2000.0, 0.05, 60);
        angles[50..].iter().fold(0.0_f64, |most, angle| most.max(angle.abs()))
    };
    assert_eq!(tuned(29.0).check(), Ok(()));
    assert!(largest(&tuned(29.0)) < 1e-4, "{}", largest(&tuned(29.0)));
    let Err(ScenarioError { keys, message, .. }) = tuned(33.0).check() else { panic!("refused") };
    assert!(keys == ["attitude_rad_s"] && message.contains("2 zeta > omega tau"), "{message}");
    assert!(largest(&tuned(33.0)) > 1e-4, "{}", largest(&tuned(33.0)));
}

/// Returns the command of a manoeuvre that tilts, climbs and turns, in commands of 20 ms.
fn manoeuvre(time_s: f64, _: &State) -> Vector3<f64> {
    let time_s = 0.02 * (time_s / 0.02 + 1e-6).floor();
    Vector3::new(2.0 * (3.0 * time_s).sin(), 1.5 * (5.0 * time_s).cos(), (4.0 * time_s).sin())
}

#[test]
fn the_engine_converges_to_the_solution_of_order_8_at_second_order() {
    // Error at 500 Hz after a second, in m and m/s: larger for faster rotors.
    for (name, left) in [("crazyflie", 2e-4), ("hummingbird", 5e-3)] {
        let start = |hz: f64| {
            let (scenario, mut fleet) = alone(model(name), hz);
            fleet.states[0].rates_rad_s = Vector3::new(3.0, -2.0, 4.0);
            fleet.wind_m_s[(0, 1)] = 3.0;
            (scenario, fleet)
        };
        let run = |plant: &mut dyn Quadrotors, hz: f64| fly(plant, (1.0, 1.0 / hz), &mut manoeuvre);
        let (_, fleet) = start(500.0);
        let exact = run(&mut continuous::Quadrotors::new(fleet), 500.0);
        let errors = [500.0, 1000.0, 2000.0, 4000.0, 8000.0].map(|hz| {
            let (scenario, fleet) = start(500.0);
            let found = run(rapier::quadrotors(&scenario, fleet).as_mut(), hz);
            (found.position_m - exact.position_m).norm() + (found.velocity_m_s - exact.velocity_m_s).norm()
        });
        assert!(errors[0] <= left, "{name}: {errors:?} m and m/s");
        assert!(orders(&errors).iter().all(|order| (1.9..2.1).contains(order)), "{name}: {errors:?}");
    }
}
