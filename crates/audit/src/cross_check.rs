//! Second detector, based on parry. It shares the pairs and their relative motion with the first detector, but no
//! formula for distances or contacts. On straight motion it casts two keep-out balls, on curves it casts them along
//! chords, and it measures distances from obstacles at points.

use nalgebra::Vector3;
use parry3d::math::{Pose, Vector};
use parry3d::query::details::cast_shapes_ball_ball;
use parry3d::query::{PointQuery as _, ShapeCastOptions};
use parry3d::shape::{Ball, Capsule, Cuboid, Cylinder, HalfSpace};

use super::cylinder::Cylinder as SafetyCylinder;
use super::enclosure::{Minimum, Search, Target};
use super::obstacle;
use super::polynomial::{motion_deviation, value};
use super::sweep::{ClosestPoint, RelativeMotion, Span, larger};
use tautline_core::obstacle::Shape;

/// Largest number of chords per segment of a curve.
const MAX_CHORDS: u32 = 64;
/// Distance of a chord from the curve as a fraction of the limit, if the number of chords allows it.
const CHORD_OVER_LIMIT: f64 = 1e-6;
/// Number of parts of a segment at whose ends the distance from an obstacle is measured again.
const PARTS: u32 = 8;
/// Relative difference of two distances from an obstacle that rounding explains; each takes a handful of operations.
const ROUNDING: f64 = 1e-12;
/// Relative excess of the scaled distance of a cylinder at the rounded fraction of its minimum.
const AT_MINIMUM: f64 = 1e-6;

/// Runs the second detector on a segment and compares it with the minimum that the first found.
pub(super) fn cross_check(search: &Search<'_>, keep_out: &KeepOut, found: &Minimum, rounding: f64) -> CrossCheck {
    match (search.target, search.exact()) {
        (Target::Origin, Some(motion)) => {
            let closest = motion.closest();
            let is_below = closest.separation_m() < keep_out.delta_m;
            keep_out.compare(&motion, closest, is_below, keep_out.cast(&motion)).1
        }
        (Target::Origin, None) => along_chords(keep_out, search.r, found, rounding),
        (Target::Cylinder(cylinder), _) => {
            from_cylinder(&cylinder, keep_out.delta_m, found, rounding, |u| search.position(u))
        }
        (Target::Shape(shape), _) => from_shape(shape, keep_out.delta_m, found, |u| search.position(u)),
    }
}

/// Casts keep-out balls along chords of a curve. The results may differ by the distance of the chords from the curve.
fn along_chords(keep_out: &KeepOut, r: &[Vector3<f64>], found: &Minimum, rounding: f64) -> CrossCheck {
    let limit = keep_out.delta_m;
    let whole = motion_deviation(r);
    let wanted = (whole / (CHORD_OVER_LIMIT * limit)).sqrt().ceil();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a small number")]
    let chords = wanted.clamp(1.0, f64::from(MAX_CHORDS)) as u32;
    let value_at = |k: u32| value(r, f64::from(k) / f64::from(chords));
    let mut from = value_at(0);
    let mut contact = None;
    for k in 0..chords {
        let to = value_at(k + 1);
        if let Some(fraction) = keep_out.cast(&RelativeMotion::new(from, to)) {
            contact = Some((f64::from(k) + fraction) / f64::from(chords));
            break;
        }
        from = to;
    }
    // The second derivative is bounded by the coefficients; n chords divide its effect by n^2.
    let deviation_bound = curvature_deviation(r) / f64::from(chords).powi(2) + rounding;
    let agrees = match contact {
        None => found.upper >= limit - deviation_bound,
        Some(fraction) => !fraction.is_nan() && found.lower <= limit + deviation_bound,
    };
    CrossCheck { contact, agrees }
}

/// Returns a bound on the distance of a chord over a part of length 1 / n from the curve, times n^2: max |r''| / 8.
fn curvature_deviation(r: &[Vector3<f64>]) -> f64 {
    r.iter().enumerate().skip(2).map(|(k, c)| (k * (k - 1)) as f64 * c.norm()).sum::<f64>() / 8.0
}

/// Measures the distance from an obstacle again, at its minimum and at points in between.
fn from_shape(shape: &Shape, limit: f64, found: &Minimum, position: impl Fn(f64) -> Vector3<f64>) -> CrossCheck {
    let points = (0..=PARTS).map(|k| f64::from(k) / f64::from(PARTS));
    let measured = |u: f64| {
        let point = position(u);
        (distance(shape, point), ROUNDING * (point.norm() + obstacle::radius(shape) + limit))
    };
    let (there, rounding) = measured(found.at);
    let same = (there - found.upper.max(0.0)).abs() <= rounding;
    let lowest = points.clone().all(|u| {
        let (distance, rounding) = measured(u);
        distance >= found.lower.max(0.0) - rounding
    });
    let contact = points.chain([found.at]).filter(|u| measured(*u).0 < limit).reduce(f64::min);
    CrossCheck { contact, agrees: same && lowest }
}

