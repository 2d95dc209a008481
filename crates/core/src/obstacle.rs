//! Obstacles at rest and their shapes. This is data only: laws and the judge measure distances in code of their own.

use nalgebra::Vector3;

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

/// Shape of an obstacle around its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Ball.
    Ball {
        /// Radius \[m\].
        radius_m: f64,
    },
    /// Upright box.
    Box {
        /// Half side lengths \[m\].
        half_m: Vector3<f64>,
        /// Rotation about the vertical \[deg\], counterclockwise from above.
        yaw_deg: f64,
    },
    /// Capsule: all points within a radius of a straight line segment.
    Capsule {
        /// One end of the segment, relative to the obstacle's position \[m\].
        from_m: Vector3<f64>,
        /// The other end \[m\].
        to_m: Vector3<f64>,
        /// Radius \[m\].
        radius_m: f64,
    },
    /// Half-space behind a plane through the obstacle's position.
    HalfSpace {
        /// Outward normal, of any nonzero length.
        normal: Vector3<f64>,
    },
}
