//! Who is near whom, and what is in the way: one search of neighbours and the shapes of obstacles.
//!
//! [`NearPairs`] finds the pairs of a whole table at once, [`KeptPairs`] keeps them while points move little, [`closest_pair`]
//! is the nearest of them, [`Spaced`] keeps points apart as they come one by one, and [`Shape`] says how far a point is from a solid. The judge of `audit` uses none of this: a fault here must not blind it.

mod closest;
mod kept;
mod near;
mod shape;
mod spaced;

pub use closest::closest_pair;
pub use kept::KeptPairs;
pub use near::NearPairs;
pub use shape::Shape;
pub use spaced::Spaced;

use nalgebra::Vector3;

/// A solid at its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// Where the shape's own origin is \[m\].
    pub place_m: Vector3<f64>,
    /// The solid.
    pub shape: Shape,
}
