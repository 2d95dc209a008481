//! Reserved segments of two vehicles, and the plane between them.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Part of space that a vehicle reserves: the segment from its reference to the stop point of its brake.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// Position of the reference \[m\].
    pub position_m: [f64; 3],
    /// Stop point of the brake from there \[m\].
    pub stop_m: [f64; 3],
}

impl Segment {
    /// Returns the segment between two points \[m\].
    #[must_use]
    pub fn new(position_m: Vector3<f64>, stop_m: Vector3<f64>) -> Self {
        Self { position_m: position_m.into(), stop_m: stop_m.into() }
    }

    /// Position of the reference \[m\].
    #[inline]
    #[must_use]
    pub fn position(&self) -> Vector3<f64> {
        self.position_m.into()
    }

    /// Stop point \[m\].
    #[inline]
    #[must_use]
    pub fn stop(&self) -> Vector3<f64> {
        self.stop_m.into()
    }

    /// Returns the distance of two segments \[m\].
    #[must_use]
    pub fn distance_m(&self, other: &Self) -> f64 {
        let (own, others) = self.closest_points(other);
        (others - own).norm()
    }

    /// Whether all numbers are finite.
    pub(crate) fn is_finite(&self) -> bool {
        self.position_m.iter().chain(&self.stop_m).all(|value| value.is_finite())
    }

    /// Returns the closest points of this segment and of another one.
    ///
    /// The squared distance of the points at the fractions s and t is a convex quadratic. Its minimum over all s and t
    /// is clamped to the ends of one segment. Then the best point of the other segment is taken (Ericson, Real-Time
    /// Collision Detection, section 5.1.9). Segments below 1e-9 m count as points.
    #[inline]
    pub(crate) fn closest_points(&self, other: &Self) -> (Vector3<f64>, Vector3<f64>) {
        /// Square of the length below which a segment is a point \[m^2\].
        const POINT_M2: f64 = 1e-18;
        /// Squared sine of the angle below which two segments count as parallel.
        const PARALLEL: f64 = 1e-14;
        let (p, q) = (self.position(), other.position());
        let (along, across, from) = (self.stop() - p, other.stop() - q, p - q);
        let (own, others) = (along.norm_squared(), across.norm_squared());
        let (c, f) = (along.dot(&from), across.dot(&from));
        let fraction = |dividend: f64, divisor: f64| (dividend / divisor).clamp(0.0, 1.0);
        let (s, t) = match (own > POINT_M2, others > POINT_M2) {
            (false, false) => (0.0, 0.0),
            (false, true) => (0.0, fraction(f, others)),
            (true, false) => (fraction(-c, own), 0.0),
            (true, true) => {
                let b = along.dot(&across);
                let determinant = own * others - b * b;
                let s =
                    if determinant > PARALLEL * own * others { fraction(b * f - c * others, determinant) } else { 0.0 };
                let t = (b * s + f) / others;
                if t < 0.0 {
                    (fraction(-c, own), 0.0)
                } else if t > 1.0 {
                    (fraction(b - c, own), 1.0)
                } else {
                    (s, t)
                }
            }
        };
        (p + along * s, q + across * t)
    }
}

/// Half-space of all x with `normal . x <= offset`, in which a vehicle keeps its path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal, towards the other vehicle.
    pub normal: Vector3<f64>,
    /// Largest extent along the normal \[m\].
    pub offset_m: f64,
}

impl Plane {
    /// Returns the distance of a point to the plane \[m\], negative outside of the half-space.
    #[inline]
    #[must_use]
    pub fn room_m(&self, point_m: &Vector3<f64>) -> f64 {
        self.offset_m - self.normal.dot(point_m)
    }

    /// Whether both ends of a segment are inside. A number that is not finite is outside.
    #[inline]
    #[must_use]
    pub fn contains(&self, segment: &Segment) -> bool {
        self.room_m(&segment.position()) >= 0.0 && self.room_m(&segment.stop()) >= 0.0
    }
}

/// Plane between the owner and the follower of a pair, before the margins of the two: all x with `normal . x = offset`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Divider {
    /// Unit normal, from the owner to the follower.
    pub normal: [f64; 3],
    /// Extent along the normal \[m\].
    pub offset_m: f64,
}

impl Divider {
    /// Returns the divider of the closest points of two segments, with the same room for both beyond their margins.
    /// `None` if the segments are closer than the sum of the margins.
    #[inline]
    #[must_use]
    pub fn between(owner: &Segment, follower: &Segment, owner_margin_m: f64, follower_margin_m: f64) -> Option<Self> {
        let (from, to) = owner.closest_points(follower);
        let apart = to - from;
        let distance = apart.norm();
        let room = distance - owner_margin_m - follower_margin_m;
        // A distance that is not finite fails the comparison too.
        if !(room >= 0.0 && distance > 0.0 && distance < f64::INFINITY) {
            return None;
        }
        let normal = apart / distance;
        Some(Self { normal: normal.into(), offset_m: normal.dot(&from) + owner_margin_m + room / 2.0 })
    }

