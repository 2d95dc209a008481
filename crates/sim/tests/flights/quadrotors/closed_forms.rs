//! Motions with a closed form: fall, drag, rotors, hover in wind.

use nalgebra::{Vector3, Vector4};
use tautline_sim::plant::rapier;
use tautline_sim::vehicle::{GRAVITY_M_S2, Model, RotorCurve, State};

use super::{alone, fly, model, open_loop, orders, without_drag};

const STILL: Vector4<f64> = Vector4::new(0.0, 0.0, 0.0, 0.0);

/// Rounding of some hundred steps, in m and m/s.
const ROUNDING: f64 = 1e-12;

fn still(state: &mut State) {
    state.rotors_rpm = STILL;
}

#[test]
fn a_vehicle_without_drag_and_thrust_falls_by_g_t_squared_over_two() {
    for dt_s in [1.0 / 500.0, 1.0 / 1000.0] {
        let fallen = open_loop(without_drag("crazyflie"), &still, STILL, (0.5, dt_s));
        assert!((fallen.position_m.z + 0.125 * GRAVITY_M_S2).abs() <= ROUNDING, "{}", fallen.position_m);
        assert!((fallen.velocity_m_s.z + 0.5 * GRAVITY_M_S2).abs() <= ROUNDING, "{}", fallen.velocity_m_s);
    }
}

/// Returns speed \[m/s\] and depth \[m\] after a time \[s\] of a fall with a drag c v^2.
fn fallen(model: &Model, time_s: f64) -> (f64, f64) {
    let terminal_m_s = (model.weight_n() / model.parasitic_drag_n_s2_m2[2]).sqrt();
    let time = GRAVITY_M_S2 * time_s / terminal_m_s;
    (terminal_m_s * time.tanh(), terminal_m_s.powi(2) / GRAVITY_M_S2 * time.cosh().ln())
}

#[test]
fn a_fall_in_air_comes_to_the_terminal_speed_at_second_order() {
    let dragged = |sign: f64| Model { parasitic_drag_n_s2_m2: [0.0, 0.0, sign * 0.02], ..without_drag("crazyflie") };
    let (speed_m_s, depth_m) = fallen(&dragged(1.0), 1.0);
    let errors = [500.0, 1000.0, 2000.0].map(|hz| {
        let state = open_loop(dragged(1.0), &still, STILL, (1.0, 1.0 / hz));
        (state.velocity_m_s.z + speed_m_s).abs().max((state.position_m.z + depth_m).abs())
    });
    // In m and m/s.
    assert!(errors[0] <= 8e-6 && orders(&errors).iter().all(|order| (1.95..2.05).contains(order)), "{errors:?}");
    let state = open_loop(dragged(1.0), &still, STILL, (5.0, 1.0 / 500.0));
    let (terminal_m_s, _) = fallen(&dragged(1.0), 1e3);
    assert!((state.velocity_m_s.z + terminal_m_s).abs() <= 1e-9, "{}", state.velocity_m_s);
    // A negative drag: faster than in a vacuum.
    let pushed = open_loop(dragged(-1.0), &still, STILL, (0.5, 1.0 / 500.0));
    assert!(-pushed.velocity_m_s.z > 0.5 * GRAVITY_M_S2, "{}", pushed.velocity_m_s);
}

#[test]
fn rotor_drag_in_hover_slows_a_glide_exponentially() {
    let glide = |model: Model| {
        let (_, fleet) = alone(model.clone(), 500.0);
        let rotors_rpm = fleet.states[0].rotors_rpm;
        let thrown = |state: &mut State| state.velocity_m_s = Vector3::new(3.0, 0.0, 0.0);
        open_loop(model, &thrown, rotors_rpm, (1.0, 1.0 / 500.0)).velocity_m_s
    };
    let model = model("crazyflie");
    let expected_m_s = 3.0 * (-model.rotor_drag_n_s_m[0] / model.mass_kg).exp();
    let found_m_s = glide(model.clone());
    // Relative error 1e-7, of order (dt D/m)^2.
    assert!((found_m_s.x - expected_m_s).abs() <= 3e-7 * expected_m_s, "{found_m_s}, {expected_m_s}");
    let flipped = Model { rotor_drag_n_s_m: model.rotor_drag_n_s_m.map(|drag| -drag), ..model };
    assert!(glide(flipped).x > 3.0);
}

#[test]
fn rotors_hover_at_the_published_speeds_and_the_vehicle_stays() {
    for (name, expected_rpm) in [
        ("crazyflie", 19_214.06),
        ("crazyflie-brushless", 15_897.14),
        ("hummingbird", 453.147_787 * 30.0 / std::f64::consts::PI),
    ] {
        let (scenario, fleet) = alone(model(name), 500.0);
        assert!((fleet.dynamics.hover_rpm() - expected_rpm).abs() <= 0.01, "{}", fleet.dynamics.hover_rpm());
        let mut plant = rapier::quadrotors(&scenario, fleet);
        let state = fly(plant.as_mut(), (10.0, 1.0 / 500.0), &mut |_, _| Vector3::zeros());
        assert!(state.position_m.norm() <= 1e-9, "{name}: {}", state.position_m);
    }
}

