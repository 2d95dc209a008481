// The plant itself, for whichever engine the including module calls `engine`.

use std::time::{Duration, Instant};

use engine::prelude::{
    ColliderBuilder, ColliderHandle, Group, InteractionGroups, InteractionTestMode, LockedAxes, MassProperties,
    PhysicsWorld, Real, RigidBodyBuilder, RigidBodyHandle, Rotation, SharedShape, Vector,
};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::plant::{Air, HullContact, Path, Plant, PlantError, Quadrotors};
use crate::record::Channel;
use crate::scenario::{CONTACT_PREDICTION_M, Scenario, Space};
use crate::space::{Obstacle, Shape};
use crate::swarm::{Pair, Rows, Swarm, mean_row, row, set_row};
use crate::vehicle::{Drift, Fleet};

/// Hulls meet hulls.
const HULL: Group = Group::GROUP_1;
/// Keep-out balls meet keep-out balls.
const KEEP_OUT: Group = Group::GROUP_2;
/// Share of the closing speed that two hulls keep after a bounce.
const HULL_RESTITUTION: Real = 0.5;

/// A swarm of rigid bodies, one a vehicle, in vehicle order.
pub(super) struct Bodies {
    world: PhysicsWorld,
    handles: Vec<RigidBodyHandle>,
    /// Accelerations held over the step, and what the wind adds to them at its beginning \[m/s^2\].
    held: Rows,
    /// What blows, where anything does.
    air: Option<Air>,
    /// Velocities of the last drift, as they were before contacts changed them \[m/s\].
    drift_m_s: Rows,
    /// Where it began, from the engine's origin \[m\].
    began_m: Rows,
    /// Length of the drift that waits for the second half of its kick \[s\]; 0 for a completed state.
    drifted_s: f64,
    /// Where the engine's origin is: the middle of the start, so that single precision resolves the swarm's own extent
    /// wherever it flies.
    origin_m: Vector3<f64>,
    mass_kg: Vec<f64>,
    /// Drag of the air included.
    a22_per_s: f64,
    /// Whether z is locked.
    is_flat: bool,
}

impl Bodies {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let mut world = empty_world();
        let origin_m = mean_row(&scenario.start.positions_m);
        let handles = (0..scenario.count()).map(|i| insert_vehicle(&mut world, scenario, origin_m, i)).collect();
        scenario.obstacles.iter().for_each(|obstacle| insert_obstacle(&mut world, obstacle, origin_m));
        Self {
            world,
            handles,
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

    /// What half a step of free motion multiplies a velocity by: exp(a22 dt/2).
    fn half_decay(&self, dt_s: f64) -> f64 {
        libm::exp(0.5 * self.a22_per_s * dt_s)
    }

    /// The command with what the wind adds to it now.
    fn hold(&mut self) {
        if let Some(air) = &self.air {
            air.write_held(&mut self.held);
        }
        if self.is_flat {
            self.held.column_mut(2).fill(0.0);
        }
    }

    /// Each vehicle's velocity \[m/s\] with the second half of the held acceleration's kick, where a drift waits for it.
    fn velocities_m_s(&self) -> impl Iterator<Item = Vector3<f64>> {
        let half_decay = self.half_decay(self.drifted_s);
        self.handles.iter().enumerate().map(move |(i, &handle)| {
            let drift_m_s = doubles(self.world.bodies[handle].linvel());
            (drift_m_s + 0.5 * self.drifted_s * row(&self.held, i)) * half_decay
        })
    }
}

impl Clone for Bodies {
    fn clone(&self) -> Self {
        let world = copied(&self.world);
        let (handles, mass_kg) = (self.handles.clone(), self.mass_kg.clone());
        let (held, drift_m_s, began_m) = (self.held.clone(), self.drift_m_s.clone(), self.began_m.clone());
        let air = self.air.clone();
        Self { world, handles, held, air, drift_m_s, began_m, mass_kg, ..*self }
    }
}

impl Plant for Bodies {
    fn count(&self) -> usize {
        self.handles.len()
    }

