//! Points: rigid bodies without rotation that execute commanded accelerations.

use nalgebra::Vector3;
use rapier3d::prelude::{
    ColliderSet, LockedAxes, PhysicsWorld, RigidBody, RigidBodyBuilder, RigidBodyHandle, RigidBodySet, Vector,
};

use super::mover::{Body, Mover};
use super::world::{from_engine, hull, keep_out, to_engine};
use crate::plant::{Air, FreeSteps, HullContact, Plant, PlantError, StepPath};
use crate::scenario::{Scenario, Space};
use tautline_core::record::Channel;
use tautline_core::swarm::{Pair, Rows, Swarm, mean_row, row, set_row};

/// Swarm of rigid bodies, one per vehicle, in vehicle order.
#[derive(Clone)]
pub(super) struct Bodies {
    mover: Mover<Point>,
    /// Accelerations held over the step, with the push of the wind at its beginning \[m/s^2\].
    held: Rows,
    /// Wind, if any.
    air: Option<Air>,
    /// Length of a drift whose second half kick is pending \[s\]; 0 for a completed state.
    drifted_s: f64,
    /// Origin of the engine's coordinates: the centre of the start. The engine then resolves the extent of the swarm
    /// wherever it starts.
    origin_m: Vector3<f64>,
    mass_kg: Vec<f64>,
    /// Velocity coefficient, drag of the air included.
    a22_per_s: f64,
    /// Whether z is locked.
    is_flat: bool,
}

/// State of a body without rotation.
#[derive(Clone)]
struct Point {
    /// Position from the engine's origin \[m\].
    position: Vector,
    /// Velocity, as the engine has it \[m/s\].
    velocity: Vector,
    /// Force over the step \[N\].
    force: Vector,
    /// Inverse mass along each axis, 0 along a locked one \[1/kg\].
    inverse_mass: Vector,
}

impl Body for Point {
    fn write(&self, body: &mut RigidBody) {
        if body.translation() != self.position {
            body.set_translation(self.position, true);
        }
        body.set_linvel(self.velocity, true);
        body.reset_forces(false);
        body.add_force(self.force, true);
    }

    fn read(&mut self, body: &RigidBody) {
        (self.position, self.velocity) = (body.translation(), body.linvel());
    }

    fn drift_freely(&mut self, dt_s: f64) -> Option<Vector> {
        self.velocity += (self.force + Vector::ZERO) * self.inverse_mass * dt_s;
        let moved = self.velocity * dt_s;
        self.position += moved;
        self.position.is_finite().then_some(moved)
    }

    fn is_same(&self, other: &Self) -> bool {
        bits(self.position) == bits(other.position) && bits(self.velocity) == bits(other.velocity)
    }
}

