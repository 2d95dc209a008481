//! Torque-free rotation: symmetric and triaxial tops, in the plant and in the bare engine.

use nalgebra::Vector3;
use rapier3d::prelude::{MassProperties, PhysicsWorld, RigidBodyBuilder, Vector};
use tautline_sim::vehicle::{Model, State};

use super::{open_loop, orders, without_drag};

/// Initial rates \[rad/s\].
const SPIN_RAD_S: Vector3<f64> = Vector3::new(5.0, 0.0, 20.0);

/// Spins a body in a vacuum for a time \[s\].
fn spun(model: Model, rates_rad_s: Vector3<f64>, duration_s: f64, hz: f64) -> State {
    let from = |state: &mut State| {
        state.rotors_rpm.fill(0.0);
        state.rates_rad_s = rates_rad_s;
    };
    open_loop(model, &from, nalgebra::Vector4::zeros(), (duration_s, 1.0 / hz))
}

/// Returns the rates of a symmetric top, which rotate about its axis at `(Jz - Jx)/Jx W_z`.
fn symmetric(model: &Model, time_s: f64) -> Vector3<f64> {
    let [jx, _, jz] = model.inertia_kg_m2;
    let angle = (jz - jx) / jx * SPIN_RAD_S.z * time_s;
    Vector3::new(SPIN_RAD_S.x * angle.cos(), SPIN_RAD_S.x * angle.sin(), SPIN_RAD_S.z)
}

#[test]
fn a_symmetric_top_wobbles_at_its_rate_to_second_order() {
    let model = without_drag("crazyflie");
    let expected = symmetric(&model, 1.0);
    let errors = [500.0, 1000.0, 2000.0, 4000.0]
        .map(|hz| (spun(model.clone(), SPIN_RAD_S, 1.0, hz).rates_rad_s - expected).norm());
    assert!(errors[0] <= 0.01, "{errors:?} rad/s");
    assert!(orders(&errors).iter().all(|order| (1.95..2.05).contains(order)), "{errors:?}");
    // A body with equal moments of inertia has no gyroscopic term and does not wobble.
    let ball = Model { inertia_kg_m2: [16.8e-6; 3], ..model };
    assert!((spun(ball, SPIN_RAD_S, 1.0, 500.0).rates_rad_s - SPIN_RAD_S).norm() <= 1e-9);
    assert!((expected - SPIN_RAD_S).norm() > 1.0);
}

/// Returns the rates of the same body after a second in the bare engine, with its own gyroscopic term.
fn spun_by_the_engine(model: &Model, hz: u32) -> Vector3<f64> {
    let mut world = PhysicsWorld { gravity: Vector::ZERO, ..PhysicsWorld::default() };
    world.integration_parameters.num_solver_iterations = 1;
    world.integration_parameters.dt = 1.0 / f64::from(hz);
    let [x, y, z] = model.inertia_kg_m2;
    let mass = MassProperties::new(Vector::ZERO, model.mass_kg, Vector::new(x, y, z));
    let spin = Vector::new(SPIN_RAD_S.x, SPIN_RAD_S.y, SPIN_RAD_S.z);
    let body = RigidBodyBuilder::dynamic().additional_mass_properties(mass).angvel(spin).can_sleep(false);
    let handle = world.bodies.insert(body);
    (0..hz).for_each(|_| world.step());
    let body = &world.bodies[handle];
    let rates = body.rotation().inverse() * body.angvel();
    Vector3::new(rates.x, rates.y, rates.z)
}

#[test]
fn the_engines_own_gyroscopic_term_is_of_first_order() {
    let model = without_drag("crazyflie");
    let expected = symmetric(&model, 1.0);
    let errors = [2000, 4000, 8000].map(|hz| (spun_by_the_engine(&model, hz) - expected).norm());
    assert!(orders(&errors).iter().all(|order| (0.8..1.2).contains(order)), "{errors:?}");
    let ours = (spun(model.clone(), SPIN_RAD_S, 1.0, 2000.0).rates_rad_s - expected).norm();
    assert!(errors[0] > 100.0 * ours, "{} and {ours} rad/s", errors[0]);
}

