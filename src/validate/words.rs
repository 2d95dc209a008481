//! Numbers in sentences: no more digits than every machine agrees on.

/// A rounding or truncation error beside what is allowed, as `below 1e-9`: its exact size differs between machines.
pub(super) fn bound(error: f64, allowed: f64) -> String {
    if error.abs() <= allowed {
        format!("below {allowed:e}")
    } else {
        format!("{error:.1e}, which is not below {allowed:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_said_to_be_below_what_is_allowed_only_where_it_is() {
        assert_eq!(bound(0.0, 1e-12), "below 1e-12");
        assert_eq!(bound(-1e-12, 1e-12), "below 1e-12");
        assert_eq!(bound(2e-12, 1e-12), "2.0e-12, which is not below 1e-12");
        assert_eq!(bound(f64::NAN, 1e-9), "NaN, which is not below 1e-9");
    }
}
