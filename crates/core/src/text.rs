//! Formats numbers for output that people read.

use std::borrow::Cow;
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

/// Formats as [`fixed`] does, rounded down, so that the text is a lower bound of `number`.
#[must_use]
pub fn at_least(number: f64, decimals: u8) -> String {
    let places = usize::from(decimals);
    let shown = fixed(number, places);
    match shown.parse::<f64>() {
        Ok(rounded) if rounded > number => fixed(rounded - 0.1_f64.powi(i32::from(decimals)), places),
        _ => shown,
    }
}

/// Formats as [`fixed`] does, rounded up, so that the text is an upper bound of `number`.
#[must_use]
pub fn at_most(number: f64, decimals: u8) -> String {
    let places = usize::from(decimals);
    let shown = fixed(number, places);
    match shown.parse::<f64>() {
        Ok(rounded) if rounded < number => fixed(rounded + 0.1_f64.powi(i32::from(decimals)), places),
        _ => shown,
    }
}

/// Formats a limit exactly, with three decimals or more: rounding would show another limit.
#[must_use]
pub fn exact(limit: f64) -> String {
    let is_limit = |shown: &String| shown.parse() == Ok(limit);
    (3..=17).map(|decimals| fixed(limit, decimals)).find(is_limit).unwrap_or_else(|| format!("{limit:e}"))
}

/// Formats `number` beside a `limit` that [`exact`] formats, so that the printed order is the true order.
///
/// Rounds down as [`at_least`] does, with `decimals` decimals or more. Returns `just below ...` for a number that is
/// less than the limit by at most a relative 1e-9.
#[must_use]
pub fn beside_limit(number: f64, limit: f64, decimals: u8) -> String {
    const JUST: f64 = 1e-9;
    let keeps_order = |&decimals: &u8| {
        if number >= limit {
            return at_least(number, decimals).parse().is_ok_and(|shown: f64| shown >= limit);
        }
        let shown = fixed(number, usize::from(decimals));
        shown != fixed(limit, usize::from(decimals)) && (number == 0.0 || shown.parse() != Ok(0.0))
    };
    if number < limit && number >= limit * (1.0 - JUST) {
        return format!("just below {}", exact(limit));
    }
    (decimals..=17).find(keeps_order).map_or_else(|| format!("{number:e}"), |decimals| at_least(number, decimals))
}

/// Formats a number that is less than a `bound` and the bound, both rounded down, with three decimals or more, so that
/// the texts differ.
#[must_use]
pub fn below_bound(number: f64, bound: f64) -> [String; 2] {
    let both = |decimals: u8| [number, bound].map(|number| at_least(number, decimals));
    (3..=17)
        .map(both)
        .find(|[below, bound]| below != bound)
        .unwrap_or_else(|| [number, bound].map(|x| format!("{x:e}")))
}

/// Formats a length \[m\], speed or acceleration with three decimals, or in powers of ten below 5e-3 and from 1e7 on.
///
/// A separation or a clearance is formatted by [`separation`], and a number that a limit bounds from above by
/// [`up_to`].
#[must_use]
pub fn metres(number: f64) -> String {
    if is_fixed(number) { fixed(number, 3) } else { format!("{number:.1e}") }
}

/// Formats a separation, a distance or a clearance \[m\] as [`metres`] does, rounded down: the true one is not smaller.
#[must_use]
pub fn separation(distance_m: f64) -> String {
    if is_fixed(distance_m) { at_least(distance_m, 3) } else { rounded_in_powers(distance_m, -1.0) }
}

/// Formats a speed, an acceleration, an error or a needed length as [`metres`] does, rounded up: the true one is not
/// larger.
#[must_use]
pub fn up_to(number: f64) -> String {
    if is_fixed(number) { at_most(number, 3) } else { rounded_in_powers(number, 1.0) }
}

/// Returns whether a number is written with three decimals.
fn is_fixed(number: f64) -> bool {
    number == 0.0 || (5e-3..1e7).contains(&number.abs())
}

/// Formats a number with two digits in powers of ten, rounded up (`sign` 1) or down (`sign` -1).
fn rounded_in_powers(number: f64, sign: f64) -> String {
    let shown = format!("{number:.1e}");
    let rounded = shown.parse().unwrap_or(number);
    if sign * (rounded - number) >= 0.0 || !number.is_finite() {
        return shown;
    }
    // The exponent before rounding: 9.96e-4 is shown as 1.0e-3, and its next two digits below are 9.9e-4.
    let digits = format!("{number:e}");
    let exponent = digits.split_once('e').and_then(|(_, exponent)| exponent.parse::<i32>().ok()).unwrap_or_default();
    format!("{:.1e}", rounded + sign * 10_f64.powi(exponent - 1))
}

