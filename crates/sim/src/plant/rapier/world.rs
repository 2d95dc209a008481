//! Bodies, colliders and contacts of the engine, common to both plants of rigid bodies.

use std::sync::Arc;

use nalgebra::Vector3;
use rapier3d::prelude::{
    Collider, ColliderBuilder, ColliderHandle, Group, InteractionGroups, InteractionTestMode, PhysicsWorld, Real,
    RigidBody, SharedShape, Vector,
};

use crate::plant::HullContact;
use crate::scenario::CONTACT_PREDICTION_M;
use tautline_core::obstacle::{Obstacle, Shape};
use tautline_core::swarm::{Pair, Rows, row};

/// Group of hulls, which collide with hulls.
const HULL: Group = Group::GROUP_1;
/// Group of keep-out balls, which detect keep-out balls.
const KEEP_OUT: Group = Group::GROUP_2;
/// Share of the closing speed that two hulls keep after a bounce.
const HULL_RESTITUTION: Real = 0.5;

/// The engine, whose contacts do not depend on steps before them.
///
/// The engine solves contacts of several hulls one after the other, in an order that depends on its earlier steps. A
/// step that brings hulls into contact, after a step without contacts, is therefore repeated by a new engine. So a
/// flight with free steps, which the engine does not make, has the same contacts (`super::proximity`).
///
/// The engine is created for its first step: a world without contacts never needs it.
pub(super) struct Engine {
    /// Creates an engine that has made no step. The body of vehicle i has the index i.
    create: Arc<dyn Fn() -> PhysicsWorld + Send + Sync>,
    /// The engine after its last step.
    world: Option<Box<PhysicsWorld>>,
    /// Whether the last step had contacts of hulls.
    had_contacts: bool,
}

impl Engine {
    /// `create` creates an engine that has made no step, with the body of vehicle i at the index i.
    pub(super) fn new(create: impl Fn() -> PhysicsWorld + Send + Sync + 'static) -> Self {
        Self { create: Arc::new(create), world: None, had_contacts: false }
    }

    /// Makes a step of this length \[s\], and returns the engine after it. `set` sets pose, velocity and force of the
    /// body of a vehicle at its beginning.
    pub(super) fn step(&mut self, dt_s: f64, set: impl Fn(usize, &mut RigidBody)) -> &PhysicsWorld {
        let step = |world: &mut PhysicsWorld| {
            world.integration_parameters.dt = dt_s;
            world.bodies.iter_mut().enumerate().for_each(|(i, (_, body))| set(i, body));
            world.step();
        };
        let create = || Box::new((self.create)());
        let is_new = self.world.is_none();
        let mut world = self.world.take().unwrap_or_else(create);
        step(&mut world);
        let has_contacts = has_hull_contacts(&world);
        if has_contacts && !self.had_contacts && !is_new {
            drop(world);
            world = create();
            step(&mut world);
        }
        self.had_contacts = has_contacts;
        self.world.insert(world)
    }

    /// Returns the engine after its last step; `None` before its first step and after [`Engine::discard`].
    pub(super) fn world(&self) -> Option<&PhysicsWorld> {
        self.world.as_deref()
    }

    /// Frees the memory of the engine, whose last step had no contacts of hulls. A new engine makes the next step.
    pub(super) fn discard(&mut self) {
        debug_assert!(!self.had_contacts, "contacts of hulls depend on earlier steps");
        self.world = None;
    }
}

/// Returns the first vehicle whose state is no longer finite after a step of the engine.
pub(super) fn first_not_finite(world: &PhysicsWorld) -> Option<usize> {
    world.quarantine().bodies().first().map(|body| body.into_raw_parts().0 as usize)
}

impl Clone for Engine {
    fn clone(&self) -> Self {
        let world = self.world.as_ref().map(|world| Box::new(copied(world)));
        Self { create: Arc::clone(&self.create), world, ..*self }
    }
}

/// Returns whether the engine solves a contact of hulls, be it only a predicted one.
fn has_hull_contacts(world: &PhysicsWorld) -> bool {
    let is_hull =
        |handle| world.colliders.get(handle).is_some_and(|collider| collider.collision_groups().memberships == HULL);
    let mut pairs = world.narrow_phase.contact_pairs();
    pairs.any(|pair| is_hull(pair.collider1) && pair.manifolds().iter().any(|manifold| !manifold.points.is_empty()))
}

/// Copies the state that the engine carries from step to step: bodies, contacts, islands, bounding volumes. Working
/// memory is not copied.
fn copied(world: &PhysicsWorld) -> PhysicsWorld {
    PhysicsWorld {
        gravity: world.gravity,
        integration_parameters: world.integration_parameters,
        islands: world.islands.clone(),
        broad_phase: world.broad_phase.clone(),
        narrow_phase: world.narrow_phase.clone(),
        bodies: world.bodies.clone(),
        colliders: world.colliders.clone(),
        impulse_joints: world.impulse_joints.clone(),
        multibody_joints: world.multibody_joints.clone(),
        ..PhysicsWorld::default()
    }
}

