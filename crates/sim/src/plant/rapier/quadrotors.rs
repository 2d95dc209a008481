//! Quadrotors: rotating rigid bodies lifted by rotors.

use std::time::Duration;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rapier3d::prelude::{MassProperties, PhysicsWorld, Real, RigidBody, RigidBodyBuilder, Rotation, Vector};

use super::mover::{Body, Mover};
use super::world::{from_engine, hull, keep_out, to_engine};
use crate::plant::{FreeSteps, HullContact, Plant, PlantError, Quadrotors, StepPath};
use crate::scenario::Scenario;
use crate::sim::Stopwatch;
use crate::vehicle::{Drift, Fleet};
use tautline_core::record::Channel;
use tautline_core::swarm::{Pair, Rows, Swarm, mean_row, row, set_row};

/// Friction of rotating hulls, which tumble after a collision.
const HULL_FRICTION: Real = 0.5;

/// Swarm of quadrotors, one body per vehicle, in vehicle order. The engine moves and turns the bodies and detects
/// collisions; the fleet computes forces, torques and the velocities around the engine's step.
#[derive(Clone)]
pub(super) struct Fliers {
    mover: Mover<RotatingBody>,
    fleet: Fleet,
    /// First half of the current step.
    drifts: Vec<Drift>,
    origin_m: Vector3<f64>,
    /// Wall-clock time spent outside the engine.
    airframe: Duration,
    stopwatch: Stopwatch,
}

/// State of a body of the engine.
#[derive(Clone)]
struct RotatingBody {
    /// Position from the engine's origin \[m\].
    position: Vector,
    rotation: Rotation,
    /// Velocity \[m/s\].
    linear: Vector,
    /// Angular velocity \[rad/s\].
    angular: Vector,
}

impl Body for RotatingBody {
    fn write(&self, body: &mut RigidBody) {
        if (body.translation(), *body.rotation()) != (self.position, self.rotation) {
            body.set_translation(self.position, true);
            body.set_rotation(self.rotation, true);
        }
        body.set_linvel(self.linear, true);
        body.set_angvel(self.angular, true);
    }

    fn read(&mut self, body: &RigidBody) {
        (self.position, self.rotation) = (body.translation(), *body.rotation());
        (self.linear, self.angular) = (body.linvel(), body.angvel());
    }

    fn drift_freely(&mut self, dt_s: f64) -> Option<Vector> {
        let half_turn = self.angular * (dt_s * 0.5);
        let turned = Rotation::from_xyzw(half_turn.x, half_turn.y, half_turn.z, 1.0) * self.rotation;
        self.rotation = turned.normalize();
        let moved = self.linear * dt_s;
        self.position += moved;
        (self.position.is_finite() && self.rotation.is_finite()).then_some(moved)
    }

    fn is_same(&self, other: &Self) -> bool {
        let bits = |body: &Self| {
            let vectors = [body.position, body.linear, body.angular];
            (vectors.map(|vector| vector.to_array().map(f64::to_bits)), body.rotation.to_array().map(f64::to_bits))
        };
        bits(self) == bits(other)
    }
}

impl Fliers {
    pub(super) fn new(scenario: &Scenario, mut fleet: Fleet) -> Self {
        fleet.compute_wrenches();
        let (origin_m, count) = (mean_row(&scenario.start.positions_m), scenario.count());
        let model = fleet.dynamics.model();
        let mass = MassProperties::new(Vector::ZERO, model.mass_kg, to_engine(fleet.dynamics.inertia_kg_m2()));
        let (hull_radius_m, keep_out_m) = (model.hull_radius_m, scenario.metric().shortest_m(scenario.delta_m));
        let starts = fleet.states.iter().map(|state| RotatingBody {
            position: to_engine(state.position_m - origin_m),
            rotation: rotation(&state.attitude),
            linear: to_engine(state.velocity_m_s),
            angular: Vector::ZERO,
        });
        let starts: Vec<_> = starts.collect();
        let bodies = starts.clone();
        let insert = move |i: usize, world: &mut PhysicsWorld| {
            let body = RigidBodyBuilder::dynamic()
                .translation(starts[i].position)
                .linvel(starts[i].linear)
                .additional_mass_properties(mass)
                .gyroscopic_forces_enabled(false)
                .allow_fast_rotation(true)
                .can_sleep(false);
            let handle = world.bodies.insert(body);
            world.bodies[handle].set_rotation(starts[i].rotation, true);
            let hull = hull(hull_radius_m, i).density(0.0).friction(HULL_FRICTION);
            for collider in [hull, keep_out(keep_out_m, i)] {
                world.colliders.insert_with_parent(collider, handle, &mut world.bodies);
            }
            world.bodies[handle].recompute_mass_properties_from_colliders(&world.colliders);
        };
        Self {
            mover: Mover::new(scenario, bodies, origin_m, insert),
            fleet,
            drifts: Vec::with_capacity(count),
            origin_m,
            airframe: Duration::ZERO,
            stopwatch: Stopwatch { is_on: false },
        }
    }

