//! Points: rigid bodies without rotation that execute commanded accelerations.

use std::sync::Arc;

use nalgebra::Vector3;
use rapier3d::prelude::{ColliderSet, LockedAxes, RigidBodyBuilder, RigidBodyHandle, RigidBodySet, Vector};

use super::proximity::{Maker, Proximity};
use super::world::{
    Engine, empty_world, first_in_contact, first_not_finite, from_engine, hull, hull_contacts, keep_out,
    keep_out_contacts, obstacle, to_engine,
};
use crate::plant::{Air, FreeSteps, HullContact, Plant, PlantError, StepPath};
use crate::scenario::{Scenario, Space};
use tautline_core::record::Channel;
use tautline_core::swarm::{Pair, Rows, Swarm, mean_row, row, set_row};

/// Swarm of rigid bodies, one per vehicle, in vehicle order.
pub(super) struct Bodies {
    engine: Engine,
    /// Positions from the engine's origin \[m\]. The bodies of the engine follow when it steps.
    positions: Vec<Vector>,
    /// Velocities, as the engine has them \[m/s\].
    velocities: Vec<Vector>,
    /// Inverse mass along each axis, 0 along a locked one \[1/kg\].
    inverse_masses: Vec<Vector>,
    proximity: Proximity,
    /// Whether the last step was free: the engine did not step.
    was_free: bool,
    /// Positions and velocities from which the engine repeats a free step, then those of the free step.
    compared: (Vec<Vector>, Vec<Vector>),
    /// Accelerations held over the step, with the push of the wind at its beginning \[m/s^2\].
    held: Rows,
    /// Wind, if any.
    air: Option<Air>,
    /// Velocities of the last drift before contacts changed them \[m/s\].
    drift_m_s: Rows,
    /// Positions at the beginning of the last drift, from the engine's origin \[m\].
    began_m: Rows,
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
        let (positions, velocities) = (vehicles.positions.clone(), vehicles.velocities.clone());
        let inverse_masses = vehicles.inverse_masses();
        let obstacles: Arc<[_]> = scenario.obstacles.iter().map(|solid| obstacle(solid, origin_m)).collect();
        let solids = Arc::clone(&obstacles);
        let create = move || {
            let mut world = empty_world();
            for i in 0..vehicles.positions.len() {
                vehicles.insert(i, &mut world.bodies, &mut world.colliders);
            }
            for obstacle in &*solids {
                world.colliders.insert(obstacle.clone());
            }
            world
        };
        Self {
            engine: Engine::new(create),
            positions,
            velocities,
            inverse_masses,
            proximity: Proximity::new(scenario, obstacles),
            was_free: false,
            compared: (Vec::new(), Vec::new()),
            held: Rows::zeros(scenario.count()),
            air: Air::of(scenario),
            drift_m_s: Rows::zeros(scenario.count()),
            began_m: Rows::zeros(scenario.count()),
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
        for (i, velocity) in self.velocities.iter_mut().enumerate() {
            let held_m_s2 = row(&self.held, i);
            let velocity_m_s = (from_engine(*velocity) + 0.5 * self.drifted_s * held_m_s2) * completing;
            let drift_m_s = velocity_m_s * half_decay + 0.5 * dt_s * held_m_s2;
            set_row(&mut self.drift_m_s, i, drift_m_s);
            set_row(&mut self.began_m, i, from_engine(self.positions[i]));
            set(velocity, to_engine(drift_m_s - dt_s * held_m_s2));
        }
    }

    /// Moves bodies without contacts, with the operations of the engine.
    fn drift_freely(&mut self, dt_s: f64) -> Result<(), PlantError> {
        let mut longest = 0.0_f64;
        for (i, (position, velocity)) in self.positions.iter_mut().zip(&mut self.velocities).enumerate() {
            let force = self.mass_kg[i] * to_engine(row(&self.held, i)) + Vector::ZERO;
            *velocity += force * self.inverse_masses[i] * dt_s;
            let moved = *velocity * dt_s;
            *position += moved;
            if !position.is_finite() {
                return Err(PlantError::NotFinite { vehicle: i });
            }
            longest = longest.max(moved.length_squared());
        }
        self.proximity.note_move(longest.sqrt());
        Ok(())
    }

