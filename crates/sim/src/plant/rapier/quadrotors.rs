//! Quadrotors: rotating rigid bodies lifted by rotors.

use std::sync::Arc;
use std::time::Duration;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rapier3d::prelude::{MassProperties, Real, RigidBody, RigidBodyBuilder, Rotation, Vector};

use super::proximity::{Maker, Proximity};
use super::world::{
    Engine, empty_world, first_in_contact, first_not_finite, from_engine, hull, hull_contacts, keep_out,
    keep_out_contacts, obstacle, to_engine,
};
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
pub(super) struct Fliers {
    engine: Engine,
    /// Poses and velocities, as the engine has them. The bodies of the engine follow when it steps.
    bodies: Vec<Body>,
    proximity: Proximity,
    /// Whether the last step was free: the engine did not step.
    was_free: bool,
    /// Bodies from which the engine repeats a free step, then those after the free step.
    compared: Vec<Body>,
    fleet: Fleet,
    /// First half of the current step.
    drifts: Vec<Drift>,
    /// Velocities of the step and positions at its beginning, from the engine's origin, for collisions.
    drift_m_s: Rows,
    began_m: Rows,
    origin_m: Vector3<f64>,
    /// Wall-clock time spent outside the engine.
    airframe: Duration,
    stopwatch: Stopwatch,
}

/// State of a body of the engine.
#[derive(Clone, Copy)]
struct Body {
    /// Position from the engine's origin \[m\].
    position: Vector,
    rotation: Rotation,
    /// Velocity \[m/s\].
    linear: Vector,
    /// Angular velocity \[rad/s\].
    angular: Vector,
}

impl Body {
    fn of(body: &RigidBody) -> Self {
        let (position, rotation) = (body.translation(), *body.rotation());
        Self { position, rotation, linear: body.linvel(), angular: body.angvel() }
    }

    /// Moves the body without contacts, with the operations of the engine. Returns the way.
    fn drift_freely(&mut self, dt_s: f64) -> Vector {
        let half_turn = self.angular * (dt_s * 0.5);
        let turned = Rotation::from_xyzw(half_turn.x, half_turn.y, half_turn.z, 1.0) * self.rotation;
        self.rotation = turned.normalize();
        let moved = self.linear * dt_s;
        self.position += moved;
        moved
    }

    fn bits(&self) -> ([[u64; 3]; 3], [u64; 4]) {
        let vectors = [self.position, self.linear, self.angular];
        (vectors.map(|vector| vector.to_array().map(f64::to_bits)), self.rotation.to_array().map(f64::to_bits))
    }
}

impl Fliers {
    pub(super) fn new(scenario: &Scenario, mut fleet: Fleet) -> Self {
        fleet.compute_wrenches();
        let (origin_m, count) = (mean_row(&scenario.start.positions_m), scenario.count());
        let model = fleet.dynamics.model();
        let mass = MassProperties::new(Vector::ZERO, model.mass_kg, to_engine(fleet.dynamics.inertia_kg_m2()));
        let (hull_radius_m, keep_out_m) = (model.hull_radius_m, scenario.metric().shortest_m(scenario.delta_m));
        let starts = fleet.states.iter().map(|state| Body {
            position: to_engine(state.position_m - origin_m),
            rotation: rotation(&state.attitude),
            linear: to_engine(state.velocity_m_s),
            angular: Vector::ZERO,
        });
        let starts: Vec<_> = starts.collect();
        let bodies = starts.clone();
        let obstacles: Arc<[_]> = scenario.obstacles.iter().map(|solid| obstacle(solid, origin_m)).collect();
        let solids = Arc::clone(&obstacles);
        let create = move || {
            let mut world = empty_world();
            for (i, start) in starts.iter().enumerate() {
                let body = RigidBodyBuilder::dynamic()
                    .translation(start.position)
                    .linvel(start.linear)
                    .additional_mass_properties(mass)
                    .gyroscopic_forces_enabled(false)
                    .allow_fast_rotation(true)
                    .can_sleep(false);
                let handle = world.bodies.insert(body);
                world.bodies[handle].set_rotation(start.rotation, true);
                let hull = hull(hull_radius_m, i).density(0.0).friction(HULL_FRICTION);
                for collider in [hull, keep_out(keep_out_m, i)] {
                    world.colliders.insert_with_parent(collider, handle, &mut world.bodies);
                }
                world.bodies[handle].recompute_mass_properties_from_colliders(&world.colliders);
            }
            for obstacle in &*solids {
                world.colliders.insert(obstacle.clone());
            }
            world
        };
        let (drift_m_s, began_m) = (Rows::zeros(count), Rows::zeros(count));
        Self {
            engine: Engine::new(create),
            bodies,
            proximity: Proximity::new(scenario, obstacles),
            was_free: false,
            compared: Vec::new(),
            fleet,
            drifts: Vec::with_capacity(count),
            drift_m_s,
            began_m,
            origin_m,
            airframe: Duration::ZERO,
            stopwatch: Stopwatch { is_on: false },
        }
    }

