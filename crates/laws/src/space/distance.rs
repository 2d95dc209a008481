//! Distances from the surfaces of obstacles.

use nalgebra::Vector3;

use tautline_core::obstacle::{Obstacle, Shape};
use tautline_core::swarm::{Rows, row};

/// Returns the distance of a point from the surface \[m\], negative inside, and the outward unit normal at the
/// nearest surface point, which is the gradient of the distance. The point is relative to the obstacle's position
/// \[m\].
///
/// If several surface points are nearest (centre of a ball, axis of a capsule, inner diagonal of a box), the normal
/// is that of one of them.
#[must_use]
pub fn signed_distance_m(shape: &Shape, point_m: Vector3<f64>) -> (f64, Vector3<f64>) {
    match *shape {
        Shape::Ball { radius_m } => from_core(point_m, radius_m, Vector3::z()),
        Shape::Box { half_m, yaw_deg: 0.0 } => from_box(point_m, half_m),
        Shape::Box { half_m, yaw_deg } => {
            let yaw_rad = yaw_deg.to_radians();
            let (sin, cos) = (libm::sin(yaw_rad), libm::cos(yaw_rad));
            let turned = Vector3::new(cos * point_m.x + sin * point_m.y, cos * point_m.y - sin * point_m.x, point_m.z);
            let (distance_m, normal) = from_box(turned, half_m);
            let back = Vector3::new(cos * normal.x - sin * normal.y, sin * normal.x + cos * normal.y, normal.z);
            (distance_m, back)
        }
        Shape::Capsule { from_m, to_m, radius_m } => {
            let (along, aside) = (to_m - from_m, point_m - from_m);
            let squared = along.norm_squared();
            let share = if squared > 0.0 { (aside.dot(&along) / squared).clamp(0.0, 1.0) } else { 0.0 };
            from_core(aside - along * share, radius_m, across(along))
        }
        Shape::HalfSpace { normal } => {
            let normal = normal.normalize();
            (point_m.dot(&normal), normal)
        }
    }
}

/// Returns the clearance margin of a point \[m\], its distance from the surface less the clearance, and the gradient of
/// the margin, a unit vector ([`signed_distance_m`]).
#[must_use]
pub fn clearance_margin_m(obstacle: &Obstacle, point_m: Vector3<f64>) -> (f64, Vector3<f64>) {
    let (distance_m, normal) = signed_distance_m(&obstacle.shape, point_m - obstacle.place_m);
    (distance_m - obstacle.clearance_m, normal)
}

