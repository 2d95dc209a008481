//! Reserved segments of two vehicles, and the plane between them.
//!
//! # Ellipsoids
//! Around each vehicle there may be an upright ellipsoid with the half axes delta / 2, delta / 2 and k instead of a
//! ball. Two such ellipsoids do not overlap if the distance of their centres is at least delta after S = diag(1, 1,
//! delta / (2 k)). A [`Metric`] is this S. Planes stay planes in scaled lengths, and segments stay segments, so the
//! proof holds for the scaled references S p^. An error of e is at most e max(1, delta / (2 k)) there. The true plane
//! of a scaled one n . S x <= c is (S n) . x <= c, divided by |S n|. Brake, choice and reach use true planes.

//!
//! # Verified planes
//! A pair of points of two segments gives an upper bound of their distance. A unit normal gives a lower bound: the gap
//! between the ends of the two segments along it. [`Divider::between`] takes the normal of the closest points if both
//! bounds agree. They do not agree for long segments that are nearly parallel. It then takes the normal with the widest
//! gap: of the closest points, of the four ends, or of the common perpendicular. The gap is computed from the ends, so
//! it is a lower bound for every normal.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::saved::vector;

/// Largest difference of the two bounds of a distance that counts as rounding \[m\].
const BOUNDS_AGREE_M: f64 = 1e-9;
/// Largest deviation of the squared length of a normal that is rounding of doubles.
const UNIT: f64 = 1e-14;
/// Largest deviation of the squared length of a normal that is valid: rounding of single precision.
const SINGLE: f64 = 1e-6;

/// Scaled lengths, in which two vehicles are delta apart: level lengths as they are, vertical ones times a factor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metric {
    vertical: f64,
}

impl Metric {
    /// True lengths, for balls.
    pub const BALL: Self = Self { vertical: 1.0 };

    /// Returns the lengths in which ellipsoids with half axes of half of delta, half of delta, and this half height
    /// are balls \[m\].
    #[must_use]
    pub fn ellipsoid(delta_m: f64, half_height_m: f64) -> Self {
        Self { vertical: delta_m / (2.0 * half_height_m) }
    }

    /// Returns the lengths with this factor of vertical ones.
    pub(crate) fn of_vertical(vertical: f64) -> Self {
        Self { vertical }
    }

    /// Factor of vertical lengths.
    pub(crate) fn vertical(self) -> f64 {
        self.vertical
    }

    /// Returns a vector in scaled lengths.
    #[inline]
    #[must_use]
    pub fn scaled(self, vector: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(vector.x, vector.y, vector.z * self.vertical)
    }

    /// Largest factor by which a length grows.
    #[must_use]
    pub fn stretch(self) -> f64 {
        self.vertical.max(1.0)
    }

    /// Largest true length of a scaled length of 1.
    pub(crate) fn widest(self) -> f64 {
        1.0 / self.vertical.min(1.0)
    }

    /// Returns the distance of two segments in scaled lengths \[m\]. It is the verified gap of a plane where rounding
    /// makes the closest points uncertain, and then at most the distance.
    #[must_use]
    pub fn distance_m(self, one: &Segment, other: &Segment) -> f64 {
        self.segment(one).distance_m(&self.segment(other))
    }

    #[inline]
    fn segment(self, segment: &Segment) -> Segment {
        Segment::new(self.scaled(&segment.position()), self.scaled(&segment.stop()))
    }

    /// Returns the true plane of a plane in scaled lengths.
    #[inline]
    fn true_plane(self, normal: Vector3<f64>, offset_m: f64) -> Plane {
        // A normal of length 1 would be rounded.
        if self == Self::BALL {
            return Plane { normal, offset_m };
        }
        let scaled = self.scaled(&normal);
        let length = scaled.norm();
        Plane { normal: scaled / length, offset_m: offset_m / length }
    }
}

