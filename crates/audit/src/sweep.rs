//! Closed form of the closest approach of one pair over one step.
//!
//! Both vehicles move on straight lines at constant speed, so their relative position does too:
//!
//! ```text
//! r(s) = r0 + s d,   d = r1 - r0,   0 <= s <= 1
//! ```
//!
//! |r(s)|^2 is a parabola in s with its vertex at s\* = -(r0 . d) / |d|^2.

use nalgebra::Vector3;

/// Smallest accepted limit \[m\]: its fourth power, which the cast forms, does not underflow.
pub(super) const MIN_LIMIT_M: f64 = 1e-70;
/// Largest accepted limit and coordinate \[m\]: fourth powers of lengths stay finite.
pub(super) const MAX_LENGTH_M: f64 = 1e70;
/// Bound on the rounding error of [`RelativeMotion::closest`], relative to the scale of the motion: the larger of |r0|
/// and |r1|.
///
/// Let u = eps/2. An error of s\* moves the point along d by at most 10.1 u |r0|. This changes the separation in second
/// order only, unless the separation itself is of that size. The point and its norm err by less than 6 u |r0|. Near
/// separation 0 all add up to 12.5 u |r0|, and elsewhere to less. Rounded ends add 1.1 u of the scale. The bound is
/// 16 u (`proofs/decisions.v`).
///
/// Interpolated ends are each off by at most 8 u of the sum of their terms, and so is every point between them. The
/// scale is then larger by twice that sum (`proofs/interpolated.v`).
const RESOLUTION: f64 = 8.0 * f64::EPSILON;

/// Closed interval of time \[s\].
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
}

impl Interval {
    /// Returns the time at a fraction of the interval. It is exact at both ends and monotonic in the fraction, since
    /// each rounded operation is. Times are halved first, so that their difference cannot overflow.
    pub(super) fn at(self, fraction: f64) -> f64 {
        let (from, to) = (0.5 * self.from_s, 0.5 * self.to_s);
        let time_s = if fraction < 1.0 { 2.0 * (from + fraction * (to - from)) } else { self.to_s };
        time_s.max(self.from_s).min(self.to_s)
    }
}

/// Returns the larger of two finite numbers; cheaper than `f64::max`, which checks for NaN.
#[inline]
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// Returns the smallest separation of two vehicles \[m\] while their relative position moves on a straight line from
/// `from` to `to` \[m\].
#[must_use]
pub fn swept_separation_m(from: Vector3<f64>, to: Vector3<f64>) -> f64 {
    RelativeMotion::new(from, to).closest().separation_m()
}

/// Smallest separation over a straight relative motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Smallest separation \[m\].
    pub min_m: f64,
    /// Time of the smallest separation, as a fraction of the motion.
    pub at: f64,
    /// Part of the motion below the limit, as fractions; `None` without one.
    pub below: Option<[f64; 2]>,
}

/// Sweeps the relative position of two vehicles on a straight line from `from` to `to` \[m\], with a limit \[m\].
#[must_use]
pub fn sweep(from: Vector3<f64>, to: Vector3<f64>, limit_m: f64) -> Sweep {
    let motion = RelativeMotion::new(from, to);
    let closest = motion.closest();
    let min_m = closest.separation_m();
    let below = (min_m < limit_m).then(|| motion.below(limit_m, closest)).map(|Span { enter, exit }| [enter, exit]);
    Sweep { min_m, at: closest.at, below }
}

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
    /// Square of the scale of the rounding errors of interpolated ends \[m^2\]; 0 for differences of two samples.
    pub(super) interpolated_squared: f64,
}

/// Point of a relative motion that is closest to the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ClosestPoint {
    /// Smallest separation, squared \[m^2\].
    pub(super) squared: f64,
    /// Fraction s of the step at which it is first reached.
    pub(super) at: f64,
}

/// Part of a step during which a pair is below a distance, as fractions of the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    pub(super) enter: f64,
    pub(super) exit: f64,
}

impl RelativeMotion {
    #[inline]
    pub(super) fn new(from: Vector3<f64>, to: Vector3<f64>) -> Self {
        let (from_squared, to_squared) = (from.norm_squared(), to.norm_squared());
        Self { from, to, by: to - from, from_squared, to_squared, interpolated_squared: 0.0 }
    }