/// Tests with parry whether scaled cylinders contain the relative position, at its minimum and at points in between.
/// `rounding` is that of the scaled distance.
pub(super) fn from_cylinder(
    cylinder: &SafetyCylinder,
    limit: f64,
    found: &Minimum,
    rounding: f64,
    position: impl Fn(f64) -> Vector3<f64>,
) -> CrossCheck {
    let is_inside = |u: f64, scale: f64| {
        // The axis of parry's cylinder is y.
        let point = vector(position(u).xzy());
        scale > 0.0
            && Cylinder::new(cylinder.vertical_m * scale, cylinder.horizontal_m * scale).contains_local_point(point)
    };
    let points = (0..=PARTS).map(|k| f64::from(k) / f64::from(PARTS));
    let tolerance = ROUNDING * (found.upper + limit) + rounding;
    let is_there = is_inside(found.at, found.upper + tolerance.max(AT_MINIMUM * found.upper));
    let lowest = found.lower - tolerance.max(AT_MINIMUM * found.lower);
    let is_lowest = !points.clone().any(|u| is_inside(u, lowest));
    let contact = points.chain([found.at]).filter(|&u| is_inside(u, limit - tolerance)).reduce(f64::min);
    CrossCheck { contact, agrees: is_there && is_lowest }
}

/// Returns the distance of a point from a shape by parry, zero inside.
fn distance(shape: &Shape, point: Vector3<f64>) -> f64 {
    let vector = |v: Vector3<f64>| Vector::new(v.x, v.y, v.z);
    let point = vector(obstacle::in_box_frame(shape, point));
    match shape {
        Shape::Ball { radius_m } => Ball::new(*radius_m).distance_to_local_point(point, true),
        Shape::Box { half_m, .. } => Cuboid::new(vector(*half_m)).distance_to_local_point(point, true),
        Shape::Capsule { from_m, to_m, radius_m } => {
            Capsule::new(vector(*from_m), vector(*to_m), *radius_m).distance_to_local_point(point, true)
        }
        Shape::HalfSpace { normal } => HalfSpace::new(vector(normal.normalize())).distance_to_local_point(point, true),
    }
}

/// Width of the band around delta in which the two detectors may differ, in units of eps (|r0|^2 + delta^2) of squared
/// separation.
///
/// The cast decides by b^2 - |d|^2 (|r0|^2 - delta^2) and takes its root. Each sum of three products carries 3 u (u =
/// eps/2). The discriminant over |d|^2, which is delta^2 less the squared distance of the line, is off by at most 17 u
/// |r0|^2 + 7 u delta^2, and the root adds 3 u of both. The closed form adds at most 6 u of both: the separation errs by
/// 6 u |r0|, and by up to 13 u |r0| near separation 0. Interpolated ends add 16 u S delta, S their scale. The sum
/// stays below 26 u = 13 eps and is rounded up to a power of two. At |r0| = 10 m and delta = 2 m the band is 1e-13 m
/// wide. `proofs/decisions.v` proves that a motion farther than this band is not below delta.
const GRAZING_BAND: f64 = 16.0 * f64::EPSILON;

/// Length below which a relative motion is cast as zero \[m\]: its square underflows, and no accepted delta resolves
/// it.
const NO_MOTION_M: f64 = 1e-100;

/// Result of the second detector for a segment of motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct CrossCheck {
    /// Fraction of the segment at the first contact; NaN if parry fails.
    pub(super) contact: Option<f64>,
    /// Whether the result agrees with the first detector.
    pub(super) agrees: bool,
}

/// Two keep-out balls of radius delta/2.
#[derive(Clone, Debug)]
pub(super) struct KeepOut {
    ball: Ball,
    /// delta \[m\].
    pub(super) delta_m: f64,
}

impl KeepOut {
    pub(super) fn new(delta_m: f64) -> Self {
        Self { ball: Ball::new(delta_m / 2.0), delta_m }
    }