/// Returns a text with its first letter in upper case.
#[must_use]
pub fn capitalised(text: &str) -> String {
    let (first, rest) = text.split_at(text.chars().next().map_or(0, char::len_utf8));
    first.to_uppercase() + rest
}

/// Replaces the control characters that reverse the direction of text by U+FFFD. Names in foreign files may contain
/// them.
#[must_use]
pub fn in_order(words: &str) -> String {
    const BIDI_CONTROLS: [char; 12] = [
        '\u{61c}', '\u{200e}', '\u{200f}', '\u{202a}', '\u{202b}', '\u{202c}', '\u{202d}', '\u{202e}', '\u{2066}',
        '\u{2067}', '\u{2068}', '\u{2069}',
    ];
    words.replace(BIDI_CONTROLS, "\u{fffd}")
}

/// Formats a time with its unit.
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

/// Formats rows of cells as aligned columns.
///
/// # Panics
/// If a row has fewer cells than the first.
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

/// Returns the number of decimals, at most `most`, of the multiples of `step`, which is 1, 2 or 5 times a power of ten.
#[must_use]
pub fn decimals_of(step: f64, most: u8) -> usize {
    /// Keeps the rounding error of the logarithm from lowering the power of ten.
    const ROUNDING: f64 = 1.000_001;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and most")]
    let decimals = (-(step * ROUNDING).log10().floor()).clamp(0.0, f64::from(most)) as usize;
    decimals
}

/// Formats a rounding or truncation error as `below 1e-9` if it is allowed: its exact value differs between machines.
#[must_use]
pub fn bound(error: f64, allowed: f64) -> String {
    if error.abs() <= allowed {
        format!("below {allowed:e}")
    } else {
        format!("{error:.1e}, which is not below {allowed:e}")
    }
}

/// Formats names and their descriptions as a table, one name per line.
pub fn table<N: std::fmt::Display>(rows: impl IntoIterator<Item = (N, String)>) -> String {
    let mut text = String::new();
    for (name, content) in rows {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name:<12} {content}");
    }
    text
}

/// Formats a given number for a message: the shortest decimal with the same bits. Numbers below 1e-5 and from 1e16 on
/// are in powers of ten. Integral values have no decimal point, so integer and float keys of TOML accept them.
#[must_use]
pub fn shortest(value: f64) -> String {
    let shown = format!("{value:?}");
    shown.strip_suffix(".0").map_or(shown.clone(), str::to_owned)
}