/// Part of space that a vehicle reserves: the segment from its reference to the stop point of its brake.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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

    /// Returns the distance of two segments \[m\]. See [`Metric::distance_m`].
    #[must_use]
    pub fn distance_m(&self, other: &Self) -> f64 {
        self.gap(other).map_or(0.0, |gap| gap.width_m)
    }

    /// Returns the gap of the best normal between this segment and another one. `None` if they meet or a number is not
    /// finite.
    #[inline]
    pub(crate) fn gap(&self, other: &Self) -> Option<Gap> {
        let (from, to) = self.closest_points(other);
        let distance = (to - from).norm();
        // A distance that is not finite fails the comparison too.
        if !(distance > 0.0 && distance < f64::INFINITY) {
            return None;
        }
        let normal = (to - from) / distance;
        let verified = self.gap_along(other, normal, from);
        if verified.width_m >= distance - BOUNDS_AGREE_M {
            return Some(Gap { normal, edge_m: normal.dot(&from), width_m: distance });
        }
        let best = self.normals(other).into_iter().map(|normal| self.gap_along(other, normal, from));
        let best = best.fold(verified, |best, gap| if gap.width_m > best.width_m { gap } else { best });
        (best.width_m > 0.0).then_some(best)
    }

    /// Returns the gap along a unit normal. Extents are taken from a point near both segments, for less rounding.
    fn gap_along(&self, other: &Self, normal: Vector3<f64>, near: Vector3<f64>) -> Gap {
        let [own, others] =
            [self, other].map(|segment| [segment.position(), segment.stop()].map(|point| normal.dot(&(point - near))));
        let (most, least) = (own[0].max(own[1]), others[0].min(others[1]));
        Gap { normal, edge_m: normal.dot(&near) + most, width_m: least - most }
    }

    /// Returns unit normals towards another segment: those of the four ends and the common perpendicular, both ways.
    fn normals(&self, other: &Self) -> [Vector3<f64>; 6] {
        let across = (self.stop() - self.position()).cross(&(other.stop() - other.position()));
        [
            other.nearest(&self.position()) - self.position(),
            other.nearest(&self.stop()) - self.stop(),
            other.position() - self.nearest(&other.position()),
            other.stop() - self.nearest(&other.stop()),
            across,
            -across,
        ]
        // A vector of length 0 has a gap that is not a number, which is never the widest.
        .map(|towards| towards / towards.norm())
    }

    /// Returns the point of this segment closest to a point.
    fn nearest(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let along = self.stop() - self.position();
        let length = along.norm_squared();
        if length > 0.0 {
            self.position() + along * ((point - self.position()).dot(&along) / length).clamp(0.0, 1.0)
        } else {
            self.position()
        }
    }

    /// Largest coordinate of both ends \[m\].
    #[inline]
    pub(crate) fn farthest_m(&self) -> f64 {
        self.position_m.iter().chain(&self.stop_m).fold(0.0, |farthest, value| farthest.max(value.abs()))
    }

    /// Whether all numbers are finite.
    #[inline]
    pub(crate) fn is_finite(&self) -> bool {
        // 0 times a number is NaN unless the number is finite. One comparison takes the place of six.
        self.position_m.iter().chain(&self.stop_m).map(|value| value * 0.0).sum::<f64>() == 0.0
    }

    /// Returns the closest points of this segment and of another one. [`Segment::gap`] verifies them: for segments that
    /// are nearly parallel they may be far from the closest ones.
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

/// Space between two segments along a unit normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gap {
    /// Unit normal, from the first segment to the second one.
    pub(crate) normal: Vector3<f64>,
    /// Largest extent of the first segment along the normal \[m\].
    pub(crate) edge_m: f64,
    /// Width \[m\].
    pub(crate) width_m: f64,
}

/// Half-space of all x with `normal . x <= offset`, in which a vehicle keeps its path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// Unit normal, towards the other vehicle.
    #[serde(with = "vector")]
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

    /// Returns the plane that has the same points of the level plane at a height \[m\], with a level normal. `None` if
    /// it has all of them or none.
    #[inline]
    #[must_use]
    pub fn in_level(&self, height_m: f64) -> Option<Self> {
        let level = Vector3::new(self.normal.x, self.normal.y, 0.0);
        let length = level.norm();
        let offset_m = (self.offset_m - self.normal.z * height_m) / length;
        (length > 0.0).then(|| Self { normal: level / length, offset_m })
    }

    /// Whether both ends of a segment are inside. A number that is not finite is outside.
    #[inline]
    #[must_use]
    pub fn contains(&self, segment: &Segment) -> bool {
        self.room_m(&segment.position()) >= 0.0 && self.room_m(&segment.stop()) >= 0.0
    }
}

/// Plane between the owner and the follower of a pair, before the margins of the two: all x with `normal . x = offset`
/// in the scaled lengths of a [`Metric`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Divider {
    /// Normal from the owner to the follower, of length 1 up to rounding of single precision.
    pub normal: [f64; 3],
    /// Extent along the normal \[m\].
    pub offset_m: f64,
}

impl Divider {
    /// Returns the divider of the closest points of two segments, with the same room for both beyond their margins.
    /// Margins and points are in scaled lengths. `None` if the segments are closer than the sum of the margins.
    #[inline]
    #[must_use]
    pub fn between(
        metric: Metric,
        owner: &Segment,
        follower: &Segment,
        owner_margin_m: f64,
        follower_margin_m: f64,
    ) -> Option<Self> {
        let gap = metric.segment(owner).gap(&metric.segment(follower))?;
        let room = gap.width_m - owner_margin_m - follower_margin_m;
        (room >= 0.0).then(|| Self { normal: gap.normal.into(), offset_m: gap.edge_m + owner_margin_m + room / 2.0 })
    }