    /// Returns the fraction of the step at which the balls first touch; NaN if parry fails.
    #[inline]
    pub(super) fn cast(&self, motion: &RelativeMotion) -> Option<f64> {
        if motion.by.norm_squared() < NO_MOTION_M * NO_MOTION_M {
            return self.cast_at_rest(motion);
        }
        self.cast_by(motion, vector(motion.by))
    }

    #[cold]
    fn cast_at_rest(&self, motion: &RelativeMotion) -> Option<f64> {
        self.cast_by(motion, Vector::ZERO)
    }

    #[inline]
    fn cast_by(&self, motion: &RelativeMotion, by: Vector) -> Option<f64> {
        let options = ShapeCastOptions {
            max_time_of_impact: 1.0,
            compute_impact_geometry_on_penetration: false,
            ..ShapeCastOptions::default()
        };
        let other = Pose::from_translation(vector(motion.from));
        cast_shapes_ball_ball(&other, by, &self.ball, &self.ball, options).map(|hit| hit.time_of_impact)
    }

    /// Returns whether the closest approach is below delta, or so little above it that rounding matters.
    #[inline]
    pub(super) fn is_near(&self, motion: &RelativeMotion, closest: ClosestPoint) -> bool {
        closest.squared <= self.delta_m * self.delta_m + self.grazing_band(motion)
    }

    /// Returns the part of the motion below delta, and the comparison with the contact of the cast. `is_below` states
    /// whether the closest approach is below delta.
    pub(super) fn compare(
        &self,
        motion: &RelativeMotion,
        closest: ClosestPoint,
        is_below: bool,
        contact: Option<f64>,
    ) -> (Option<Span>, CrossCheck) {
        let below = is_below.then(|| motion.below(self.delta_m, closest));
        (below, CrossCheck { contact, agrees: self.agrees(motion, closest, below, contact) })
    }

    /// Returns whether the two results agree up to rounding ([`GRAZING_BAND`]).
    ///
    /// If only one detector reports a contact, the smallest separation must lie in the band. If both do, the squared
    /// separation must change by less than the band between the two entries. That change is l (2 h + l) for entries l
    /// apart along the path, with h half the chord that the path cuts out of the ball of radius delta.
    fn agrees(
        &self,
        motion: &RelativeMotion,
        closest: ClosestPoint,
        below: Option<Span>,
        contact: Option<f64>,
    ) -> bool {
        let apart_squared = match (below, contact) {
            (None, None) => 0.0,
            (None, Some(toi)) if toi.is_nan() => f64::NAN,
            (Some(_), None) | (None, Some(_)) => {
                let separation_m = closest.separation_m();
                ((separation_m - self.delta_m) * (separation_m + self.delta_m)).abs()
            }
            (Some(span), Some(toi)) => {
                let speed_squared = motion.by.norm_squared();
                let foot = motion.from - motion.by * (motion.from.dot(&motion.by) / speed_squared);
                let chord = 2.0 * (self.delta_m * self.delta_m - foot.norm_squared()).max(0.0).sqrt();
                let apart = (toi - span.enter).abs() * speed_squared.sqrt();
                apart * (chord + apart)
            }
        };
        apart_squared <= self.grazing_band(motion)
    }

    /// Returns the width of the band for this motion \[m^2\].
    #[inline]
    fn grazing_band(&self, motion: &RelativeMotion) -> f64 {
        GRAZING_BAND * (larger(motion.from_squared, motion.interpolated_squared) + self.delta_m * self.delta_m)
    }
}

