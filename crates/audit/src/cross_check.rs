//! The second detector on recorded motion: parry, which shares the pairs and their relative motion with the first, and no
//! formula for distances or contacts.

use nalgebra::Vector3;
use parry3d::math::Vector;
use parry3d::query::PointQuery as _;
use parry3d::shape::{Ball, Capsule, Cuboid, HalfSpace};

use super::enclosure::{Minimum, Search, Target};
use super::obstacle::Shape;
use super::parry::{CrossCheck, KeepOut};
use super::polynomial::{stray, value};
use super::sweep::RelativeMotion;

/// Most chords that a segment of a curve is cast along.
const MOST_CHORDS: u32 = 64;
/// How far a chord may stray from the curve, as a fraction of the limit, where the number of chords allows it.
const CHORD_OVER_LIMIT: f64 = 1e-6;
/// Points of a segment at which the distance from an obstacle is measured again.
const PLACES: u32 = 8;
/// Relative difference of two distances from an obstacle that rounding explains: each is a handful of operations.
const ROUNDING: f64 = 1e-12;

/// What the second detector says of a segment where the first found this minimum.
pub(super) fn cross_check(search: &Search<'_>, keep_out: &KeepOut, found: &Minimum, rounding: f64) -> CrossCheck {
    match (search.target, search.exact()) {
        (Target::Origin, Some(motion)) => {
            let closest = motion.closest();
            let is_below = closest.separation_m() < keep_out.delta_m;
            keep_out.compare(&motion, closest, is_below, keep_out.cast(&motion)).1
        }
        (Target::Origin, None) => along_chords(keep_out, search.r, found, rounding),
        (Target::Shape(shape), _) => from_shape(shape, keep_out.delta_m, found, |u| search.position(u)),
    }
}

/// Casts keep-out balls along chords of a curve. The answers may differ by what the chords stray.
fn along_chords(keep_out: &KeepOut, r: &[Vector3<f64>], found: &Minimum, rounding: f64) -> CrossCheck {
    let limit = keep_out.delta_m;
    let whole = stray(r);
    let wanted = (whole / (CHORD_OVER_LIMIT * limit)).sqrt().ceil();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a small number")]
    let chords = wanted.clamp(1.0, f64::from(MOST_CHORDS)) as u32;
    let at = |k: u32| value(r, f64::from(k) / f64::from(chords));
    let mut from = at(0);
    let mut contact = None;
    for k in 0..chords {
        let to = at(k + 1);
        if let Some(fraction) = keep_out.cast(&RelativeMotion::new(from, to)) {
            contact = Some((f64::from(k) + fraction) / f64::from(chords));
            break;
        }
        from = to;
    }
    // The second differences of the control points bound the curvature, which n chords divide by n^2.
    let strayed = curvature_stray(r) / f64::from(chords).powi(2) + rounding;
    let agrees = match contact {
        None => found.upper >= limit - strayed,
        Some(fraction) => !fraction.is_nan() && found.lower <= limit + strayed,
    };
    CrossCheck { contact, agrees }
}

/// Farthest that a chord of a part of length 1 / n strays from the curve, times n^2: an eighth of a bound on |r''|.
fn curvature_stray(r: &[Vector3<f64>]) -> f64 {
    r.iter().enumerate().skip(2).map(|(k, c)| (k * (k - 1)) as f64 * c.norm()).sum::<f64>() / 8.0
}

/// Measures the distance from an obstacle again, where it was found to be smallest and at places in between.
fn from_shape(shape: &Shape, limit: f64, found: &Minimum, position: impl Fn(f64) -> Vector3<f64>) -> CrossCheck {
    let places = (0..=PLACES).map(|k| f64::from(k) / f64::from(PLACES));
    let measured = |u: f64| {
        let at = position(u);
        (distance(shape, at), ROUNDING * (at.norm() + shape.radius() + limit))
    };
    let (there, rounding) = measured(found.at);
    let same = (there - found.upper.max(0.0)).abs() <= rounding;
    let lowest = places.clone().all(|u| {
        let (distance, rounding) = measured(u);
        distance >= found.lower.max(0.0) - rounding
    });
    let contact = places.chain([found.at]).filter(|u| measured(*u).0 < limit).reduce(f64::min);
    CrossCheck { contact, agrees: same && lowest }
}