    fn advance(&mut self, dt_s: f64, predicted: &mut Swarm, _path: &mut Path) -> Result<(), PlantError> {
        self.world.integration_parameters.dt = real(dt_s);
        // A drift that waits for its command is completed with the one that is held.
        let (completing, half_decay) = (self.half_decay(self.drifted_s), self.half_decay(dt_s));
        for (i, &handle) in self.handles.iter().enumerate() {
            let body = &mut self.world.bodies[handle];
            let held_m_s2 = row(&self.held, i);
            let velocity_m_s = (doubles(body.linvel()) + 0.5 * self.drifted_s * held_m_s2) * completing;
            let drift_m_s = velocity_m_s * half_decay + 0.5 * dt_s * held_m_s2;
            set_row(&mut self.drift_m_s, i, drift_m_s);
            set_row(&mut self.began_m, i, doubles(body.translation()));
            body.set_linvel(reals(drift_m_s - dt_s * held_m_s2), true);
            body.reset_forces(false);
            body.add_force(reals(held_m_s2) * real(self.mass_kg[i]), true);
        }
        self.world.step();
        self.drifted_s = dt_s;
        if let Some(air) = &mut self.air {
            air.advance(dt_s);
            self.hold();
        }
        if let Some(lost) = self.world.quarantine().bodies().first() {
            let vehicle = self.handles.iter().position(|h| h == lost).unwrap_or_default();
            return Err(PlantError::NotFinite { vehicle });
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
            for (i, velocity_m_s) in self.velocities_m_s().enumerate() {
                set_row(&mut state.velocities_m_s, i, doubles(reals(velocity_m_s)));
            }
            for (i, &handle) in self.handles.iter().enumerate() {
                self.world.bodies[handle].set_linvel(reals(row(&state.velocities_m_s, i)), true);
            }
            self.drifted_s = 0.0;
        }
    }

    fn observe(&self, swarm: &mut Swarm) {
        for (i, &handle) in self.handles.iter().enumerate() {
            set_row(&mut swarm.positions_m, i, self.origin_m + doubles(self.world.bodies[handle].translation()));
        }
        for (i, velocity_m_s) in self.velocities_m_s().enumerate() {
            set_row(&mut swarm.velocities_m_s, i, velocity_m_s);
        }
    }

