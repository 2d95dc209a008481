//! Numbers in sentences: no more digits than every machine agrees on.

/// Decades in which bounds are given.
const DECADES: f64 = 3.0;
/// Exponent of the smallest bound: what is smaller is rounding, whose size differs between machines.
const SMALLEST: f64 = -12.0;

/// A bound on a rounding or truncation error from above, as `below 1e-9`: a power of 1000, at least 1e-12, with a factor
/// of 3 to spare.
pub(super) fn bound(error: f64) -> String {
    if !error.is_finite() {
        return "not a number".to_owned();
    }
    let exponent = DECADES * ((3.0 * error.abs()).log10() / DECADES).ceil();
    // Adding zero takes the sign from a negative zero.
    format!("below 1e{:.0}", exponent.max(SMALLEST) + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_is_a_power_of_1000_above_three_times_the_error() {
        assert_eq!(bound(0.0), "below 1e-12");
        assert_eq!(bound(2e-16), "below 1e-12");
        assert_eq!(bound(-4e-13), "below 1e-9");
        assert_eq!(bound(5e-4), "below 1e0");
        assert_eq!(bound(f64::NAN), "not a number");
        assert_eq!(bound(f64::INFINITY), "not a number");
    }
}
