//! Planes between a vehicle and convex obstacles. The vehicle renews them alone, without messages.
//!
//! # Lemma 4
//! Let c be the point of a convex body closest to a point x outside, and n = (c - x) / |c - x|. Then n . y >= n . c for
//! every point y of the body: otherwise the step from c towards y, inside the body, comes closer to x. The half-space
//! n . x <= n . c - m therefore has the distance m from the body. Take m = clearance + e. By Lemmas 1 and 2 the
//! reference stays inside the plane that is held, and the vehicle stays within e of the reference. It is at least its
//! clearance away from the body at all times.
//!
//! No other vehicle relies on this plane. The vehicle may replace it at any instant by any such plane that has p and s
//! inside. Lemma 2 needs no more.
//!
//! # Choice of the plane
//! The distance from a convex body is a convex function along the segment from p to s. Its slope at a point is -n times
//! the direction of the segment, so its minimum is found by bisection. At the minimum both ends have at least the room
//! of x. Each point x gives a safe plane, however far the bisection has come.

use std::fmt;
use std::sync::Arc;

use nalgebra::{Isometry3, Unit, Vector3};

use crate::plane::{Plane, Segment};
use crate::settings::{ROUNDING_M, ShieldError, ShieldFault};

/// Points of the segment at which a plane is tried.
const TRIES: usize = 32;
/// Room that the search gives away \[m\].
const TOLERANCE_M: f64 = 1e-9;
/// Smallest distance of a point that gives a plane \[m\]. Nearer to the body, rounding would turn the normal.
const LEAST_M: f64 = 1e-3;

/// Convex, closed body that does not move.
pub trait ConvexBody: fmt::Debug + Send + Sync {
    /// Returns the point of the body closest to a point outside \[m\]. `None` for a point that is not outside.
    ///
    /// The certificate depends on this point: it must be exact but for the rounding of doubles.
    fn closest_point_m(&self, point_m: &Vector3<f64>) -> Option<Vector3<f64>>;
}

/// Ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre \[m\].
    pub centre_m: Vector3<f64>,
    /// Radius \[m\]; 0 for a point.
    pub radius_m: f64,
}

impl ConvexBody for Ball {
    fn closest_point_m(&self, point_m: &Vector3<f64>) -> Option<Vector3<f64>> {
        let offset = point_m - self.centre_m;
        let distance = offset.norm();
        (distance > self.radius_m).then(|| self.centre_m + offset * (self.radius_m / distance))
    }
}

/// Box of any orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// Centre \[m\] and orientation.
    pub pose: Isometry3<f64>,
    /// Half of the edges \[m\]; 0 for a plate.
    pub half_extents_m: Vector3<f64>,
}

impl ConvexBody for Cuboid {
    fn closest_point_m(&self, point_m: &Vector3<f64>) -> Option<Vector3<f64>> {
        let point = self.pose.inverse_transform_point(&(*point_m).into()).coords;
        let closest = point.zip_map(&self.half_extents_m, |value, half| value.max(-half).min(half));
        (closest != point).then(|| self.pose.transform_point(&closest.into()).coords)
    }
}

/// Solid half-space: ground, or a wall without an end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolidHalfSpace {
    /// Normal, out of the solid.
    pub normal: Unit<Vector3<f64>>,
    /// Extent of the solid along the normal \[m\].
    pub offset_m: f64,
}

impl ConvexBody for SolidHalfSpace {
    fn closest_point_m(&self, point_m: &Vector3<f64>) -> Option<Vector3<f64>> {
        let distance = self.normal.dot(point_m) - self.offset_m;
        (distance > 0.0).then(|| point_m - self.normal.scale(distance))
    }
}

/// Body with the distance that vehicles keep from it.
#[derive(Clone, Debug)]
pub struct Obstacle {
    /// The body.
    pub body: Arc<dyn ConvexBody>,
    /// Smallest distance from the body that is certified \[m\].
    pub clearance_m: f64,
}

impl Obstacle {
    /// Returns an obstacle.
    #[must_use]
    pub fn new(body: impl ConvexBody + 'static, clearance_m: f64) -> Self {
        Self { body: Arc::new(body), clearance_m }
    }

