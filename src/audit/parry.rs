//! The second detector: parry's shape cast on keep-out balls, in double precision.

use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::{ShapeCastOptions, cast_shapes};
use parry3d_f64::shape::Ball;

use super::sweep::{Approach, RelativeMotion, Span};

/// Width of the band around delta in which the two detectors may differ, in units of eps (|r0|^2 + delta^2) of squared
/// separation.
///
/// The cast decides by b^2 - |d|^2 (|r0|^2 - delta^2) and takes its root. Each sum of three products carries 3 u
/// (u = eps/2); collected, the discriminant over |d|^2, which is delta^2 less the squared distance of the line, is off by
/// at most 17 u |r0|^2 + 7 u delta^2, and the root adds 3 u of both. The closed form adds 8 u |r0| delta
/// ([`super::sweep::RESOLUTION`]). The sum stays below 24 u = 12 eps and is rounded up to a power of two.
/// At |r0| = 10 m and delta = 2 m the band is 1e-13 m wide.
const GRAZING_BAND: f64 = 16.0 * f64::EPSILON;

/// Relative motions shorter than this \[m\] are given to parry as none: their squares underflow, and no accepted delta
/// resolves them.
const NO_MOTION_M: f64 = 1e-100;

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
        let by = if motion.by.norm_squared() < NO_MOTION_M * NO_MOTION_M { Vector::ZERO } else { vector(motion.by) };
        let options = ShapeCastOptions {
            max_time_of_impact: 1.0,
            compute_impact_geometry_on_penetration: false,
            ..ShapeCastOptions::default()
        };
        let other = Pose::from_translation(vector(motion.from));
        match cast_shapes(&Pose::IDENTITY, Vector::ZERO, &self.ball, &other, by, &self.ball, options) {
            Ok(hit) => hit.map(|hit| hit.time_of_impact),
            Err(_) => Some(f64::NAN),
        }
    }

    /// Whether the closest approach is below delta or so little above it that it takes a closer look.
    #[inline]
    pub(super) fn is_near(&self, motion: &RelativeMotion, closest: Approach) -> bool {
        closest.squared <= self.delta_m * self.delta_m + self.grazing_band(motion)
    }

    /// Whether the two answers are the same up to rounding ([`GRAZING_BAND`]).
    ///
    /// Where one says contact and the other none, the smallest separation must lie in the band. Where both say contact,
    /// the squared separation must change by less than the band between the two entries: that is l (2 h + l) for entries
    /// l apart along the path, with h half the chord that the path cuts out of the ball of radius delta.
    pub(super) fn agrees(
        &self,
        motion: &RelativeMotion,
        closest: Approach,
        below: Option<Span>,
        cast: Option<f64>,
    ) -> bool {
        let differs_by = match (below, cast) {
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
        differs_by <= self.grazing_band(motion)
    }

    /// Width of the band for this motion \[m^2\].
    #[inline]
    fn grazing_band(&self, motion: &RelativeMotion) -> f64 {
        GRAZING_BAND * (motion.from_squared + self.delta_m * self.delta_m)
    }
}

fn vector(v: nalgebra::Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}
