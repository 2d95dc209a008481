//! Interval arithmetic with outward rounding.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::double_double::DoubleDouble;

/// Closed interval that contains a real number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Enclosed {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Enclosed {
    pub(super) const ZERO: Self = Self { low: 0.0, high: 0.0 };

    /// Returns the interval of a double alone.
    pub(super) fn exactly(x: f64) -> Self {
        Self { low: x, high: x }
    }

    /// Returns an interval of rounded bounds.
    fn rounded(low: f64, high: f64) -> Self {
        // An operation on bounds out of range, such as 0 times infinity, gives no bound.
        let low = if low.is_nan() { f64::NEG_INFINITY } else { low.next_down() };
        let high = if high.is_nan() { f64::INFINITY } else { high.next_up() };
        Self { low, high }
    }

    /// Returns the interval within `by` of this one.
    pub(super) fn widened(self, by: f64) -> Self {
        Self::rounded(self.low - by, self.high + by)
    }

    /// Returns the difference of two doubles, without width where it is a double.
    pub(super) fn difference(a: f64, b: f64) -> Self {
        let DoubleDouble { high, low } = DoubleDouble::difference(a, b);
        if low == 0.0 { Self::exactly(high) } else { Self::rounded(high, high) }
    }

    pub(super) fn squared(self) -> Self {
        let (a, b) = (self.low * self.low, self.high * self.high);
        let least = if self.low <= 0.0 && self.high >= 0.0 { 0.0 } else { a.min(b).next_down() };
        Self { low: least.max(0.0), high: if a.max(b) == 0.0 { 0.0 } else { a.max(b).next_up() } }
    }

    /// Returns the square root; a negative part counts as 0.
    pub(super) fn root(self) -> Self {
        let [low, high] = [self.low, self.high].map(|bound| bound.max(0.0).sqrt());
        Self { low: low.next_down().max(0.0), high: high.next_up() }
    }

    pub(super) fn absolute(self) -> Self {
        if self.low >= 0.0 {
            self
        } else if self.high <= 0.0 {
            -self
        } else {
            Self { low: 0.0, high: self.high.max(-self.low) }
        }
    }

    /// Returns whether the number may be 0.
    pub(super) fn has_zero(self) -> bool {
        self.low <= 0.0 && self.high >= 0.0
    }

    /// Returns the double in the middle.
    pub(super) fn middle(self) -> f64 {
        0.5 * self.low + 0.5 * self.high
    }
}

impl Neg for Enclosed {
    type Output = Self;

    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }
}

impl Add for Enclosed {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        if self == Self::ZERO {
            other
        } else if other == Self::ZERO {
            self
        } else {
            Self::rounded(self.low + other.low, self.high + other.high)
        }
    }
}

impl Sub for Enclosed {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Enclosed {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        if self == Self::ZERO || other == Self::ZERO {
            return Self::ZERO;
        }
        let products = [self.low * other.low, self.low * other.high, self.high * other.low, self.high * other.high];
        if products.iter().any(|product| product.is_nan()) {
            return Self { low: f64::NEG_INFINITY, high: f64::INFINITY };
        }
        Self::rounded(
            products.into_iter().fold(f64::INFINITY, f64::min),
            products.into_iter().fold(f64::NEG_INFINITY, f64::max),
        )
    }
}

impl Div for Enclosed {
    type Output = Self;

    /// Returns the quotient; all numbers if the divisor may be 0.
    fn div(self, other: Self) -> Self {
        if other.has_zero() {
            return Self { low: f64::NEG_INFINITY, high: f64::INFINITY };
        }
        if self == Self::ZERO {
            return Self::ZERO;
        }
        let quotients = [self.low / other.low, self.low / other.high, self.high / other.low, self.high / other.high];
        Self::rounded(
            quotients.into_iter().fold(f64::INFINITY, f64::min),
            quotients.into_iter().fold(f64::NEG_INFINITY, f64::max),
        )
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fractions::{Fraction, exact};

    proptest! {
        #[test]
        fn every_operation_contains_the_exact_result(a in -1e3..1e3_f64, b in -1e3..1e3_f64) {
            let (x, y) = (Enclosed::exactly(a), Enclosed::exactly(b));
            let holds = |x: Enclosed, result: Fraction| exact(x.low) <= result && result <= exact(x.high);
            prop_assert!(holds(x + y, exact(a) + exact(b)));
            prop_assert!(holds(x - y, exact(a) - exact(b)));
            prop_assert!(holds(Enclosed::difference(a, b), exact(a) - exact(b)));
            prop_assert!(holds(x * y, exact(a) * exact(b)));
            prop_assert!(holds(x.squared(), exact(a) * exact(a)));
            if b != 0.0 {
                prop_assert!(holds(x / y, exact(a) / exact(b)));
            }
            let root = x.absolute().root();
            prop_assert!(exact(root.low) * exact(root.low) <= exact(a.abs()));
            prop_assert!(exact(root.high) * exact(root.high) >= exact(a.abs()));
        }
    }

    #[test]
    fn a_quotient_by_an_interval_with_zero_is_unbounded() {
        let around = Enclosed { low: -1.0, high: 1.0 };
        let all = Enclosed::exactly(1.0) / around;
        assert_eq!((all.low, all.high), (f64::NEG_INFINITY, f64::INFINITY));
        assert_eq!(around.squared(), Enclosed { low: 0.0, high: 1.0_f64.next_up() });
        assert_eq!(around.absolute(), Enclosed { low: 0.0, high: 1.0 });
    }
}