/// Appends the pairs whose keep-out balls overlap, in index order.
pub(super) fn keep_out_contacts(world: &PhysicsWorld, pairs: &mut Vec<Pair>) {
    let before = pairs.len();
    let vehicle = |handle: ColliderHandle| {
        let collider = world.colliders.get(handle)?;
        let keeps_out = collider.collision_groups().memberships == KEEP_OUT;
        keeps_out.then_some(usize::try_from(collider.user_data).ok()?)
    };
    for contact in world.narrow_phase.contact_pairs() {
        // A manifold also holds predicted contacts; only an overlap counts.
        let overlaps = contact.manifolds().iter().any(|m| m.points.iter().any(|point| point.dist < 0.0));
        if overlaps && let (Some(i), Some(j)) = (vehicle(contact.collider1), vehicle(contact.collider2)) {
            pairs.push(Pair::new(i, j));
        }
    }
    pairs[before..].sort_unstable();
}

/// Returns the first vehicle with an overlap of keep-out balls; vehicle 0 if only hulls have a contact, even a
/// predicted one.
pub(super) fn first_in_contact(world: &PhysicsWorld) -> Option<usize> {
    let mut pairs = Vec::new();
    keep_out_contacts(world, &mut pairs);
    let is_of_hulls = has_hull_contacts(world);
    pairs.first().map(|pair| pair.first()).or(is_of_hulls.then_some(0))
}

/// Appends the pairs whose hulls collided in the last step, in index order. Their closing speeds follow from the
/// positions \[m\] at the start of the step and the velocities \[m/s\] before the collision.
pub(super) fn hull_contacts(world: &PhysicsWorld, began_m: &Rows, drift_m_s: &Rows, contacts: &mut Vec<HullContact>) {
    let before = contacts.len();
    for contact in world.narrow_phase.contact_pairs() {
        // Keep-out balls have no impulse.
        let pushed = contact.manifolds().iter().any(|m| m.points.iter().any(|point| point.data.impulse > 0.0));
        let vehicle = |handle: ColliderHandle| {
            world.colliders.get(handle).and_then(|collider| usize::try_from(collider.user_data).ok())
        };
        if pushed && let (Some(i), Some(j)) = (vehicle(contact.collider1), vehicle(contact.collider2)) {
            let apart = (row(began_m, j) - row(began_m, i)).normalize();
            let closing_m_s = -(row(drift_m_s, j) - row(drift_m_s, i)).dot(&apart);
            contacts.push(HullContact { pair: Pair::new(i, j), closing_m_s });
        }
    }
    contacts[before..].sort_unstable_by_key(|contact| contact.pair);
}

pub(super) fn empty_world() -> PhysicsWorld {
    let mut world = PhysicsWorld { gravity: Vector::ZERO, ..PhysicsWorld::default() };
    let parameters = &mut world.integration_parameters;
    // With one iteration, motion within a step is a straight line (module documentation).
    parameters.num_solver_iterations = 1;
    // The default of the engine clamps speeds at 400 m/s.
    parameters.normalized_max_linear_velocity = Real::MAX;
    parameters.normalized_prediction_distance = CONTACT_PREDICTION_M;
    // Recycled contacts report stale distances; evidence must be of this step.
    parameters.contact_recycling = false;
    // Continuous collision detection would shorten motion; the audit handles violations.
    parameters.max_ccd_substeps = 0;
    world
}

/// Returns the solid ball of a vehicle.
pub(super) fn hull(radius_m: f64, vehicle: usize) -> ColliderBuilder {
    ColliderBuilder::ball(radius_m)
        .restitution(HULL_RESTITUTION)
        .friction(0.0)
        .collision_groups(InteractionGroups::new(HULL, HULL, InteractionTestMode::And))
        .user_data(vehicle as u128)
}

/// Returns the sensor ball of a vehicle: two overlap if the vehicles are closer than delta.
pub(super) fn keep_out(delta_m: f64, vehicle: usize) -> ColliderBuilder {
    ColliderBuilder::ball(delta_m / 2.0)
        .density(0.0)
        .collision_groups(InteractionGroups::new(KEEP_OUT, KEEP_OUT, InteractionTestMode::And))
        .solver_groups(InteractionGroups::none())
        .user_data(vehicle as u128)
}

/// Returns a fixed solid that hulls collide with. It has the index of no vehicle.
pub(super) fn obstacle(obstacle: &Obstacle, origin_m: Vector3<f64>) -> Collider {
    let place_m = obstacle.place_m - origin_m;
    let collider = match obstacle.shape {
        Shape::Ball { radius_m } => ColliderBuilder::ball(radius_m),
        Shape::Box { half_m, yaw_deg } => ColliderBuilder::cuboid(half_m.x, half_m.y, half_m.z)
            .rotation(to_engine(Vector3::z() * yaw_deg.to_radians())),
        Shape::Capsule { from_m, to_m, radius_m } => {
            ColliderBuilder::capsule_from_endpoints(to_engine(from_m), to_engine(to_m), radius_m)
        }
        Shape::HalfSpace { normal } => ColliderBuilder::new(SharedShape::halfspace(to_engine(normal.normalize()))),
    };
    let hulls = InteractionGroups::new(HULL, HULL, InteractionTestMode::And);
    let collider = collider.translation(to_engine(place_m)).restitution(HULL_RESTITUTION).friction(0.0);
    collider.collision_groups(hulls).user_data(u128::MAX).build()
}

/// Converts a vector to the engine's type.
pub(super) fn to_engine(v: Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

/// Converts a vector from the engine's type.
pub(super) fn from_engine(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}
