//! Exact separation of two vehicles on straight lines.
//!
//! A [`Line`] joins two samples, whose times and positions are the doubles of the recording. Over the time that two
//! lines share, the relative position moves on a straight line too, from r0 to r1 = r0 + d. Its coordinates are
//! fractions of these doubles. The separation falls below x iff |r0| < x, or |r1| < x, or between the ends:
//!
//! ```text
//! r0 . d < 0 < r1 . d   and   |r0|^2 |d|^2 - (r0 . d)^2 < x^2 |d|^2
//! ```
//!
//! Three stages decide it, each if the one before cannot:
//!
//! - Doubles ([`RelativeMotion`](super::sweep::RelativeMotion)), with a bound on their rounding.
//! - Double-doubles, with a bound on their error.
//! - Integers: all coordinates in units of one power of two and all times in units of another. Both sides are
//!   multiplied by their denominators.

mod cylinder;

use std::cmp::Ordering;

use nalgebra::Vector3;
use num_bigint::BigInt;

use super::double_double::{DoubleDouble, OPERATION, is_shorter};
use super::segment::{EndPosition, INTERPOLATION, Line};
use super::sweep::Interval;

/// Motion of two vehicles on lines over an interval within both.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExactMotion {
    pub(super) first: Line,
    pub(super) second: Line,
    pub(super) interval: Interval,
}

/// Range of squared lengths in which no product of four lengths underflows or overflows.
const SQUARES: std::ops::RangeInclusive<f64> = 1e-200..=1e142;
/// Largest number of units in the last place by which a separation is corrected before it is computed with integers.
const MAX_CORRECTIONS: u32 = 4;
/// Smallest size of a coordinate whose square has all of its digits.
const SQUARABLE: f64 = 1e-120;

/// Returns the sign of a number with this error bound; `None` if the error could change the sign.
fn sign(number: DoubleDouble, error: f64) -> Option<Ordering> {
    match number.high {
        high if high > error => Some(Ordering::Greater),
        high if high < -error => Some(Ordering::Less),
        _ => None,
    }
}

/// Returns b - a, exactly.
#[inline]
fn difference(b: &Vector3<f64>, a: &Vector3<f64>) -> [DoubleDouble; 3] {
    [0, 1, 2].map(|axis| DoubleDouble::difference(b[axis], a[axis]))
}

