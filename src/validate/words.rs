//! Numbers in sentences: no more digits than every machine agrees on.

/// The power of ten that bounds a rounding error from above with a factor of 3 to spare, as `1e-14`: rounding differs
/// between machines, its size does not.
pub(super) fn bound(error: f64) -> String {
    if error == 0.0 {
        return "exactly 0".to_owned();
    }
    if !error.is_finite() {
        return "not a number".to_owned();
    }
    format!("below 1e{:.0}", (3.0 * error.abs()).log10().ceil())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_is_a_power_of_ten_above_three_times_the_error() {
        assert_eq!(bound(2e-16), "below 1e-15");
        assert_eq!(bound(-4e-16), "below 1e-14");
        assert_eq!(bound(0.0), "exactly 0");
        assert_eq!(bound(f64::NAN), "not a number");
        assert_eq!(bound(f64::INFINITY), "not a number");
    }
}
