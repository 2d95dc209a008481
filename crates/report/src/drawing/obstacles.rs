//! Geometry of obstacles.

use nalgebra::{Rotation3, Vector3};

use tautline_core::obstacle::Shape;

/// Smallest z of the unit normal of level ground.
const LEVEL: f64 = 0.999;

/// Returns whether a plane with this normal is level, with free space above.
#[must_use]
pub fn is_level(normal: Vector3<f64>) -> bool {
    normal.z >= LEVEL * normal.norm()
}

/// Returns the sides of a box: three perpendicular half sides, the first outwards, relative to its middle \[m\].
pub fn box_sides(half_m: Vector3<f64>, yaw_deg: f64) -> impl Iterator<Item = [Vector3<f64>; 3]> {
    let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_deg.to_radians());
    (0..6).map(move |side| {
        let half = [0, 1, 2].map(|k| (side / 2 + k) % 3).map(|axis| turned * Vector3::ith(axis, half_m[axis]));
        if side % 2 == 0 { half } else { half.map(|half| -half) }
    })
}

/// Returns a square in a plane through the origin: its middle, which is nearest to a position, and two half sides of a
/// length \[m\].
#[must_use]
pub fn plane_section(normal: Vector3<f64>, near_m: Vector3<f64>, half_m: f64) -> [Vector3<f64>; 3] {
    let normal = normal.normalize();
    let foot = near_m - normal * near_m.dot(&normal);
    let [across, along] = perpendicular(normal);
    [foot, across * half_m, along * half_m]
}

/// Returns two unit vectors that are perpendicular to a unit vector and to each other.
pub(crate) fn perpendicular(axis: Vector3<f64>) -> [Vector3<f64>; 2] {
    let across = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
    [across, axis.cross(&across)]
}

/// Returns the corners of a box with these smallest and largest coordinates.
#[must_use]
pub fn box_corners([low, high]: [Vector3<f64>; 2]) -> [Vector3<f64>; 8] {
    std::array::from_fn(|k| Vector3::from_fn(|axis, _| if k >> axis & 1 == 0 { low[axis] } else { high[axis] }))
}

/// Returns the smallest and largest coordinates of an upright box around a shape, relative to its position \[m\];
/// `None` for an unbounded one.
#[must_use]
pub fn shape_bounds(shape: &Shape) -> Option<[Vector3<f64>; 2]> {
    let around = |half: Vector3<f64>| [-half, half];
    match *shape {
        Shape::Ball { radius_m } => Some(around(Vector3::repeat(radius_m))),
        Shape::Capsule { from_m, to_m, radius_m } => {
            Some([from_m.inf(&to_m).add_scalar(-radius_m), from_m.sup(&to_m).add_scalar(radius_m)])
        }
        Shape::Box { half_m, .. } => {
            let across = half_m.xy().norm();
            Some(around(Vector3::new(across, across, half_m.z)))
        }
        Shape::HalfSpace { .. } => None,
    }
}