#[inline]
fn dot(a: &[DoubleDouble; 3], b: &[DoubleDouble; 3]) -> DoubleDouble {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl ExactMotion {
    /// Returns whether the separation falls below a distance.
    pub(super) fn is_below(&self, distance: f64) -> bool {
        let is_limited = distance < f64::INFINITY;
        !is_limited || self.decide_by_double_doubles(distance).unwrap_or_else(|| self.integer(distance).is_below())
    }

    /// Returns whether the separation is below a distance at the start.
    pub(super) fn starts_below(&self, distance: f64) -> bool {
        let [start, _] = self.ends();
        start.is_below(distance).unwrap_or_else(|| self.integer(distance).starts_below())
    }

    /// Returns the smallest separation, rounded down to a double.
    pub(super) fn separation(&self) -> f64 {
        let Some(mut distance) = self.approximate_separation() else { return self.integer(0.0).separation() };
        let mut is_next_below = false;
        for _ in 0..MAX_CORRECTIONS {
            if self.is_below(distance) {
                distance = distance.next_down();
                is_next_below = true;
            } else if is_next_below || self.is_below(distance.next_up()) {
                return distance;
            } else {
                distance = distance.next_up();
            }
        }
        self.integer(0.0).separation()
    }

    /// Returns the motion in integers.
    #[cold]
    fn integer(&self, distance: f64) -> IntegerMotion {
        IntegerMotion::new([&self.first, &self.second], self.interval, distance)
    }

    /// Returns the relative position at both ends.
    fn ends(&self) -> [RelativeEnd; 2] {
        let Self { first, second, .. } = self;
        if first.from == first.to && second.from == second.to {
            let still = RelativeEnd { r: difference(&second.from, &first.from), error: 0.0 };
            return [still, still];
        }
        [(self.interval.from_s, false), (self.interval.to_s, true)].map(|(time_s, is_end)| {
            let [first, second] = [&self.first, &self.second].map(|line| line.place(time_s, is_end));
            if let (EndPosition::Sample(a), EndPosition::Sample(b)) = (&first, &second) {
                return RelativeEnd { r: difference(b, a), error: 0.0 };
            }
            let position = |line: &Line, place| match place {
                EndPosition::Sample(position) => [0, 1, 2].map(|axis| DoubleDouble::from(position[axis])),
                EndPosition::Interpolated => line.position(time_s),
            };
            let (a, b) = (position(&self.first, first), position(&self.second, second));
            let size = |line: &Line| line.from.amax() + line.to.amax();
            let error = INTERPOLATION * (size(&self.first) + size(&self.second));
            RelativeEnd { r: [0, 1, 2].map(|axis| b[axis] - a[axis]), error }
        })
    }

    /// Decides by double-doubles; `None` if their rounding could change the result.
    fn decide_by_double_doubles(&self, distance: f64) -> Option<bool> {
        let [start, end] = self.ends();
        let is_below = start.is_below(distance)?;
        if is_below || RelativeEnd::are_same(&start, &end) {
            return Some(is_below);
        }
        if end.is_below(distance)? {
            return Some(true);
        }
        let between = InteriorMinimum::of(&start, &end)?;
        if !between.may_be_closer() {
            return Some(false);
        }
        let squared = DoubleDouble::square_of(distance);
        SQUARES.contains(&squared.high).then_some(())?;
        let (by, error) = (between.by_squared, between.error(squared.high));
        match sign(between.cross_squared - squared * by, error)? {
            Ordering::Less => between.is_closer().then_some(true),
            _ => Some(false),
        }
    }

    /// Returns the smallest separation to about a unit in the last place; `None` if its size is out of range.
    fn approximate_separation(&self) -> Option<f64> {
        let [start, end] = self.ends();
        let ends = [&start, &end].map(|end| dot(&end.r, &end.r).high);
        let nearest = ends[0].min(ends[1]);
        let between = if RelativeEnd::are_same(&start, &end) { None } else { Some(InteriorMinimum::of(&start, &end)?) };
        let squared = match between.filter(InteriorMinimum::may_be_closer) {
            Some(between) => between.cross_squared.divided_by(between.by_squared).high.min(nearest),
            None => nearest,
        };
        SQUARES.contains(&squared).then(|| squared.sqrt())
    }
}

/// Relative position at an end of the shared time, with a bound on its error.
#[derive(Clone, Copy)]
struct RelativeEnd {
    r: [DoubleDouble; 3],
    error: f64,
}

impl RelativeEnd {
    /// Returns whether the relative position is constant.
    fn are_same(start: &Self, end: &Self) -> bool {
        start.error == 0.0 && end.error == 0.0 && start.r == end.r
    }

    /// Returns whether no term of the exact square underflows.
    fn is_squarable(&self) -> bool {
        let parts = self.r.iter().flat_map(|x| [x.high, x.low]);
        parts.into_iter().all(|part| part == 0.0 || part.abs() > SQUARABLE)
    }

    /// Returns whether the position is nearer to the origin than a distance; `None` if rounding could change the
    /// result.
    fn is_below(&self, distance: f64) -> Option<bool> {
        if self.error == 0.0 && self.r.iter().all(|x| x.high == 0.0) {
            return Some(distance > 0.0);
        }
        let (squared, limit) = (dot(&self.r, &self.r), DoubleDouble::square_of(distance));
        if !(SQUARES.contains(&squared.high) && SQUARES.contains(&limit.high)) {
            return None;
        }
        let length = squared.high.sqrt();
        let error = 16.0 * OPERATION * (squared.high + limit.high) + self.error * (4.0 * length + 2.0 * self.error);
        match sign(squared - limit, error) {
            Some(order) => Some(order == Ordering::Less),
            None => (self.error == 0.0 && self.is_squarable()).then(|| is_shorter(&self.r, distance)),
        }
    }
}

/// Terms that decide whether a relative motion is closest between its ends.
struct InteriorMinimum {
    /// |r0|^2 |d|^2 - (r0 . d)^2.
    cross_squared: DoubleDouble,
    /// |d|^2.
    by_squared: DoubleDouble,
    /// r0 . d and r1 . d.
    rates: [DoubleDouble; 2],
    rate_error: f64,
    /// |r0| and |d|.
    length: f64,
    by: f64,
    /// Bound on the error of the ends.
    end_error: f64,
}

impl InteriorMinimum {
    /// Creates the terms; `None` if the sizes are out of range or the error of the ends is too large.
    fn of(start: &RelativeEnd, end: &RelativeEnd) -> Option<Self> {
        let d = [0, 1, 2].map(|axis| end.r[axis] - start.r[axis]);
        let end_error = start.error.max(end.error);
        let (from_squared, by_squared) = (dot(&start.r, &start.r), dot(&d, &d));
        let (length, by) = (from_squared.high.sqrt(), by_squared.high.sqrt());
        let is_sized = SQUARES.contains(&from_squared.high) && SQUARES.contains(&by_squared.high);
        if !is_sized || 4.0 * end_error > length.min(by) {
            return None;
        }
        let rates = [dot(&start.r, &d), dot(&end.r, &d)];
        let rate_error = 16.0 * OPERATION * (length + by) * by + 4.0 * end_error * (length + by);
        let cross_squared = from_squared * by_squared - rates[0].square();
        Some(Self { cross_squared, by_squared, rates, rate_error, length, by, end_error })
    }

    /// Returns a bound on the error of `cross_squared` less x^2 |d|^2. E is the error of the ends, a = |r0|, b = |d|,
    /// and E is at most a quarter of both. The product |r0 x d| is off by c <= E (1.5 b + 2 a) < a b. Its square is off
    /// by c (2 a b + c), and x^2 |d|^2 by 5 x^2 b E.
    fn error(&self, squared: f64) -> f64 {
        let (a, b) = (self.length, self.by);
        let of_ends = 16.0 * self.end_error * (a * b * b + a * a * b + squared * b);
        32.0 * OPERATION * (2.0 * a * a + squared) * b * b + of_ends
    }

    /// Returns whether the closest point may lie between the ends.
    fn may_be_closer(&self) -> bool {
        self.rates[0].high < self.rate_error && self.rates[1].high > -self.rate_error
    }

    /// Returns whether the closest point certainly lies between the ends.
    fn is_closer(&self) -> bool {
        self.rates[0].high < -self.rate_error && self.rates[1].high > self.rate_error
    }
}

/// Unit of length or time: 2^k, with the exponent k.
#[derive(Clone, Copy, Debug)]
struct Units(i32);

/// Returns the mantissa of a finite double and its power of two.
fn parts(number: f64) -> (i64, i32) {
    let bits = number.to_bits();
    let (exponent, fraction) = ((bits >> 52) & 0x7ff, bits & ((1 << 52) - 1));
    #[expect(clippy::cast_possible_wrap, clippy::cast_possible_truncation, reason = "53 and 11 bits")]
    let (mantissa, exponent) =
        if exponent == 0 { (fraction as i64, -1074) } else { ((fraction | 1 << 52) as i64, exponent as i32 - 1075) };
    (if number < 0.0 { -mantissa } else { mantissa }, exponent)
}

impl Units {
    /// Returns the largest unit that divides all these numbers.
    fn of(numbers: impl IntoIterator<Item = f64>) -> Self {
        let exponents = numbers.into_iter().filter(|x| *x != 0.0).map(|x| parts(x).1);
        Self(exponents.min().unwrap_or(0))
    }

    /// Returns the number in these units.
    fn integer(self, number: f64) -> BigInt {
        let (mantissa, exponent) = parts(number);
        if mantissa == 0 { BigInt::ZERO } else { BigInt::from(mantissa) << exponent.abs_diff(self.0) }
    }
}

/// Motion in integers: relative positions times `weight`, in units of length.
pub(super) struct IntegerMotion {
    ends: [[BigInt; 3]; 2],
    by: [BigInt; 3],
    /// Distance to compare with, scaled likewise.
    distance: BigInt,
    weight: BigInt,
    units: Units,
}

fn product(a: &[BigInt; 3], b: &[BigInt; 3]) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

impl IntegerMotion {
    #[cold]
    pub(super) fn new(lines: [&Line; 2], interval: Interval, distance: f64) -> Self {
        let times =
            Units::of(lines.iter().flat_map(|line| [line.from_s, line.to_s]).chain([interval.from_s, interval.to_s]));
        let coordinates = lines.iter().flat_map(|line| line.from.iter().chain(&line.to).copied());
        let units = Units::of(coordinates.chain([distance]));
        let window_ends = [(interval.from_s, false), (interval.to_s, true)];
        let is_between =
            |line: &Line| window_ends.iter().any(|&(t, end)| matches!(line.place(t, end), EndPosition::Interpolated));
        let weights = lines.map(|line| {
            if is_between(line) { times.integer(line.to_s) - times.integer(line.from_s) } else { BigInt::from(1) }
        });
        let position = |k: usize, time_s: f64, is_end: bool| {
            let line = lines[k];
            [0, 1, 2].map(|axis| match line.place(time_s, is_end) {
                EndPosition::Sample(position) => units.integer(position[axis]) * &weights[k],
                EndPosition::Interpolated => {
                    let by = units.integer(line.to[axis]) - units.integer(line.from[axis]);
                    units.integer(line.from[axis]) * &weights[k]
                        + by * (times.integer(time_s) - times.integer(line.from_s))
                }
            })
        };
        let ends = window_ends.map(|(time_s, is_end)| {
            let (a, b) = (position(0, time_s, is_end), position(1, time_s, is_end));
            [0, 1, 2].map(|axis| &b[axis] * &weights[0] - &a[axis] * &weights[1])
        });
        let by = [0, 1, 2].map(|axis| &ends[1][axis] - &ends[0][axis]);
        let weight = &weights[0] * &weights[1];
        Self { ends, by, distance: units.integer(distance) * &weight, weight, units }
    }

    pub(super) fn starts_below(&self) -> bool {
        product(&self.ends[0], &self.ends[0]) < &self.distance * &self.distance
    }

    pub(super) fn is_below(&self) -> bool {
        let (squared, by_squared) = self.closest();
        squared < &self.distance * &self.distance * by_squared
    }

    /// Returns the smallest squared separation as a numerator and a denominator.
    fn closest(&self) -> (BigInt, BigInt) {
        let [start, end] = &self.ends;
        let start_rate = product(start, &self.by);
        let (from_squared, to_squared) = (product(start, start), product(end, end));
        if start_rate < BigInt::ZERO && product(end, &self.by) > BigInt::ZERO {
            let by_squared = product(&self.by, &self.by);
            (from_squared * &by_squared - &start_rate * &start_rate, by_squared)
        } else {
            (from_squared.min(to_squared), BigInt::from(1))
        }
    }

    pub(super) fn separation(&self) -> f64 {
        let (squared, by_squared) = self.closest();
        rounded_root(&squared, &(by_squared * &self.weight * &self.weight), self.units.0)
    }
}

/// Compares the height at a time within a line with another height, exactly.
pub(super) fn compare_height(line: &Line, time_s: f64, height: f64) -> Ordering {
    let times = Units::of([line.from_s, line.to_s, time_s]);
    let lengths = Units::of([line.from.z, line.to.z, height]);
    let above_start = lengths.integer(height) - lengths.integer(line.from.z);
    let climbs = lengths.integer(line.to.z) - lengths.integer(line.from.z);
    let [from, to, instant] = [line.from_s, line.to_s, time_s].map(|time_s| times.integer(time_s));
    (climbs * (instant - &from)).cmp(&(above_start * (to - from)))
}

/// Returns the double in the middle of all doubles between two.
pub(super) fn midpoint(low: f64, high: f64) -> f64 {
    // Integers in the order of the doubles.
    let key = |number: f64| {
        let bits = number.to_bits().cast_signed();
        if bits < 0 { i64::MIN - bits } else { bits }
    };
    let middle = key(low) + (key(high) - key(low)) / 2;
    f64::from_bits(if middle < 0 { i64::MIN - middle } else { middle }.cast_unsigned())
}

/// Returns the square root of a fraction, times 2^`exponent`, rounded down to a double.
fn rounded_root(numerator: &BigInt, denominator: &BigInt, exponent: i32) -> f64 {
    const DIGITS: u64 = 53;
    if *numerator == BigInt::ZERO {
        return 0.0;
    }
    // Shifted until the root has more digits than a double.
    let shift = (denominator.bits() + 2 * DIGITS + 4).saturating_sub(numerator.bits()).div_ceil(2);
    let root = ((numerator << (2 * shift)) / denominator).sqrt();
    let exponent = i64::from(exponent) - i64::try_from(shift).unwrap_or(i64::MAX);
    let extra = i64::try_from(root.bits().saturating_sub(DIGITS)).unwrap_or(i64::MAX).max(-1074 - exponent);
    let mantissa = (root >> extra).to_u64_digits().1.first().copied().unwrap_or(0);
    let power = |exponent: i64| 2_f64.powi(i32::try_from(exponent).unwrap_or(i32::MAX));
    let exponent = exponent + extra;
    // In two steps, since one power of two could be out of range.
    mantissa as f64 * power(exponent / 2) * power(exponent - exponent / 2)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Generates small integers, which meet distances exactly, and numbers with all digits of any size.
    fn coordinate() -> impl Strategy<Value = f64> {
        let sized = (-1.0..1.0_f64, -300..200_i32).prop_map(|(x, exponent)| x * 2_f64.powi(exponent));
        prop_oneof![4 => (-6..7_i32).prop_map(f64::from), 4 => -10.0..10.0_f64, 1 => sized]
    }

    fn time() -> impl Strategy<Value = f64> {
        prop_oneof![(0..9_i32).prop_map(f64::from), 0.0..9.0_f64]
    }

    fn motion() -> impl Strategy<Value = ExactMotion> {
        let point = || prop::array::uniform3(coordinate()).prop_map(Vector3::from);
        (prop::array::uniform4(time()), prop::array::uniform4(point()), any::<bool>()).prop_map(
            |(times, [a, b, c, d], is_together)| {
                let [t, u, v, w] = times;
                let (first, second) = ([t.min(u), t.max(u)], if is_together { [t, u] } else { [v, w] });
                let second = [second[0].min(second[1]).min(first[1]), second[0].max(second[1]).max(first[0])];
                let interval = Interval { from_s: first[0].max(second[0]), to_s: first[1].min(second[1]) };
                let line = |[from_s, to_s]: [f64; 2], from, to| Line { from_s, to_s, from, to };
                ExactMotion { first: line(first, a, b), second: line(second, c, d), interval }
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_stage_agrees_with_integers(motion in motion(), limit in 0..9_i32) {
            let separation = motion.separation();
            prop_assert_eq!(separation, motion.integer(0.0).separation());
            prop_assert!(!motion.is_below(separation) && motion.is_below(separation.next_up()), "{}", separation);
            for distance in [f64::from(limit), separation, separation.next_up(), separation.next_down().max(0.0)] {
                let integer = motion.integer(distance);
                prop_assert_eq!(motion.is_below(distance), integer.is_below());
                prop_assert_eq!(motion.starts_below(distance), integer.starts_below());
            }
        }
    }

    #[test]
    fn a_separation_of_extreme_size_is_exact() {
        for size in [5e-324, 3e-310, 1e-170, 1e70] {
            let line = |y: f64, x: f64| Line {
                from_s: 0.0,
                to_s: 1.0,
                from: Vector3::new(-x, y, 0.0),
                to: Vector3::new(x, y, 0.0),
            };
            let interval = Interval { from_s: 0.0, to_s: 1.0 };
            let motion = ExactMotion { first: line(0.0, 1.0), second: line(size, -1.0), interval };
            assert_eq!(motion.separation(), size);
            assert!(!motion.is_below(size) && motion.is_below(size.next_up()));
        }
    }
}
