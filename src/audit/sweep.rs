//! Closest approach of one pair over one step, in closed form.
//!
//! Both vehicles move on straight lines at constant speed, so their relative position does too:
//! r(s) = r0 + s d with d = r1 - r0 and s from 0 to 1. |r(s)|^2 is a parabola in s with its vertex at
//! s\* = -(r0 . d) / |d|^2.

use nalgebra::Vector3;

/// Rounding of [`RelativeMotion::closest`]: the separation found is off by at most this many times the larger of |r0|
/// and |r1|.
///
/// To first order in u = eps/2: r0 and r1 carry u each, d one more u, s d two, the sum and the norm three, each relative
/// to |r0| or less since s |d| <= |r0| at the closest point; that is at most 8 u = 4 eps. An error of s\* itself moves the
/// point along d, which the separation feels in second order alone unless it is itself of that size.
pub(super) const RESOLUTION: f64 = 4.0 * f64::EPSILON;

/// Straight relative motion of a pair over a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct RelativeMotion {
    /// r0 \[m\].
    pub(super) from: Vector3<f64>,
    /// r1 \[m\].
    pub(super) to: Vector3<f64>,
    /// d = r1 - r0 \[m\].
    pub(super) by: Vector3<f64>,
    /// |r0|^2 \[m^2\].
    pub(super) from_squared: f64,
    /// |r1|^2 \[m^2\].
    pub(super) to_squared: f64,
}

/// Where a relative motion is closest to zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Approach {
    /// Smallest separation, squared \[m^2\].
    pub(super) squared: f64,
    /// Fraction s of the step at which it is reached first.
    pub(super) at: f64,
}

/// The part of a step that a pair spends below a distance, as fractions of the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    pub(super) enter: f64,
    pub(super) exit: f64,
}

impl RelativeMotion {
    #[inline]
    pub(super) fn new(from: Vector3<f64>, to: Vector3<f64>) -> Self {
        Self { from, to, by: to - from, from_squared: from.norm_squared(), to_squared: to.norm_squared() }
    }

    /// The closest approach. It is never farther than either end.
    #[inline]
    pub(super) fn closest(&self) -> Approach {
        let mut closest = Approach { squared: self.from_squared, at: 0.0 };
        let start_rate = self.from.dot(&self.by);
        if start_rate < 0.0 && self.to.dot(&self.by) > 0.0 {
            let at = (-start_rate / self.by.norm_squared()).min(1.0);
            closest.improve((self.from + self.by * at).norm_squared(), at);
        }
        closest.improve(self.to_squared, 1.0);
        closest
    }

    /// When the pair is below `distance_m`, given that the closest approach is.
    ///
    /// With b = r0 . d and c = |r0|^2 - distance^2 the roots of |d|^2 s^2 + 2 b s + c are q / |d|^2 and c / q, where
    /// q = -b -+ sqrt(b^2 - |d|^2 c) takes the sign that does not cancel. The discriminant is taken from the closest
    /// point of the unbounded line, |d|^2 (distance^2 - |r(s\*)|^2), which keeps a graze exact where b^2 - |d|^2 c cancels.
    pub(super) fn below(&self, distance_m: f64, closest: Approach) -> Span {
        let excess = |squared: f64| (squared.sqrt() - distance_m) * (squared.sqrt() + distance_m);
        let (speed_squared, b, c) = (self.by.norm_squared(), self.from.dot(&self.by), excess(self.from_squared));
        let foot_squared = (self.from - self.by * (b / speed_squared)).norm_squared();
        let root = (speed_squared * -excess(foot_squared)).max(0.0).sqrt();
        let (enter, exit) = if b < 0.0 { (c / (root - b), (root - b) / speed_squared) } else { (0.0, -c / (root + b)) };
        // `min` and `max` pass over NaN, so a motion too small to divide by keeps the whole step.
        let enter = if self.from_squared.sqrt() < distance_m { 0.0 } else { enter.max(0.0).min(closest.at) };
        let exit = if self.to_squared.sqrt() < distance_m { 1.0 } else { exit.min(1.0).max(closest.at) };
        Span { enter, exit }
    }
}

impl Approach {
    #[inline]
    fn improve(&mut self, squared: f64, at: f64) {
        if squared < self.squared {
            *self = Self { squared, at };
        }
    }

    /// Smallest separation \[m\].
    #[inline]
    pub(super) fn separation_m(&self) -> f64 {
        self.squared.sqrt()
    }
}