    /// Returns the plane before the body with this margin \[m\] that leaves a segment the most room, and that room.
    /// `None` if the segment meets the body, or a number is not finite.
    fn plane_before(&self, segment: &Segment, margin_m: f64) -> Option<(Plane, f64)> {
        let (start, along) = (segment.position(), segment.stop() - segment.position());
        let (mut low, mut high) = (0.0, 1.0);
        let mut best: Option<(Plane, f64)> = None;
        for k in 0..TRIES {
            let fraction = if k < 2 { k as f64 } else { f64::midpoint(low, high) };
            let point = start + along * fraction;
            let closest = self.body.closest_point_m(&point)?;
            let distance = (closest - point).norm();
            if !(LEAST_M..f64::INFINITY).contains(&distance) {
                return None;
            }
            let normal = (closest - point) / distance;
            let plane = Plane { normal, offset_m: normal.dot(&closest) - margin_m };
            let room = plane.room_m(&segment.position()).min(plane.room_m(&segment.stop()));
            if best.is_none_or(|(_, most)| room > most) {
                best = Some((plane, room));
            }
            if room >= distance - margin_m - TOLERANCE_M {
                break;
            }
            if normal.dot(&along) > 0.0 {
                low = fraction;
            } else {
                high = fraction;
            }
        }
        best
    }
}

/// Obstacle with the plane that a vehicle holds before it.
#[derive(Clone, Debug)]
pub(crate) struct KeepOut {
    obstacle: Obstacle,
    /// Clearance, tube and rounding \[m\].
    margin_m: f64,
    held: Plane,
}

impl KeepOut {
    /// Returns the planes of a vehicle, by its number, its reserved segment, and its largest distance from the segment
    /// \[m\].
    pub(crate) fn all(
        obstacles: &[Obstacle],
        vehicle: u16,
        around_m: f64,
        segment: &Segment,
    ) -> Result<Vec<Self>, ShieldError> {
        let vehicle = u64::from(vehicle) + 1;
        let keep_outs = obstacles.iter().zip(1..).map(|(obstacle, number): (_, usize)| {
            let clearance_m = obstacle.clearance_m;
            if !(clearance_m.is_finite() && clearance_m >= 0.0) {
                let problem = format!("the clearance of obstacle {number} must not be negative");
                return Err(ShieldError::new(
                    ShieldFault::OutOfRange,
                    "clearance_m",
                    problem,
                    clearance_m,
                    "give 0 or a positive number",
                ));
            }
            let margin_m = clearance_m + around_m + ROUNDING_M / 2.0;
            match obstacle.plane_before(segment, margin_m) {
                Some((held, room_m)) if room_m >= 0.0 => Ok(Self { obstacle: obstacle.clone(), margin_m, held }),
                Some((_, room_m)) => {
                    let problem = format!(
                        "vehicle {vehicle} reserves a segment nearer to obstacle {number} than the {margin_m:.6} m of \
                         its margin"
                    );
                    let remedy = "move it away, start slower or lower the errors";
                    Err(ShieldError::new(ShieldFault::TooNear, "start", problem, room_m + margin_m, remedy))
                }
                None => {
                    let problem = format!("vehicle {vehicle} reserves a segment that meets obstacle {number}");
                    Err(ShieldError::new(ShieldFault::TooNear, "start", problem, 0.0, "move it away or start slower"))
                }
            }
        });
        keep_outs.collect()
    }

    /// Least distance of the segment from the body \[m\].
    pub(crate) fn least_m(&self) -> f64 {
        self.margin_m.max(LEAST_M)
    }

    /// Returns the plane to be held from an instant on, with the position of the reference, its reserved segment and
    /// the reach of a period \[m\]. `None` for a plane beyond reach. A plane within reach is renewed.
    #[inline]
    pub(crate) fn within(&mut self, segment: &Segment, reach_m: f64) -> Option<Plane> {
        let position = segment.position();
        if self.held.room_m(&position) > reach_m {
            return None;
        }
        if let Some((plane, _)) = self.obstacle.plane_before(segment, self.margin_m).filter(|(_, room)| *room >= 0.0) {
            self.held = plane;
        }
        (self.held.room_m(&position) <= reach_m).then_some(self.held)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion};