/// Distance of a point from a shape by parry, zero within.
fn distance(shape: &Shape, point: Vector3<f64>) -> f64 {
    let vector = |v: Vector3<f64>| Vector::new(v.x, v.y, v.z);
    let point = vector(shape.turned(point));
    match shape {
        Shape::Ball { radius_m } => Ball::new(*radius_m).distance_to_local_point(point, true),
        Shape::Box { half_m, .. } => Cuboid::new(vector(*half_m)).distance_to_local_point(point, true),
        Shape::Capsule { from_m, to_m, radius_m } => {
            Capsule::new(vector(*from_m), vector(*to_m), *radius_m).distance_to_local_point(point, true)
        }
        Shape::HalfSpace { normal } => HalfSpace::new(vector(normal.normalize())).distance_to_local_point(point, true),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::obstacle::one_of_each;

    #[test]
    fn parry_measures_the_same_distances() {
        for shape in one_of_each() {
            for k in 0..50_u32 {
                let turn = f64::from(k) * 2.4;
                let point = Vector3::new(3.0 * turn.cos(), 3.0 * turn.sin(), 0.1 * f64::from(k) - 2.0);
                let ours = shape.distance(point).max(0.0);
                assert!((distance(&shape, point) - ours).abs() < 1e-14, "{shape:?} {point:?}");
            }
        }
    }

    #[test]
    fn what_rounding_explains_of_a_distance_is_no_disagreement_however_far_the_obstacle_is() {
        for shape in one_of_each() {
            for k in 0..50_u32 {
                let turn = f64::from(k) * 2.4;
                let far = Vector3::new(3e7 * turn.cos(), 2e7 * turn.sin(), 1e7);
                // Past it: nearest somewhere between the ends.
                let across = Vector3::new(-far.y, far.x, 0.0).normalize();
                let along = |u: f64| far + across * (6e6 * u - 2.9e6);
                let (lower, at) = shape.closest(along(0.0), along(1.0));
                let right = Minimum { lower, upper: lower, at };
                assert!(from_shape(&shape, 1.0, &right, along).agrees, "{shape:?} {far:?}");
                // Within, parry says zero however deep it is.
                let wrong = Minimum { upper: lower + 0.1, ..right };
                // Within a half-space one depth is as good as another.
                assert!(lower < 0.0 || !from_shape(&shape, 1.0, &wrong, along).agrees, "{shape:?} {far:?}");
            }
        }
    }

    #[test]
    fn a_minimum_that_is_wrong_is_a_disagreement() {
        let along = |u: f64| Vector3::new(6.0 * u - 3.0, 2.0, 0.0);
        for shape in one_of_each() {
            let (lower, at) = shape.closest(along(0.0), along(1.0));
            let right = Minimum { lower, upper: lower, at };
            assert!(from_shape(&shape, 1.0, &right, along).agrees, "{shape:?}");
            for wrong in [Minimum { upper: lower + 0.1, ..right }, Minimum { lower: lower + 3.0, ..right }] {
                assert!(!from_shape(&shape, 1.0, &wrong, along).agrees, "{shape:?} {wrong:?}");
            }
        }
        let curve = [Vector3::new(-1.0, 0.5, 0.0), Vector3::new(2.0, -2.0, 0.0), Vector3::new(0.0, 2.0, 0.0)];
        let keep_out = KeepOut::new(0.6);
        let clear = Minimum { lower: 0.7, upper: 0.7, at: 0.5 };
        let touching = Minimum { lower: 0.0, upper: 0.0, at: 0.5 };
        assert!(along_chords(&keep_out, &curve, &touching, 0.0).agrees);
        assert!(!along_chords(&keep_out, &curve, &clear, 0.0).agrees);
    }
}
