//! Drift of the bodies of both plants over a step: by the engine, without it, or in both ways.

use std::sync::Arc;

use nalgebra::Vector3;
use rapier3d::prelude::{PhysicsWorld, RigidBody, Vector};

use super::proximity::{Maker, Proximity};
use super::world::{
    Engine, empty_world, first_in_contact, first_not_finite, hull_contacts, keep_out_contacts, obstacle,
};
use crate::plant::{HullContact, PlantError};
use crate::scenario::Scenario;
use tautline_core::swarm::{Pair, Rows};

/// State of a body, as the engine has it.
pub(super) trait Body: Clone {
    /// Sets pose, velocity and force of the body of the engine.
    fn write(&self, body: &mut RigidBody);

    /// Takes pose and velocity from the body of the engine.
    fn read(&mut self, body: &RigidBody);

    /// Moves the body without contacts, with the operations of the engine. Returns the way; `None` if the pose is no
    /// longer finite.
    fn drift_freely(&mut self, dt_s: f64) -> Option<Vector>;

    /// Returns whether two bodies have the same bits.
    fn is_same(&self, other: &Self) -> bool;
}

/// Bodies of a plant, one per vehicle, in vehicle order.
#[derive(Clone)]
pub(super) struct Mover<B> {
    /// The bodies. Those of the engine follow when it steps.
    pub(super) bodies: Vec<B>,
    engine: Engine,
    pub(super) proximity: Proximity,
    /// Whether the last step was free: the engine did not step.
    was_free: bool,
    /// Bodies from which the engine repeats a free step, then those after the free step.
    compared: Vec<B>,
    /// Velocities of the last drift before contacts changed them \[m/s\].
    pub(super) drift_m_s: Rows,
    /// Positions at the beginning of the last drift, from the engine's origin \[m\].
    pub(super) began_m: Rows,
}

impl<B: Body> Mover<B> {
    /// Returns bodies at their start. `insert` inserts the body of a vehicle into a new engine, whose origin is
    /// `origin_m`.
    pub(super) fn new(
        scenario: &Scenario,
        bodies: Vec<B>,
        origin_m: Vector3<f64>,
        insert: impl Fn(usize, &mut PhysicsWorld) + Send + Sync + 'static,
    ) -> Self {
        let count = bodies.len();
        let obstacles: Arc<[_]> = scenario.obstacles.iter().map(|solid| obstacle(solid, origin_m)).collect();
        let solids = Arc::clone(&obstacles);
        let create = move || {
            let mut world = empty_world();
            (0..count).for_each(|i| insert(i, &mut world));
            for obstacle in &*solids {
                world.colliders.insert(obstacle.clone());
            }
            world
        };
        Self {
            bodies,
            engine: Engine::new(create),
            proximity: Proximity::new(scenario, obstacles),
            was_free: false,
            compared: Vec::new(),
            drift_m_s: Rows::zeros(count),
            began_m: Rows::zeros(count),
        }
    }

    /// Moves the bodies over a step from `began_m`.
    pub(super) fn drift(&mut self, dt_s: f64) -> Result<(), PlantError> {
        let maker = self.proximity.begin_step(&self.began_m);
        self.was_free = maker == Maker::FreeStep;
        match maker {
            Maker::Engine => self.drift_in_engine(dt_s),
            Maker::FreeStep => {
                if self.proximity.trusts_free_steps() {
                    self.engine.discard();
                }
                self.drift_freely(dt_s)
            }
            Maker::Both => self.drift_in_both(dt_s),
        }
    }

    /// Moves the bodies without contacts.
    fn drift_freely(&mut self, dt_s: f64) -> Result<(), PlantError> {
        let mut longest = 0.0_f64;
        for (vehicle, body) in self.bodies.iter_mut().enumerate() {
            let moved = body.drift_freely(dt_s).ok_or(PlantError::NotFinite { vehicle })?;
            longest = longest.max(moved.length_squared());
        }
        self.proximity.note_move(longest.sqrt());
        Ok(())
    }

    /// Moves the bodies with the engine.
    fn drift_in_engine(&mut self, dt_s: f64) -> Result<(), PlantError> {
        let Self { engine, bodies, .. } = self;
        let world = engine.step(dt_s, |i, body| bodies[i].write(body));
        if let Some(vehicle) = first_not_finite(world) {
            return Err(PlantError::NotFinite { vehicle });
        }
        for ((_, body), state) in world.bodies.iter().zip(bodies) {
            state.read(body);
        }
        Ok(())
    }

    /// Moves the bodies without contacts, and again with the engine. The results must be the same.
    fn drift_in_both(&mut self, dt_s: f64) -> Result<(), PlantError> {
        self.compared.clone_from(&self.bodies);
        self.drift_freely(dt_s)?;
        std::mem::swap(&mut self.bodies, &mut self.compared);
        self.drift_in_engine(dt_s)?;
        let mut both = self.bodies.iter().zip(&self.compared);
        let differs = both.position(|(engine, free)| !engine.is_same(free));
        match differs.or_else(|| self.engine.world().and_then(first_in_contact)) {
            Some(vehicle) => Err(PlantError::EngineDiffers { vehicle }),
            None => Ok(()),
        }
    }

    /// Appends the pairs whose keep-out balls overlap after the last step, in index order.
    pub(super) fn keep_out_contacts(&self, pairs: &mut Vec<Pair>) {
        if self.was_free {
            pairs.extend_from_slice(self.proximity.overlaps());
        } else if let Some(world) = self.engine.world() {
            keep_out_contacts(world, pairs);
        }
    }

    /// Appends the pairs whose hulls collided in the last step, in index order.
    pub(super) fn hull_contacts(&self, contacts: &mut Vec<HullContact>) {
        if let Some(world) = self.engine.world().filter(|_| !self.was_free) {
            hull_contacts(world, &self.began_m, &self.drift_m_s, contacts);
        }
    }

    #[cfg(test)]
    pub(super) fn was_free(&self) -> bool {
        self.was_free
    }
}
