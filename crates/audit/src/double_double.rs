//! Double-double arithmetic: sums and products of doubles with twice the digits, and the exact sign of a sum.
//!
//! u = 2^-53 is the unit roundoff. The algorithms and their bounds are those of M. Joldes, J.-M. Muller and V. Popescu
//! (ACM Transactions on Mathematical Software 44(2), 15, 2017) and of J. R. Shewchuk (Discrete & Computational Geometry
//! 18, 305, 1997). They hold if no product underflows and no number overflows; callers check the sizes.

use std::ops::{Add, Mul, Sub};

/// Relative error of a sum, difference or product of two [`DoubleDouble`]s: at most 16 u^2.
pub(super) const OPERATION: f64 = f64::EPSILON * f64::EPSILON * 4.0;
/// Relative error of a quotient of two [`DoubleDouble`]s: at most 64 u^2.
pub(super) const QUOTIENT: f64 = 4.0 * OPERATION;

/// Unevaluated sum of two doubles, the second at most half a unit in the last place of the first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DoubleDouble {
    pub(super) high: f64,
    pub(super) low: f64,
}

/// Returns a + b rounded, and the rounding error.
#[inline]
fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let from_b = high - a;
    DoubleDouble { high, low: (a - (high - from_b)) + (b - from_b) }
}

/// As [`two_sum`], for |a| >= |b|.
#[inline]
fn fast_two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    DoubleDouble { high, low: b - (high - a) }
}

/// Returns two halves of a double whose products with other halves are exact.
#[inline]
fn split(a: f64) -> (f64, f64) {
    const SPLITTER: f64 = 134_217_729.0;
    let scaled = SPLITTER * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

/// Returns a * b rounded, and the rounding error.
#[inline]
fn two_product(a: f64, b: f64) -> DoubleDouble {
    let high = a * b;
    let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
    DoubleDouble { high, low: ((a_high * b_high - high) + a_high * b_low + a_low * b_high) + a_low * b_low }
}

impl DoubleDouble {
    /// Returns a - b, exactly.
    #[inline]
    pub(super) fn difference(a: f64, b: f64) -> Self {
        two_sum(a, -b)
    }

    /// Returns a^2, exactly.
    #[inline]
    pub(super) fn square_of(a: f64) -> Self {
        two_product(a, a)
    }

    #[inline]
    pub(super) fn square(self) -> Self {
        self * self
    }

    /// Returns the quotient, to within [`QUOTIENT`].
    #[inline]
    pub(super) fn divided_by(self, divisor: Self) -> Self {
        let first = self.high / divisor.high;
        let rest = self - divisor * Self::from(first);
        fast_two_sum(first, rest.high / divisor.high)
    }
}

impl From<f64> for DoubleDouble {
    #[inline]
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Add for DoubleDouble {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        let (high, low) = (two_sum(self.high, other.high), two_sum(self.low, other.low));
        let sum = fast_two_sum(high.high, high.low + low.high);
        fast_two_sum(sum.high, low.low + sum.low)
    }
}

impl Sub for DoubleDouble {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        self.add(Self { high: -other.high, low: -other.low })
    }
}

impl Mul for DoubleDouble {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        let high = two_product(self.high, other.high);
        fast_two_sum(high.high, high.low + (self.high * other.low + self.low * other.high))
    }
}

/// Largest number of terms of |r|^2 - x^2: six for each axis, and two.
const MAX_TERMS: usize = 20;

/// Exact sum of doubles: terms that do not overlap, the smallest first.
#[derive(Debug)]
struct Expansion {
    terms: [f64; MAX_TERMS],
    count: usize,
}

impl Expansion {
    /// Adds a number; at most [`MAX_TERMS`] times.
    fn add(&mut self, number: f64) {
        let (mut carry, mut kept) = (number, 0);
        for k in 0..self.count {
            let sum = two_sum(carry, self.terms[k]);
            carry = sum.high;
            if sum.low != 0.0 {
                self.terms[kept] = sum.low;
                kept += 1;
            }
        }
        if carry != 0.0 {
            self.terms[kept] = carry;
            kept += 1;
        }
        self.count = kept;
    }
}

