//! Flights of shielded vehicles on the ideal plant, and random numbers with the same values on every platform.

mod ellipsoids;
mod flights;
mod irregular;
mod long_segments;
mod obstacles;
mod reference;
mod twins;
mod unicycles;
mod world;

use nalgebra::{Isometry3, Unit, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

use crate::obstacle::{Ball, Cuboid, Obstacle, SolidHalfSpace};

#[derive(Clone)]
pub(crate) struct Random(ChaCha8Rng);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Returns a number in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub(crate) fn chance(&mut self, share: f64) -> bool {
        self.unit() < share
    }

    /// Returns a whole number in [0, count).
    pub(crate) fn index(&mut self, count: usize) -> usize {
        usize::try_from(self.0.next_u64() % count as u64).expect("below count")
    }

    /// Returns a vector in the ball of this radius.
    pub(crate) fn vector(&mut self, radius: f64) -> Vector3<f64> {
        self.direction() * (radius * self.unit())
    }

    /// Returns a unit vector, uniform on the sphere.
    pub(crate) fn direction(&mut self) -> Vector3<f64> {
        loop {
            let corner = Vector3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            let length = corner.norm();
            if (0.1..=1.0).contains(&length) {
                return corner / length;
            }
        }
    }
}

/// Returns a ball, box or half-space whose surface is about so far from the origin at most.
pub(crate) fn random_body(random: &mut Random, within_m: f64, clearance_m: f64) -> Obstacle {
    let centre_m = random.vector(within_m);
    match random.index(3) {
        0 => Obstacle::new(Ball { centre_m, radius_m: random.between(0.0, 1.0) }, clearance_m),
        1 => {
            let pose = Isometry3::new(centre_m, random.vector(3.0));
            // Some plates and needles.
            let half_extents_m = Vector3::from_fn(|_, _| random.between(-0.3, 2.0).max(0.0));
            Obstacle::new(Cuboid { pose, half_extents_m }, clearance_m)
        }
        _ => {
            let normal = Unit::new_normalize(random.direction());
            Obstacle::new(SolidHalfSpace { normal, offset_m: random.between(-within_m, 0.0) }, clearance_m)
        }
    }
}
