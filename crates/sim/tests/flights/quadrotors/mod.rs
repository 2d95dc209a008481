//! Quadrotors against closed forms, against continuous time, and in flight.

mod attitude;
mod closed_forms;
mod flights;
mod large_signals;
mod laws;
mod rotation;
mod scenarios;
mod shielded;

use nalgebra::{Vector3, Vector4};
use tautline_core::swarm::{Rows, Swarm, set_row};
use tautline_laws::formation::Formation;
use tautline_sim::plant::{Quadrotors, StepPath, rapier};
use tautline_sim::scenario::Scenario;
use tautline_sim::vehicle::{self, Airframe, Fleet, MODELS, Model, Quadrotor, State};

/// Returns a built-in model.
fn model(name: &str) -> Model {
    let (_, text) = MODELS.iter().find(|(known, _)| *known == name).expect("a built-in model");
    vehicle::read(name, text).expect("a right model")
}

/// Returns a model without drag.
fn without_drag(name: &str) -> Model {
    Model { rotor_drag_n_s_m: [0.0; 3], parasitic_drag_n_s2_m2: [0.0; 3], ..model(name) }
}

/// Returns one vehicle at the origin, in space, with a rate of the attitude loop.
fn alone(model: Model, attitude_hz: f64) -> (Scenario, Fleet) {
    let start = Swarm::at_rest(Rows::zeros(1));
    let mut scenario = Scenario::new("alone", start, Formation::line(1, 1.0), 1.0, 1.0);
    scenario.space = tautline_sim::scenario::Space::Volume;
    scenario.set_airframe(Airframe::Quadrotor(Box::new(Quadrotor {
        model,
        attitude_hz,
        ground_effect: false,
        downwash: false,
    })));
    let fleet = scenario.fleet().expect("a quadrotor");
    (scenario, fleet)
}

/// Advances a plant of quadrotors for a time \[s\] under accelerations \[m/s^2\] that depend on time and state, once
/// per step.
fn fly(
    plant: &mut dyn Quadrotors,
    (duration_s, dt_s): (f64, f64),
    law: &mut dyn FnMut(f64, &State) -> Vector3<f64>,
) -> State {
    let (mut swarm, mut command) = (Swarm::at_rest(Rows::zeros(1)), Rows::zeros(1));
    for step in (0_u32..).take_while(|&step| f64::from(step) * dt_s < duration_s - 0.5 * dt_s) {
        set_row(&mut command, 0, law(f64::from(step) * dt_s, &plant.fleet().states[0]));
        plant.apply(&command, &mut swarm);
        let mut path = StepPath::default();
        plant.advance(dt_s, &mut swarm, &mut path).expect("a finite motion");
    }
    plant.fleet().states[0]
}

/// Advances the engine with constant rotor speeds \[rpm\] and no attitude loop.
fn open_loop(
    model: Model,
    from: &dyn Fn(&mut State),
    commanded_rpm: Vector4<f64>,
    (duration_s, dt_s): (f64, f64),
) -> State {
    let (scenario, mut fleet) = alone(model, 500.0);
    from(&mut fleet.states[0]);
    fleet.open_loop(&[commanded_rpm]);
    let mut plant = rapier::quadrotors(&scenario, fleet);
    fly(plant.as_mut(), (duration_s, dt_s), &mut |_, _| Vector3::zeros())
}

/// Returns the observed orders of convergence for errors of steps, each half of the previous.
fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect()
}