    use super::*;
    use crate::tests::{Random, random_body};

    #[test]
    fn closest_points_known_by_hand() {
        let ball = Ball { centre_m: Vector3::x(), radius_m: 0.5 };
        assert_eq!(ball.closest_point_m(&Vector3::zeros()), Some(Vector3::x() * 0.5));
        assert_eq!(ball.closest_point_m(&(Vector3::x() * 1.5)), None);
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        let pose = Isometry3::from_parts(Translation3::new(0.0, 0.0, 1.0), turned);
        let cuboid = Cuboid { pose, half_extents_m: Vector3::new(3.0, 1.0, 0.5) };
        let closest = cuboid.closest_point_m(&Vector3::new(2.0, 2.0, 1.0)).expect("outside");
        assert!((closest - Vector3::new(1.0, 2.0, 1.0)).norm() < 1e-15, "{closest}");
        assert_eq!(cuboid.closest_point_m(&Vector3::new(0.9, 2.9, 1.4)), None);
        let ground = SolidHalfSpace { normal: Vector3::z_axis(), offset_m: 1.0 };
        assert_eq!(ground.closest_point_m(&Vector3::new(4.0, 5.0, 3.0)), Some(Vector3::new(4.0, 5.0, 1.0)));
        assert_eq!(ground.closest_point_m(&Vector3::new(4.0, 5.0, 1.0)), None);
    }

    #[test]
    fn a_plane_has_the_margin_from_the_body_and_leaves_the_segment_its_distance() {
        let mut random = Random::new(21);
        let mut found = 0;
        for _ in 0..3_000 {
            let obstacle = random_body(&mut random, 2.0, 0.0);
            let segment = Segment::new(random.vector(4.0), random.vector(4.0));
            let margin = random.between(0.1, 0.5);
            let point_at = |k: usize| segment.position() + (segment.stop() - segment.position()) * (k as f64 / 200.0);
            let distance = |k: usize| {
                let point = point_at(k);
                obstacle.body.closest_point_m(&point).map_or(0.0, |closest| (closest - point).norm())
            };
            let nearest = (0..=200).map(distance).fold(f64::INFINITY, f64::min);
            let Some((plane, room)) = obstacle.plane_before(&segment, margin) else {
                assert!(nearest < 0.05, "{obstacle:?} {segment:?}: {nearest}");
                continue;
            };
            found += 1;
            assert!((plane.normal.norm() - 1.0).abs() < 1e-12);
            // Samples are at most 8/200 m apart.
            assert!((-1e-9..0.021).contains(&(nearest - margin - room)), "{obstacle:?} {segment:?}: {nearest} {room}");
            // Points of the body, found as the closest points to points around it.
            for _ in 0..100 {
                let around = random.vector(6.0);
                let point = obstacle.body.closest_point_m(&around).unwrap_or(around);
                assert!(plane.room_m(&point) <= -margin + 1e-9, "{obstacle:?} {segment:?}: {point}");
            }
        }
        assert!(found > 1_000, "{found}");
    }

    #[test]
    fn numbers_that_are_not_finite_have_no_plane() {
        let segment = Segment::new(Vector3::zeros(), Vector3::x());
        for (x, radius_m) in [(f64::NAN, 0.5), (f64::INFINITY, 0.5), (3.0, f64::NAN), (3.0, f64::INFINITY)] {
            let obstacle = Obstacle::new(Ball { centre_m: Vector3::x() * x, radius_m }, 0.1);
            assert!(obstacle.plane_before(&segment, 0.1).is_none(), "{x} {radius_m}");
        }
        let nan = Cuboid { pose: Isometry3::identity(), half_extents_m: Vector3::x() * f64::NAN };
        let found = Obstacle::new(nan, 0.1).plane_before(&Segment::new(Vector3::x(), Vector3::x()), 0.1);
        assert!(found.is_none_or(|(_, room)| room < 0.0 || room.is_finite()));
    }
}
