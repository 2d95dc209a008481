//! The separation of two straight lines in whole numbers of any size.

use std::cmp::Ordering;

use num_bigint::BigInt;

use super::polynomial::{Line, Place};
use super::sweep::Interval;

/// A unit, 2 to some power, that doubles are whole numbers of.
#[derive(Clone, Copy, Debug)]
struct Units(i32);

/// The mantissa of a finite double and the power of two that it is multiplied by.
fn parts(number: f64) -> (i64, i32) {
    let bits = number.to_bits();
    let (exponent, fraction) = ((bits >> 52) & 0x7ff, bits & ((1 << 52) - 1));
    #[expect(clippy::cast_possible_wrap, clippy::cast_possible_truncation, reason = "53 and 11 bits")]
    let (mantissa, exponent) =
        if exponent == 0 { (fraction as i64, -1074) } else { ((fraction | 1 << 52) as i64, exponent as i32 - 1075) };
    (if number < 0.0 { -mantissa } else { mantissa }, exponent)
}

impl Units {
    /// The largest one that the exponents of these numbers allow.
    fn of(numbers: impl IntoIterator<Item = f64>) -> Self {
        let exponents = numbers.into_iter().filter(|x| *x != 0.0).map(|x| parts(x).1);
        Self(exponents.min().unwrap_or(0))
    }

    /// The number in these units.
    fn whole(self, number: f64) -> BigInt {
        let (mantissa, exponent) = parts(number);
        if mantissa == 0 { BigInt::ZERO } else { BigInt::from(mantissa) << exponent.abs_diff(self.0) }
    }
}

/// The motion in whole numbers: relative positions times `weight`, in units of length.
pub(super) struct WholeMotion {
    ends: [[BigInt; 3]; 2],
    by: [BigInt; 3],
    /// A distance likewise.
    distance: BigInt,
    weight: BigInt,
    units: Units,
}

fn product(a: &[BigInt; 3], b: &[BigInt; 3]) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

impl WholeMotion {
    #[cold]
    pub(super) fn new(lines: [&Line; 2], over: Interval, distance: f64) -> Self {
        let times = Units::of(lines.iter().flat_map(|line| [line.from_s, line.to_s]).chain([over.from_s, over.to_s]));
        let coordinates = lines.iter().flat_map(|line| line.from.iter().chain(&line.to).copied());
        let units = Units::of(coordinates.chain([distance]));
        let at = [(over.from_s, false), (over.to_s, true)];
        let is_between = |line: &Line| at.iter().any(|&(t, end)| matches!(line.place(t, end), Place::Between));
        let weights = lines.map(|line| {
            if is_between(line) { times.whole(line.to_s) - times.whole(line.from_s) } else { BigInt::from(1) }
        });
        let position = |k: usize, time_s: f64, is_end: bool| {
            let line = lines[k];
            [0, 1, 2].map(|axis| match line.place(time_s, is_end) {
                Place::Sample(at) => units.whole(at[axis]) * &weights[k],
                Place::Between => {
                    let by = units.whole(line.to[axis]) - units.whole(line.from[axis]);
                    units.whole(line.from[axis]) * &weights[k] + by * (times.whole(time_s) - times.whole(line.from_s))
                }
            })
        };
        let ends = at.map(|(time_s, is_end)| {
            let (a, b) = (position(0, time_s, is_end), position(1, time_s, is_end));
            [0, 1, 2].map(|axis| &b[axis] * &weights[0] - &a[axis] * &weights[1])
        });
        let by = [0, 1, 2].map(|axis| &ends[1][axis] - &ends[0][axis]);
        let weight = &weights[0] * &weights[1];
        Self { ends, by, distance: units.whole(distance) * &weight, weight, units }
    }

    pub(super) fn starts_below(&self) -> bool {
        product(&self.ends[0], &self.ends[0]) < &self.distance * &self.distance
    }

    pub(super) fn is_below(&self) -> bool {
        let (squared, by_squared) = self.closest();
        squared < &self.distance * &self.distance * by_squared
    }

    /// The smallest squared separation as a numerator and a denominator.
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
        root(&squared, &(by_squared * &self.weight * &self.weight), self.units.0)
    }

    /// By bisection of the doubles from the first to the last instant.
    pub(super) fn closest_s(&self, over: Interval) -> f64 {
        let start_rate = product(&self.ends[0], &self.by);
        if start_rate >= BigInt::ZERO {
            return over.from_s;
        }
        if product(&self.ends[1], &self.by) <= BigInt::ZERO {
            return over.to_s;
        }
        let by_squared = product(&self.by, &self.by);
        // (t - from_s) |d|^2 <= -(r0 . d) (to_s - from_s)
        let is_reached = |time_s: f64| {
            let times = Units::of([over.from_s, over.to_s, time_s]);
            let [from, to, at] = [over.from_s, over.to_s, time_s].map(|time_s| times.whole(time_s));
            (at - &from) * &by_squared <= -&start_rate * (to - from)
        };
        let (mut low, mut high) = (over.from_s, over.to_s);
        while low.next_up() < high {
            let middle = between(low, high);
            if is_reached(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}

/// Compares the height at a time within a line with another, exactly.
pub(super) fn compare_height(line: &Line, time_s: f64, height: f64) -> Ordering {
    let times = Units::of([line.from_s, line.to_s, time_s]);
    let lengths = Units::of([line.from.z, line.to.z, height]);
    let above_start = lengths.whole(height) - lengths.whole(line.from.z);
    let climbs = lengths.whole(line.to.z) - lengths.whole(line.from.z);
    let [from, to, at] = [line.from_s, line.to_s, time_s].map(|time_s| times.whole(time_s));
    (climbs * (at - &from)).cmp(&(above_start * (to - from)))
}

/// The double in the middle of all that lie between two.
fn between(low: f64, high: f64) -> f64 {
    // Bits of doubles in the order of the numbers.
    let key = |number: f64| {
        let bits = number.to_bits().cast_signed();
        if bits < 0 { i64::MIN - bits } else { bits }
    };
    let middle = key(low) + (key(high) - key(low)) / 2;
    f64::from_bits(if middle < 0 { i64::MIN - middle } else { middle }.cast_unsigned())
}

/// The largest double that is at most the root of a fraction, times 2 to an exponent.
fn root(numerator: &BigInt, denominator: &BigInt, exponent: i32) -> f64 {
    const DIGITS: u64 = 53;
    if *numerator == BigInt::ZERO {
        return 0.0;
    }
    // So much that the root has more digits than a double.
    let shift = (denominator.bits() + 2 * DIGITS + 4).saturating_sub(numerator.bits()).div_ceil(2);
    let root = ((numerator << (2 * shift)) / denominator).sqrt();
    let exponent = i64::from(exponent) - i64::try_from(shift).unwrap_or(i64::MAX);
    let extra = i64::try_from(root.bits().saturating_sub(DIGITS)).unwrap_or(i64::MAX).max(-1074 - exponent);
    let mantissa = (root >> extra).to_u64_digits().1.first().copied().unwrap_or(0);
    let power = |exponent: i64| 2_f64.powi(i32::try_from(exponent).unwrap_or(i32::MAX));
    let exponent = exponent + extra;
    // In two steps, neither of which rounds.
    mantissa as f64 * power(exponent / 2) * power(exponent - exponent / 2)
}
