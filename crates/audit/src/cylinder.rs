//! Upright cylinders: a pair is too near if its horizontal and vertical distances are too small at one instant.
//!
//! The scaled distance of a relative position (x, y, z) is the larger of the horizontal distance over R and the
//! vertical distance over H. It is a convex function of the position, and two vehicles touch at 1. Along a straight
//! relative motion the vertical distance is below x H on one open interval of time. The scaled distance falls below x
//! iff the smallest horizontal distance over the closure of this interval is strictly below x R.
//!
//! Doubles with a bound on their rounding decide first, then integers ([`ExactMotion::enters`]).

use nalgebra::Vector3;

use super::exact::{ExactMotion, midpoint};
use super::sweep::{RelativeMotion, Span};

/// Bound on the rounding of positions, reaches and quotients, relative to the scale of the motion and of the reach.
const RESOLUTION: f64 = 64.0 * f64::EPSILON;
/// Smallest scale \[m\] and smallest squared displacement \[m^2\] that doubles decide.
const SMALLEST_SCALE_M: f64 = 1e-100;
const SMALLEST_SQUARED_M2: f64 = 1e-280;
/// Largest number of units in the last place by which a distance is corrected before it is bisected.
const MAX_CORRECTIONS: u32 = 4;
/// Relative slack of a rounded lower bound that is confirmed afterwards.
const SLACK: f64 = 1e-6;

/// Upright cylinder around each vehicle that no other vehicle may enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// Horizontal distance R \[m\].
    pub horizontal_m: f64,
    /// Vertical distance H, above and below \[m\].
    pub vertical_m: f64,
}

impl Cylinder {
    /// Returns the scaled distance of a relative position \[m\]: 1 on the surface.
    #[must_use]
    pub fn distance(&self, r: Vector3<f64>) -> f64 {
        (r.xy().norm() / self.horizontal_m).max(r.z.abs() / self.vertical_m)
    }

    /// Returns an upper bound on the change of the scaled distance by a displacement of 1 m \[1/m\].
    pub(super) fn per_metre(&self) -> f64 {
        self.horizontal_m.min(self.vertical_m).recip() * (1.0 + 2.0 * f64::EPSILON)
    }

    /// Returns whether the scaled distance falls below a value along a straight motion. `exact` is the same motion.
    pub(super) fn is_below(&self, motion: &RelativeMotion, exact: &ExactMotion, distance: f64) -> bool {
        let is_limited = distance < f64::INFINITY;
        !is_limited || self.decide(motion, distance).unwrap_or_else(|| exact.enters(self, distance))
    }

    /// Decides in doubles whether the scaled distance falls below a value; `None` if rounding could change the result.
    ///
    /// A computed end of the interval is the exact end for a reach that differs by less than the error e. Outside the
    /// interval of the reach x H + e the vertical distance is at least x H; inside that of x H - e it is below x H.
    pub(super) fn decide(&self, motion: &RelativeMotion, distance: f64) -> Option<bool> {
        let (across, along) = (self.horizontal_m * distance, self.vertical_m * distance);
        let scale = motion.scale_squared().sqrt() + across + along;
        if scale < SMALLEST_SCALE_M {
            return None;
        }
        let error = RESOLUTION * scale;
        let Some(outer) = fractions_within(motion, along + error, 1.0) else { return Some(false) };
        if smallest_across(motion, outer)? >= across + error {
            return Some(false);
        }
        let inner = fractions_within(motion, along - error, -1.0)?;
        (smallest_across(motion, inner)? <= across - error).then_some(true)
    }

