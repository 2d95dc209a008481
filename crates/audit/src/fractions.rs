//! Exact fractions, with which tests compare results.

use num_bigint::BigInt;
use num_rational::Ratio;

pub(crate) type Fraction = Ratio<BigInt>;

/// Returns a finite number as a fraction.
///
/// # Panics
/// If the number is not finite.
pub(crate) fn exact(number: f64) -> Fraction {
    assert!(number.is_finite(), "{number}");
    let bits = number.abs().to_bits();
    // A subnormal number has the exponent 1 and no leading one.
    let (exponent, digits) = ((bits >> 52).max(1), bits & ((1 << 52) - 1));
    let leading = u64::from(bits >> 52 > 0) << 52;
    let mantissa = BigInt::from(digits | leading) * if number < 0.0 { -1 } else { 1 };
    // number = mantissa 2^(exponent - 1075)
    if exponent >= 1075 {
        Ratio::from_integer(mantissa << (exponent - 1075))
    } else {
        Ratio::new(mantissa, BigInt::from(1) << (1075 - exponent))
    }
}

#[test]
fn a_number_is_its_fraction() {
    let half = Ratio::new(BigInt::from(1), BigInt::from(2));
    let power = |exponent: usize| Ratio::from_integer(BigInt::from(1) << exponent);
    assert_eq!(exact(0.0), Ratio::from_integer(BigInt::from(0)));
    assert_eq!(exact(-0.5), -&half);
    assert_eq!(exact(6.75), Ratio::from_integer(BigInt::from(7)) - &half * &half);
    assert_eq!(exact(2_f64.powi(80) + 2_f64.powi(40)), power(80) + power(40));
    assert_eq!(exact(f64::from_bits(3)) * power(1074), Ratio::from_integer(BigInt::from(3)));
    assert_eq!(exact(f64::MIN_POSITIVE) * power(1022), power(0));
    assert_eq!(exact(f64::MAX) + power(971), power(1024));
}