    /// Creates a motion between interpolated ends. Each end is a difference of starting points plus fractions of two
    /// displacements.
    #[inline]
    pub(super) fn interpolated(ends: [Vector3<f64>; 2], start: Vector3<f64>, by: [Vector3<f64>; 2]) -> Self {
        let [from, to] = ends;
        // The square of a sum of three is at most three times the sum of the squares; |r0| is at most that sum.
        let sum_squared = 3.0 * (start.norm_squared() + by[0].norm_squared() + by[1].norm_squared());
        Self { interpolated_squared: 9.0 * sum_squared, ..Self::new(from, to) }
    }

    /// Returns the square of the scale of the rounding errors \[m^2\].
    #[inline]
    pub(super) fn scale_squared(&self) -> f64 {
        larger(larger(self.from_squared, self.to_squared), self.interpolated_squared)
    }

    /// Returns the bound on the error of the computed separation \[m\].
    #[inline]
    pub(super) fn resolution_m(&self) -> f64 {
        RESOLUTION * self.scale_squared().sqrt()
    }

    /// Returns the closest approach, which is never farther than either end.
    #[inline]
    pub(super) fn closest(&self) -> ClosestPoint {
        let mut closest = ClosestPoint { squared: self.from_squared, at: 0.0 };
        let start_rate = self.from.dot(&self.by);
        if start_rate < 0.0 && self.to.dot(&self.by) > 0.0 {
            let fraction = (-start_rate / self.by.norm_squared()).min(1.0);
            closest.improve((self.from + self.by * fraction).norm_squared(), fraction);
        }
        closest.improve(self.to_squared, 1.0);
        closest
    }

    /// Returns the part of the step during which the pair is below `distance_m`, given that the closest approach is.
    ///
    /// Let b = r0 . d and c = |r0|^2 - distance^2. The roots of |d|^2 s^2 + 2 b s + c are q / |d|^2 and c / q. The sign
    /// in q = -b -+ sqrt(b^2 - |d|^2 c) is the one that does not cancel. The discriminant is computed from the closest
    /// point of the unbounded line, |d|^2 (distance^2 - |r(s\*)|^2). That stays exact for a graze, where b^2 - |d|^2 c
    /// cancels.
    pub(super) fn below(&self, distance_m: f64, closest: ClosestPoint) -> Span {
        let excess = |squared: f64| (squared.sqrt() - distance_m) * (squared.sqrt() + distance_m);
        let (speed_squared, b, c) = (self.by.norm_squared(), self.from.dot(&self.by), excess(self.from_squared));
        let foot_squared = (self.from - self.by * (b / speed_squared)).norm_squared();
        let root = (speed_squared * -excess(foot_squared)).max(0.0).sqrt();
        let (enter, exit) = if b < 0.0 { (c / (root - b), (root - b) / speed_squared) } else { (0.0, -c / (root + b)) };
        // `min` and `max` ignore NaN, so a motion too small to divide by counts as below for the whole step.
        let enter = if self.from_squared.sqrt() < distance_m { 0.0 } else { enter.max(0.0).min(closest.at) };
        let exit = if self.to_squared.sqrt() < distance_m { 1.0 } else { exit.min(1.0).max(closest.at) };
        Span { enter, exit }
    }
}

impl ClosestPoint {
    #[inline]
    fn improve(&mut self, squared: f64, fraction: f64) {
        if squared < self.squared {
            *self = Self { squared, at: fraction };
        }
    }

