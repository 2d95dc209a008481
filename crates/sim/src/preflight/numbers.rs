//! Numbers of a pre-flight check as people read them.

use tautline_core::text;

/// A rate \[1/s\] to six decimals, with its sign.
pub(super) fn rate(rate_per_s: f64) -> String {
    // Adding zero takes the sign from what rounds to zero.
    format!("{:.6}", (rate_per_s * 1e6).round() / 1e6 + 0.0)
}

/// A positive number to three significant digits.
pub(super) fn significant(number: f64) -> String {
    if number == 0.0 || (1e-6..1e6).contains(&number.abs()) {
        text::significant(number, 3)
    } else {
        format!("{number:.2e}")
    }
}