    fn restore(&mut self, swarm: &Swarm) {
        for (i, &handle) in self.handles.iter().enumerate() {
            let body = &mut self.world.bodies[handle];
            body.set_translation(reals(row(&swarm.positions_m, i) - self.origin_m), true);
            body.set_linvel(reals(row(&swarm.velocities_m_s, i)), true);
        }
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

    fn keep_out_contacts(&self, pairs: &mut Vec<Pair>) {
        keep_out_contacts(&self.world, pairs);
    }

    fn hull_contacts(&self, contacts: &mut Vec<HullContact>) {
        hull_contacts(&self.world, &self.began_m, &self.drift_m_s, contacts);
    }
}

/// Everything that the engine carries from step to step: bodies, contacts, islands, bounding volumes. What it leaves out is
/// working memory.
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
fn keep_out_contacts(world: &PhysicsWorld, pairs: &mut Vec<Pair>) {
    let before = pairs.len();
    let vehicle = |handle: ColliderHandle| {
        let collider = world.colliders.get(handle)?;
        let keeps_out = collider.collision_groups().memberships == KEEP_OUT;
        keeps_out.then_some(usize::try_from(collider.user_data).ok()?)
    };
    for contact in world.narrow_phase.contact_pairs() {
        // A manifold also holds contacts predicted for the near future: only an overlap counts.
        let overlaps = contact.manifolds().iter().any(|m| m.points.iter().any(|point| point.dist < 0.0));
        if overlaps && let (Some(i), Some(j)) = (vehicle(contact.collider1), vehicle(contact.collider2)) {
            pairs.push(Pair::new(i, j));
        }
    }
    pairs[before..].sort_unstable();
}

/// Appends the pairs whose hulls pushed each other in a drift from these places \[m\] at these velocities \[m/s\], in index
/// order.
fn hull_contacts(world: &PhysicsWorld, began_m: &Rows, drift_m_s: &Rows, contacts: &mut Vec<HullContact>) {
    let before = contacts.len();
    for contact in world.narrow_phase.contact_pairs() {
        // Keep-out balls push nothing.
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

fn empty_world() -> PhysicsWorld {
    let mut world = PhysicsWorld { gravity: Vector::ZERO, ..PhysicsWorld::default() };
    let parameters = &mut world.integration_parameters;
    // One iteration: motion within a step is a straight line (module documentation).
    parameters.num_solver_iterations = 1;
    // The engine would clamp speeds at 400 m/s.
    parameters.normalized_max_linear_velocity = Real::MAX;
    parameters.normalized_prediction_distance = real(CONTACT_PREDICTION_M);
    // Reused contacts report stale distances: evidence must be of this step.
    parameters.contact_recycling = false;
    // Continuous collision detection would shorten motion; the audit judges what happened.
    parameters.max_ccd_substeps = 0;
    world
}

fn insert_vehicle(world: &mut PhysicsWorld, scenario: &Scenario, origin_m: Vector3<f64>, i: usize) -> RigidBodyHandle {
    let locked = match scenario.space {
        Space::Plane => LockedAxes::ROTATION_LOCKED | LockedAxes::TRANSLATION_LOCKED_Z,
        Space::Volume => LockedAxes::ROTATION_LOCKED,
    };
    let body = RigidBodyBuilder::dynamic()
        .translation(reals(row(&scenario.start.positions_m, i) - origin_m))
        .linvel(reals(row(&scenario.start.velocities_m_s, i)))
        .locked_axes(locked)
        .can_sleep(false);
    let handle = world.bodies.insert(body);

    let hull = hull(scenario.hull_radius_m[i], i).mass(real(scenario.mass_kg[i]));
    for collider in [hull, keep_out(scenario.metric().shortest_m(scenario.delta_m), i)] {
        world.colliders.insert_with_parent(collider, handle, &mut world.bodies);
    }
    world.bodies[handle].recompute_mass_properties_from_colliders(&world.colliders);
    handle
}

/// The solid ball of a vehicle.
fn hull(radius_m: f64, vehicle: usize) -> ColliderBuilder {
    ColliderBuilder::ball(real(radius_m))
        .restitution(HULL_RESTITUTION)
        .friction(0.0)
        .collision_groups(InteractionGroups::new(HULL, HULL, InteractionTestMode::And))
        .user_data(vehicle as u128)
}

/// The ball that keeps two vehicles a distance apart, in what it sees.
fn keep_out(delta_m: f64, vehicle: usize) -> ColliderBuilder {
    ColliderBuilder::ball(real(delta_m / 2.0))
        .density(0.0)
        .collision_groups(InteractionGroups::new(KEEP_OUT, KEEP_OUT, InteractionTestMode::And))
        .solver_groups(InteractionGroups::none())
        .user_data(vehicle as u128)
}

/// A solid that hulls meet and nothing moves. It is the hull of no vehicle.
fn insert_obstacle(world: &mut PhysicsWorld, obstacle: &Obstacle, origin_m: Vector3<f64>) {
    let place_m = obstacle.place_m - origin_m;
    let collider = match obstacle.shape {
        Shape::Ball { radius_m } => ColliderBuilder::ball(real(radius_m)),
        Shape::Box { half_m, yaw_deg } => ColliderBuilder::cuboid(real(half_m.x), real(half_m.y), real(half_m.z))
            .rotation(reals(Vector3::z() * yaw_deg.to_radians())),
        Shape::Capsule { from_m, to_m, radius_m } => {
            ColliderBuilder::capsule_from_endpoints(reals(from_m), reals(to_m), real(radius_m))
        }
        Shape::HalfSpace { normal } => ColliderBuilder::new(SharedShape::halfspace(reals(normal.normalize()))),
    };
    let hulls = InteractionGroups::new(HULL, HULL, InteractionTestMode::And);
    let collider = collider.translation(reals(place_m)).restitution(HULL_RESTITUTION).friction(0.0);
    world.colliders.insert(collider.collision_groups(hulls).user_data(u128::MAX));
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::unnecessary_cast,
    reason = "rounding to the engine's precision is what is meant"
)]
fn real(x: f64) -> Real {
    x as Real
}

fn reals(v: Vector3<f64>) -> Vector {
    Vector::new(real(v.x), real(v.y), real(v.z))
}

#[allow(clippy::useless_conversion, reason = "a widening in single precision only")]
fn double(x: Real) -> f64 {
    x.into()
}

fn doubles(v: Vector) -> Vector3<f64> {
    Vector3::new(double(v.x), double(v.y), double(v.z))
}