impl Bodies {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let origin_m = mean_row(&scenario.start.positions_m);
        let Swarm { positions_m, velocities_m_s } = &scenario.start;
        let vehicles = Vehicles {
            positions: (0..scenario.count()).map(|i| to_engine(row(positions_m, i) - origin_m)).collect(),
            velocities: (0..scenario.count()).map(|i| to_engine(row(velocities_m_s, i))).collect(),
            mass_kg: scenario.mass_kg.clone(),
            hull_radius_m: scenario.hull_radius_m.clone(),
            keep_out_m: scenario.metric().shortest_m(scenario.delta_m),
            space: scenario.space,
        };
        let point = |(i, inverse_mass)| Point {
            position: vehicles.positions[i],
            velocity: vehicles.velocities[i],
            force: Vector::ZERO,
            inverse_mass,
        };
        let points = vehicles.inverse_masses().into_iter().enumerate().map(point).collect();
        let insert = move |i: usize, world: &mut PhysicsWorld| {
            vehicles.insert(i, &mut world.bodies, &mut world.colliders);
        };
        Self {
            mover: Mover::new(scenario, points, origin_m, insert),
            held: Rows::zeros(scenario.count()),
            air: Air::of(scenario),
            drifted_s: 0.0,
            origin_m,
            mass_kg: scenario.mass_kg.clone(),
            a22_per_s: scenario.velocity_coefficient_per_s(),
            is_flat: scenario.space == Space::Plane,
        }
    }

    /// Returns the factor of a velocity over half a step of free motion: exp(a22 dt/2).
    fn half_decay(&self, dt_s: f64) -> f64 {
        libm::exp(0.5 * self.a22_per_s * dt_s)
    }

    /// Updates the held accelerations: the command plus the present push of the wind.
    fn hold(&mut self) {
        if let Some(air) = &self.air {
            air.write_held(&mut self.held);
        }
        if self.is_flat {
            self.held.column_mut(2).fill(0.0);
        }
    }

    /// Completes a pending drift with the held command, and sets the velocities from which the engine starts.
    fn begin_drift(&mut self, dt_s: f64) {
        let (completing, half_decay) = (self.half_decay(self.drifted_s), self.half_decay(dt_s));
        let Mover { bodies, drift_m_s, began_m, .. } = &mut self.mover;
        for (i, point) in bodies.iter_mut().enumerate() {
            let held_m_s2 = row(&self.held, i);
            let velocity_m_s = (from_engine(point.velocity) + 0.5 * self.drifted_s * held_m_s2) * completing;
            let drifting_m_s = velocity_m_s * half_decay + 0.5 * dt_s * held_m_s2;
            set_row(drift_m_s, i, drifting_m_s);
            set_row(began_m, i, from_engine(point.position));
            set(&mut point.velocity, to_engine(drifting_m_s - dt_s * held_m_s2));
            point.force = self.mass_kg[i] * to_engine(held_m_s2);
        }
    }

    /// Returns each velocity \[m/s\], completed by the second half kick of the held acceleration if that is pending.
    fn velocities_m_s(&self) -> impl Iterator<Item = Vector3<f64>> {
        let half_decay = self.half_decay(self.drifted_s);
        self.mover.bodies.iter().enumerate().map(move |(i, point)| {
            (from_engine(point.velocity) + 0.5 * self.drifted_s * row(&self.held, i)) * half_decay
        })
    }
}

#[cfg(test)]
impl Bodies {
    pub(super) fn proximity(&mut self) -> &mut super::proximity::Proximity {
        &mut self.mover.proximity
    }

    pub(super) fn was_free(&self) -> bool {
        self.mover.was_free()
    }

    /// Changes the last bit of the inverse mass of a vehicle in free steps.
    pub(super) fn change_inverse_mass(&mut self, vehicle: usize) {
        let inverse_mass = &mut self.mover.bodies[vehicle].inverse_mass;
        (inverse_mass.x, inverse_mass.y) = (inverse_mass.x.next_up(), inverse_mass.y.next_up());
    }
}

impl Plant for Bodies {
    fn count(&self) -> usize {
        self.mover.bodies.len()
    }

    fn advance(&mut self, dt_s: f64, predicted: &mut Swarm, _path: &mut StepPath) -> Result<(), PlantError> {
        self.begin_drift(dt_s);
        self.mover.drift(dt_s)?;
        self.drifted_s = dt_s;
        if let Some(air) = &mut self.air {
            air.advance(dt_s);
            self.hold();
        }
        self.observe(predicted);
        Ok(())
    }

    fn apply(&mut self, command: &Rows, state: &mut Swarm) {
        self.held.copy_from(command);
        if let Some(air) = &mut self.air {
            air.hold(command);
        }
        self.hold();
        if self.drifted_s > 0.0 {
            let half_decay = self.half_decay(self.drifted_s);
            for (i, point) in self.mover.bodies.iter_mut().enumerate() {
                let drift_m_s = from_engine(point.velocity);
                let completed = to_engine((drift_m_s + 0.5 * self.drifted_s * row(&self.held, i)) * half_decay);
                set_row(&mut state.velocities_m_s, i, from_engine(completed));
                set(&mut point.velocity, completed);
            }
            self.drifted_s = 0.0;
        }
    }