    /// Returns the smallest scaled distance along a straight motion, rounded down to a double.
    pub(super) fn separation(&self, motion: &RelativeMotion, exact: &ExactMotion) -> f64 {
        let is_below = |distance: f64| self.is_below(motion, exact, distance);
        let (mut distance, _) = self.closest(motion);
        let mut is_next_below = false;
        for _ in 0..MAX_CORRECTIONS {
            if is_below(distance) {
                distance = distance.next_down().max(0.0);
                is_next_below = true;
            } else if is_next_below || is_below(distance.next_up()) {
                return distance;
            } else {
                distance = distance.next_up();
            }
        }
        let start = distance * (1.0 - SLACK);
        let mut low = if is_below(start) { 0.0 } else { start };
        let mut high = distance.max(f64::MIN_POSITIVE);
        while !is_below(high) {
            (low, high) = (high, 2.0 * high);
        }
        while low.next_up() < high {
            let middle = midpoint(low, high);
            if is_below(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        low
    }

    /// Returns the smallest scaled distance in doubles, and the first fraction of the motion at which it is reached.
    ///
    /// The larger of two convex functions is smallest at an end, at the minimum of either, or where they are equal.
    pub(super) fn closest(&self, motion: &RelativeMotion) -> (f64, f64) {
        let (f, b) = (motion.from.xy() / self.horizontal_m, motion.by.xy() / self.horizontal_m);
        let (z, w) = (motion.from.z / self.vertical_m, motion.by.z / self.vertical_m);
        let (squared, rate, excess) = (b.norm_squared() - w * w, f.dot(&b) - z * w, f.norm_squared() - z * z);
        let root = (rate * rate - squared * excess).max(0.0).sqrt();
        let q = -(rate + root.copysign(rate));
        let inner = [-f.dot(&b) / b.norm_squared(), -z / w, q / squared, excess / q];
        let inner = inner.into_iter().filter(|u| u.is_finite()).map(|u| u.clamp(0.0, 1.0));
        let (mut least, mut fraction) = (f64::INFINITY, 0.0);
        for u in [0.0].into_iter().chain(inner).chain([1.0]) {
            let r = if u >= 1.0 { motion.to } else { motion.from + motion.by * u };
            let distance = self.distance(r);
            if distance < least || (distance == least && u < fraction) {
                (least, fraction) = (distance, u);
            }
        }
        (least, fraction)
    }

    /// Returns a lower bound of the scaled distance along a straight motion.
    pub(super) fn lower_bound(&self, motion: &RelativeMotion) -> f64 {
        let bound = self.closest(motion).0 * (1.0 - SLACK);
        if bound > 0.0 && self.decide(motion, bound) == Some(false) { bound } else { 0.0 }
    }

    /// Returns the part of a straight motion below a scaled distance, given that the motion falls below it.
    pub(super) fn below(&self, motion: &RelativeMotion, distance: f64) -> Span {
        let (_, fraction) = self.closest(motion);
        let flat = |r: Vector3<f64>| Vector3::new(r.x, r.y, 0.0);
        let across = RelativeMotion::new(flat(motion.from), flat(motion.to));
        let (nearest, reach) = (across.closest(), self.horizontal_m * distance);
        let sides = if nearest.separation_m() < reach {
            across.below(reach, nearest)
        } else {
            Span { enter: fraction, exit: fraction }
        };
        let (low, high) = fractions_within(motion, self.vertical_m * distance, 1.0).unwrap_or((fraction, fraction));
        Span { enter: sides.enter.max(low).min(fraction), exit: sides.exit.min(high).max(fraction) }
    }
}

/// Returns the fractions of a motion between which the vertical distance is at most a reach, if any. If the height
/// changes by rounding only, the change counts as reach times `slack`.
fn fractions_within(motion: &RelativeMotion, reach: f64, slack: f64) -> Option<(f64, f64)> {
    let (z, by) = (motion.from.z, motion.by.z);
    if by.abs() <= RESOLUTION * (z.abs() + reach.abs()) {
        return (z.abs() <= reach + slack * by.abs()).then_some((0.0, 1.0));
    }
    let (first, second) = ((-reach - z) / by, (reach - z) / by);
    let (low, high) = (first.min(second).max(0.0), first.max(second).min(1.0));
    (reach >= 0.0 && low <= high).then_some((low, high))
}

/// Returns the smallest horizontal distance between two fractions of a motion; `None` if its size is out of range.
fn smallest_across(motion: &RelativeMotion, (low, high): (f64, f64)) -> Option<f64> {
    let (from, by) = (motion.from.xy(), motion.by.xy());
    let squared = by.norm_squared();
    let fraction = if squared > SMALLEST_SQUARED_M2 {
        (-from.dot(&by) / squared).clamp(low, high)
    } else if by.amax() == 0.0 {
        low
    } else {
        return None;
    };
    Some((from + by * fraction).norm())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::segment::Line;
    use crate::sweep::Interval;

    /// Generates small integers, which meet R and H exactly, and numbers with all digits.
    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![3 => (-6..7_i32).prop_map(f64::from), 2 => -8.0..8.0_f64]
    }

    fn line(from: Vector3<f64>, to: Vector3<f64>) -> Line {
        Line { from_s: 0.0, to_s: 1.0, from, to }
    }

    /// Returns the motion of the second vehicle relative to a first at the origin.
    fn motion(from: [f64; 3], to: [f64; 3]) -> (RelativeMotion, ExactMotion) {
        let (from, to) = (Vector3::from(from), Vector3::from(to));
        let exact = ExactMotion {
            first: line(Vector3::zeros(), Vector3::zeros()),
            second: line(from, to),
            interval: Interval { from_s: 0.0, to_s: 1.0 },
        };
        (RelativeMotion::new(from, to), exact)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn doubles_and_integers_agree_and_the_separation_is_the_largest_double_below(
            from in prop::array::uniform3(coordinate()),
            to in prop::array::uniform3(coordinate()),
            horizontal_m in prop_oneof![Just(2.0), Just(5.0), 0.1..9.0_f64],
            vertical_m in prop_oneof![Just(1.0), Just(3.0), 0.1..9.0_f64],
        ) {
            let cylinder = Cylinder { horizontal_m, vertical_m };
            let (motion, exact) = motion(from, to);
            let separation = cylinder.separation(&motion, &exact);
            prop_assert!(!exact.enters(&cylinder, separation) && exact.enters(&cylinder, separation.next_up()));
            for distance in [1.0, 0.5, separation, separation * 0.999, separation * 1.001, separation + 1e-9] {
                if let Some(is_below) = cylinder.decide(&motion, distance) {
                    prop_assert_eq!(is_below, exact.enters(&cylinder, distance), "{}", distance);
                }
            }
            prop_assert!(cylinder.lower_bound(&motion) <= separation);
            prop_assert!((cylinder.closest(&motion).0 - separation).abs() <= 1e-7 * (1.0 + separation));
            // No sampled distance is below the separation.
            for k in 0..=50 {
                let r = motion.from.lerp(&motion.to, f64::from(k) / 50.0);
                prop_assert!(cylinder.distance(r) >= separation - 1e-12);
            }
            prop_assert_eq!(exact.starts_within(&cylinder, 1.0), cylinder.distance(motion.from) < 1.0);
        }
    }

    #[test]
    fn exactly_at_either_distance_is_outside_and_the_next_double_inside() {
        let cylinder = Cylinder { horizontal_m: 0.3, vertical_m: 0.1 };
        let is_inside = |from: [f64; 3], to: [f64; 3]| {
            let (motion, exact) = motion(from, to);
            cylinder.is_below(&motion, &exact, 1.0)
        };
        // Past at exactly R, at a height inside, and one unit nearer.
        assert!(!is_inside([0.3, -1.0, 0.05], [0.3, 1.0, 0.05]));
        assert!(is_inside([0.3_f64.next_down(), -1.0, 0.05], [0.3_f64.next_down(), 1.0, 0.05]));
        // Straight across at exactly H, and one unit lower.
        assert!(!is_inside([-1.0, 0.0, 0.1], [1.0, 0.0, 0.1]));
        assert!(is_inside([-1.0, 0.0, 0.1_f64.next_down()], [1.0, 0.0, 0.1_f64.next_down()]));
        // Through the edge: the height reaches H exactly where the horizontal distance reaches R.
        let edge = Cylinder { horizontal_m: 1.0, vertical_m: 1.0 };
        let (through, exact) = motion([0.0, 0.0, 2.0], [2.0, 0.0, 0.0]);
        assert!(!edge.is_below(&through, &exact, 1.0));
        assert_eq!(edge.separation(&through, &exact), 1.0);
    }

    #[test]
    fn the_part_below_is_the_time_inside_both() {
        let cylinder = Cylinder { horizontal_m: 2.0, vertical_m: 1.0 };
        // Descends by 4 while it crosses 8 m: inside horizontally from 1/4 to 3/4, vertically from 1/2 to 1.
        let (motion, exact) = motion([-4.0, 0.0, 3.0], [4.0, 0.0, -1.0]);
        assert!(cylinder.is_below(&motion, &exact, 1.0));
        let Span { enter, exit } = cylinder.below(&motion, 1.0);
        assert!((enter - 0.5).abs() < 1e-15 && (exit - 0.75).abs() < 1e-15, "{enter} {exit}");
    }
}