    /// Moves bodies with the engine.
    fn drift_in_engine(&mut self, dt_s: f64) -> Result<(), PlantError> {
        let Self { positions, velocities, held, mass_kg, .. } = self;
        let world = self.engine.step(dt_s, |i, body| {
            if body.translation() != positions[i] {
                body.set_translation(positions[i], true);
            }
            body.set_linvel(velocities[i], true);
            body.reset_forces(false);
            body.add_force(to_engine(row(held, i)) * mass_kg[i], true);
        });
        if let Some(vehicle) = first_not_finite(world) {
            return Err(PlantError::NotFinite { vehicle });
        }
        for ((_, body), (position, velocity)) in world.bodies.iter().zip(positions.iter_mut().zip(velocities)) {
            (*position, *velocity) = (body.translation(), body.linvel());
        }
        Ok(())
    }

    /// Moves bodies without contacts, and again with the engine. The results must be the same.
    fn drift_in_both(&mut self, dt_s: f64) -> Result<(), PlantError> {
        self.compared.0.clone_from(&self.positions);
        self.compared.1.clone_from(&self.velocities);
        self.drift_freely(dt_s)?;
        std::mem::swap(&mut self.positions, &mut self.compared.0);
        std::mem::swap(&mut self.velocities, &mut self.compared.1);
        self.drift_in_engine(dt_s)?;
        let is_same = |(engine, free): (&Vector, &Vector)| bits(*engine) == bits(*free);
        let differs = |i: &usize| {
            !is_same((&self.positions[*i], &self.compared.0[*i]))
                || !is_same((&self.velocities[*i], &self.compared.1[*i]))
        };
        if let Some(vehicle) = (0..self.positions.len()).find(differs) {
            return Err(PlantError::EngineDiffers { vehicle });
        }
        if let Some(vehicle) = self.engine.world().and_then(first_in_contact) {
            return Err(PlantError::EngineDiffers { vehicle });
        }
        Ok(())
    }

    /// Returns each velocity \[m/s\], completed by the second half kick of the held acceleration if that is pending.
    fn velocities_m_s(&self) -> impl Iterator<Item = Vector3<f64>> {
        let half_decay = self.half_decay(self.drifted_s);
        self.velocities
            .iter()
            .enumerate()
            .map(move |(i, &drift)| (from_engine(drift) + 0.5 * self.drifted_s * row(&self.held, i)) * half_decay)
    }
}

#[cfg(test)]
impl Bodies {
    pub(super) fn proximity(&mut self) -> &mut Proximity {
        &mut self.proximity
    }

    pub(super) fn was_free(&self) -> bool {
        self.was_free
    }

    /// Changes the last bit of the inverse mass of a vehicle in free steps.
    pub(super) fn change_inverse_mass(&mut self, vehicle: usize) {
        self.inverse_masses[vehicle].x = self.inverse_masses[vehicle].x.next_up();
        self.inverse_masses[vehicle].y = self.inverse_masses[vehicle].y.next_up();
    }
}

impl Clone for Bodies {
    fn clone(&self) -> Self {
        Self {
            engine: self.engine.clone(),
            positions: self.positions.clone(),
            velocities: self.velocities.clone(),
            inverse_masses: self.inverse_masses.clone(),
            proximity: self.proximity.clone(),
            compared: (Vec::new(), Vec::new()),
            held: self.held.clone(),
            air: self.air.clone(),
            drift_m_s: self.drift_m_s.clone(),
            began_m: self.began_m.clone(),
            mass_kg: self.mass_kg.clone(),
            ..*self
        }
    }
}

impl Plant for Bodies {
    fn count(&self) -> usize {
        self.positions.len()
    }

    fn advance(&mut self, dt_s: f64, predicted: &mut Swarm, _path: &mut StepPath) -> Result<(), PlantError> {
        self.begin_drift(dt_s);
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
            for (i, velocity) in self.velocities.iter_mut().enumerate() {
                let drift_m_s = from_engine(*velocity);
                let completed = to_engine((drift_m_s + 0.5 * self.drifted_s * row(&self.held, i)) * half_decay);
                set_row(&mut state.velocities_m_s, i, from_engine(completed));
                set(velocity, completed);
            }
            self.drifted_s = 0.0;
        }
    }

    fn observe(&self, swarm: &mut Swarm) {
        for (i, &position) in self.positions.iter().enumerate() {
            set_row(&mut swarm.positions_m, i, self.origin_m + from_engine(position));
        }
        for (i, velocity_m_s) in self.velocities_m_s().enumerate() {
            set_row(&mut swarm.velocities_m_s, i, velocity_m_s);
        }
    }

    fn restore(&mut self, swarm: &Swarm) {
        for i in 0..self.count() {
            set(&mut self.positions[i], to_engine(row(&swarm.positions_m, i) - self.origin_m));
            set(&mut self.velocities[i], to_engine(row(&swarm.velocities_m_s, i)));
        }
        self.proximity.forget();
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