    fn observe(&self, swarm: &mut Swarm) {
        for (i, point) in self.mover.bodies.iter().enumerate() {
            set_row(&mut swarm.positions_m, i, self.origin_m + from_engine(point.position));
        }
        for (i, velocity_m_s) in self.velocities_m_s().enumerate() {
            set_row(&mut swarm.velocities_m_s, i, velocity_m_s);
        }
    }

    fn restore(&mut self, swarm: &Swarm) {
        for (i, point) in self.mover.bodies.iter_mut().enumerate() {
            set(&mut point.position, to_engine(row(&swarm.positions_m, i) - self.origin_m));
            set(&mut point.velocity, to_engine(row(&swarm.velocities_m_s, i)));
        }
        self.mover.proximity.forget();
        self.drifted_s = 0.0;
        if let Some(air) = &mut self.air {
            air.undo();
            self.hold();
        }
    }

    fn channels(&self) -> Vec<Channel> {
        self.air.iter().map(|_| Air::channel()).collect()
    }

    fn write_channels(&self, channels: &mut [Channel]) {
        self.air.iter().zip(channels).for_each(|(air, channel)| air.write_channel(channel));
    }

    fn reseed(&mut self, seed: u64) {
        if let Some(air) = &mut self.air {
            air.reseed(seed);
        }
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
}

fn bits(vector: Vector) -> [u64; 3] {
    vector.to_array().map(f64::to_bits)
}

/// Sets a vector unless it is equal, like the engine: then a zero keeps its sign.
fn set(vector: &mut Vector, to: Vector) {
    if *vector != to {
        *vector = to;
    }
}

/// Vehicles of an engine before its first step.
struct Vehicles {
    /// Positions from the engine's origin \[m\].
    positions: Vec<Vector>,
    /// Velocities \[m/s\].
    velocities: Vec<Vector>,
    mass_kg: Vec<f64>,
    hull_radius_m: Vec<f64>,
    /// Diameter of the keep-out balls \[m\].
    keep_out_m: f64,
    space: Space,
}

impl Vehicles {
    /// Inserts a vehicle.
    fn insert(&self, i: usize, bodies: &mut RigidBodySet, colliders: &mut ColliderSet) -> RigidBodyHandle {
        let locked = match self.space {
            Space::Plane => LockedAxes::ROTATION_LOCKED | LockedAxes::TRANSLATION_LOCKED_Z,
            Space::Volume => LockedAxes::ROTATION_LOCKED,
        };
        let body = RigidBodyBuilder::dynamic()
            .translation(self.positions[i])
            .linvel(self.velocities[i])
            .locked_axes(locked)
            .can_sleep(false);
        let handle = bodies.insert(body);
        let hull = hull(self.hull_radius_m[i], i).mass(self.mass_kg[i]);
        for collider in [hull, keep_out(self.keep_out_m, i)] {
            colliders.insert_with_parent(collider, handle, bodies);
        }
        bodies[handle].recompute_mass_properties_from_colliders(colliders);
        handle
    }

    /// Returns the inverse mass of each body along each axis, as the engine has it.
    fn inverse_masses(&self) -> Vec<Vector> {
        let mut found: Vec<Vector> = Vec::with_capacity(self.mass_kg.len());
        for (i, numbers) in self.mass_kg.iter().zip(&self.hull_radius_m).enumerate() {
            let is_same = |before: usize| numbers == (&self.mass_kg[before], &self.hull_radius_m[before]);
            found.push(if i > 0 && is_same(i - 1) {
                found[i - 1]
            } else {
                let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
                let handle = self.insert(i, &mut bodies, &mut colliders);
                bodies[handle].mass_properties().effective_inv_mass
            });
        }
        found
    }
}