    /// Applies half of the kick and sets the velocities for the drift.
    fn begin(&mut self, dt_s: f64) {
        self.drifts.clear();
        for (i, body) in self.bodies.iter_mut().enumerate() {
            let drift = self.fleet.dynamics.begin_step(&self.fleet.states[i], self.fleet.wrench(i), dt_s);
            set_row(&mut self.drift_m_s, i, drift.velocity_m_s);
            set_row(&mut self.began_m, i, from_engine(body.position));
            body.linear = to_engine(drift.velocity_m_s);
            body.angular = to_engine(drift.turn_rad_s);
            self.drifts.push(drift);
        }
    }

    /// Moves and turns the bodies without contacts.
    fn drift_freely(&mut self, dt_s: f64) -> Result<(), PlantError> {
        let mut longest = 0.0_f64;
        for (vehicle, body) in self.bodies.iter_mut().enumerate() {
            let moved = body.drift_freely(dt_s);
            if !(body.position.is_finite() && body.rotation.is_finite()) {
                return Err(PlantError::NotFinite { vehicle });
            }
            longest = longest.max(moved.length_squared());
        }
        self.proximity.note_move(longest.sqrt());
        Ok(())
    }

    /// Moves and turns the bodies with the engine.
    fn drift_in_engine(&mut self, dt_s: f64) -> Result<(), PlantError> {
        let Self { bodies, .. } = self;
        let world = self.engine.step(dt_s, |i, body| {
            let state = &bodies[i];
            if (body.translation(), *body.rotation()) != (state.position, state.rotation) {
                body.set_translation(state.position, true);
                body.set_rotation(state.rotation, true);
            }
            body.set_linvel(state.linear, true);
            body.set_angvel(state.angular, true);
        });
        if let Some(vehicle) = first_not_finite(world) {
            return Err(PlantError::NotFinite { vehicle });
        }
        for ((_, body), state) in world.bodies.iter().zip(bodies) {
            *state = Body::of(body);
        }
        Ok(())
    }

    /// Moves and turns the bodies without contacts, and again with the engine. The results must be the same.
    fn drift_in_both(&mut self, dt_s: f64) -> Result<(), PlantError> {
        self.compared.clone_from(&self.bodies);
        self.drift_freely(dt_s)?;
        std::mem::swap(&mut self.bodies, &mut self.compared);
        self.drift_in_engine(dt_s)?;
        let mut both = self.bodies.iter().zip(&self.compared);
        if let Some(vehicle) = both.position(|(engine, free)| engine.bits() != free.bits()) {
            return Err(PlantError::EngineDiffers { vehicle });
        }
        if let Some(vehicle) = self.engine.world().and_then(first_in_contact) {
            return Err(PlantError::EngineDiffers { vehicle });
        }
        Ok(())
    }

    /// Takes the poses after the drift and applies the other half of the kick.
    fn end(&mut self, dt_s: f64) {
        let lag = self.fleet.dynamics.rotor_lag(dt_s);
        for (i, (body, drift)) in self.bodies.iter().zip(&mut self.drifts).enumerate() {
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
        self.was_free
    }
}

impl Clone for Fliers {
    fn clone(&self) -> Self {
        Self {
            engine: self.engine.clone(),
            bodies: self.bodies.clone(),
            proximity: self.proximity.clone(),
            was_free: self.was_free,
            compared: Vec::new(),
            fleet: self.fleet.clone(),
            drifts: self.drifts.clone(),
            drift_m_s: self.drift_m_s.clone(),
            began_m: self.began_m.clone(),
            origin_m: self.origin_m,
            airframe: self.airframe,
            stopwatch: self.stopwatch,
        }
    }
}

impl Quadrotors for Fliers {
    fn fleet(&self) -> &Fleet {
        &self.fleet
    }
}

impl Plant for Fliers {
    fn count(&self) -> usize {
        self.bodies.len()
    }

    fn advance(&mut self, dt_s: f64, predicted: &mut Swarm, _path: &mut StepPath) -> Result<(), PlantError> {
        let began = self.stopwatch.start();
        self.fleet.save_state();
        self.fleet.run_attitude();
        self.begin(dt_s);
        self.airframe += began.elapsed();
        let maker = self.proximity.begin_step(&self.began_m);
        self.was_free = maker == Maker::FreeStep;
        match maker {
            Maker::Engine => self.drift_in_engine(dt_s)?,
            Maker::FreeStep => {
                if self.proximity.trusts_free_steps() {
                    self.engine.discard();
                }
                self.drift_freely(dt_s)?;
            }
            Maker::Both => self.drift_in_both(dt_s)?,
        }
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
        for (i, body) in self.bodies.iter_mut().enumerate() {
            body.position = to_engine(row(&self.began_m, i));
            body.rotation = rotation(&self.fleet.states[i].attitude);
        }
        self.proximity.forget();
    }

    fn allow_free_steps(&mut self, free: FreeSteps) {
        self.proximity.allow_free_steps(free);
    }

    fn engine_steps(&self) -> Option<u64> {
        Some(self.proximity.engine_steps())
    }

    fn keep_out_contacts(&self, pairs: &mut Vec<Pair>) {
        if self.was_free {
            pairs.extend_from_slice(self.proximity.overlaps());
        } else if let Some(world) = self.engine.world() {
            keep_out_contacts(world, pairs);
        }
    }

    fn hull_contacts(&self, contacts: &mut Vec<HullContact>) {
        if let Some(world) = self.engine.world().filter(|_| !self.was_free) {
            hull_contacts(world, &self.began_m, &self.drift_m_s, contacts);
        }
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