/// Returns height \[m\] and speed \[m/s\] of a climb in a vacuum, a time after a new speed of all rotors was commanded.
fn climbed(model: &Model, from_rpm: f64, to_rpm: f64, time_s: f64) -> (f64, f64) {
    let (a, b) = (model.thrust_n_per_rpm2, model.thrust_n_per_rpm);
    let (lag_s, off) = (model.lag_up_s, from_rpm - to_rpm);
    // First and second integrals of exp(-t/lag).
    let once = |lag_s: f64| lag_s * (1.0 - (-time_s / lag_s).exp());
    let twice = |lag_s: f64| lag_s * (time_s - once(lag_s));
    let held = to_rpm * (a * to_rpm + b);
    let (linear, square) = (off * (2.0 * a * to_rpm + b), a * off * off);
    let of = |one: f64, linear_s: f64, square_s: f64| {
        (4.0 / model.mass_kg) * (held * one + linear * linear_s + square * square_s) - GRAVITY_M_S2 * one
    };
    (of(0.5 * time_s * time_s, twice(lag_s), twice(0.5 * lag_s)), of(time_s, once(lag_s), once(0.5 * lag_s)))
}

#[test]
fn a_step_of_the_rotor_command_lags_and_gives_the_computed_climb() {
    let model = without_drag("crazyflie");
    let (_, fleet) = alone(model.clone(), 500.0);
    let hover_rpm = fleet.dynamics.hover_rpm();
    let asked = Vector4::repeat(1.05 * hover_rpm);
    let (height_m, speed_m_s) = climbed(&model, hover_rpm, 1.05 * hover_rpm, 0.2);
    let errors = [500.0, 1000.0, 2000.0].map(|hz| {
        let state = open_loop(model.clone(), &|_| {}, asked, (0.2, 1.0 / hz));
        let lagging_rpm = hover_rpm * (1.05 - 0.05 * (-0.2 / model.lag_up_s).exp());
        assert!((state.rotors_rpm[0] - lagging_rpm).abs() <= 1e-8, "{}", state.rotors_rpm);
        (state.position_m.z - height_m).abs().max((state.velocity_m_s.z - speed_m_s).abs())
    });
    assert!(errors[0] <= 6e-6 && orders(&errors).iter().all(|order| (1.95..2.05).contains(order)), "{errors:?}");
    let prompt = Model { lag_up_s: 1e-9, lag_down_s: 1e-9, ..model };
    let state = open_loop(prompt, &|_| {}, asked, (0.2, 1.0 / 500.0));
    assert!(state.velocity_m_s.z > 1.3 * speed_m_s, "{} without lag, {speed_m_s} with it", state.velocity_m_s.z);
}

#[test]
fn rotors_that_turn_one_way_faster_turn_the_vehicle_the_other_way() {
    let model = without_drag("crazyflie");
    let curve = RotorCurve::of(&model);
    let share_n = 0.25 * model.weight_n();
    let [ccw_rpm, cw_rpm] = [1.1, 0.9].map(|share| curve.speed_rpm(share * share_n));
    let rotors_rpm = Vector4::new(ccw_rpm, cw_rpm, ccw_rpm, cw_rpm);
    let state = open_loop(model.clone(), &|state| state.rotors_rpm = rotors_rpm, rotors_rpm, (0.5, 1.0 / 500.0));
    // Half of the rotors push a tenth more, the others a tenth less: 0.4 of a share.
    let expected_rad_s = -0.5 * 0.4 * share_n * model.torque_per_thrust_m / model.inertia_kg_m2[2];
    assert!((state.rates_rad_s.z - expected_rad_s).abs() <= 1e-10, "{}, {expected_rad_s}", state.rates_rad_s.z);
    assert!(state.position_m.norm() <= ROUNDING);
}

/// Returns the tangent of the tilt that holds a vehicle in a wind: `D_x s w/(m g)` with the rotor speed s relative to
/// hover.
fn tilt_in_wind(model: &Model, hover_rpm: f64, wind_m_s: f64) -> f64 {
    let curve = RotorCurve::of(model);
    let [along, _, axial] = model.rotor_drag_n_s_m;
    let mut share = 1.0;
    for _ in 0..100 {
        let tilt = (along * share * wind_m_s / model.weight_n()).atan();
        let thrust_n = model.weight_n() * tilt.cos() + axial * share * wind_m_s * tilt.sin();
        share = curve.speed_rpm(0.25 * thrust_n) / hover_rpm;
    }
    along * share * wind_m_s / model.weight_n()
}

#[test]
fn the_tangent_of_the_tilt_in_a_steady_wind_is_drag_over_weight() {
    for (wind_m_s, axial) in [(2.0, 1.0), (6.0, 1.0), (6.0, 0.0), (6.0, 4.0)] {
        let mut model = model("crazyflie");
        model.rotor_drag_n_s_m[2] *= axial;
        let (scenario, mut fleet) = alone(model.clone(), 500.0);
        fleet.wind_m_s[(0, 0)] = wind_m_s;
        let expected = tilt_in_wind(&model, fleet.dynamics.hover_rpm(), wind_m_s);
        let hold = &mut |_, state: &State| -state.position_m - 2.0 * state.velocity_m_s;
        let mut plant = rapier::quadrotors(&scenario, fleet.clone());
        let state = fly(plant.as_mut(), (100.0, 1.0 / 500.0), hold);
        let up = state.attitude * Vector3::z();
        assert!((-up.x / up.z - expected).abs() <= 1e-9, "{} at {wind_m_s} m/s, {expected}", -up.x / up.z);
        assert!(state.velocity_m_s.norm() <= 1e-9 && up.y.abs() <= ROUNDING, "{}", state.velocity_m_s);
        let [along, across, axial] = model.rotor_drag_n_s_m;
        let (scenario, mut flipped) = alone(Model { rotor_drag_n_s_m: [-along, -across, axial], ..model }, 500.0);
        flipped.wind_m_s[(0, 0)] = wind_m_s;
        let mut plant = rapier::quadrotors(&scenario, flipped);
        let up = fly(plant.as_mut(), (20.0, 1.0 / 500.0), hold).attitude * Vector3::z();
        assert!(-up.x / up.z < 0.0, "a drag of the wrong sign tilts it with the wind");
    }
}