    /// Applies half of the kick and sets the velocities for the drift.
    fn begin(&mut self, dt_s: f64) {
        self.drifts.clear();
        let Mover { bodies, drift_m_s, began_m, .. } = &mut self.mover;
        for (i, body) in bodies.iter_mut().enumerate() {
            let drift = self.fleet.dynamics.begin_step(&self.fleet.states[i], self.fleet.wrench(i), dt_s);
            set_row(drift_m_s, i, drift.velocity_m_s);
            set_row(began_m, i, from_engine(body.position));
            body.linear = to_engine(drift.velocity_m_s);
            body.angular = to_engine(drift.turn_rad_s);
            self.drifts.push(drift);
        }
    }

    /// Takes the poses after the drift and applies the other half of the kick.
    fn end(&mut self, dt_s: f64) {
        let lag = self.fleet.dynamics.rotor_lag(dt_s);
        for (i, (body, drift)) in self.mover.bodies.iter().zip(&mut self.drifts).enumerate() {
            let commanded_rpm = self.fleet.commanded_rpm(i);
            let state = &mut self.fleet.states[i];
            state.position_m = self.origin_m + from_engine(body.position);
            state.attitude = attitude(body.rotation);
            state.rotors_rpm = lag.after(state.rotors_rpm, commanded_rpm);
            let by_m_s = from_engine(body.linear - to_engine(drift.velocity_m_s));
            let by_rad_s = from_engine(body.angular - to_engine(drift.turn_rad_s));
            if by_m_s != Vector3::zeros() || by_rad_s != Vector3::zeros() {
                self.fleet.dynamics.add_impulse(drift, &state.attitude, by_m_s, by_rad_s);
            }
            self.fleet.dynamics.predict(state, drift);
        }
        self.fleet.advance_wind(dt_s);
        // Also begins the next step: forces differ from those of the completed velocities by the square of the step.
        self.fleet.compute_wrenches();
        self.fleet.complete(&self.drifts, dt_s);
    }
}

#[cfg(test)]
impl Fliers {
    pub(super) fn was_free(&self) -> bool {
        self.mover.was_free()
    }
}

impl Quadrotors for Fliers {
    fn fleet(&self) -> &Fleet {
        &self.fleet
    }
}

impl Plant for Fliers {
    fn count(&self) -> usize {
        self.mover.bodies.len()
    }

    fn advance(&mut self, dt_s: f64, predicted: &mut Swarm, _path: &mut StepPath) -> Result<(), PlantError> {
        let began = self.stopwatch.start();
        self.fleet.save_state();
        self.fleet.run_attitude();
        self.begin(dt_s);
        self.airframe += began.elapsed();
        self.mover.drift(dt_s)?;
        let began = self.stopwatch.start();
        self.end(dt_s);
        self.fleet.advance_clock(dt_s);
        self.fleet.observe(predicted);
        self.airframe += began.elapsed();
        Ok(())
    }

    /// The state is complete: a command changes forces only as fast as rotors follow it.
    fn apply(&mut self, command: &Rows, _state: &mut Swarm) {
        self.fleet.command(command);
    }

    fn observe(&self, swarm: &mut Swarm) {
        self.fleet.observe(swarm);
    }

    fn restore(&mut self, _swarm: &Swarm) {
        self.fleet.restore_state();
        let Mover { bodies, began_m, .. } = &mut self.mover;
        for (i, body) in bodies.iter_mut().enumerate() {
            body.position = to_engine(row(began_m, i));
            body.rotation = rotation(&self.fleet.states[i].attitude);
        }
        self.mover.proximity.forget();
    }

    fn allow_free_steps(&mut self, free: FreeSteps) {
        self.mover.proximity.allow_free_steps(free);
    }

    fn engine_steps(&self) -> Option<u64> {
        Some(self.mover.proximity.engine_steps())
    }

    fn keep_out_contacts(&self, pairs: &mut Vec<Pair>) {
        self.mover.keep_out_contacts(pairs);
    }

    fn hull_contacts(&self, contacts: &mut Vec<HullContact>) {
        self.mover.hull_contacts(contacts);
    }

    fn airframe_time(&self) -> Duration {
        self.airframe
    }

    fn measure_time(&mut self, is_on: bool) {
        self.stopwatch.is_on = is_on;
    }

    fn channels(&self) -> Vec<Channel> {
        self.fleet.channels()
    }

    fn write_channels(&self, channels: &mut [Channel]) {
        self.fleet.write_channels(channels);
    }

    fn reseed(&mut self, seed: u64) {
        self.fleet.reseed(seed);
    }
}

/// Converts an attitude of the engine without normalization, so that it converts back to the same numbers.
fn attitude(rotation: Rotation) -> UnitQuaternion<f64> {
    let [x, y, z, w] = rotation.to_array();
    UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z))
}

fn rotation(attitude: &UnitQuaternion<f64>) -> Rotation {
    let q = attitude.quaternion();
    Rotation::from_xyzw(q.i, q.j, q.k, q.w)
}
