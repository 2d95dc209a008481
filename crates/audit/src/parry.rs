//! The second detector: parry's shape cast on keep-out balls, in double precision. A cross-check of the closed form, on the
//! relative motion that it is given too.

use parry3d::math::{Pose, Vector};
use parry3d::query::ShapeCastOptions;
use parry3d::query::details::cast_shapes_ball_ball;
use parry3d::shape::Ball;

use super::sweep::{ClosestPoint, RelativeMotion, Span, larger};

/// Width of the band around delta in which the two detectors may differ, in units of eps (|r0|^2 + delta^2) of squared
/// separation.
///
/// The cast decides by b^2 - |d|^2 (|r0|^2 - delta^2) and takes its root. Each sum of three products carries 3 u
/// (u = eps/2); collected, the discriminant over |d|^2, which is delta^2 less the squared distance of the line, is off by
/// at most 17 u |r0|^2 + 7 u delta^2, and the root adds 3 u of both. The closed form adds 8 u |r0| delta
/// (`RelativeMotion::resolution_m` without its margin). Interpolated ends add 16 u S delta, S their scale. The sum stays below 24 u = 12 eps and is rounded up to a power of two.
/// At |r0| = 10 m and delta = 2 m the band is 1e-13 m wide.
const GRAZING_BAND: f64 = 16.0 * f64::EPSILON;

/// Relative motions shorter than this \[m\] are given to parry as none: their squares underflow, and no accepted delta
/// resolves them.
const NO_MOTION_M: f64 = 1e-100;

/// What the second detector says of a segment of motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct CrossCheck {
    /// Fraction of the segment at which it sees the first contact; NaN where it cannot tell.
    pub(super) contact: Option<f64>,
    /// Whether it agrees with the first.
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

    /// When the balls first touch, as a fraction of the step; NaN if parry cannot tell.
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

    /// Whether the closest approach is below delta or so little above it that it takes a closer look.
    #[inline]
    pub(super) fn is_near(&self, motion: &RelativeMotion, closest: ClosestPoint) -> bool {
        closest.squared <= self.delta_m * self.delta_m + self.grazing_band(motion)
    }

    /// When a motion that is closest here is below delta, given whether it is, beside what the cast says.
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

    /// Whether the two answers are the same up to rounding ([`GRAZING_BAND`]).
    ///
    /// Where one says contact and the other none, the smallest separation must lie in the band. Where both say contact,
    /// the squared separation must change by less than the band between the two entries: that is l (2 h + l) for entries
    /// l apart along the path, with h half the chord that the path cuts out of the ball of radius delta.
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

    /// Width of the band for this motion \[m^2\].
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

    const DELTA_M: f64 = 2.0;

    /// A straight pass: `miss_m` from zero at the closest, seen from `before_m` ahead of it to `after_m` behind it, in the
    /// plane of two directions.
    fn pass(miss_m: f64, before_m: f64, after_m: f64, along: [f64; 3], aside: [f64; 3]) -> Option<RelativeMotion> {
        let along = Vector3::from(along).try_normalize(1e-3)?;
        let aside = Vector3::from(aside);
        let aside = (aside - along * along.dot(&aside)).try_normalize(1e-3)?;
        Some(RelativeMotion::new(aside * miss_m - along * before_m, aside * miss_m + along * after_m))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn the_detectors_agree_within_the_band_even_where_rounding_decides(
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
            // What needs no closer look is clear to both.
            prop_assert!(keep_out.is_near(&motion, closest) || (below.is_none() && check.contact.is_none()));
        }
    }

    #[test]
    fn any_answer_that_rounding_does_not_explain_is_a_disagreement() {
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