    /// Returns the true half-space of the owner with its margin \[m\] in scaled lengths.
    #[inline]
    #[must_use]
    pub fn owner_plane(&self, metric: Metric, margin_m: f64) -> Plane {
        let (normal, offset_m) = self.unit();
        metric.true_plane(normal, offset_m - margin_m)
    }

    /// Returns the true half-space of the follower with its margin \[m\] in scaled lengths.
    #[inline]
    #[must_use]
    pub fn follower_plane(&self, metric: Metric, margin_m: f64) -> Plane {
        let (normal, offset_m) = self.unit();
        metric.true_plane(-normal, -offset_m - margin_m)
    }

    /// Returns the divider with a normal of length 1. Both vehicles of a pair get the same numbers from the same
    /// divider, so the owner may round the normal before the proposal.
    #[inline]
    fn unit(&self) -> (Vector3<f64>, f64) {
        let normal = Vector3::from(self.normal);
        let squared = normal.norm_squared();
        // A normal of length 1 would be rounded.
        if (squared - 1.0).abs() <= UNIT {
            return (normal, self.offset_m);
        }
        let length = squared.sqrt();
        (normal / length, self.offset_m / length)
    }

    /// Whether the normal has length 1 up to rounding of single precision and the offset is finite.
    #[inline]
    pub(crate) fn is_valid(&self) -> bool {
        (Vector3::from(self.normal).norm_squared() - 1.0).abs() <= SINGLE && self.offset_m.is_finite()
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
            let point_at = |segment: &Segment, k: usize| {
                segment.position() + (segment.stop() - segment.position()) * (k as f64 / 20.0)
            };
            let sampled = (0..=20).flat_map(|s| (0..=20).map(move |t| (s, t)));
            let nearest =
                sampled.map(|(s, t)| (point_at(&own, s) - point_at(&other, t)).norm()).fold(f64::INFINITY, f64::min);
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
        for round in 0..3_000 {
            let (owner, follower) = (segment(&mut random), segment(&mut random));
            let (mine, yours) = (random.between(0.1, 1.0), random.between(0.1, 1.0));
            let metric = [Metric::BALL, Metric::ellipsoid(1.0, 1.5), Metric::ellipsoid(1.0, 0.2)][round % 3];
            let room = metric.distance_m(&owner, &follower) - mine - yours;
            let divider = Divider::between(metric, &owner, &follower, mine, yours);
            assert_eq!(divider.is_some(), room >= 0.0, "{owner:?} {follower:?}");
            let Some(divider) = divider else { continue };
            assert!(divider.is_valid());
            found += 1;
            let planes = [divider.owner_plane(metric, mine), divider.follower_plane(metric, yours)];
            for (plane, segment) in planes.iter().zip([owner, follower]) {
                assert!((plane.normal.norm() - 1.0).abs() < 1e-12);
                // Scaled lengths per metre of room.
                let unit = metric.scaled(&Vector3::from(divider.normal)).norm();
                let least = plane.room_m(&segment.position()).min(plane.room_m(&segment.stop())) * unit;
                assert!((least - room / 2.0).abs() < 1e-9, "{owner:?} {follower:?}: {least} {room}");
            }
            // Any two points inside are as far apart as the margins, in scaled lengths.
            for _ in 0..10 {
                let [one, other] = [0, 1].map(|k| {
                    let point = random.vector(5.0);
                    point + planes[k].normal * planes[k].room_m(&point).min(0.0)
                });
                assert!(metric.scaled(&(one - other)).norm() >= mine + yours - 1e-9, "{metric:?}: {one} {other}");
            }
        }
        assert!(found > 500, "{found}");
    }

    #[test]
    fn numbers_that_are_not_finite_are_outside_and_have_no_divider() {
        let point = |x: f64| Segment::new(Vector3::new(x, 0.0, 0.0), Vector3::new(x, 0.0, 0.0));
        let plane = Plane { normal: Vector3::x(), offset_m: 1.0 };
        assert!(plane.contains(&point(1.0)) && !plane.contains(&point(1.1)) && !plane.contains(&point(f64::NAN)));
        assert_eq!(Divider::between(Metric::BALL, &point(0.0), &point(f64::NAN), 0.5, 0.5), None);
        assert_eq!(Divider::between(Metric::BALL, &point(0.0), &point(f64::INFINITY), 0.5, 0.5), None);
        assert_eq!(Divider::between(Metric::BALL, &point(0.0), &point(0.0), 0.0, 0.0), None);
        assert!(!Divider { normal: [1.0, 1.0, 0.0], offset_m: 0.0 }.is_valid());
        assert!(!Divider { normal: [1.0, 0.0, 0.0], offset_m: f64::NAN }.is_valid());
    }
}
