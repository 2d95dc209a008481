//! Geometry in space: search of near pairs, scaled lengths and the shapes of obstacles.
//!
//! - [`CellList`] finds all near pairs of a table.
//! - [`VerletList`] reuses them while points move little.
//! - [`closest_pair`] finds the nearest pair.
//! - [`SpacedPoints`] accepts points one by one that keep a minimum distance.
//! - [`Shape`] gives the distance of a point from a solid.
//! - [`Metric`] scales lengths so that keep-out ellipsoids become balls.
//!
//! The auditor in `audit` uses none of this, so a defect here cannot hide a violation.

mod metric;
mod near;
mod shape;
mod spaced;

pub use metric::Metric;
pub(crate) use near::NearLists;
pub use near::{CellList, VerletList};
pub use shape::Shape;
pub use spaced::{SpacedPoints, closest_pair};

use nalgebra::Vector3;

use tautline_core::swarm::{Rows, row};

/// Fixed solid that vehicles keep clear of.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// Name of the obstacle.
    pub name: String,
    /// Position of the shape's origin \[m\].
    pub place_m: Vector3<f64>,
    /// Shape of the solid.
    pub shape: Shape,
    /// Least distance of a vehicle's centre from the surface \[m\].
    pub clearance_m: f64,
}

impl Obstacle {
    /// Returns the clearance margin of a point \[m\], its distance from the surface less the clearance, and the
    /// gradient of the margin, a unit vector ([`Shape::signed_distance_m`]).
    #[must_use]
    pub fn clearance_margin_m(&self, point_m: Vector3<f64>) -> (f64, Vector3<f64>) {
        let (distance_m, normal) = self.shape.signed_distance_m(point_m - self.place_m);
        (distance_m - self.clearance_m, normal)
    }
}

/// Returns the smallest clearance margin of any position at any obstacle \[m\], with the row and the obstacle; `None`
/// without positions or obstacles.
#[must_use]
pub fn smallest_clearance_margin(obstacles: &[Obstacle], positions_m: &Rows) -> Option<(f64, usize, usize)> {
    let rooms = (0..positions_m.nrows()).flat_map(|i| {
        let point_m = row(positions_m, i);
        obstacles.iter().enumerate().map(move |(k, obstacle)| (obstacle.clearance_margin_m(point_m).0, i, k))
    });
    rooms.min_by(|a, b| a.0.total_cmp(&b.0))
}
