//! Numbers as people read them.

use std::fmt::Write as _;

/// Formats a number with `decimals` decimals, or in powers of ten if it is 1e15 or more. Zero has no sign.
#[must_use]
pub fn fixed(number: f64, decimals: usize) -> String {
    const LONG: f64 = 1e15;
    if number.abs() >= LONG {
        return format!("{number:e}");
    }
    let shown = format!("{number:.decimals$}");
    match shown.strip_prefix('-') {
        Some(size) if size.bytes().all(|byte| matches!(byte, b'0' | b'.')) => size.to_owned(),
        _ => shown,
    }
}

/// Like [`fixed`], rounded down: what is said to be "never closer than" this never is.
#[must_use]
pub fn at_least(number: f64, decimals: u8) -> String {
    let places = usize::from(decimals);
    let shown = fixed(number, places);
    match shown.parse::<f64>() {
        Ok(rounded) if rounded > number => fixed(rounded - 0.1_f64.powi(i32::from(decimals)), places),
        _ => shown,
    }
}

/// Like [`fixed`], rounded up: what is said to be "at most" this is.
#[must_use]
pub fn at_most(number: f64, decimals: u8) -> String {
    let places = usize::from(decimals);
    let shown = fixed(number, places);
    match shown.parse::<f64>() {
        Ok(rounded) if rounded < number => fixed(rounded + 0.1_f64.powi(i32::from(decimals)), places),
        _ => shown,
    }
}

/// A limit with at least three decimals, and as many as it has: rounded it would be another one.
#[must_use]
pub fn exact(limit: f64) -> String {
    let is_limit = |shown: &String| shown.parse() == Ok(limit);
    (3..=17).map(|decimals| fixed(limit, decimals)).find(is_limit).unwrap_or_else(|| format!("{limit:e}"))
}

/// Formats `number` \[m\], which is below `limit_m` \[m\], rounded down as [`at_least`] does, with at least three decimals and
/// as many as it takes to differ from the limit; `just below ...` within 1e-9 of it.
#[must_use]
pub fn metres_below(number: f64, limit_m: f64) -> String {
    const JUST: f64 = 1e-9;
    if number >= limit_m * (1.0 - JUST) {
        return format!("just below {}", exact(limit_m));
    }
    let is_told = |&decimals: &u8| {
        let shown = fixed(number, usize::from(decimals));
        shown != fixed(limit_m, usize::from(decimals)) && (number == 0.0 || shown.parse() != Ok(0.0))
    };
    (3..=17).find(is_told).map_or_else(|| format!("{number:e}"), |decimals| at_least(number, decimals))
}

/// A length \[m\] (or speed, or acceleration) with three decimals, or in powers of ten where that would show zero or fill a line.
#[must_use]
pub fn metres(number: f64) -> String {
    if number == 0.0 || (5e-3..1e7).contains(&number.abs()) { fixed(number, 3) } else { format!("{number:.1e}") }
}

/// Replaces the control characters that reverse the direction of text by U+FFFD; names in foreign files may hold some.
#[must_use]
pub fn in_order(words: &str) -> String {
    const TURNS: [char; 12] = [
        '\u{61c}', '\u{200e}', '\u{200f}', '\u{202a}', '\u{202b}', '\u{202c}', '\u{202d}', '\u{202e}', '\u{2066}',
        '\u{2067}', '\u{2068}', '\u{2069}',
    ];
    words.replace(TURNS, "\u{fffd}")
}

/// A time with its unit.
#[must_use]
pub fn seconds(time_s: f64) -> String {
    format!("{} s", fixed(time_s, 2))
}

/// Formats a number with `digits` significant digits, at most 8 decimals.
#[must_use]
pub fn significant(number: f64, digits: u8) -> String {
    let magnitude = if number == 0.0 { 0.0 } else { number.abs().log10().floor() };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 8")]
    let decimals = (f64::from(digits) - 1.0 - magnitude).clamp(0.0, 8.0) as usize;
    format!("{number:.decimals$}")
}

/// Rows of cells as columns.
///
/// # Panics
/// Where a row has fewer cells than the first.
pub fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let widths: Vec<_> = (0..columns).map(|k| rows.iter().map(|row| row[k].len()).max().unwrap_or(0)).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (cell, width) in row.iter().zip(&widths) {
            // Writing to a string cannot fail.
            let _ = write!(line, "{cell:<width$}  ");
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}

/// Number of decimals, at most `most`, that the multiples of `step` need; a step is 1, 2 or 5 times a power of ten.
#[must_use]
pub fn decimals_of(step: f64, most: u8) -> usize {
    /// Rounding must not take a step for the next smaller power.
    const ROUNDING: f64 = 1.000_001;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and most")]
    let decimals = (-(step * ROUNDING).log10().floor()).clamp(0.0, f64::from(most)) as usize;
    decimals
}

