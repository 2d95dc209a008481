//! Who is near whom, and what is in the way: one search of neighbours and the shapes of obstacles.
//!
//! [`NearPairs`] finds the pairs of a whole table at once, [`KeptPairs`] keeps them while points move little, [`closest_pair`]
//! is the nearest of them, [`Spaced`] keeps points apart as they come one by one, [`Shape`] says how far a point is from a solid, and [`Metric`] scales lengths to what must stay empty. The judge of `audit` uses none of this: a fault here must not blind it.

mod metric;
mod near;
mod shape;
mod spaced;

pub use metric::Metric;
pub(crate) use near::NearLists;
pub use near::{KeptPairs, NearPairs};
pub use shape::Shape;
pub use spaced::{Spaced, closest_pair};

use nalgebra::Vector3;

use tautline_core::swarm::{Rows, row};

/// A solid at rest that vehicles keep clear of.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// What it is called.
    pub name: String,
    /// Where the shape's own origin is \[m\].
    pub place_m: Vector3<f64>,
    /// The solid.
    pub shape: Shape,
    /// Distance that the centre of a vehicle must keep from the surface \[m\].
    pub clearance_m: f64,
}

impl Obstacle {
    /// How much farther from the surface than its clearance a point is \[m\], and the direction in which that grows by one
    /// metre a metre ([`Shape::signed_distance_m`]).
    #[must_use]
    pub fn room_m(&self, point_m: Vector3<f64>) -> (f64, Vector3<f64>) {
        let (distance_m, normal) = self.shape.signed_distance_m(point_m - self.place_m);
        (distance_m - self.clearance_m, normal)
    }
}

/// The least room that rows of positions have from any obstacle \[m\], with the row and the obstacle; none where there is
/// nothing to compare.
#[must_use]
pub fn least_room(obstacles: &[Obstacle], positions_m: &Rows) -> Option<(f64, usize, usize)> {
    let rooms = (0..positions_m.nrows()).flat_map(|i| {
        let point_m = row(positions_m, i);
        obstacles.iter().enumerate().map(move |(k, obstacle)| (obstacle.room_m(point_m).0, i, k))
    });
    rooms.min_by(|a, b| a.0.total_cmp(&b.0))
}
