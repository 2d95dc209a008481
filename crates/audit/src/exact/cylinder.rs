//! Exact entry of a straight relative motion into an upright cylinder.
//!
//! All coordinates are integers in units of one power of two, times the weights of the motion. With the fraction u of
//! the shared time, |z(u)| < x H holds on an open interval (n1 / D, n2 / D) with D = |z1 - z0|. Over its closure,
//! clamped to [0, 1], the squared horizontal distance is a parabola. Both sides are multiplied by their denominators.

use num_bigint::BigInt;

use super::{ExactMotion, IntegerMotion, parts};
use crate::cylinder::Cylinder;

impl ExactMotion {
    /// Returns whether the scaled distance falls below a value.
    #[cold]
    pub(crate) fn enters(&self, cylinder: &Cylinder, distance: f64) -> bool {
        distance > 0.0 && self.integer_cylinder(cylinder, distance).is_entered()
    }

    /// Returns whether the scaled distance is below a value at the start.
    #[cold]
    pub(crate) fn starts_within(&self, cylinder: &Cylinder, distance: f64) -> bool {
        distance > 0.0 && self.integer_cylinder(cylinder, distance).contains_start()
    }

    fn integer_cylinder(&self, cylinder: &Cylinder, distance: f64) -> IntegerCylinder {
        IntegerCylinder::new(&self.integer(0.0), cylinder, distance)
    }
}

/// Relative positions at both ends, and the reaches x R and x H, in the same units.
struct IntegerCylinder {
    ends: [[BigInt; 3]; 2],
    horizontal: BigInt,
    vertical: BigInt,
}

impl IntegerCylinder {
    fn new(motion: &IntegerMotion, cylinder: &Cylinder, distance: f64) -> Self {
        let (factor, exponent) = parts(distance);
        let product = |length: f64| {
            let (mantissa, of_length) = parts(length);
            (BigInt::from(factor) * mantissa, exponent + of_length)
        };
        let reaches = [cylinder.horizontal_m, cylinder.vertical_m].map(product);
        let unit = reaches.iter().map(|(_, exponent)| *exponent).fold(motion.units.0, i32::min);
        let [horizontal, vertical] =
            reaches.map(|(mantissa, exponent)| (mantissa * &motion.weight) << exponent.abs_diff(unit));
        let ends = [0, 1].map(|end| [0, 1, 2].map(|axis| &motion.ends[end][axis] << motion.units.0.abs_diff(unit)));
        Self { ends, horizontal, vertical }
    }

    fn contains_start(&self) -> bool {
        let [x, y, z] = &self.ends[0];
        is_smaller(z, &self.vertical) && x * x + y * y < &self.horizontal * &self.horizontal
    }

    fn is_entered(&self) -> bool {
        let [[x0, y0, z0], [x1, y1, z1]] = &self.ends;
        let (dx, dy, dz) = (x1 - x0, y1 - y0, z1 - z0);
        let zero = BigInt::ZERO;
        // Interval of the fraction as numerators over `length`.
        let (low, high, length) = if dz == zero {
            if !is_smaller(z0, &self.vertical) {
                return false;
            }
            (zero.clone(), BigInt::from(1), BigInt::from(1))
        } else {
            let toward = if dz > zero { -z0 } else { z0.clone() };
            let length = if dz > zero { dz } else { -dz };
            let (low, high) = (&toward - &self.vertical, toward + &self.vertical);
            if high <= zero || low >= length {
                return false;
            }
            (low.max(zero.clone()), high.min(length.clone()), length)
        };
        let squared_reach = &self.horizontal * &self.horizontal;
        let by_squared = &dx * &dx + &dy * &dy;
        let rate = x0 * &dx + y0 * &dy;
        // Sign of the derivative at a numerator n: (x0, y0) . d + n / length |d|^2.
        let slope = |n: &BigInt| &rate * &length + n * &by_squared;
        if slope(&low) < zero && slope(&high) > zero {
            let cross = x0 * &dy - y0 * &dx;
            return &cross * &cross < squared_reach * by_squared;
        }
        let nearest = if slope(&low) >= zero { low } else { high };
        let (x, y) = (x0 * &length + &nearest * dx, y0 * &length + nearest * dy);
        &x * &x + &y * &y < squared_reach * &length * &length
    }
}

/// Returns whether a number is smaller in size than a positive bound.
fn is_smaller(number: &BigInt, bound: &BigInt) -> bool {
    number < bound && -number < *bound
}