    /// Smallest separation \[m\].
    #[inline]
    pub(super) fn separation_m(&self) -> f64 {
        self.squared.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn motion(from: [f64; 3], to: [f64; 3]) -> RelativeMotion {
        RelativeMotion::new(Vector3::from(from), Vector3::from(to))
    }

    /// Returns the smallest squared separation of integer positions as an exact fraction: |r0 x d|^2 / |d|^2 between
    /// the ends, else the square of the nearer end.
    fn exact_closest(from: [i64; 3], to: [i64; 3]) -> (i128, i128) {
        let wide = |v: [i64; 3]| v.map(i128::from);
        let (from, to) = (wide(from), wide(to));
        let by = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
        let dot = |a: [i128; 3], b: [i128; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        if dot(from, by) >= 0 || dot(to, by) <= 0 {
            return (dot(from, from).min(dot(to, to)), 1);
        }
        let cross = |i: usize, j: usize| from[i] * by[j] - from[j] * by[i];
        let cross = [cross(1, 2), cross(2, 0), cross(0, 1)];
        (dot(cross, cross), dot(by, by))
    }

    fn integers(range: std::ops::Range<i64>) -> impl Strategy<Value = [i64; 3]> {
        prop::array::uniform3(range)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn the_separation_equals_exact_arithmetic_to_within_the_resolution(
            (from, to) in prop_oneof![
                (integers(-1_000_000..1_000_000), integers(-1_000_000..1_000_000)),
                (integers(-9..9), integers(-9..9)),
                // Close to the origin.
                (integers(-1_000_000..1_000_000), integers(-9..9)).prop_map(|(a, b)| {
                    (a, std::array::from_fn(|axis| b[axis] - a[axis]))
                }),
            ],
        ) {
            #[expect(clippy::cast_precision_loss, reason = "the fraction is rounded to double precision once")]
            let exact = { let (above, below) = exact_closest(from, to); (above as f64 / below as f64).sqrt() };
            let motion = motion(from.map(|x| x as f64), to.map(|x| x as f64));
            let found = motion.closest();
            let resolution = 4.0 * f64::EPSILON * motion.from_squared.sqrt();
            prop_assert!((found.separation_m() - exact).abs() <= resolution, "{} {exact}", found.separation_m());
            prop_assert!(found.squared <= motion.from_squared.min(motion.to_squared));
            prop_assert!((0.0..=1.0).contains(&found.at));
        }

        #[test]
        fn the_time_is_monotonic_in_the_fraction(
            from_s in -1e3..1e3_f64, length_s in 0.0..10.0_f64, fraction in 0.0..1.0_f64, near in 1..4_u32
        ) {
            let interval = Interval { from_s, to_s: from_s + length_s };
            let next = (0..near).fold(fraction, |fraction: f64, _| fraction.next_up()).min(1.0);
            prop_assert!(interval.at(fraction) <= interval.at(next));
            prop_assert!(interval.at(next) <= interval.at(1.0));
            prop_assert_eq!([interval.at(0.0), interval.at(1.0)], [interval.from_s, interval.to_s]);
        }

        #[test]
        fn at_entry_and_exit_the_separation_is_the_distance(
            from in prop::array::uniform3(-50.0..50.0_f64),
            to in prop::array::uniform3(-50.0..50.0_f64),
            deep in 1e-6..30.0_f64,
        ) {
            // Rounding of |r0 + s d| from up to 90 m away, with a margin.
            const TOLERANCE_M: f64 = 1e-12;
            let motion = motion(from, to);
            let closest = motion.closest();
            let distance = closest.separation_m() + deep;
            let Span { enter, exit } = motion.below(distance, closest);
            prop_assert!(0.0 <= enter && enter <= closest.at && closest.at <= exit && exit <= 1.0);
            let distance_at = |s: f64| (motion.from + motion.by * s).norm();
            if enter > 0.0 { prop_assert!((distance_at(enter) - distance).abs() < TOLERANCE_M) }
            if exit < 1.0 { prop_assert!((distance_at(exit) - distance).abs() < TOLERANCE_M) }
            prop_assert_eq!(enter <= 0.0, distance_at(0.0) < distance);
            prop_assert_eq!(exit >= 1.0, distance_at(1.0) < distance);
        }
    }

    #[test]
    fn a_constant_separation_is_closest_at_the_start() {
        let still = motion([3.0, 4.0, 0.0], [3.0, 4.0, 0.0]);
        assert_eq!(still.closest(), ClosestPoint { squared: 25.0, at: 0.0 });
        assert_eq!(still.below(6.0, still.closest()), Span { enter: 0.0, exit: 1.0 });
    }

    #[test]
    fn a_graze_is_below_for_the_length_of_its_chord() {
        // 1 nm deep at distance 2 m: half the chord is sqrt((2 - x)(2 + x)) with x = 2 - 1e-9.
        let x = 2.0 - 1e-9;
        let graze = motion([-10.0, x, 0.0], [10.0, x, 0.0]);
        let Span { enter, exit } = graze.below(2.0, graze.closest());
        let half = ((2.0 - x) * (2.0 + x)).sqrt() / 20.0;
        assert!((enter - (0.5 - half)).abs() < 1e-15 && (exit - (0.5 + half)).abs() < 1e-15);
    }

    #[test]
    fn a_motion_whose_square_underflows_is_below_for_the_whole_step() {
        let tiny = motion([1e-180, 0.0, 0.0], [-1e-180, 0.0, 0.0]);
        assert_eq!(tiny.below(1.0, tiny.closest()), Span { enter: 0.0, exit: 1.0 });
    }
}
