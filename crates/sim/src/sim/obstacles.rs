//! Obstacles as the judge knows them: its shapes are its own.

use tautline_audit as audit;
use tautline_laws::space::{Obstacle, Shape};

/// An obstacle at rest, as it is judged.
#[must_use]
pub fn judged(obstacle: &Obstacle) -> audit::Obstacle {
    audit::Obstacle {
        name: obstacle.name.clone(),
        shape: judged_shape(obstacle.shape),
        clearance_m: Some(obstacle.clearance_m),
        path: vec![(0.0, obstacle.place_m)],
    }
}

/// A shape, as it is judged.
#[must_use]
pub fn judged_shape(shape: Shape) -> audit::Shape {
    match shape {
        Shape::Ball { radius_m } => audit::Shape::Ball { radius_m },
        Shape::Box { half_m, yaw_deg } => audit::Shape::Box { half_m, yaw_rad: yaw_deg.to_radians() },
        Shape::Capsule { from_m, to_m, radius_m } => audit::Shape::Capsule { from_m, to_m, radius_m },
        Shape::HalfSpace { normal } => audit::Shape::HalfSpace { normal },
    }
}