    /// Returns the half-space of the owner with its margin \[m\].
    #[inline]
    #[must_use]
    pub fn owner_plane(&self, margin_m: f64) -> Plane {
        Plane { normal: self.normal.into(), offset_m: self.offset_m - margin_m }
    }

    /// Returns the half-space of the follower with its margin \[m\].
    #[inline]
    #[must_use]
    pub fn follower_plane(&self, margin_m: f64) -> Plane {
        Plane { normal: -Vector3::from(self.normal), offset_m: -self.offset_m - margin_m }
    }

    /// Whether the normal has length 1 up to rounding and the offset is finite.
    #[inline]
    pub(crate) fn is_valid(&self) -> bool {
        /// Error of a squared length by rounding, and by a radio that sends few digits.
        const UNIT: f64 = 1e-12;
        (Vector3::from(self.normal).norm_squared() - 1.0).abs() <= UNIT && self.offset_m.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::Random;

    fn segment(random: &mut Random) -> Segment {
        let from = random.vector(3.0);
        let to = if random.chance(0.2) { from } else { from + random.vector(3.0) };
        Segment::new(from, to)
    }

    #[test]
    fn no_sampled_pair_of_points_is_closer_and_the_closest_points_are_on_the_segments() {
        let mut random = Random::new(3);
        for _ in 0..2_000 {
            let (own, other) = (segment(&mut random), segment(&mut random));
            let distance = own.distance_m(&other);
            let at = |of: &Segment, k: usize| of.position() + (of.stop() - of.position()) * (k as f64 / 20.0);
            let sampled = (0..=20).flat_map(|s| (0..=20).map(move |t| (s, t)));
            let nearest = sampled.map(|(s, t)| (at(&own, s) - at(&other, t)).norm()).fold(f64::INFINITY, f64::min);
            assert!(distance <= nearest + 1e-12, "{own:?} {other:?}: {distance} {nearest}");
            // Samples are 1/20 of a segment apart.
            assert!(distance >= nearest - 0.16, "{own:?} {other:?}: {distance} {nearest}");
            assert!((distance - other.distance_m(&own)).abs() < 1e-9, "{own:?} {other:?}");
        }
    }

    #[test]
    fn a_divider_has_both_segments_inside_with_the_same_room() {
        let mut random = Random::new(4);
        let mut found = 0;
        for _ in 0..2_000 {
            let (owner, follower) = (segment(&mut random), segment(&mut random));
            let (mine, yours) = (random.between(0.1, 1.0), random.between(0.1, 1.0));
            let room = owner.distance_m(&follower) - mine - yours;
            let divider = Divider::between(&owner, &follower, mine, yours);
            assert_eq!(divider.is_some(), room >= 0.0, "{owner:?} {follower:?}");
            let Some(divider) = divider else { continue };
            assert!(divider.is_valid());
            found += 1;
            for (plane, segment) in [(divider.owner_plane(mine), owner), (divider.follower_plane(yours), follower)] {
                let least = plane.room_m(&segment.position()).min(plane.room_m(&segment.stop()));
                assert!((least - room / 2.0).abs() < 1e-9, "{owner:?} {follower:?}: {least} {room}");
            }
        }
        assert!(found > 500, "{found}");
    }

    #[test]
    fn numbers_that_are_not_finite_are_outside_and_have_no_divider() {
        let point = |x: f64| Segment::new(Vector3::new(x, 0.0, 0.0), Vector3::new(x, 0.0, 0.0));
        let plane = Plane { normal: Vector3::x(), offset_m: 1.0 };
        assert!(plane.contains(&point(1.0)) && !plane.contains(&point(1.1)) && !plane.contains(&point(f64::NAN)));
        assert_eq!(Divider::between(&point(0.0), &point(f64::NAN), 0.5, 0.5), None);
        assert_eq!(Divider::between(&point(0.0), &point(f64::INFINITY), 0.5, 0.5), None);
        assert_eq!(Divider::between(&point(0.0), &point(0.0), 0.0, 0.0), None);
        assert!(!Divider { normal: [1.0, 1.0, 0.0], offset_m: 0.0 }.is_valid());
        assert!(!Divider { normal: [1.0, 0.0, 0.0], offset_m: f64::NAN }.is_valid());
    }
}