/// Returns whether |r| < x, exactly.
pub(super) fn is_shorter(r: &[DoubleDouble; 3], x: f64) -> bool {
    let mut sum = Expansion { terms: [0.0; MAX_TERMS], count: 0 };
    let mut add = |product: DoubleDouble, sign: f64| {
        for term in [product.low, product.high] {
            if term != 0.0 {
                sum.add(sign * term);
            }
        }
    };
    add(two_product(x, x), -1.0);
    for DoubleDouble { high, low } in *r {
        add(two_product(high, high), 1.0);
        if low != 0.0 {
            add(two_product(2.0 * high, low), 1.0);
            add(two_product(low, low), 1.0);
        }
    }
    // The last term is larger than the sum of all others.
    sum.count > 0 && sum.terms[sum.count - 1] < 0.0
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fractions::{Fraction, exact};

    fn value(number: DoubleDouble) -> Fraction {
        exact(number.high) + exact(number.low)
    }

    fn number() -> impl Strategy<Value = f64> {
        (-1.0..1.0_f64, -60..60_i32).prop_map(|(x, exponent)| x * 2_f64.powi(exponent))
    }

    fn pair() -> impl Strategy<Value = DoubleDouble> {
        (number(), number(), -60..-53_i32).prop_map(|(a, b, exponent)| two_sum(a, b * a * 2_f64.powi(exponent)))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_operation_is_within_its_error_bound(a in pair(), b in pair(), near in -4..4_i32) {
            prop_assume!(a.high != 0.0 && b.high != 0.0);
            // A second operand that nearly cancels.
            let almost = two_sum(-a.high * (1.0 + f64::from(near) * f64::EPSILON), 0.5 * a.low);
            let within = |found: DoubleDouble, expected: Fraction, bound: f64| {
                let off = value(found) - &expected;
                let most = exact(bound) * expected;
                &off * &off <= &most * &most
            };
            let (x, y, z) = (value(a), value(b), value(almost));
            prop_assert!(within(a + b, &x + &y, OPERATION));
            prop_assert!(within(a + almost, &x + &z, OPERATION));
            prop_assert!(within(a - b, &x - &y, OPERATION));
            prop_assert!(within(a * b, &x * &y, OPERATION));
            prop_assert!(within(a.divided_by(b), &x / &y, QUOTIENT));
            prop_assert_eq!(value(DoubleDouble::difference(a.high, b.high)), exact(a.high) - exact(b.high));
        }

        #[test]
        fn a_length_is_compared_exactly(r in prop::array::uniform3(pair()), ulps in -3..4_i32) {
            let squared = r.map(value).iter().fold(exact(0.0), |sum, x| sum + x * x);
            let about = r.map(|x| x.high * x.high).iter().sum::<f64>().sqrt();
            let x = (0..ulps.abs()).fold(about, |x, _| if ulps > 0 { x.next_up() } else { x.next_down() });
            prop_assert_eq!(is_shorter(&r, x), squared < exact(x) * exact(x));
        }
    }

    #[test]
    fn an_equal_length_is_not_shorter() {
        let r = [3.0, 0.0, -4.0].map(DoubleDouble::from);
        assert!(!is_shorter(&r, 5.0) && is_shorter(&r, 5.0_f64.next_up()) && !is_shorter(&r, 5.0_f64.next_down()));
        // 0.3 - 0.1 is 0.2 less a part that is not a double of that size.
        let along = DoubleDouble::difference(0.3, 0.1);
        let r = [along, DoubleDouble::default(), DoubleDouble::default()];
        assert_eq!(is_shorter(&r, along.high), along.low < 0.0);
        assert!(is_shorter(&r, along.high.next_up()));
    }
}
