//! Exact distances of positions as decimals: the shortest decimals that read as the doubles of a recording.
//!
//! The doubles nearest to 0.1 and 0.6 are less than 0.5 apart. The verdict is that of the doubles. This module
//! distinguishes such a violation from a violation by the written numbers.

use nalgebra::Vector3;
use num_bigint::BigInt;

/// Decimal number: an integer and a power of ten.
type Decimal = (BigInt, i32);

/// Returns whether the shortest decimals of two positions are exactly as far apart as the shortest decimal of `limit`.
#[must_use]
pub fn are_decimals_apart(first: Vector3<f64>, second: Vector3<f64>, limit: f64) -> bool {
    let numbers = first.iter().chain(&second).chain([&limit]).map(|number| decimal(*number));
    let Some(numbers) = numbers.collect::<Option<Vec<_>>>() else { return false };
    let least = numbers.iter().map(|(_, power)| *power).min().unwrap_or(0);
    let integers: Vec<_> =
        numbers.into_iter().map(|(digits, power)| digits * BigInt::from(10).pow(power.abs_diff(least))).collect();
    let [first @ .., limit] = &integers[..] else { return false };
    let (first, second) = first.split_at(3);
    let squares = first.iter().zip(second).map(|(a, b)| (a - b).pow(2));
    squares.sum::<BigInt>() == limit.pow(2)
}

/// Returns the shortest decimal that reads as a double; `None` for numbers that are not finite.
fn decimal(number: f64) -> Option<Decimal> {
    let text = format!("{number:e}");
    let (digits, power) = text.split_once('e')?;
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let digits = format!("{whole}{fraction}").parse().ok()?;
    let places = i32::try_from(fraction.len()).ok()?;
    Some((digits, power.parse::<i32>().ok()? - places))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_compared_exactly() {
        let vector = Vector3::new;
        assert!(are_decimals_apart(vector(0.1, 0.0, 0.0), vector(0.6, 0.0, 0.0), 0.5));
        assert!(are_decimals_apart(vector(0.1, 0.2, 0.3), vector(0.4, 0.6, 0.3), 0.5), "3, 4 and 5 tenths");
        assert!(are_decimals_apart(vector(-1e3, 0.0, 0.0), vector(-999.5, 0.0, 0.0), 0.5));
        assert!(!are_decimals_apart(vector(0.1, 0.0, 0.0), vector(0.599_999_999_999, 0.0, 0.0), 0.5));
        assert!(!are_decimals_apart(vector(0.1, 0.0, 0.0), vector(f64::NAN, 0.0, 0.0), 0.5));
        assert!(are_decimals_apart(vector(1e-300, 0.0, 0.0), vector(3e-300, 0.0, 0.0), 2e-300));
    }
}