/// A rounding or truncation error beside what is allowed, as `below 1e-9`: its exact size differs between machines.
#[must_use]
pub fn bound(error: f64, allowed: f64) -> String {
    if error.abs() <= allowed {
        format!("below {allowed:e}")
    } else {
        format!("{error:.1e}, which is not below {allowed:e}")
    }
}

/// Names and what is said of each, a line each, as a table.
pub fn table<N: std::fmt::Display>(rows: impl IntoIterator<Item = (N, String)>) -> String {
    let mut text = String::new();
    for (name, content) in rows {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name:<12} {content}");
    }
    text
}

/// A number as a whole one where it is, which keys of either kind take.
#[must_use]
pub fn as_toml(value: f64) -> String {
    const WHOLE: f64 = 1e15;
    if value.abs() < WHOLE { value.to_string() } else { format!("{value:?}") }
}

/// Formats a count with its noun: `1 vehicle`, `2 vehicles`.
#[must_use]
pub fn counted(count: u64, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_is_never_shown_longer_than_it_is_and_less_than_a_digit_shorter() {
        let lengths_m =
            [1.999_999_9, 2.46, 1.001, 0.305_304_9, 0.1 + 0.2, 0.2 - 4.0 * f64::EPSILON, 0.0, -0.5, 123_456.789_9];
        for (decimals, digit) in [(3, 1e-3), (6, 1e-6)] {
            for length_m in lengths_m {
                let shown: f64 = at_least(length_m, decimals).parse().expect("a number");
                assert!(shown <= length_m && length_m - shown < digit * (1.0 + 1e-9), "{length_m:?}: {shown}");
            }
        }
        assert_eq!([2.46, 1.001, 1.999_999].map(|length_m| at_least(length_m, 3)), ["2.460", "1.001", "1.999"]);
        assert_eq!([1e300, f64::INFINITY].map(|length_m| at_least(length_m, 3)), ["1e300", "inf"]);
        assert_eq!([-0.0, -1e-9].map(|length_m| at_most(length_m, 3)), ["0.000"; 2]);
        assert_eq!([-0.0, 7e-4, -1e-9].map(|length_m| at_least(length_m, 3)), ["0.000", "0.000", "-0.001"]);
    }

    #[test]
    fn a_bound_is_never_shown_smaller_than_it_is_and_a_length_below_a_limit_never_as_the_limit() {
        for length_m in [1.999_999_9, 2.46, 1.001, 0.305_304_9, 0.1 + 0.2, 0.0, -0.5, 123_456.789_9] {
            let shown: f64 = at_most(length_m, 6).parse().expect("a number");
            assert!(shown >= length_m && shown - length_m < 1e-6 * (1.0 + 1e-9), "{length_m:?}: {shown}");
        }
        assert_eq!(at_most(f64::INFINITY, 6), "inf");
        for (number, limit_m, said) in [
            (1.5, 2.0, "1.500"),
            (1.999_96, 2.0, "1.99996"),
            (1.999_999_9, 2.0, "1.9999999"),
            (2.0_f64.next_down(), 2.0, "just below 2.000"),
            (0.3_f64.next_down(), 0.3, "just below 0.300"),
            (6e-13, 1e-12, "0.0000000000006"),
        ] {
            assert_eq!(metres_below(number, limit_m), said);
        }
    }

    #[test]
    fn an_error_is_said_to_be_below_what_is_allowed_only_where_it_is() {
        assert_eq!(bound(0.0, 1e-12), "below 1e-12");
        assert_eq!(bound(-1e-12, 1e-12), "below 1e-12");
        assert_eq!(bound(2e-12, 1e-12), "2.0e-12, which is not below 1e-12");
        assert_eq!(bound(f64::NAN, 1e-9), "NaN, which is not below 1e-9");
    }

    #[test]
    fn significant_digits_are_counted_from_the_first_that_is_not_zero() {
        assert_eq!([0.0, 0.3, 1.5, 123.456].map(|number| significant(number, 3)), ["0.00", "0.300", "1.50", "123"]);
        assert_eq!(significant(1_234_567.8, 6), "1234568");
    }

    #[test]
    fn multiples_of_a_step_have_the_decimals_of_the_step() {
        assert_eq!([20.0, 1.0, 0.5, 0.1, 0.05, 1e-7].map(|step| decimals_of(step, 4)), [0, 0, 1, 1, 2, 4]);
    }
}