/// Returns Jacobi's sn, cn and dn of an argument and a parameter m = k^2, by the arithmetic-geometric mean.
fn jacobi(u: f64, m: f64) -> (f64, f64, f64) {
    let (mut a, mut b) = (vec![1.0], (1.0 - m).sqrt());
    let mut c = vec![m.sqrt()];
    while c[c.len() - 1].abs() > 1e-16 {
        let last = a[a.len() - 1];
        c.push(0.5 * (last - b));
        a.push(0.5 * (last + b));
        b = (last * b).sqrt();
    }
    let n = a.len() - 1;
    let mut phi = (1_u64 << n) as f64 * a[n] * u;
    for k in (1..=n).rev() {
        phi = 0.5 * (phi + (c[k] / a[k] * phi.sin()).asin());
    }
    (phi.sin(), phi.cos(), (1.0 - m * phi.sin().powi(2)).sqrt())
}

#[test]
fn jacobis_functions_are_those_of_the_tables() {
    // Abramowitz and Stegun, 16.1: sn(K) = 1; circular functions for m = 0 and hyperbolic ones near 1.
    let (sn, cn, _) = jacobi(1.854_074_677_301_372, 0.5);
    assert!((sn - 1.0).abs() <= 1e-12 && cn.abs() <= 1e-7, "{sn}, {cn}");
    let (sn, cn, dn) = jacobi(0.7, 0.0);
    assert!((sn - 0.7_f64.sin()).abs() + (cn - 0.7_f64.cos()).abs() + (dn - 1.0).abs() <= 1e-15);
}

/// Returns the rates of a triaxial top with Jx < Jy < Jz and `W_y = 0` at the start, rotating mostly about z.
fn triaxial(model: &Model, begin: Vector3<f64>, time_s: f64) -> Vector3<f64> {
    let [x, y, z] = model.inertia_kg_m2;
    let energy = x * begin.x.powi(2) + z * begin.z.powi(2);
    let momentum = (x * begin.x).powi(2) + (z * begin.z).powi(2);
    let (over, under) = (energy * z - momentum, momentum - energy * x);
    let rate = ((z - y) * under / (x * y * z)).sqrt();
    let (sn, cn, dn) = jacobi(rate * time_s, (y - x) * over / ((z - y) * under));
    Vector3::new(begin.x * cn, (over / (y * (z - y))).sqrt() * sn, begin.z * dn)
}

#[test]
fn a_triaxial_top_follows_jacobis_functions_and_keeps_momentum_and_energy() {
    let model = without_drag("crazyflie-brushless");
    let begin = Vector3::new(8.0, 0.0, 12.0);
    let inertia = Vector3::from(model.inertia_kg_m2);
    let measures = |rates: Vector3<f64>| {
        let momentum = inertia.component_mul(&rates);
        (momentum.norm(), 0.5 * momentum.dot(&rates))
    };
    let (momentum, energy) = measures(begin);
    let mut energies = Vec::new();
    let errors = [1000.0, 2000.0, 4000.0].map(|hz| {
        let rates = spun(model.clone(), begin, 2.0, hz).rates_rad_s;
        let (found_momentum, found_energy) = measures(rates);
        assert!((found_momentum / momentum - 1.0).abs() <= 1e-12, "|L| is kept: {found_momentum}, {momentum}");
        energies.push((found_energy / energy - 1.0).abs());
        (rates - triaxial(&model, begin, 2.0)).norm()
    });
    assert!(errors[0] <= 5e-4 && orders(&errors).iter().all(|order| (1.9..2.1).contains(order)), "{errors:?}");
    assert!(energies[0] <= 1e-4 && energies[2] < energies[0] / 10.0, "energy is off by {energies:?}");
}