fn vector(v: nalgebra::Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;
    use crate::obstacle::one_of_each;

    #[test]
    fn parry_measures_the_same_distances() {
        for shape in one_of_each() {
            for k in 0..50_u32 {
                let turn = f64::from(k) * 2.4;
                let point = Vector3::new(3.0 * turn.cos(), 3.0 * turn.sin(), 0.1 * f64::from(k) - 2.0);
                let ours = obstacle::distance(&shape, point).max(0.0);
                assert!((distance(&shape, point) - ours).abs() < 1e-14, "{shape:?} {point:?}");
            }
        }
    }

    #[test]
    fn rounding_of_a_distance_is_no_disagreement_far_from_the_origin() {
        for shape in one_of_each() {
            for k in 0..50_u32 {
                let turn = f64::from(k) * 2.4;
                let far = Vector3::new(3e7 * turn.cos(), 2e7 * turn.sin(), 1e7);
                // Past the obstacle: nearest somewhere between the ends.
                let across = Vector3::new(-far.y, far.x, 0.0).normalize();
                let along = |u: f64| far + across * (6e6 * u - 2.9e6);
                let (lower, fraction) = obstacle::closest(&shape, along(0.0), along(1.0));
                let right = Minimum { lower, upper: lower, at: fraction };
                assert!(from_shape(&shape, 1.0, &right, along).agrees, "{shape:?} {far:?}");
                // Inside, parry returns zero at every depth.
                let wrong = Minimum { upper: lower + 0.1, ..right };
                // Inside a half-space the second detector cannot tell two depths apart.
                assert!(lower < 0.0 || !from_shape(&shape, 1.0, &wrong, along).agrees, "{shape:?} {far:?}");
            }
        }
    }

    #[test]
    fn a_wrong_minimum_is_a_disagreement() {
        let along = |u: f64| Vector3::new(6.0 * u - 3.0, 2.0, 0.0);
        for shape in one_of_each() {
            let (lower, fraction) = obstacle::closest(&shape, along(0.0), along(1.0));
            let right = Minimum { lower, upper: lower, at: fraction };
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

    const DELTA_M: f64 = 2.0;

    /// Returns a straight pass at the distance `miss_m` from the origin, from `before_m` ahead of the closest point to
    /// `after_m` behind it, in the plane of two directions.
    fn pass(miss_m: f64, before_m: f64, after_m: f64, along: [f64; 3], aside: [f64; 3]) -> Option<RelativeMotion> {
        let along = Vector3::from(along).try_normalize(1e-3)?;
        let aside = Vector3::from(aside);
        let aside = (aside - along * along.dot(&aside)).try_normalize(1e-3)?;
        Some(RelativeMotion::new(aside * miss_m - along * before_m, aside * miss_m + along * after_m))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn the_detectors_agree_within_the_grazing_band(
            ulps in -40.0..40.0_f64,
            (before, after) in (-6.0..6.0_f64, -6.0..6.0_f64),
            along in prop::array::uniform3(-1.0..1.0_f64),
            aside in prop::array::uniform3(-1.0..1.0_f64),
            depth in prop_oneof![Just(0.0), -1e-9..1e-9_f64, -1.0..1.0_f64],
        ) {
            let (before_m, after_m) = (10_f64.powf(before), 10_f64.powf(after));
            let rounding_m = f64::EPSILON * (before_m * before_m + DELTA_M * DELTA_M) / (2.0 * DELTA_M);
            let miss_m = DELTA_M + depth + (ulps * rounding_m).clamp(-1.0, 1.0);
            let Some(motion) = pass(miss_m, before_m, after_m, along, aside) else { return Ok(()) };
            let keep_out = KeepOut::new(DELTA_M);
            let closest = motion.closest();
            let is_below = closest.separation_m() < DELTA_M;
            let (below, check) = keep_out.compare(&motion, closest, is_below, keep_out.cast(&motion));
            prop_assert!(check.agrees, "{below:?} {check:?}");
            // A motion that is not near is clear for both detectors.
            prop_assert!(keep_out.is_near(&motion, closest) || (below.is_none() && check.contact.is_none()));
        }
    }

    #[test]
    fn a_difference_beyond_rounding_is_a_disagreement() {
        let keep_out = KeepOut::new(DELTA_M);
        let agrees = |miss_m: f64, change: fn(Option<f64>) -> Option<f64>| {
            let motion = pass(miss_m, 10.0, 10.0, [1.0, 2.0, 0.5], [0.0, 1.0, -1.0]).unwrap();
            let closest = motion.closest();
            let is_below = closest.separation_m() < DELTA_M;
            keep_out.compare(&motion, closest, is_below, change(keep_out.cast(&motion))).1.agrees
        };
        for (miss_m, changes) in [
            (1.0, [|_| None, |toi: Option<f64>| toi.map(|toi| toi + 1e-12), |_| Some(f64::NAN)]),
            (DELTA_M - 1e-9, [|_| None, |toi: Option<f64>| toi.map(|toi| toi + 1e-8), |_| Some(0.0)]),
            (DELTA_M + 1e-9, [|_| Some(0.5), |_| Some(0.0), |_| Some(f64::NAN)]),
        ] {
            assert!(agrees(miss_m, |cast| cast));
            for change in changes {
                assert!(!agrees(miss_m, change), "{miss_m}");
            }
        }
    }

    #[test]
    fn a_motion_whose_square_underflows_makes_no_contact() {
        let keep_out = KeepOut::new(DELTA_M);
        let from = Vector3::new(DELTA_M + 1e-12, 0.0, 0.0);
        let motion = RelativeMotion::new(from, from + Vector3::new(0.0, 1e-158, 0.0));
        assert_eq!(keep_out.cast(&motion), None);
    }
}