/// Formats the long decimals of a message as [`shortest`] does. `{}` writes 1e300 with 301 digits.
#[must_use]
pub fn with_short_numbers(message: &str) -> Cow<'_, str> {
    /// Most characters of a decimal that is kept.
    const LONG: usize = 25;
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    if !message.as_bytes().chunk_by(|a, b| is_part((*a).into()) && is_part((*b).into())).any(|run| run.len() > LONG) {
        return Cow::Borrowed(message);
    }
    let (mut out, mut rest) = (String::with_capacity(message.len()), message);
    while let Some(start) = rest.find(is_part) {
        let end = rest[start..].find(|c| !is_part(c)).map_or(rest.len(), |length| start + length);
        // A full stop ends a sentence.
        let digits = rest[start..end].trim_end_matches('.');
        let is_within_word = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || matches!(c, '_' | '/'));
        let is_name = is_within_word(rest[..start].chars().next_back()) || is_within_word(rest[end..].chars().next());
        let number = digits.parse().ok().filter(|_| digits.len() > LONG && !is_name);
        out += &rest[..start];
        out += &number.map_or_else(|| digits.to_owned(), shortest);
        rest = &rest[start + digits.len()..];
        // The full stops of the run are not part of a number.
        let stops = rest.len() - rest.trim_start_matches('.').len();
        out += &rest[..stops];
        rest = &rest[stops..];
    }
    Cow::Owned(out + rest)
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
    fn at_least_rounds_down_by_less_than_one_digit() {
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
    fn at_most_rounds_up_and_a_number_beside_its_limit_keeps_the_order() {
        for length_m in [1.999_999_9, 2.46, 1.001, 0.305_304_9, 0.1 + 0.2, 0.0, -0.5, 123_456.789_9] {
            let shown: f64 = at_most(length_m, 6).parse().expect("a number");
            assert!(shown >= length_m && shown - length_m < 1e-6 * (1.0 + 1e-9), "{length_m:?}: {shown}");
        }
        assert_eq!(at_most(f64::INFINITY, 6), "inf");
        for (number, limit_m, expected) in [
            (1.5, 2.0, "1.500"),
            (1.999_96, 2.0, "1.99996"),
            (1.999_999_9, 2.0, "1.9999999"),
            (2.0_f64.next_down(), 2.0, "just below 2.000"),
            (0.3_f64.next_down(), 0.3, "just below 0.300"),
            (6e-13, 1e-12, "0.0000000000006"),
            (1.532_715_2, 1.5327, "1.5327"),
            (1.5327, 1.5327, "1.5327"),
            (2.460_355, 2.0, "2.460"),
            (0.1 + 0.2, 0.1 + 0.2, "0.30000000000000004"),
            (f64::INFINITY, 2.0, "inf"),
        ] {
            assert_eq!(beside_limit(number, limit_m, 3), expected);
        }
        assert_eq!([beside_limit(1.5, 2.0, 6), beside_limit(2.5, 2.0, 6)], ["1.500000", "2.500000"]);
        assert_eq!(below_bound(2.055_2, 2.055_306_9), ["2.0552", "2.0553"]);
    }

    #[test]
    fn separations_are_rounded_down_and_upper_bounds_up() {
        for (number, down, up) in [
            (2.504_72, "2.504", "2.505"),
            (2.504, "2.504", "2.504"),
            (-0.4995, "-0.500", "-0.499"),
            (0.0, "0.000", "0.000"),
            (1.26e-4, "1.2e-4", "1.3e-4"),
            (1.24e-4, "1.2e-4", "1.3e-4"),
            (1.2e-4, "1.2e-4", "1.2e-4"),
            (9.96e-4, "9.9e-4", "1.0e-3"),
            (1.239e8, "1.2e8", "1.3e8"),
            (-1.26e-4, "-1.3e-4", "-1.2e-4"),
            (f64::INFINITY, "inf", "inf"),
        ] {
            assert_eq!([separation(number), up_to(number)], [down, up], "{number}");
        }
        for k in 1_u32..2000 {
            for scale in [1e-12, 1e-5, 1e-3, 0.1, 1e5, 1e12] {
                let number = f64::from(k) * 1.000_37 * scale;
                let [low, high]: [f64; 2] =
                    [separation(number), up_to(number)].map(|shown| shown.parse().expect("a number"));
                assert!(low <= number && number <= high, "{low} {number} {high}");
                assert!(high - low <= 0.11 * number.max(1e-2), "{low} {number} {high}");
            }
        }
    }

    #[test]
    fn a_repeated_number_is_short_and_has_the_same_bits() {
        let numbers =
            [0.0, 1.0, -3.5, 0.1 + 0.2, 1e-4, 1e-7, 1e-300, 1e9, 1e15, 1e16, 1e300, -f64::MAX, f64::MIN_POSITIVE];
        for number in numbers {
            let shown = shortest(number);
            assert!(shown.len() <= 25 && shown.parse() == Ok(number), "{shown}");
        }
        let shown = [2.0, 1e300, 1e-7, f64::INFINITY, 240.0].map(shortest);
        assert_eq!(shown, ["2", "1e300", "1e-7", "inf", "240"]);
    }

    #[test]
    fn long_decimals_of_a_message_are_short() {
        let message = format!("must be at most {}, got {} and -{}. Or 0.1", 1e9, 1e300, 1e-300);
        assert_eq!(with_short_numbers(&message), "must be at most 1000000000, got 1e300 and -1e-300. Or 0.1");
        for kept in ["0.30000000000000004 m", "v1.2.3...", "file 0123456789012345678901234567890.csv", "", "a.b"] {
            assert_eq!(with_short_numbers(kept), kept);
        }
    }

    #[test]
    fn bound_is_met_only_up_to_the_allowed_error() {
        assert_eq!(bound(0.0, 1e-12), "below 1e-12");
        assert_eq!(bound(-1e-12, 1e-12), "below 1e-12");
        assert_eq!(bound(2e-12, 1e-12), "2.0e-12, which is not below 1e-12");
        assert_eq!(bound(f64::NAN, 1e-9), "NaN, which is not below 1e-9");
    }

    #[test]
    fn significant_digits_count_from_the_first_nonzero_digit() {
        assert_eq!([0.0, 0.3, 1.5, 123.456].map(|number| significant(number, 3)), ["0.00", "0.300", "1.50", "123"]);
        assert_eq!(significant(1_234_567.8, 6), "1234568");
    }

    #[test]
    fn decimals_of_a_step_cover_its_multiples() {
        assert_eq!([20.0, 1.0, 0.5, 0.1, 0.05, 1e-7].map(|step| decimals_of(step, 4)), [0, 0, 1, 1, 2, 4]);
    }
}