/// Returns the smallest clearance margin of any position at any obstacle \[m\], with the row and the obstacle; `None`
/// without positions or obstacles.
#[must_use]
pub fn smallest_clearance_margin(obstacles: &[Obstacle], positions_m: &Rows) -> Option<(f64, usize, usize)> {
    let margins = (0..positions_m.nrows()).flat_map(|i| {
        let point_m = row(positions_m, i);
        obstacles.iter().enumerate().map(move |(k, obstacle)| (clearance_margin_m(obstacle, point_m).0, i, k))
    });
    margins.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Returns distance and normal for the surface at `radius_m` around a core, from the vector `off` that points from the
/// core to the point. On the core itself the normal is `instead`.
fn from_core(off: Vector3<f64>, radius_m: f64, instead: Vector3<f64>) -> (f64, Vector3<f64>) {
    let distance_m = off.norm();
    (distance_m - radius_m, if distance_m > 0.0 { off / distance_m } else { instead })
}

/// Returns distance and normal for an axis-aligned box about the origin.
fn from_box(point: Vector3<f64>, half_m: Vector3<f64>) -> (f64, Vector3<f64>) {
    let off = point.zip_map(&half_m, |x, half| x - x.clamp(-half.max(0.0), half.max(0.0)));
    if off.norm_squared() > 0.0 {
        return from_core(off, 0.0, Vector3::z());
    }
    let depths = point.abs() - half_m;
    let axis = depths.imax();
    let mut normal = Vector3::zeros();
    normal[axis] = 1.0_f64.copysign(point[axis]);
    (depths[axis], normal)
}

/// Returns a unit vector perpendicular to `along`, as far upwards as possible.
fn across(along: Vector3<f64>) -> Vector3<f64> {
    let up = Vector3::z() * along.norm_squared() - along * along.z;
    up.try_normalize(0.0).unwrap_or_else(|| if along.z == 0.0 { Vector3::z() } else { Vector3::x() })
}

#[cfg(test)]
mod tests {
    use parry3d::math::{Pose, Vector};
    use parry3d::query::PointQuery as _;
    use parry3d::shape::{Ball, Capsule, Cuboid, HalfSpace};
    use proptest::prelude::*;

    use super::*;

    /// Rounding of lengths of a few metres.
    const TOLERANCE_M: f64 = 1e-9;

    fn vector(extent: f64) -> impl Strategy<Value = Vector3<f64>> {
        [-extent..extent, -extent..extent, -extent..extent].prop_map(Vector3::from)
    }

    fn shape() -> impl Strategy<Value = Shape> {
        let length = || 0.1..3.0;
        prop_oneof![
            length().prop_map(|radius_m| Shape::Ball { radius_m }),
            ([length(), length(), length()], prop_oneof![1 => Just(0.0), 4 => -400.0..400.0])
                .prop_map(|(half, yaw_deg)| Shape::Box { half_m: half.into(), yaw_deg }),
            (vector(3.0), vector(3.0), length()).prop_map(|(from_m, to_m, radius_m)| Shape::Capsule {
                from_m,
                to_m,
                radius_m
            }),
            vector(1.0).prop_filter("a direction", |n| n.norm() > 0.1).prop_map(|normal| Shape::HalfSpace { normal }),
        ]
    }

    /// Distance from the surface computed by parry.
    fn by_parry(shape: &Shape, point: Vector3<f64>) -> f64 {
        let vector = |v: Vector3<f64>| Vector::new(v.x, v.y, v.z);
        let point = vector(point);
        match *shape {
            Shape::Ball { radius_m } => Ball::new(radius_m).distance_to_local_point(point, false),
            Shape::Box { half_m, yaw_deg } => Cuboid::new(vector(half_m)).distance_to_point(
                &Pose::rotation(Vector::new(0.0, 0.0, yaw_deg.to_radians())),
                point,
                false,
            ),
            Shape::Capsule { from_m, to_m, radius_m } => {
                Capsule::new(vector(from_m), vector(to_m), radius_m).distance_to_local_point(point, false)
            }
            Shape::HalfSpace { normal } => {
                HalfSpace::new(vector(normal.normalize())).distance_to_local_point(point, false)
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn distances_match_parry(shape in shape(), point in vector(5.0)) {
            let (distance_m, _) = signed_distance_m(&shape, point);
            prop_assert!((distance_m - by_parry(&shape, point)).abs() < TOLERANCE_M, "{shape:?}: {distance_m}");
        }

        #[test]
        fn the_surface_lies_at_the_distance_along_the_normal(
            shape in shape(), point in vector(5.0), directions in prop::collection::vec(vector(1.0), 200),
        ) {
            let (distance_m, normal) = signed_distance_m(&shape, point);
            prop_assert!((normal.norm() - 1.0).abs() < TOLERANCE_M);
            let (on_surface, _) = signed_distance_m(&shape, point - normal * distance_m);
            prop_assert!(on_surface.abs() < TOLERANCE_M, "{shape:?}: {on_surface}");
            for direction in directions.iter().filter_map(|d| d.try_normalize(0.1)) {
                let (nearer, _) = signed_distance_m(&shape, point + direction * (distance_m.abs() * 0.999));
                prop_assert!(nearer * distance_m >= 0.0, "{shape:?}: the surface is crossed on the way");
            }
        }

        #[test]
        fn the_normal_is_the_gradient_of_the_distance(shape in shape(), point in vector(5.0)) {
            const STEP_M: f64 = 1e-6;
            let (distance_m, normal) = signed_distance_m(&shape, point);
            let (farther_m, same) = signed_distance_m(&shape, point + normal * STEP_M);
            // Excludes points where the nearest feature changes within the step.
            prop_assume!((same - normal).norm() < 1e-3);
            prop_assert!((farther_m - distance_m - STEP_M).abs() < 1e-9, "{shape:?}");
        }
    }

    #[test]
    fn the_normal_is_defined_where_several_surface_points_are_nearest() {
        let up = Vector3::z();
        assert_eq!(signed_distance_m(&Shape::Ball { radius_m: 2.0 }, Vector3::zeros()), (-2.0, up));
        let capsule = |to_m| Shape::Capsule { from_m: Vector3::zeros(), to_m, radius_m: 0.5 };
        assert_eq!(signed_distance_m(&capsule(Vector3::x()), Vector3::x() * 0.5), (-0.5, up));
        assert_eq!(signed_distance_m(&capsule(up), up * 0.5), (-0.5, Vector3::x()));
        assert_eq!(signed_distance_m(&capsule(Vector3::zeros()), Vector3::zeros()), (-0.5, up));
        let cube = Shape::Box { half_m: Vector3::repeat(1.0), yaw_deg: 0.0 };
        assert_eq!(signed_distance_m(&cube, Vector3::zeros()), (-1.0, Vector3::x()));
    }
}
